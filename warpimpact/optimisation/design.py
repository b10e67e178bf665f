"""A design file: a campaign with free variables, objectives, bounds and constraints."""

from __future__ import annotations

import json
import math
import warnings
from collections.abc import Callable, Mapping
from copy import deepcopy
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, field_validator, model_validator

from warpimpact.campaign.campaign import Campaign, lacking
from warpimpact.campaign.places import set_value
from warpimpact.campaign.schema import campaign_schema, file_schema
from warpimpact.campaign.text import as_campaign_error, parsed, read_text
from warpimpact.errors import CampaignError, Implausible
from warpimpact.measures.measure import Measure
from warpimpact.measures.vocabulary import WEIGHTS
from warpimpact.optimisation.space import Space, read_space
from warpimpact.records import attributes as attr
from warpimpact.records.kinds import DESIGN
from warpimpact.scene import EllipsePattern, Plate, Target
from warpimpact.scene.model import Array, Model
from warpimpact.scene.pattern import LatticePattern
from warpimpact.scene.units import Number, PositiveArealDensity, PositiveLength, Title, Whole, quoted
from warpimpact.solver.limit import check_arrests

_SAMPLER_HITS = 2**20
"""Number of hits of the sampler of a search. Far fewer are computed."""
_TURNING = ("obliquity", "azimuth", "pitch", "yaw", "spin")
INVALID = "a campaign that is valid"
_Table = dict[str, Any]
_Name = Annotated[Title, Field(min_length=1, max_length=80)]


class _Goal(Model):
    """A measure of a target.

    Attributes:
        measure: such as `mean(residual_energy_density@130mm)`, `worst_tenth(base_depth)`, `P(base_perforated)`,
            `P(inclination@130mm > 30 deg)`, `V50`, `mean(limit_thickness@layer 1)` or `areal_density`; the default
            stand-off is the largest one.
        threats: over several threats the "worst" one counts, or their weighted "mean".
    """

    measure: str
    threats: Literal["worst", "mean"] = "worst"

    @field_validator("measure")
    @classmethod
    def _is_no_single_hit(cls, text: str) -> str:
        if Measure.parse(text).kind == "worst_point":
            raise ValueError(f"got {quoted(text)}, but a search takes no worst point; worst_tenth(…) has an interval")
        return text

    @cached_property
    def spec(self) -> Measure:
        """The measure."""
        return Measure.parse(self.measure)


class Objective(_Goal):
    """What is minimised or maximised.

    Attributes:
        goal: "minimise" or "maximise"; by default, what is better for whoever is behind the plate.
    """

    goal: Literal["minimise", "maximise"] | None = None

    @property
    def sign(self) -> float:
        """Factor that turns the measure into a quantity to minimise."""
        return -1.0 if self.goal == "maximise" or (self.goal is None and self.spec.higher_is_better) else 1.0

    @model_validator(mode="after")
    def _has_a_goal(self) -> Objective:
        if self.goal is None and self.spec.higher_is_better is None:
            raise ValueError(f'needs goal = "minimise" or "maximise": neither is better of {quoted(self.measure)}')
        return self


class Bound(_Goal):
    """A measure with an upper or a lower limit.

    Attributes:
        at_most, at_least: limits, in the units in which inspect shows the measure.
    """

    at_most: Number | None = None
    at_least: Number | None = None

    @model_validator(mode="after")
    def _has_a_limit(self) -> Bound:
        if (self.at_most is None) == (self.at_least is None):
            raise ValueError("needs at_most or at_least, one of both")
        return self

    @property
    def limit(self) -> float:
        return float(next(limit for limit in (self.at_most, self.at_least) if limit is not None))

    @property
    def sign(self) -> float:
        """Factor that turns a lower limit into an upper one."""
        return -1.0 if self.at_most is None else 1.0


class DesignThreat(Model):
    """A threat, given by the keys of the campaign that it replaces.

    Attributes:
        name: name of the threat.
        weight: weight in a mean over the threats.
        core, impact: keys of these tables.
    """

    name: _Name
    weight: Annotated[Number, Field(gt=0)] = 1.0
    core: _Table = Field(default_factory=dict)
    impact: _Table = Field(default_factory=dict)


