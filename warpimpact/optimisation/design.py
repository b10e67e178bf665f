"""A design file: a campaign with free variables, objectives, bounds and constraints."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, ValidationError, model_validator

from warpimpact.campaign.campaign import Campaign
from warpimpact.campaign.schema import campaign_schema, file_schema
from warpimpact.campaign.text import CampaignError, parsed, read_text
from warpimpact.optimisation.asked import Bound, Objective, check_needs
from warpimpact.optimisation.space import Space, read_space
from warpimpact.results.kinds import DESIGN
from warpimpact.results.measures import Measure
from warpimpact.scene.model import Array, Model
from warpimpact.scene.problems import sentence
from warpimpact.scene.units import Number, PositiveArealDensity, PositiveLength, Title

SCRAMBLINGS = 16
"""Number of scramblings of the hits of a search: hit k belongs to scrambling k modulo this number."""
_Table = dict[str, Any]
_Name = Annotated[Title, Field(min_length=1, max_length=80)]

OWN_TABLES = ("variables", "objectives", "bounds", "threats", "constraints", "search", "references")
"""Tables of a design file beside those of a campaign."""


class FacedThreat(Model):
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


class Constraints(Model):
    """Bounds that every layer with holes must keep before anything is computed.

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
        hits: first number of hits of every design.
        most_hits: most hits of a design while the paired difference to the front does not decide.
        confirmed: most designs of the front that are computed again with fresh hits.
        confirm_hits: hits of each of these.
    """

    designs: Annotated[int, Field(strict=True, ge=1, le=1_000_000)] = 1000
    population: Annotated[int, Field(strict=True, ge=4, le=1024)] = 40
    seed: Annotated[int, Field(strict=True, ge=0, lt=2**31)] = 0
    hits: Annotated[int, Field(strict=True, ge=16, le=2**16)] = 64
    most_hits: Annotated[int, Field(strict=True, ge=16, le=2**20)] = 1024
    confirmed: Annotated[int, Field(strict=True, ge=1, le=200)] = 20
    confirm_hits: Annotated[int, Field(strict=True, ge=64, le=2**22)] = 1024

    @model_validator(mode="after")
    def _grows(self) -> Search:
        if self.most_hits < self.hits:
            raise ValueError(f"got most_hits = {self.most_hits}, but it must be at least hits = {self.hits}")
        return self

    @property
    def extent(self) -> str:
        """Words for the most that is computed."""
        return (
            f"searches at most {self.designs} designs with {self.hits} to {self.most_hits} hits each, then up to "
            f"{self.confirmed} of the front with {self.confirm_hits} fresh hits; how long that takes is told as it runs"
        )

    @property
    def rungs(self) -> list[int]:
        """Numbers of hits of a design, from the first to the largest, each four times the one before."""
        rungs = [self.hits]
        while rungs[-1] < self.most_hits:
            rungs.append(min(4 * rungs[-1], self.most_hits))
        return rungs


class Asking(Model):
    """The tables of a design file beside those of a campaign and its variables."""

    objectives: Annotated[tuple[Objective, ...], Field(min_length=1, max_length=3)]
    bounds: Annotated[tuple[Bound, ...], Field(max_length=16)] = ()
    threats: Annotated[tuple[FacedThreat, ...], Field(max_length=16)] = ()
    references: Annotated[tuple[Reference, ...], Field(max_length=16)] = ()
    constraints: Constraints = Constraints()
    search: Search = Search()


@dataclass(frozen=True)
class Design:
    """A design file.

    Attributes:
        title: title of the campaign.
        text: text of the file.
        name, folder: name of the file in errors, and folder from which file names in it count.
        base: tables of the campaign.
        space: free variables.
        objectives, bounds, threats, references, constraints, search: as in the file. Without threats there is the
            threat of the campaign, without a name.
        keys: columns that are computed of every hit, for the measures that are asked for.
    """

    title: str
    text: str
    name: str
    folder: Path
    base: Mapping[str, Any]
    space: Space
    objectives: tuple[Objective, ...]
    bounds: tuple[Bound, ...]
    threats: tuple[FacedThreat, ...]
    references: tuple[Reference, ...]
    constraints: Constraints
    search: Search
    keys: tuple[Measure, ...] = field(default=())

    @property
    def asked(self) -> tuple[Objective | Bound, ...]:
        """Objectives and bounds."""
        return (*self.objectives, *self.bounds)

    def tables(self, values: Array) -> dict[str, Any]:
        """The tables of the campaign of a point of the space."""
        return self.space.tables(self.base, values, self.name)

    def campaign(self, tables: Mapping[str, Any], threat: FacedThreat) -> Campaign:
        """The campaign of a target with these tables and a threat.

        Raises:
            CampaignError: the campaign is not valid.
        """
        data = dict(tables)
        for table in ("core", "impact"):
            overrides = getattr(threat, table)
            data[table] = dict(overrides) if table == "core" and overrides else data.get(table, {}) | overrides
        return _campaign(json.dumps(data, ensure_ascii=False), self.name, self.folder)


@lru_cache(maxsize=256)
def _campaign(text: str, name: str, folder: Path) -> Campaign:
    """A campaign of a search, cached for further hits, so that its plate also keeps its tile."""
    return Campaign.from_text(text, name=name, folder=folder)


def read_design(path: str | Path) -> Design:
    """Read a design file; file names in it count from its folder.

    Raises:
        CampaignError: the file is missing, is not TOML, or has a value that is not allowed.
    """
    path = Path(path)
    return design_from(read_text(path), str(path), path.parent)


def design_from(text: str, name: str, folder: Path) -> Design:
    """Read a design from its text; `name` is the name of the file in errors."""
    data = parsed(text, name, DESIGN)
    asking_tables = {key: data.pop(key) for key in OWN_TABLES if key in data}
    if "stop" in data:
        raise CampaignError(f"{name}: stop: a design file takes no [stop]; [search] sets the hits")
    space = read_space(asking_tables.pop("variables", {}), name)
    try:
        asking = Asking.model_validate(asking_tables)
    except ValidationError as error:
        raise CampaignError(f"{name}: {sentence(error, asking_tables)}") from None
    threats = asking.threats or (FacedThreat(name="threat"),)
    names = [threat.name for threat in threats] + [reference.name for reference in asking.references]
    if twice := next((name for name in names if names.count(name) > 1), None):
        raise CampaignError(f'{name}: got the name "{twice}" twice, but each threat and reference needs its own')
    layered = "layer" in data or any(variable.place == "layer" for variable in space.variables)
    places = {
        f"{table}[{k}]": goal for table in ("objectives", "bounds") for k, goal in enumerate(getattr(asking, table))
    }
    try:
        check_needs(places, data.get("output", {}), layered=layered)
    except ValueError as error:
        raise CampaignError(f"{name}: {error}") from None
    asked = (goal.asked for goal in (*asking.objectives, *asking.bounds))
    keys = dict.fromkeys(measure.column for measure in asked if measure.kind != "target")
    return Design(
        title=str(data.get("title", "")),
        text=text,
        name=name,
        folder=folder,
        base=data,
        space=space,
        keys=tuple(keys),
        **dict(asking) | {"threats": threats},
    )


def design_schema() -> dict[str, Any]:
    """The JSON schema of a design file: of a campaign, what is free in it, and what is sought."""
    campaign, asking = campaign_schema(), file_schema(Asking, "warpimpact design")
    variables = {
        "description": 'Free variables by their places, such as "plate.pattern.width": a range with low, high and, '
        "where it has one, a step; or a list of values, or of tables with names.",
        "type": "object",
        "additionalProperties": {"type": ["object", "array"]},
    }
    keys = {key: schema for key, schema in campaign["properties"].items() if key not in ("stop", "sweep")}
    return asking | {
        "properties": keys | asking["properties"] | {"variables": variables},
        "$defs": asking["$defs"] | campaign["$defs"],
        "required": ["objectives"],
    }
