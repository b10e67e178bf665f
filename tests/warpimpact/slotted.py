"""The slotted plate of the examples at draft, by the fast law alone, with changes."""

from pathlib import Path

from warpimpact import Campaign

CAMPAIGNS = Path(__file__).parents[2] / "campaigns"
SLOTTED_PLATE = CAMPAIGNS / "slotted_plate.toml"


def slotted_text(*changes: tuple[str, str]) -> str:
    """Its text, in which each change replaces what is there."""
    text = SLOTTED_PLATE.read_text(encoding="utf-8")
    for old, new in (('"standard"', '"draft"'), ("\nhits = 12", ""), *changes):
        assert old in text, old
        text = text.replace(old, new)
    return text


def slotted(*changes: tuple[str, str], count: int | None = None, folder: Path = Path()) -> Campaign:
    """Its campaign; the files that it names are in the folder."""
    return Campaign.from_text(slotted_text(*changes), name="a", folder=folder, count=count)