class Reference(Model):
    """A target to compare with, such as a published plate, given by the tables of the campaign that it replaces.

    Attributes:
        name: name of the target.
        plate: the whole table.
        layer: all tables of layers behind the plate; those of the campaign by default.
    """

    name: _Name
    plate: _Table
    layer: tuple[_Table, ...] | None = None

    def tables(self, base: Mapping[str, Any]) -> dict[str, Any]:
        """The tables of its campaign, from those of the design file."""
        return {**base, **self.model_dump(include={"plate", "layer"}, exclude_none=True)}


class Constraints(Model):
    """Bounds that every layer with holes must keep before anything is computed; polygons keep any size and radius.

    Attributes:
        smallest_ligament: least width of material between two holes [m].
        smallest_hole: least diameter of the largest circle in a hole [m].
        largest_hole: greatest extent of a hole [m].
        smallest_corner_radius: least radius of the corners of a hole [m]; that of a slot is half its width.
        smallest_open_area, largest_open_area: share of holes.
        smallest_areal_density, largest_areal_density: of the whole target [kg/m²].
        smallest_add_on_areal_density, largest_add_on_areal_density: of the layers in front of the base, or of a plate
            alone [kg/m²].
    """

    smallest_ligament: PositiveLength | None = None
    smallest_hole: PositiveLength | None = None
    largest_hole: PositiveLength | None = None
    smallest_corner_radius: PositiveLength | None = None
    smallest_open_area: Annotated[Number, Field(ge=0, lt=1)] | None = None
    largest_open_area: Annotated[Number, Field(gt=0, le=1)] | None = None
    smallest_areal_density: PositiveArealDensity | None = None
    largest_areal_density: PositiveArealDensity | None = None
    smallest_add_on_areal_density: PositiveArealDensity | None = None
    largest_add_on_areal_density: PositiveArealDensity | None = None


class Search(Model):
    """How much is computed.

    Attributes:
        designs: most designs that are computed.
        population: designs that are computed together, and from which the next ones follow.
        seed: seed of the optimiser and of the hits.
        hits: hits of every design, at the same places of all.
        confirmed: most designs that are confirmed by their answers, as `warpimpact run` gives them.
        confirm_hits: hits of each of these.
        elements: hits by finite elements of each of these, and of each reference, in the place of `continuum.hits`.
    """

    designs: Annotated[Whole, Field(ge=1, le=1_000_000)] = 1000
    population: Annotated[Whole, Field(ge=4, le=1024)] = 40
    seed: Annotated[Whole, Field(ge=0, lt=2**31)] = 0
    hits: Annotated[Whole, Field(ge=16, le=2**20)] = 256
    confirmed: Annotated[Whole, Field(ge=1, le=200)] = 20
    confirm_hits: Annotated[Whole, Field(ge=64, le=2**22)] = 1024
    elements: Annotated[Whole, Field(ge=1, le=1024)] | None = None


class DesignFile(Model):
    """The tables of a design file beside those of a campaign.

    Attributes:
        variables: free variables by their places, such as "plate.pattern.width": a range with low, high and, where it
            has one, a step; or a list of values, or of tables with names.
    """

    variables: _Table = Field(default_factory=dict)
    objectives: Annotated[tuple[Objective, ...], Field(min_length=1, max_length=3)]
    bounds: Annotated[tuple[Bound, ...], Field(max_length=16)] = ()
    threats: Annotated[tuple[DesignThreat, ...], Field(min_length=1, max_length=16)] = (DesignThreat(name="threat"),)
    references: Annotated[tuple[Reference, ...], Field(max_length=16)] = ()
    constraints: Constraints = Constraints()
    search: Search = Search()


