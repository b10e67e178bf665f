"""Designs: campaigns as tables, with their checks, the stages of their computation, and changes beyond one value."""

from __future__ import annotations

import json
import math
import zlib
from base64 import urlsafe_b64decode
from collections.abc import Callable, Iterator, Mapping
from copy import deepcopy
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import tomli_w

from warpimpact.campaign.campaign import Campaign
from warpimpact.campaign.catalogued import catalogue_of
from warpimpact.campaign.plates import read_plates
from warpimpact.campaign.text import CampaignError, parsed, read_text
from warpimpact.catalogue.entries import Material, Threat
from warpimpact.results import attributes as attr
from warpimpact.results import files, front
from warpimpact.results.files import kind_of, opened
from warpimpact.results.kinds import FRONT
from warpimpact.scene import Numerics, Plate
from warpimpact.scene.patterns.pattern import LatticePattern
from warpimpact.scene.units import quoted
from warpimpact.solver.accuracy import pilot_size
from warpimpact.solver.prepare import prepare
from warpimpact.solver.resolution import LADDER, TooManySteps, at_level, coarsest_level

Tables = dict[str, Any]

FILE_KEYS = ("file", "catalogue")
"""Keys of a campaign that name files."""
FEW, SOME = 256, 1024
"""Most hits of the first map after a change, and of the draft."""
FIRST_WORK, FEWEST = 0.08, 64
"""Approximate seconds of a core for the hits of a first map, so that it appears in 0.3 s on two cores; and its fewest
hits. A lower level comes before fewer hits."""
_MOST_ADDRESS = 2**20
"""Most characters of a design in an address, unpacked."""
ROOT = Path("/")
"""Folder of a design's files. Their names are absolute, so it does not matter."""
_DESIGN_NAME = "design"
"""Name of a design in errors."""


@dataclass(frozen=True)
class Shelf:
    """Designs and files with which a page was started.

    Attributes:
        designs: tables of the campaigns by name.
        files: files that the campaigns name, which designs of the page may name, too.
    """

    designs: Mapping[str, Tables]
    files: frozenset[str] = field(default_factory=frozenset)

    def checked(self, tables: Tables) -> ValidDesign:
        """A design of the page.

        Raises:
            CampaignError: it is not a valid campaign, or names a file that no campaign of the start names.
        """
        if not isinstance(tables, dict):
            raise CampaignError(f"{_DESIGN_NAME}: got {quoted(tables)}, but it must be a table")
        for place, name in _files_of(tables).items():
            if name not in self.files:
                raise CampaignError(
                    f"{_DESIGN_NAME}: {place}: got {quoted(name)}, but a page reads only files that the campaigns "
                    "name which warpimpact design was started with"
                )
        if (null := next((place for place, _, value in _entries(tables) if value is None), None)) is not None:
            raise CampaignError(f"{_DESIGN_NAME}: {null}: got null, but it must be a value, or be left out")
        text = tomli_w.dumps(tables)
        return ValidDesign(tables, text, Campaign.from_text(text, name=_DESIGN_NAME, folder=ROOT))


@dataclass(frozen=True)
class ValidDesign:
    """A valid design.

    Attributes:
        tables: tables of the campaign, as written.
        text: the tables as TOML.
        campaign: the campaign.
    """

    tables: Tables
    text: str
    campaign: Campaign


def shelf_of(paths: list[Path]) -> Shelf:
    """Designs in files: a campaign is one design per plate; a search of warpimpact optimise gives the designs of its
    front; a result gives its campaign.

    Raises:
        CampaignError, ResultError: a file is missing or not valid.
    """
    designs: dict[str, Tables] = {}
    for path in paths:
        for name, text in _texts(path):
            tables = _absolute(parsed(text, str(path)), path.parent)
            Campaign.from_text(tomli_w.dumps(tables), name=str(path), folder=path.parent)
            designs[name if name not in designs else f"{name} ({path})"] = tables
    files = {name for tables in designs.values() for name in _files_of(tables).values()}
    return Shelf(designs, frozenset(files))


