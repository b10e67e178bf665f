"""The text of a campaign, TOML or JSON, read and parsed but not validated."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from ..results.files import is_netcdf, kind_of
from ..results.kinds import text_kind
from ..scene import input_files
from ..scene.model import sentence

REMOVED_KEYS: dict[str, str] = {
    "search.allow_untested": "leave it out; the front names designs outside the tested range",
    "output.layer_standoffs": "layer_tilt and layer_residual_velocity say how a core leaves each layer",
    "assumptions": "run warpimpact sensitivity CAMPAIGN.toml",
    "burst": "cracks and bulges decide several hits on one plate, and the model lacks them; compute single hits",
    "layer.degradation_depth": "leave it out: a layer weakens as a whole; give thick layers degradation = 1",
    "plate.degradation_depth": "leave it out: a plate weakens as a whole; give thick plates degradation = 1",
    "posterior": "use hits.file with the CSV file that `warpimpact identify` writes",
    "plate.pattern.shape = supershape": 'use shape = "slot", which protects no worse, or shape = "polygons"',
    "plate.pattern.shape = level_set": 'use shape = "slot", which protects no worse, or shape = "polygons"',
    "plate.pattern.cell_size": "leave it out: polygons are exact",
    "plate.pattern.smallest_feature": "leave it out, and round the corners of the polygons",
    "plate.margin": "list whole holes in a cell as large as the plate",
    "hits.repeats": "repeat the rows of hits.file",
    "published": "put published limits into a comment; warpimpact catalogue shows those of its materials",
    "procedure.name = 3pod": "use langlie",
    "procedure.name = neyer": "use langlie",
    "directions": "sweep impact.obliquity and impact.azimuth",
    "requirement": "give proof.velocity and the core of the campaign",
    "search.most_hits": "use search.hits, which every design gets",
    "numerics.coarser": "A level sets all settings. Use numerics.level, or patches_axial, grid_spacing and travel.",
}
"""The sentence for each key, by its dotted path without numbers of list items; or for a value, as "key = value"."""


class CampaignError(ValueError):
    """A campaign that cannot be run: one sentence naming file, field, value and what is allowed."""


@contextmanager
def as_campaign_error(place: str = "", tables: Mapping[str, Any] | None = None) -> Iterator[None]:
    """Raise a ValueError, as of a model of tables, as a CampaignError, with the place before its sentence."""
    try:
        yield
    except ValueError as error:
        text = sentence(error, dict(tables or {})) if isinstance(error, ValidationError) else error
        raise CampaignError(f"{place}{text}") from None


def parsed(text: str, name: str, kind: str = "") -> dict[str, Any]:
    """The tables of a campaign, TOML or JSON, not yet validated.

    Raises:
        CampaignError: the text is neither, has a key that was removed, or is another kind of file; `name` is its name
            in the message.
    """
    with as_campaign_error():
        tables = input_files.parsed(text, name)
    for key, value in _entries(tables, ""):
        for removed in REMOVED_KEYS.keys() & {key, f"{key} = {value}"}:
            raise CampaignError(f"{name}: {removed} was removed: {REMOVED_KEYS[removed]}")
    other, use = text_kind(tables, kind)
    if kind and other not in ("", kind):
        raise CampaignError(f"{name}: is {other}, not {kind}; {use}")
    return tables


def _entries(value: Any, path: str) -> Iterator[tuple[str, Any]]:
    """Dotted paths of all keys with their texts; items of a list have the path of the list."""
    if path:
        yield path, value if isinstance(value, str) else None
    of_list = [("", item) for item in value] if isinstance(value, list) else []
    for key, item in value.items() if isinstance(value, dict) else of_list:
        yield from _entries(item, f"{path}.{key}".strip("."))


def read_text(path: Path) -> str:
    """The text of a campaign file.

    Raises:
        CampaignError: the file is missing, cannot be read, or is a netCDF file.
    """
    with as_campaign_error():
        input_files.check_file(path)
        if is_netcdf(path):
            kind = kind_of(path)
            raise ValueError(f"{path}: is {kind.name}, not a TOML file; {kind.use}")
        return input_files.read_text(path)