@dataclass(frozen=True)
class Design:
    """A design file.

    Attributes:
        text: text of the file.
        name, folder: name of the file in errors, and folder from which file names in it count.
        base: tables of the campaign.
        space: free variables.
        file: the other tables.
    """

    text: str
    name: str
    folder: Path
    base: Mapping[str, Any]
    space: Space
    file: DesignFile

    @property
    def goals(self) -> tuple[Objective | Bound, ...]:
        """Objectives and bounds."""
        return (*self.file.objectives, *self.file.bounds)

    @cached_property
    def columns(self) -> tuple[Measure, ...]:
        """Numbers of every hit, of which the measures are made."""
        return tuple(dict.fromkeys(goal.spec.column for goal in self.goals if goal.spec.kind != "target"))

    @property
    def continuum_hits(self) -> int | None:
        """Hits by finite elements of each confirmed design and each reference; None without any."""
        hits: int | None = self.base.get("continuum", {}).get("hits")
        return hits

    def with_continuum_hits(self, hits: int | None) -> Design:
        """The design with so many hits by finite elements."""
        base = {name: table for name, table in self.base.items() if name != "continuum"}
        table = {key: value for key, value in self.base.get("continuum", {}).items() if key != "hits"}
        table |= {"hits": hits} if hits else {}
        return replace(self, base=base | ({"continuum": table} if table else {}))

    @property
    def fresh_seed(self) -> int:
        """Seed of hits that the search has not computed."""
        return int(np.random.SeedSequence(self.file.search.seed, spawn_key=(24,)).generate_state(1)[0] >> 1)

    def tables(self, values: Array) -> dict[str, Any]:
        """The tables of the campaign of a point of the space."""
        data = deepcopy(dict(self.base))
        for variable, value in zip(self.space.variables, values, strict=True):
            if not math.isnan(value):
                set_value(data, variable.place, deepcopy(variable.written(value)), f"{self.name}: variables")
        return data

    def against(self, tables: Mapping[str, Any], threat: DesignThreat) -> dict[str, Any]:
        """The tables of a target with the keys of a threat."""
        core = dict(threat.core) or tables.get("core", {})
        return dict(tables) | {"core": core, "impact": tables.get("impact", {}) | threat.impact}

    def campaign(self, tables: Mapping[str, Any], threat: int = 0, seed: int | None = None) -> Campaign:
        """The campaign of a target and a threat: hits in the irreducible part of the cell, where it has one.

        Args:
            tables: tables of the target.
            threat: number of the threat.
            seed: of the hits; by default that of the search.

        Raises:
            CampaignError: the campaign is not valid.
        """
        data = self.against(tables, self.file.threats[threat])
        seed = self.file.search.seed if seed is None else seed
        sampling = {"sampling": "sobol", "count": _SAMPLER_HITS, "seed": seed, "irreducible": is_irreducible(tables)}
        data["hits"] = {key: value for key, value in data.get("hits", {}).items() if key == "area"} | sampling
        return campaign_from(json.dumps(data, default=str, ensure_ascii=False), self.name, self.folder)


def campaign_tables(design: Design, tables: Mapping[str, Any], threat: int, name: str) -> dict[str, Any]:
    """The tables of the campaign of a target, by its name, and a threat, for `warpimpact run`."""
    threats = design.file.threats
    made: dict[str, Any] = json.loads(json.dumps(design.against(tables, threats[threat]), default=str))
    made.setdefault("hits", {"sampling": "sobol", "count": 4096, "seed": design.file.search.seed})
    named = f", {threats[threat].name}" if len(threats) > 1 else ""
    title = " ".join(f"{design.base.get('title', '')}{named}: {name}"[:200].split())
    return made | {"title": title.rstrip(":")}


def is_irreducible(tables: Mapping[str, Any]) -> bool:
    """Whether the symmetries of a target depend only on plate and shot."""
    layers, impact = tables.get("layer", ()), tables.get("impact", {})
    holed = any({"pattern", "size"} & {*layer} for layer in layers)
    return not holed and not any(isinstance(impact.get(name), dict) for name in _TURNING)