def _texts(path: Path) -> Iterator[tuple[str, str]]:
    """Name and text of every design in a file: campaigns of plates, of a front, or of a hit map."""
    if path.suffix == ".nc" and kind_of(path) is FRONT:
        front_file = files.read(path, FRONT)
        for name, text in zip(front_file[front.FILE].values, front_file[front.CAMPAIGN].values, strict=True):
            yield Path(str(name)).stem, str(text)
        return
    if path.suffix == ".nc":
        with opened(path) as dataset:
            yield path.stem, str(dataset.attrs.get(attr.CAMPAIGN, ""))
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


def _entries(part: Any, place: str = "") -> Iterator[tuple[str, str | int, Any]]:
    """Place, key and value of every entry of tables, and of what is in it."""
    for key, value in part.items() if isinstance(part, dict) else enumerate(part) if isinstance(part, list) else ():
        inner = f"{place}[{key}]" if isinstance(key, int) else f"{place}.{key}".removeprefix(".")
        yield inner, key, value
        yield from _entries(value, inner)


def _files_of(tables: Tables) -> dict[str, str]:
    """Names of the files in tables, by their places."""
    return {place: value for place, key, value in _entries(tables) if key in FILE_KEYS and isinstance(value, str)}


def _absolute(part: Any, folder: Path, key: str = "") -> Any:
    """Tables with absolute names of files, so that the campaign runs from any folder."""
    if isinstance(part, list):
        return [_absolute(entry, folder) for entry in part]
    if isinstance(part, dict):
        return {name: _absolute(entry, folder, name) for name, entry in part.items()}
    return str((folder / part).absolute()) if key in FILE_KEYS and isinstance(part, str) else part


def stages(shelf: Shelf, design: ValidDesign, level: int) -> Iterator[tuple[str, ValidDesign]]:
    """The stages in which a design is computed, by name: "first", few hits at one level of resolution, without a pilot;
    "draft", more hits at draft; and "full", the campaign as it is. A stage that the campaign cannot have is left out.

    The hits of the first stage are those of the irreducible part of the cell, if there is one.

    Args:
        level: finest level of the first stage, as the last draft has found it.
    """
    if (first := _first(shelf, design, level)) is not None and first.text != design.text:
        yield "first", first
    if (draft := _draft(shelf, design)) is not None and draft.text != design.text:
        yield "draft", draft
    yield "full", design


def _draft(shelf: Shelf, design: ValidDesign) -> ValidDesign | None:
    """A design for its draft; None if it has none."""
    campaign = design.campaign
    if campaign.numerics.explicit is not None:
        return None
    return _valid(shelf, _of_few_hits(design, SOME) | {"numerics": _kept(design) | {"fidelity": "draft"}})


