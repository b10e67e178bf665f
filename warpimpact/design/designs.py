"""Designs: campaigns as tables, with their checks, the stages of their computation, and changes beyond one value."""

from __future__ import annotations

import json
import math
import zlib
from base64 import urlsafe_b64decode
from collections.abc import Iterator, Mapping
from copy import deepcopy
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import tomli_w

from warpimpact.campaign.campaign import Campaign, read_plates
from warpimpact.campaign.elements import continuum_table
from warpimpact.campaign.names import catalogue_of
from warpimpact.campaign.text import parsed, read_text
from warpimpact.catalogue.entries import Material, Threat
from warpimpact.errors import CampaignError, TooLong
from warpimpact.records import attributes as attr
from warpimpact.records.kinds import FRONT
from warpimpact.results import files
from warpimpact.results.files import kind_of, opened
from warpimpact.scene import Plate
from warpimpact.scene.input_files import FILE_KEYS, files_of
from warpimpact.scene.pattern import LatticePattern
from warpimpact.scene.units import quoted
from warpimpact.solver.prepare import prepare

Tables = dict[str, Any]

FIRST_HITS, DRAFT_HITS = 256, 1024
"""Most hits of the first map after a change, and of the draft. Before a base, where every draw of a hit is computed,
they are fewer by `WITH_A_BASE`."""
WITH_A_BASE = 4
FIRST_SECONDS, FEWEST_HITS = 0.08, 64
"""Approximate seconds of a core for the hits of a first map, so that it appears in 0.3 s on two cores; and its fewest
hits. A lower level comes before fewer hits."""
_MOST_ADDRESS = 2**20
"""Most characters of a design in an address, unpacked."""
_ANY_RESOLUTION = ("scheme", "precision", "layout")
"""Keys of the numerics that are valid at any resolution."""
ROOT = Path("/")
"""Folder of a design's files. Their names are absolute, so it does not matter."""


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

    @property
    def is_fixed(self) -> bool:
        """Whether the campaign fixes its resolution."""
        return self.campaign.numerics.explicit is not None


@dataclass(frozen=True)
class DesignStore:
    """Designs and files with which a page was started.

    Attributes:
        designs: tables of the campaigns by name.
    """

    designs: Mapping[str, Tables]

    @cached_property
    def files(self) -> frozenset[str]:
        """Files that the campaigns name, which designs of the page may name, too."""
        return frozenset(name for tables in self.designs.values() for name in files_of(tables).values())

    def checked(self, tables: Tables) -> ValidDesign:
        """Validate a design of the page.

        Raises:
            CampaignError: it is not a valid campaign, or names a file that no campaign of the start names.
        """
        for key, name in files_of(tables).items():
            if name not in self.files:
                raise CampaignError(
                    f"{key}: got {quoted(name)}, but a page reads only files that the campaigns name "
                    "which warpimpact design was started with"
                )
        try:
            text = tomli_w.dumps(tables)
        except TypeError:
            raise CampaignError("got null, but a key has a value, or is left out") from None
        return ValidDesign(tables, text, Campaign.from_text(text, name="", folder=ROOT))


def read_designs(paths: list[Path]) -> dict[str, Tables]:
    """Read the designs in files by name.

    A campaign is one design per plate; a search of warpimpact optimise has the designs of its front; a result has its
    campaign.

    Raises:
        CampaignError, ResultError: a file is missing or not valid.
    """
    designs: dict[str, Tables] = {}
    for path in paths:
        for name, text in _texts(path):
            tables = _absolute(parsed(text, str(path)), path.parent)
            Campaign.from_text(tomli_w.dumps(tables), name=str(path), folder=path.parent)
            designs[name if name not in designs else f"{name} ({path})"] = tables
    return designs


def _texts(path: Path) -> Iterator[tuple[str, str]]:
    """Name and text of every design in a file: campaigns of plates, of a front, or of a hit map."""
    if path.suffix == ".nc" and kind_of(path) is FRONT:
        dataset = files.read(path, FRONT).to_dataset()
        for name, text in zip(dataset.front_file.values, dataset.front_campaign.values, strict=True):
            yield Path(str(name)).stem, str(text)
    elif path.suffix == ".nc":
        with opened(path) as result:
            yield path.stem, str(result.attrs.get(attr.CAMPAIGN, ""))
    elif isinstance(parsed(text := read_text(path), str(path), "a campaign").get("plate"), list):
        yield from ((name, campaign.text) for name, campaign in read_plates(path).items())
    else:
        yield path.stem, text


