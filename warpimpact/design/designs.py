"""Designs: campaigns that a page holds as tables, how they are checked, and in which stages they are computed."""

from __future__ import annotations

import json
import zlib
from base64 import urlsafe_b64decode
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from warpimpact.campaign.campaign import Campaign
from warpimpact.campaign.plates import read_plates
from warpimpact.campaign.text import CampaignError, parsed, read_text
from warpimpact.campaign.toml import toml_text
from warpimpact.results import attributes as attr
from warpimpact.results import files, front
from warpimpact.results.files import kind_of, opened
from warpimpact.scene.units import quoted

Tables = dict[str, Any]

FILE_KEYS = ("file", "posterior", "catalogue")
"""Keys of a campaign that name files."""
FEW, SOME = 256, 1024
"""Hits at most of the first map after a change, and of the draft. A first map has as many as the draft where
at least four of them are images of each other."""
_MOST_ADDRESS = 2**20
"""Characters of a design in an address, unpacked."""
FOLDER = Path("/")
"""Names of files in a design are absolute, so no folder counts."""
_NAME = "design"
"""What errors call a design."""


@dataclass(frozen=True)
class Shelf:
    """What a page was started with.

    Attributes:
        designs: tables of the campaigns by name.
        files: those that the campaigns name, and that designs of the page may name.
    """

    designs: Mapping[str, Tables]
    files: frozenset[str] = field(default_factory=frozenset)

    def checked(self, tables: Tables) -> ValidDesign:
        """A design of the page.

        Raises:
            CampaignError: it is not a valid campaign, or names a file that no campaign of the start names.
        """
        if not isinstance(tables, dict):
            raise CampaignError(f"{_NAME}: got {quoted(tables)}, but it must be a table")
        for place, name in _files_of(tables, ""):
            if name not in self.files:
                raise CampaignError(
                    f"{_NAME}: {place}: got {quoted(name)}, but a page reads only files that the campaigns name which "
                    "warpimpact design was started with"
                )
        if (null := _null_in(tables, "")) is not None:
            raise CampaignError(f"{_NAME}: {null}: got null, but it must be a value, or be left out")
        text = toml_text(tables)
        return ValidDesign(tables, text, Campaign.from_text(text, name=_NAME, folder=FOLDER))


@dataclass(frozen=True)
class ValidDesign:
    """A design that is valid.

    Attributes:
        tables: of the campaign, as written.
        text: the same as a TOML file.
        campaign: what it says.
    """

    tables: Tables
    text: str
    campaign: Campaign


class Stage(NamedTuple):
    """A design as it is computed at one stage of refinement: "first", "draft" or "full"."""

    name: str
    design: ValidDesign


def shelf_of(paths: list[Path]) -> Shelf:
    """What files hold: campaigns, of which one with several plates has a design each; searches of warpimpact optimise,
    with the designs of their fronts; and results, with their campaigns.

    Raises:
        CampaignError, ResultError: a file is missing or not valid.
    """
    designs: dict[str, Tables] = {}
    for path in paths:
        for name, text in _texts(path):
            tables = _absolute(parsed(text, str(path)), path.parent)
            Campaign.from_text(toml_text(tables), name=str(path), folder=path.parent)
            designs[name if name not in designs else f"{name} ({path})"] = tables
    files = {name for tables in designs.values() for _, name in _files_of(tables, "")}
    return Shelf(designs, frozenset(files))


def _texts(path: Path) -> Iterator[tuple[str, str]]:
    """Name and text of every design in a file."""
    if path.suffix == ".nc":
        yield from _texts_of_results(path)
        return
    text = read_text(path)
    tables = parsed(text, str(path))
    if "variables" in tables:
        raise CampaignError(
            f"{path}: variables: this takes one design; warpimpact optimise {path} searches the best ones into a "
            "file, which this takes"
        )
    if isinstance(tables.get("plate"), list):
        for name, campaign in read_plates(path).items():
            yield name, campaign.text
    else:
        yield path.stem, text


def _texts_of_results(path: Path) -> Iterator[tuple[str, str]]:
    """The same of a file of results: the campaigns of a front, or that of a hit map."""
    if kind_of(path) is not front.FRONT:
        with opened(path) as dataset:
            yield path.stem, str(dataset.attrs.get(attr.CAMPAIGN, ""))
        return
    front_file = files.read(path, front.FRONT)
    for name, text in zip(front_file[front.FILE].values, front_file[front.CAMPAIGN].values, strict=True):
        yield Path(str(name)).stem, str(text)