@lru_cache(maxsize=256)
def campaign_from(text: str, name: str, folder: Path) -> Campaign:
    """A campaign of a search, cached so that its plate keeps its tile."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", ".* weakens so fast", Implausible)  # of a thickness that the search chose
        return Campaign.from_text(text, name=name, folder=folder)


Violation = tuple[str, float, str]
"""A constraint that a design breaks: its key, or INVALID; relative size of the violation; value and allowed range."""


def violations(design: Design, tables: Mapping[str, Any]) -> tuple[Target | None, list[Violation]]:
    """The target of a design, None if its campaign is not valid, and the constraints that it breaks."""
    try:
        campaign = design.campaign(tables)
        if any(measure.is_limit for measure in design.columns):
            check_arrests(campaign.scene)
    except ValueError as error:  # a CampaignError is one, too
        return None, [(INVALID, 1.0, error.problem if isinstance(error, CampaignError) else str(error))]
    target, broken = campaign.target, list[Violation]()
    for key, limit in design.file.constraints:
        name = key.partition("_")[2]
        if limit is None:
            continue
        if name in WEIGHTS:
            unit, numbers = " kg/m²", {WEIGHTS[name].label: target_weights(target)[name]}
        else:
            unit, number_of = _OF_HOLES[key]
            holed = {place: plate for place, plate in target.named if plate.open_area > 0.0}
            numbers = {f"{place}: {name.replace('_', ' ')}": number_of(plate) for place, plate in holed.items()}
        sign, scale = 1.0 if key.startswith("smallest") else -1.0, 1e3 if unit == " mm" else 1.0
        for what, value in numbers.items():
            if sign * value < sign * limit * (1.0 - sign * 1e-9):
                end = f"at {'least' if sign > 0.0 else 'most'} {scale * limit:.4g}{unit}"
                text = f"{what} of {scale * value:.4g}{unit}, but it must be {end}"
                broken.append((key, sign * (limit - value) / limit, text))
    return target, broken


def target_weights(target: Target) -> dict[str, float]:
    """Masses per area of a target, by the names of the measures."""
    weights = target.weights
    return {attr.AREAL_DENSITY: target.areal_density, attr.ADD_ON_DENSITY: weights.get("add-on", target.areal_density)}


def hole_sizes(plate: Plate) -> tuple[float, float]:
    """Diameter of the largest circle in a hole, and greatest extent of a hole [m]; NaN of polygons."""
    return plate.pattern.hole_size if isinstance(plate.pattern, LatticePattern) else (math.nan, math.nan)


def corner_radius(plate: Plate) -> float:
    """Least radius of the corners of the holes [m]; NaN of polygons."""
    pattern = plate.pattern
    if isinstance(pattern, EllipsePattern):
        return float(pattern.width**2 / (2.0 * pattern.length))
    return float(pattern.rounding) if isinstance(pattern, LatticePattern) else math.nan


_OF_HOLES: dict[str, tuple[str, Callable[[Plate], float]]] = {
    "smallest_ligament": (" mm", lambda plate: plate.ligament),
    "smallest_hole": (" mm", lambda plate: hole_sizes(plate)[0]),
    "largest_hole": (" mm", lambda plate: hole_sizes(plate)[1]),
    "smallest_corner_radius": (" mm", corner_radius),
    "smallest_open_area": ("", lambda plate: plate.open_area),
    "largest_open_area": ("", lambda plate: plate.open_area),
}
"""Constraints of the holes of a plate: unit in a sentence, and the bounded number in SI."""


def read_design(path: str | Path) -> Design:
    """Read a design file; file names in it count from its folder.

    Raises:
        CampaignError: the file is missing, is not TOML, or has a value that is not allowed.
    """
    path = Path(path)
    return design_from(read_text(path), str(path), path.parent)


def design_from(text: str, name: str, folder: Path) -> Design:
    """Read a design from its text; `name` is the name of the file in errors."""
    base = parsed(text, name, DESIGN)
    tables = {key: base.pop(key) for key in DesignFile.model_fields if key in base}
    if "stop" in base:
        raise CampaignError(f"{name}: stop: a design file takes no [stop]; [search] sets the hits")
    with as_campaign_error(f"{name}: ", tables):
        file = DesignFile.model_validate(tables)
    space, output = read_space(file.variables, f"{name}: variables"), base.get("output", {})
    layered = "layer" in base or any(variable.place == "layer" for variable in space.variables)
    standoffs: list[float] | None = [] if output.get("standoffs") == [] else None
    for table in ("objectives", "bounds"):
        for k, goal in enumerate(getattr(file, table)):
            has = {"layered": layered, "bending": output.get("bending") is True, "breakable": True}
            if keys := lacking(goal.spec, standoffs, **has, deforms=False):  # a search computes by the fast law
                raise CampaignError(f'{name}: {table}[{k}].measure = "{goal.measure}" needs {keys}')
    design = Design(text=text, name=name, folder=folder, base=base, space=space, file=file)
    return design if file.search.elements is None else design.with_continuum_hits(file.search.elements)


def design_schema() -> dict[str, Any]:
    """The JSON schema of a design file: of a campaign, what is free in it, and what is sought."""
    campaign, own = campaign_schema(), file_schema(DesignFile, "warpimpact design")
    keys = {key: schema for key, schema in campaign["properties"].items() if key not in ("stop", "sweep")}
    own["properties"], own["required"] = keys | own["properties"], ["objectives"]
    return own | {"$defs": own["$defs"] | campaign["$defs"]}