def _first(shelf: Shelf, design: ValidDesign, level: int) -> ValidDesign | None:
    """A design for its first map, as fine as FIRST_WORK allows; None if it cannot have one."""
    first = _of_first_hits(shelf, design, level, FEW)
    if first is None:
        return None
    free = design.campaign.numerics.explicit is None
    at, seconds = level, work(first.campaign)
    while free and at > 0 and seconds > FIRST_WORK:
        at -= 1
        seconds = work(first.campaign, first.campaign.numerics.model_copy(update={"level": at}))
    few = FEW if seconds <= FIRST_WORK else max(FEWEST, int(FEW * FIRST_WORK / seconds) // FEWEST * FEWEST)
    return first if (at, few) == (level, FEW) else _of_first_hits(shelf, design, at, few)


def _of_first_hits(shelf: Shelf, design: ValidDesign, level: int, few: int) -> ValidDesign | None:
    """A design with few hits at a level, in the irreducible part of the cell where the scene allows it."""
    numerics = design.tables.get("numerics", {})
    if design.campaign.numerics.explicit is None:
        numerics = _kept(design) | {"level": level}
    few_hits = (_of_few_hits(design, few, irreducible=part) | {"numerics": numerics} for part in (True, False))
    return next(filter(None, (_valid(shelf, tables) for tables in few_hits)), None)


def _kept(design: ValidDesign) -> Tables:
    """Keys of the numerics that are valid at any resolution."""
    numerics = design.tables.get("numerics", {})
    return {key: numerics[key] for key in ("scheme", "precision", "layout") if key in numerics}


def work(campaign: Campaign, numerics: Numerics | None = None) -> float:
    """Approximate seconds of a core for the hits of a campaign, the same on every machine; infinite where they cannot
    be computed.

    Args:
        numerics: numerics that fix a resolution; by default those of the campaign.
    """
    sampler = campaign.sampler()
    try:
        first = prepare(campaign.scene, sampler.shots(0, 1), numerics or campaign.numerics)
        return first.seconds * len(sampler)
    except (ValueError, TooManySteps, MemoryError):
        return math.inf


def work_ahead(campaign: Campaign, level: int) -> float:
    """Approximate seconds of a core for a campaign (`work`), including a pilot that ends at its first level, or at a
    finer one.

    Args:
        level: level of its hits, as far as it is known.
    """
    if campaign.numerics.explicit is not None:
        return work(campaign)
    first = coarsest_level(campaign.numerics.asked.strictness)
    last = max(first, level)
    hits = len(campaign.sampler())
    of_levels = [work(campaign, at_level(at, campaign.numerics)) for at in range(first, last + 3) if at < len(LADDER)]
    return of_levels[last - first] + pilot_size(campaign.numerics.asked) / hits * sum(of_levels)


def _valid(shelf: Shelf, tables: Tables) -> ValidDesign | None:
    """The design in some tables; None if it is not valid."""
    try:
        return shelf.checked(tables)
    except CampaignError:
        return None


def _of_few_hits(design: ValidDesign, most: int, *, irreducible: bool = False) -> Tables:
    """Tables of a design with at most this number of hits, without a stop rule. A list keeps the hits
    of its file."""
    tables = {key: value for key, value in design.tables.items() if key != "stop"}
    count = design.campaign.hits.count
    if count is None:
        return tables
    part = {"irreducible": True} if irreducible else {}
    return tables | {"hits": dict(design.tables.get("hits", {})) | {"count": min(most, count)} | part}


def stage_of(shelf: Shelf, design: ValidDesign, level: int, name: str) -> ValidDesign:
    """A design at a stage, or at its last stage if it does not have this one."""
    every = dict(stages(shelf, design, level))
    return every.get(name, every["full"])


_SIZES: Mapping[str, Callable[[float], dict[str, float]]] = {
    "circle": lambda area: {"diameter": math.sqrt(4.0 * area / math.pi)},
    "slot": lambda area: _oblong(math.sqrt(area / (2.0 + math.pi / 4.0)), 3.0),
    "ellipse": lambda area: _oblong(math.sqrt(2.0 * area / math.pi), 2.0),
    "triangle": lambda area: {"side": math.sqrt(4.0 * area / math.sqrt(3.0))},
    "square": lambda area: {"side": math.sqrt(area)},
    "hexagon": lambda area: {"width": math.sqrt(2.0 * area / math.sqrt(3.0))},
}
"""Lengths [m] of a hole with a given area [m²], by shape."""
SHAPES = ("none", *_SIZES)
_SPACING = (8e-3, 16e-3)
_OPEN = 0.25
"""Cell [m] and open area of the first holes of a plate."""
_BASE = {"gap": "100 mm", "thickness": "10 mm"}
"""A layer that is added. Its material is that of the layer in front."""
_SMALLER, _TRIES = 0.85, 24
_OF_A_MATERIAL = ("resistance", "shear_coefficient", "density")


def _oblong(width: float, slender: float) -> dict[str, float]:
    return {"length": slender * width, "width": width}


def choices(design: Tables) -> dict[str, list[str]]:
    """Names that each choice offers. Threats whose core is unknown are left out."""
    catalogue = catalogue_of(design, "design", ROOT)
    threats = [name for name, threat in catalogue.all(Threat).items() if threat.shape is not None]
    return {"threat": threats, "material": list(catalogue.all(Material)), "shape": list(SHAPES)}


def changed(design: ValidDesign, shelf: Shelf, what: str, layer: int, value: str) -> Tables:
    """The tables of a design after a change.

    Args:
        what: "threat", "material", "shape", "add layer" or "remove layer".
        layer: number of the changed layer, 0 the plate.
        value: the chosen name; "" is a core or a material of one's own.

    Raises:
        CampaignError: there is no such change.
    """
    tables = deepcopy(design.tables)
    if not 0 <= layer < len(design.campaign.target.layers):
        raise CampaignError(f"got layer {layer}, but the design has layers 0 to {len(design.campaign.layer)}")
    match what:
        case "threat":
            _take_threat(tables, design, value)
        case "material":
            _take_material(_plate(tables, layer), design.campaign.target.layers[layer], value)
            if not value:
                tables["interaction"] = design.campaign.interaction.model_dump(exclude_none=True)
        case "shape":
            _take_shape(tables, design, shelf, layer, value)
        case "add layer":
            front = design.campaign.target.layers[-1]
            of_front = {"material": front.material} if front.material else _own(front)
            tables["layer"] = [*tables.get("layer", []), _BASE | of_front]
        case "remove layer" if layer > 0:
            tables["layer"] = [table for place, table in enumerate(tables["layer"]) if place != layer - 1]
            if not tables["layer"]:
                del tables["layer"]
        case _:
            raise CampaignError(
                f"got the change {quoted(what)}, but it must be threat, material, shape, add layer or remove layer"
            )
    return tables


def _plate(tables: Tables, layer: int) -> Tables:
    plate: Tables = tables["layer"][layer - 1] if layer else tables["plate"]
    return plate


def _own(plate: Plate) -> dict[str, Any]:
    """The numbers of a material as keys of a plate."""
    return {
        "resistance": f"{plate.resistance / 1e6:.6g} MPa",
        "shear_coefficient": plate.shear_coefficient,
        "density": f"{plate.density:.6g} kg/m^3",
    }


def _take_threat(tables: Tables, design: ValidDesign, name: str) -> None:
    """Take the core of a threat, and its velocity if the catalogue has one; an empty name keeps the core as numbers."""
    impact, core = tables.setdefault("impact", {}), design.campaign.core
    if name:
        tables["core"] = {"threat": name}
        known = catalogue_of(tables, "design", ROOT).all(Threat).get(name)
        if known is not None and known.velocities:
            impact.pop("velocity", None)
        else:
            impact["velocity"] = f"{design.campaign.impact.velocity:.6g} m/s"
        return
    labels = ("threat", "standard", "velocity_tolerance")
    shape = core.model_dump(mode="json", exclude_none=True, exclude=set(labels))
    shape |= {key: table for key, table in tables["core"].items() if key not in labels}
    tables["core"] = shape
    impact.setdefault("velocity", f"{design.campaign.impact.velocity:.6g} m/s")


def _take_material(table: Tables, plate: Plate, name: str) -> None:
    if name:
        for key in _OF_A_MATERIAL:
            table.pop(key, None)
        table["material"] = name
    else:
        table.pop("material", None)
        table |= _own(plate)


def _take_shape(tables: Tables, design: ValidDesign, shelf: Shelf, layer: int, shape: str) -> None:
    """Take holes of another shape with the same area, or with the largest area that leaves ligaments."""
    table, old = _plate(tables, layer), design.campaign.target.layers[layer].pattern
    if shape == "none":
        table.pop("pattern", None)
        return
    if shape not in _SIZES:
        raise CampaignError(f"got the shape {quoted(shape)}, but it must be one of {', '.join(SHAPES)}")
    lattice = isinstance(old, LatticePattern)
    spacing = old.spacing if isinstance(old, LatticePattern) else _SPACING
    area = old.hole_area if isinstance(old, LatticePattern) else _OPEN * math.prod(_SPACING)
    kept = {
        key: value for key, value in table.get("pattern", {}).items() if lattice and key in ("staggered", "rotation")
    }
    for _ in range(_TRIES):
        sizes = {key: _mm(length) for key, length in _SIZES[shape](area).items()}
        table["pattern"] = {"shape": shape, **sizes, "spacing": [_mm(side) for side in spacing], **kept}
        try:
            shelf.checked(tables)
        except CampaignError:
            area *= _SMALLER
        else:
            return


def _mm(length: float) -> str:
    return f"{round(1e3 * length, 1):g} mm"


def from_address(address: str) -> Tables:
    """The design in the address of a page, behind its "#".

    Raises:
        CampaignError: the address has none.
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
    """A value as JSON that JavaScript reads. NaN and infinity become null."""
    return json.dumps(value, ensure_ascii=False, separators=(",", ":"), allow_nan=False, default=str)