def _files_of(part: Any, place: str) -> Iterator[tuple[str, str]]:
    """Places and names of the files in tables."""
    for key, value in part.items() if isinstance(part, dict) else enumerate(part) if isinstance(part, list) else ():
        inner = f"{place}[{key}]" if isinstance(key, int) else f"{place}.{key}".removeprefix(".")
        if key in FILE_KEYS and isinstance(value, str):
            yield inner, value
        yield from _files_of(value, inner)


def _absolute(part: Any, folder: Path, key: str = "") -> Any:
    """Tables with absolute names of files, so that the campaign runs from any folder."""
    if isinstance(part, list):
        return [_absolute(entry, folder) for entry in part]
    if isinstance(part, dict):
        return {name: _absolute(entry, folder, name) for name, entry in part.items()}
    return str((folder / part).absolute()) if key in FILE_KEYS and isinstance(part, str) else part


def _null_in(part: Any, place: str) -> str | None:
    """Place of the first null, which TOML does not have."""
    for key, value in part.items() if isinstance(part, dict) else enumerate(part) if isinstance(part, list) else ():
        inner = f"{place}[{key}]" if isinstance(key, int) else f"{place}.{key}".removeprefix(".")
        found = inner if value is None else _null_in(value, inner)
        if found is not None:
            return found
    return None


def stages(shelf: Shelf, design: ValidDesign, level: int) -> list[Stage]:
    """The stages in which a design is computed: few hits at one level of resolution, which need no pilot; more hits at
    draft; and the campaign as it is. A stage that the campaign cannot have is left out.

    The hits of the first stage are those of the irreducible part of the cell with their images, where there is one: as
    many hits for a part of the time.

    Args:
        level: resolution of the first stage, as the last draft has found it.
    """
    campaign, numerics = design.campaign, dict(design.tables.get("numerics", {}))
    coarse, draft = numerics, None
    if campaign.numerics.explicit is None:
        kept = {key: numerics[key] for key in ("scheme", "precision", "layout") if key in numerics}
        coarse, draft = kept | {"level": level}, kept | {"fidelity": "draft"}
    whole = _of_few_hits(design, FEW) | {"numerics": coarse}
    part = _of_few_hits(design, SOME, irreducible=True) | {"numerics": coarse}
    first = _valid(shelf, part)
    if first is None or FEW * len(first.campaign.symmetries) < SOME:
        first = _valid(shelf, whole)
    drafted = None if draft is None else _valid(shelf, _of_few_hits(design, SOME) | {"numerics": draft})
    before = {"first": first, "draft": drafted}
    stages_before = [
        Stage(name, stage_design)
        for name, stage_design in before.items()
        if stage_design is not None and stage_design.text != design.text
    ]
    return [*stages_before, Stage("full", design)]


def _valid(shelf: Shelf, tables: Tables) -> ValidDesign | None:
    """A design, if it is valid."""
    try:
        return shelf.checked(tables)
    except CampaignError:
        return None


def _of_few_hits(design: ValidDesign, most: int, *, irreducible: bool = False) -> Tables:
    """Tables of a design with so many hits at most, without a stop rule; a list has the hits of its file."""
    tables = {key: value for key, value in design.tables.items() if key != "stop"}
    count, together = design.campaign.hits.count, design.campaign.at_a_plate
    if count is None:
        return tables
    few = max(together, min(most, count) // together * together)
    part = {"irreducible": True} if irreducible else {}
    return tables | {"hits": dict(design.tables.get("hits", {})) | {"count": few} | part}


def stage_of(shelf: Shelf, design: ValidDesign, level: int, name: str) -> ValidDesign:
    """A design as it is computed at a stage; the last one that it has where it does not have that."""
    every = {stage.name: stage.design for stage in stages(shelf, design, level)}
    return every.get(name, every["full"])


def from_address(address: str) -> Tables:
    """The design that the address of a page holds behind its "#".

    Raises:
        CampaignError: it holds none.
    """
    _, _, packed = address.partition("#")
    try:
        unpacking = zlib.decompressobj(-zlib.MAX_WBITS)
        data = unpacking.decompress(urlsafe_b64decode(packed + "=" * (-len(packed) % 4)), _MOST_ADDRESS)
        tables = parsed(data.decode(), "address")["design"]
    except (ValueError, KeyError, zlib.error):
        raise CampaignError('got an address that holds no design behind its "#"; copy it whole') from None
    return dict(tables) if isinstance(tables, dict) else {}


def as_json(value: Any) -> str:
    """A value as JSON that JavaScript reads; a number that is none is null."""
    return json.dumps(value, ensure_ascii=False, separators=(",", ":"), allow_nan=False, default=str)
