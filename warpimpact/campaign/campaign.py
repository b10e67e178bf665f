"""Campaign: one TOML file, validated, as one immutable value.

Long because everything that two tables of a file must agree on is checked here.
"""

import math
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Self

import numpy as np
from pydantic import BaseModel, Field, PrivateAttr, ValidationError, model_validator

from ..results.kinds import CAMPAIGN
from ..results.measures import Measure
from ..scene import (
    AnyCore,
    Hits,
    Impact,
    Interaction,
    Layer,
    Numerics,
    Plate,
    Record,
    Sampler,
    Scatter,
    Scene,
    Symmetry,
    Target,
    exclusions,
    symmetries_used,
)
from ..scene.distributions import EDGE
from ..scene.exclusions import check_together
from ..scene.input_files import InputFile
from ..scene.model import Model
from ..scene.problems import sentence
from ..scene.quantities import BY_LAYER
from ..scene.scatter import check_range
from ..scene.shots import FARTHEST_HIT
from ..scene.symmetry import unsymmetric
from ..scene.target import MOST_LAYERS
from ..scene.units import Number, PositiveLength, Title
from .catalogued import catalogue_of, known_resistance, with_materials, with_threat
from .continuum_settings import FiniteElements
from .needs import lacking
from .plausible import check_plausible, warn_of
from .references import ReferenceSampler, at_base_alone, at_solid
from .scatter_tables import with_scatter_apart
from .stop import Stop
from .text import CampaignError, parsed, read_text

_MOST_LENGTHS = 1000
"""Most degradation lengths in the radius of a core, whose surface has patches of about this length."""


class Output(Record):
    """What is reported: the records of every shot, with at least one stand-off, and what a run adds.

    Attributes:
        failed_share: share of shots whose computation may fail; a run with more ends with exit code 3.
        solid_reference: compute some hits of its references, too (`Campaign.references`), into groups of the file.
        exit_state: store velocity, axis and position of every core at the end of contact.
    """

    standoffs: Annotated[tuple[PositiveLength, ...], Field(fail_fast=True, max_length=64)] = (0.05, 0.13)
    failed_share: Annotated[Number, Field(ge=0, le=1)] = 0.01
    solid_reference: Annotated[bool, Field(strict=True)] = True
    exit_state: Annotated[bool, Field(strict=True)] = True