def _absolute(part: Any, folder: Path, key: str = "") -> Any:
    """Return tables with absolute names of files, so that the campaign runs from any folder."""
    if isinstance(part, list):
        return [_absolute(entry, folder) for entry in part]
    if isinstance(part, dict):
        return {name: _absolute(entry, folder, name) for name, entry in part.items()}
    return str((folder / part).absolute()) if key in FILE_KEYS and isinstance(part, str) else part


def stages(store: DesignStore, design: ValidDesign, level: int) -> dict[str, ValidDesign]:
    """Return the stages in which a design is computed, by name.

    "first" has few hits at one level of resolution, without a pilot, in the irreducible part of the cell if there is
    one; "draft" has more hits at draft, or behind a base at the default accuracy; "full" has all hits by the fast law;
    "elements" is the campaign as it is, with hits by finite elements. A stage that it cannot have is left out.

    Args:
        level: finest level of the first stage, as the last draft has found it.
    """
    fast = design
    if design.campaign.continuum.hits:
        continuum = {key: value for key, value in design.tables["continuum"].items() if key != "hits"}
        fast = store.checked(design.tables | {"continuum": continuum})
    every = {"first": _first(store, fast, level)}
    if not fast.is_fixed:
        is_single = len(fast.campaign.target.layers) == 1  # a base has an accuracy of its own
        most = DRAFT_HITS if is_single else DRAFT_HITS // WITH_A_BASE
        every["draft"] = _variant(store, fast, most, {"fidelity": "draft"} if is_single else {})
    known = {name: one for name, one in every.items() if one and one.text != fast.text} | {"full": fast}
    return known if fast is design or elements_refusal(design.campaign) else known | {"elements": design}


def elements_refusal(campaign: Campaign) -> str:
    """Why a campaign cannot have the hits by finite elements that it wants; empty where it can, or wants none."""
    try:
        if campaign.continuum.hits:
            continuum_table(campaign)
    except ValueError as error:
        return f"No hits by finite elements: {error}"
    return ""