class Campaign(Model):
    """What is shot at what, where, how finely it is computed and what is reported.

    Attributes:
        title: one line, which figures and reports show.
        core: the rigid core.
        plate: what it is shot at.
        layer: what stands behind the plate, in order: a table `[[layer]]` each.
        impact: how the core arrives.
        hits: where it hits.
        interaction: stress on the surface of the core.
        numerics: how finely the shots are computed.
        output: what is reported.
        scatter: distributions of values that scatter. A file has them in the places of the values.
        catalogue: TOML file with threats and materials of your own, tables `[[threat]]` and `[[material]]`.
        stop: when the run ends, instead of a count. By default, its hits are then those of the irreducible part of the
            cell.
        allow_implausible: compute also with values that no core or target has, such as a plate of 4 m: they are else
            refused, as a slip of units.
        continuum: how `warpimpact continuum` computes its hits.
    """

    title: Title
    core: AnyCore
    plate: Plate
    layer: Annotated[tuple[Layer, ...], Field(fail_fast=True, max_length=MOST_LAYERS)] = ()
    impact: Impact
    hits: Hits
    interaction: Interaction = Interaction()
    numerics: Numerics = Numerics()
    output: Output = Output()
    scatter: Scatter = Scatter()
    catalogue: InputFile | None = None
    stop: Stop | None = None
    allow_implausible: Annotated[bool, Field(strict=True)] = False
    continuum: FiniteElements = FiniteElements()
    _source: str = PrivateAttr("")
    _sampler: Sampler | None = PrivateAttr(None)

    @property
    def text(self) -> str:
        """The TOML file as it was read; of a campaign made or changed in Python, its values as JSON."""
        return self._source or self.model_dump_json()

    @classmethod
    def from_toml(cls, path: str | Path, *, count: int | None = None, needs_velocity: bool = True) -> Self:
        """Read a campaign file; file names in it count from its folder.

        Args:
            path: the TOML file.
            count: number of hits, instead of the file's.
            needs_velocity: whether the shots need a velocity. Where it is searched, a threat without one will do.

        Raises:
            CampaignError: the file is missing, is not TOML, or has a value that is not allowed.
        """
        path = Path(path)
        text = read_text(path)
        return cls.from_text(text, name=str(path), folder=path.parent, count=count, needs_velocity=needs_velocity)

    @classmethod
    def from_text(
        cls, text: str, *, name: str, folder: Path, count: int | None = None, needs_velocity: bool = True
    ) -> Self:
        """Read a campaign from its text, TOML, or the JSON of a campaign made in Python. Errors have its name; files
        that it names count from the folder.

        Raises:
            CampaignError: the text is not TOML, or has a value that is not allowed.
        """
        data = parsed(text, name, CAMPAIGN)
        if isinstance(plates := data.get("plate"), list):
            raise CampaignError(
                f"{name}: plate: got {len(plates)} plates, but this takes one; warpimpact compare {name} runs them all "
                "and compares them"
            )
        if "sweep" in data:
            raise CampaignError(
                f"{name}: sweep: this takes one combination of inputs; warpimpact sweep {name} runs them all"
            )
        if count is not None:
            _override_count(data, count)
        catalogue = catalogue_of(data, name, folder)
        data = with_threat(data, catalogue, name, needs_velocity=needs_velocity)
        data = with_scatter_apart(data, name)
        data = with_materials(data, catalogue, name)
        try:
            campaign = cls.model_validate(data, context={"folder": folder})
        except ValidationError as error:
            raise CampaignError(f"{name}: {sentence(error, data)}") from None
        campaign._source = text
        return campaign

    @property
    def _values(self) -> tuple[Any, ...]:
        """Values by which two campaigns are compared. The form of their text does not count."""
        return tuple(getattr(self, name) for name in type(self).model_fields)

    @property
    def scene(self) -> Scene:
        """Core, target, interaction and records."""
        return Scene(core=self.core, target=self.target, interaction=self.interaction, record=self.output)

    @property
    def target(self) -> Target:
        """The plate and the layers behind it."""
        return Target(layers=(self.plate, *self.layer))

    def computed_by(self, elements: FiniteElements) -> Self:
        """The campaign, with its text, but with these settings for hits by finite elements."""
        changed = self.model_copy(update={"continuum": elements})
        changed._source = self._source
        return changed

    @property
    def replicates(self) -> int:
        """Number of independent scramblings to which the shots are dealt in turn."""
        return self.hits.scramblings

    @property
    def symmetries(self) -> tuple[Symmetry, ...]:
        """Symmetries that give the rest of the cell from its hits; the identity alone without `hits.irreducible`."""
        return symmetries_used(self.impact, self.hits, self.plate)

    def sampler(self) -> Sampler:
        """The sampler of its shots."""
        if self._sampler is not None:
            return self._sampler
        return Sampler(self.impact, self.hits, self.plate, self.scatter, self.replicates)

    @property
    def references(self) -> dict[str, Self]:
        """Its references: "solid" if it is not solid itself, and "base_alone" if it has layers."""
        is_solid = not self.layer and self.target.solid == self.target
        return ({} if is_solid else {"solid": self.solid()}) | ({"base_alone": self.base_alone()} if self.layer else {})

    def solid(self) -> Self:
        """The campaign with a solid plate as heavy as its own; of layers, a solid add-on before the same base.

        A Y of the catalogue becomes that of the new thickness. The shots have the places and conditions of this
        campaign; where thicknesses scatter, each solid plate is as heavy as that of its shot.
        """
        pairs = zip(self.target.layers, self.target.solid.layers, strict=True)
        solid = Target(layers=tuple(self._of_its_thickness(*pair) for pair in pairs))
        return self._reference(solid, ReferenceSampler(self.sampler(), partial(at_solid, self.target, solid)))

    def base_alone(self) -> Self:
        """The campaign with its last layer alone; the shots have the places and conditions of this campaign."""
        last = len(self.layer)
        own = {name: getattr(self.scatter, name)[last:] for name in BY_LAYER if not name.startswith("offset")}
        scatter = BaseModel.model_copy(self.scatter, update={"offset_y": (), "offset_z": ()} | own)
        sampler = ReferenceSampler(self.sampler(), partial(at_base_alone, self.target))
        return self._reference(self.target.base_alone, sampler, scatter=scatter)

    def _reference(self, target: Target, sampler: Sampler, **changed: Any) -> Self:
        changed |= {"plate": target.layers[0], "layer": target.layers[1:]}
        changed["hits"] = BaseModel.model_copy(self.hits, update={"irreducible": False})  # not that of its own plate
        reference = BaseModel.model_copy(self, update=changed)
        reference._source, reference._sampler = "", sampler
        return reference

    def _of_its_thickness(self, given: Plate, solid: Plate) -> Plate:
        known = None
        if solid != given:
            of = self.interaction, self.core, given, self.impact.obliquity, self.catalogue
            known = known_resistance(*of, solid.thickness)
        return solid if known is None else solid.model_copy(update={"resistance": known.median})

    def lacking(self, measure: Measure) -> str:
        """Keys that the campaign needs for a measure of its hits and does not have; empty if it lacks none."""
        breakable = self.core.strength is not None or "strength" in (self.hits.listed or {})
        return lacking(
            measure,
            standoffs=self.output.standoffs,
            layered=bool(self.layer),
            bending=self.output.bending,
            breakable=breakable,
        )

    @model_validator(mode="after")
    def _is_plausible(self) -> Self:  # first, as a slip of units breaks other rules, too
        if not self.allow_implausible:
            try:
                check_plausible(self.core, self.target, self.output, self.impact, self.hits)
            except ValueError as error:
                raise ValueError(f"{error}; allow_implausible = true has it computed as it is") from None
        return self

    @model_validator(mode="before")
    @classmethod
    def _stop_bounds_the_count(cls, values: Any) -> Any:
        stop, hits = values.get("stop"), values.get("hits")
        if isinstance(stop, dict) and isinstance(hits, dict) and "max_count" in stop:
            return values | {"hits": {"count": stop["max_count"]} | hits}
        return values

    @model_validator(mode="after")
    def _stop_samples_irreducible_part(self) -> Self:
        """Sample the irreducible part of the cell by default, where an answer costs least
        (tests/benchmarks/NOTES.md)."""
        hits = self.hits
        chosen = "irreducible" in hits.model_fields_set or hits.area != "cell" or hits.file is not None
        if self.stop is None or chosen or any(unsymmetric(self.scatter, self.layer).values()):
            return self  # without symmetry every hit is computed
        part = hits.model_copy(update={"irreducible": hits.sampling in ("sobol", "random")})
        object.__setattr__(self, "hits", part)
        return self

    @model_validator(mode="after")
    def _goes_together(self) -> Self:
        """Check all options that exclude or need each other (scene/exclusions.py)."""
        stop, hits, numerics = self.stop, self.hits, self.numerics
        check_together(
            unsymmetric(self.scatter, self.layer)
            | {
                exclusions.STOP: stop is not None,
                exclusions.UNEVEN: hits.sampling in ("grid", "list") and f'hits.sampling = "{hits.sampling}"',
                exclusions.ONE_SCRAMBLING: hits.sampling == "sobol" and self.replicates == 1,
                exclusions.IRREDUCIBLE: hits.irreducible,
                exclusions.LISTED_STRENGTH: "strength" in (hits.listed or {}),
                exclusions.LAYERS: bool(self.layer),
                exclusions.BENDING: self.output.bending,
                exclusions.STRENGTH: self.core.strength is not None or "strength" in (hits.listed or {}),
                exclusions.NODAL: numerics.scheme == "nodal",
                exclusions.FREE_SURFACE: self.interaction.free_surface is not None,
                exclusions.BLOCK: numerics.layout == "block",
                exclusions.DOUBLE: numerics.precision == "double",
            }
        )
        return self

    @model_validator(mode="after")
    def _stop_fits(self) -> Self:
        if self.stop is None:
            return self
        if self.hits.count != self.stop.max_count:
            raise ValueError(
                f"hits.count = {self.hits.count} and stop.max_count = {self.stop.max_count} cannot be combined: "
                "[stop] sets the number of hits; leave out hits.count"
            )
        measure, asked = self.stop.measure, f'stop.quantity = "{self.stop.quantity}"'
        if measure.is_limit:
            raise ValueError(f"{asked} is told by warpimpact limit, which takes no [stop]")
        if keys := self.lacking(measure):
            raise ValueError(f"{asked} needs {keys}")
        return self

    @model_validator(mode="after")
    def _hits_cover_something(self) -> Self:
        covered, listed = self.hits.covered(self.plate), self.hits.listed
        if listed is None or "hit_y" not in listed:
            farthest = 0.5 * max(covered)
        else:
            farthest = max(float(np.abs(listed[name]).max()) for name in ("hit_y", "hit_z"))
        # Cells of the plate have 32-bit numbers, counted from the origin.
        cell = min(self.plate.degradation_length / 25.0, (self.numerics.grid_spacing or math.inf) / 5.0)
        allowed = min(FARTHEST_HIT, 2**30 * cell)
        if farthest > allowed:
            raise ValueError(
                f"got hits up to {farthest:.6g} m from the origin, but they are exact up to {allowed:.4g} m; a pattern "
                "repeats, so take hits near the origin"
            )
        return self

    @model_validator(mode="after")
    def _shots_are_possible(self) -> Self:
        ranges = {name: (value, value) for name, value in self.impact}
        for (name, _), distribution in self.scatter.given.items():
            low, high = distribution.quantile(np.array([EDGE, 1.0 - EDGE]))
            ranges[name] = (float(low), float(high))
        for name, column in (self.hits.listed or {}).items():
            ranges[name] = (float(column.min()), float(column.max()))
            try:
                check_range(name, *ranges[name])
            except ValueError as error:
                raise ValueError(f"got hits.file with a column {name} that {error}") from None
        if ranges != {name: (value, value) for name, value in self.impact}:
            _check_nose_first({name: max(map(abs, ends)) for name, ends in ranges.items()})
        return self

    @model_validator(mode="after")
    def _weakens_about_the_core(self) -> Self:
        radius, listed = self.core.max_radius, (self.hits.listed or {}).get("degradation_length", [math.inf])
        for name, plate in self.target.named:
            shortest = min(plate.degradation_length, *listed) if name == "plate" else plate.degradation_length
            if radius > _MOST_LENGTHS * shortest:
                raise ValueError(
                    f"got {name}.degradation_length = {shortest:g} m, but a core of radius {radius:g} "
                    f"m needs at least 1/{_MOST_LENGTHS} of its radius, {radius / _MOST_LENGTHS:.4g} m"
                )
        return self

    @model_validator(mode="after")
    def _output_is_possible(self) -> Self:
        self.output.check(self.core)
        return self

    @model_validator(mode="after")
    def _looks_as_meant(self) -> Self:
        warn_of(self.scene, self.impact, self.hits)
        return self


def _check_nose_first(largest: dict[str, float]) -> None:
    """Refuse shots that might not arrive nose first: the axis is built from projected angles, which flip at 90°."""
    for name in ("pitch", "yaw"):
        if largest[name] + largest["obliquity"] >= math.pi / 2:
            raise ValueError(
                f"got shots with {name} up to {math.degrees(largest[name]):.4g} deg and obliquity up to "
                f"{math.degrees(largest['obliquity']):.4g} deg, but their sum must stay below 90 deg"
            )


def _override_count(data: dict[str, Any], count: int) -> None:
    """Replace the number of hits of the file; with a stop rule this is the largest number."""
    stopped = isinstance(data.get("stop"), dict)
    if stopped:
        data["stop"]["max_count"] = count
    if isinstance(data.setdefault("hits", {}), dict) and (not stopped or "count" in data["hits"]):
        data["hits"]["count"] = count