def _first(store: DesignStore, design: ValidDesign, level: int) -> ValidDesign | None:
    """Return a design for its first map, as fine as FIRST_SECONDS allows; None if it cannot have one."""
    most = FIRST_HITS if len(design.campaign.target.layers) == 1 else FIRST_HITS // WITH_A_BASE
    few = ((part, _variant(store, design, most, {"level": level}, irreducible=part)) for part in (True, False))
    part, finest = next(((part, one) for part, one in few if one), (False, None))
    if finest is None:
        return None
    for at in [level] if design.is_fixed else range(level, -1, -1):
        seconds = estimate_seconds(finest.campaign, None if design.is_fixed else at)
        if seconds <= FIRST_SECONDS:
            break
    hits = max(FEWEST_HITS, int(most * min(1.0, FIRST_SECONDS / seconds)) // FEWEST_HITS * FEWEST_HITS)
    return _variant(store, design, hits, {"level": at}, irreducible=part)


def _variant(
    store: DesignStore, design: ValidDesign, hits: int, numerics: Tables, *, irreducible: bool = False
) -> ValidDesign | None:
    """Return a design with at most so many hits, and without a stop rule; None if it is not valid.

    Args:
        numerics: resolution, where the design does not fix its own.
        irreducible: whether the hits are those of the irreducible part of the cell.
    """
    tables = {key: value for key, value in design.tables.items() if key != "stop"}
    if (count := design.campaign.hits.count) is not None:  # else a list keeps the hits of its file
        tables["hits"] = dict(tables.get("hits", {})) | {"count": min(hits, count)}
        if irreducible:
            tables["hits"]["irreducible"] = True
    if not design.is_fixed:
        given = tables.get("numerics", {})
        tables["numerics"] = {key: given[key] for key in _ANY_RESOLUTION if key in given} | numerics
        if not tables["numerics"]:  # as a design that gives none
            del tables["numerics"]
    try:
        return store.checked(tables)
    except CampaignError:
        return None


def estimate_seconds(campaign: Campaign, level: int | None = None) -> float:
    """Estimate the seconds of a core for the hits of a campaign, the same on every machine.

    It is infinite where they cannot be computed.

    Args:
        level: level of the hits; by default that of the campaign.
    """
    sampler = campaign.sampler()
    numerics = campaign.numerics if level is None else campaign.numerics.at_level(level)
    try:
        return prepare(campaign.scene, sampler.shots(0, 1), numerics).cost.seconds * len(sampler)
    except (ValueError, TooLong, MemoryError):
        return math.inf


_SLOT, _ELLIPSE = 1.0 / math.sqrt(2.0 + math.pi / 4.0), math.sqrt(2.0 / math.pi)
_SIZES = {
    "circle": {"diameter": math.sqrt(4.0 / math.pi)},
    "slot": {"length": 3.0 * _SLOT, "width": _SLOT},
    "triangle": {"side": math.sqrt(4.0 / math.sqrt(3.0))},
    "square": {"side": 1.0},
    "hexagon": {"width": math.sqrt(2.0 / math.sqrt(3.0))},
    "ellipse": {"length": 2.0 * _ELLIPSE, "width": _ELLIPSE},
}
"""Lengths of a hole of the area 1, by shape."""
SHAPES = ("none", *_SIZES)
_SPACING = (8e-3, 16e-3)
_OPEN = 0.25
"""Cell [m] and open area of the first holes of a plate."""
_BASE = {"gap": "100 mm", "thickness": "10 mm"}
"""A layer that is added. Its material is that of the layer in front."""
_SMALLER, _TRIES = 0.85, 24
_OF_A_MATERIAL = ("resistance", "shear_coefficient", "density")


def choices(design: Tables) -> dict[str, list[str]]:
    """Names that each choice offers. Threats whose core is unknown are left out."""
    catalogue = catalogue_of(design, ROOT)
    threats = [name for name, threat in catalogue.all(Threat).items() if threat.shape is not None]
    return {"threat": threats, "material": list(catalogue.all(Material)), "shape": list(SHAPES)}


def apply_change(design: ValidDesign, store: DesignStore, change: str, layer: int, value: str) -> Tables:
    """Return the tables of a design after a change.

    Args:
        change: "threat", "material", "shape", "add layer" or "remove layer".
        layer: number of the changed layer, 0 the plate.
        value: the chosen name; "" is a core or a material of one's own.
    """
    tables, layers = deepcopy(design.tables), design.campaign.target.layers
    every = [tables["plate"], *tables.get("layer", [])]
    match change:
        case "threat":
            _take_threat(tables, design, value)
        case "material":
            for key in (*_OF_A_MATERIAL, "material") if value else ("material",):
                every[layer].pop(key, None)
            every[layer] |= {"material": value} if value else _own(layers[layer])
            if not value:
                tables["interaction"] = design.campaign.interaction.model_dump(exclude_none=True)
        case "shape":
            _take_shape(tables, every[layer], layers[layer], store, value)
        case "add layer":
            every.append(_BASE | ({"material": layers[-1].material} if layers[-1].material else _own(layers[-1])))
        case "remove layer":
            del every[layer]
    tables["layer"] = every[1:]
    return tables if every[1:] else {key: table for key, table in tables.items() if key != "layer"}


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
        known = catalogue_of(tables, ROOT).all(Threat).get(name)
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


def _take_shape(tables: Tables, table: Tables, plate: Plate, store: DesignStore, shape: str) -> None:
    """Take holes of another shape with the same area, or with the largest area that leaves ligaments."""
    before = table.pop("pattern", {})
    if shape == "none":
        return
    old, kept = plate.pattern, {}
    spacing, area = _SPACING, _OPEN * math.prod(_SPACING)
    if isinstance(old, LatticePattern):
        spacing, area = old.spacing, old.hole_area
        kept = {key: before[key] for key in ("staggered", "rotation") if key in before}
    for _ in range(_TRIES):
        sizes = {key: _mm(length * math.sqrt(area)) for key, length in _SIZES[shape].items()}
        table["pattern"] = {"shape": shape, **sizes, "spacing": [_mm(side) for side in spacing], **kept}
        try:
            store.checked(tables)
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
