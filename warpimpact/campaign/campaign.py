"""Campaign: one TOML file, validated, as one immutable value."""

import json
import math
import re
import warnings
from collections.abc import Sequence
from copy import deepcopy
from functools import cached_property, partial
from pathlib import Path
from typing import Annotated, Any, Self

import numpy as np
from pydantic import (
    BaseModel,
    Field,
    PrivateAttr,
    ValidationError,
    ValidationInfo,
    ValidatorFunctionWrapHandler,
    field_serializer,
    field_validator,
    model_validator,
)

from ..catalogue.strength import Resistance
from ..results.kinds import CAMPAIGN
from ..results.measures import Measure
from ..results.variables import BENDING_VARIABLES, BROKEN_VARIABLES, DEPTH
from ..results.vocabulary import BASE, STRENGTH
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
from ..scene.input_files import InputFile
from ..scene.model import Model, sentence
from ..scene.quantities import BY_LAYER, SCATTERED, Implausible
from ..scene.sampling import unsymmetric
from ..scene.scatter import Distribution, check_range
from ..scene.shots import FARTHEST_HIT
from ..scene.target import MOST_LAYERS, layer_name
from ..scene.units import Number, PositiveLength, Radians, Title, Whole, in_radians, quantity, quoted
from .continuum_settings import FiniteElements
from .materials import catalogue_of, known_resistance, with_materials, with_threat
from .plausible import check_plausible, doubted
from .references import ReferenceSampler, at_base_alone, at_solid
from .text import CampaignError, parsed, read_text

_MOST_LENGTHS = 1000
"""Most degradation lengths in the radius of a core, whose surface has patches of about this length."""
CORES_STAYED_WHOLE = "the cores of both published shots stayed whole at bending stresses of some 4.2 to 5.6 GPa"
_PLATE_NAME = re.compile(r"\w[\w .+-]{,79}")
"""Names of plates; the result files get the same names."""


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


class Stop(Model):
    """When a run ends: as soon as a confidence interval is narrow enough.

    Attributes:
        quantity: a measure with an interval, such as `mean(residual_velocity)`, `quantile(tilt@130mm, 0.05)`,
            `worst_tenth(residual_energy_density@130mm)` or `P(perforated)`.
        half_width: largest half width of the interval, SI; that of an angle is given in degrees or with its unit.
        confidence: of the interval.
        max_count: number of shots after which the run ends in any case.
    """

    quantity: str
    half_width: Annotated[float, Field(json_schema_extra={"type": ["number", "string"]})]
    confidence: Annotated[Number, Field(gt=0, lt=1)] = 0.95
    max_count: Annotated[Whole, Field(ge=1, le=2**30)]

    @field_validator("quantity")
    @classmethod
    def _is_a_measure(cls, text: str) -> str:
        if not Measure.parse(text).has_interval:
            raise ValueError(f"got {quoted(text)}, but a run cannot stop by a number without an interval")
        return text

    @field_validator("half_width", mode="wrap")
    @classmethod
    def _in_si(cls, value: object, _: ValidatorFunctionWrapHandler, info: ValidationInfo) -> float:
        if "quantity" not in info.data:
            raise ValueError(f"got {quoted(value)}, but it needs a valid stop.quantity")
        number = Measure.parse(info.data["quantity"]).in_units(value)
        if number <= 0.0:
            raise ValueError(f"got {quoted(value)}, but it must be greater than 0")
        return number

    @field_serializer("half_width", when_used="json")
    def _as_read(self, value: float) -> float | str:
        return in_radians(value) if isinstance(value, Radians) else value

    @property
    def measure(self) -> Measure:
        """The measure that the quantity names."""
        return Measure.parse(self.quantity)


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
        data = with_materials(with_scatter(data, name), catalogue, name, folder)
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

    @cached_property
    def scene(self) -> Scene:
        """Core, target, interaction and records."""
        return Scene(core=self.core, target=self.target, interaction=self.interaction, record=self.output)

    @cached_property
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

        def of_its_thickness(plate: Plate, solid: Plate) -> Plate:
            known = None if solid == plate else self.catalogue_resistance(plate, solid.thickness)
            return solid if known is None else solid.model_copy(update={"resistance": known.median})

        pairs = zip(self.target.layers, self.target.solid.layers, strict=True)
        solid = Target(layers=tuple(of_its_thickness(*pair) for pair in pairs))
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
        for name in ("scene", "target"):  # cached ones of this campaign
            reference.__dict__.pop(name, None)
        reference._source, reference._sampler = "", sampler
        return reference

    def catalogue_resistance(self, plate: Plate, thickness: float | None = None) -> Resistance | None:
        """The resistance of a plate, or of one of another thickness [m], by the catalogue; None where Y is the
        user's."""
        return known_resistance(self.interaction, self.core, plate, self.impact.obliquity, self.catalogue, thickness)

    def lacking(self, measure: Measure) -> str:
        """Keys that the campaign needs for a measure of its hits and does not have; empty if it lacks none."""
        output, layered, breakable = self.output, bool(self.layer), self._has_strength
        return lacking(measure, output.standoffs, layered=layered, bending=output.bending, breakable=breakable)

    @property
    def _has_strength(self) -> bool:
        return self.core.strength is not None or "strength" in (self.hits.listed or {})

    @model_validator(mode="before")
    @classmethod
    def _stop_bounds_the_count(cls, values: Any) -> Any:
        stop, hits = values.get("stop"), values.get("hits")
        if isinstance(stop, dict) and isinstance(hits, dict) and "max_count" in stop:
            return values | {"hits": {"count": stop["max_count"]} | hits}
        return values

    @model_validator(mode="after")
    def _agrees(self) -> Self:
        """Check what two tables must agree on."""
        if not self.allow_implausible:  # first, as a slip of units breaks other rules, too
            try:
                check_plausible(self.core, self.target, self.output, self.impact, self.hits)
            except ValueError as error:
                raise ValueError(f"{error}; allow_implausible = true has it computed as it is") from None
        if self.stop is not None:
            object.__setattr__(self, "hits", self._hits_of_a_stop())
        self._check_options()
        if self.stop is not None:
            self._check_stop(self.stop)
        self._check_hits()
        self._check_shots()
        self._check_lengths()
        self.output.check(self.core)
        for doubt in doubted(self.scene, self.impact, self.hits):
            warnings.warn(doubt, Implausible, stacklevel=2)
        return self

    def _hits_of_a_stop(self) -> Hits:
        """Hits in the irreducible part of the cell by default, where an answer costs least (tests/benchmarks)."""
        hits = self.hits
        chosen = "irreducible" in hits.model_fields_set or hits.area != "cell" or hits.file is not None
        if chosen or any(unsymmetric(self.scatter, self.layer).values()):
            return hits  # without symmetry every hit is computed
        return hits.model_copy(update={"irreducible": hits.sampling in ("sobol", "random")})

    def _check_options(self) -> None:
        """Check all options that exclude or need each other (scene/exclusions.py)."""
        stop, hits, numerics = self.stop, self.hits, self.numerics
        exclusions.check_together(
            unsymmetric(self.scatter, self.layer)
            | {
                exclusions.STOP: stop is not None,
                exclusions.UNEVEN: hits.sampling in ("grid", "list") and f'hits.sampling = "{hits.sampling}"',
                exclusions.ONE_SCRAMBLING: hits.sampling == "sobol" and self.replicates == 1,
                exclusions.IRREDUCIBLE: hits.irreducible,
                exclusions.LISTED_STRENGTH: "strength" in (hits.listed or {}),
                exclusions.LAYERS: bool(self.layer),
                exclusions.BENDING: self.output.bending,
                exclusions.STRENGTH: self._has_strength,
                exclusions.NODAL: numerics.scheme == "nodal",
                exclusions.FREE_SURFACE: self.interaction.free_surface is not None,
                exclusions.BLOCK: numerics.layout == "block",
                exclusions.DOUBLE: numerics.precision == "double",
            }
        )

    def _check_stop(self, stop: Stop) -> None:
        if self.hits.count != stop.max_count:
            raise ValueError(
                f"hits.count = {self.hits.count} and stop.max_count = {stop.max_count} cannot be combined: "
                "[stop] sets the number of hits; leave out hits.count"
            )
        if stop.measure.is_limit:
            raise ValueError(
                f'stop.quantity = "{stop.quantity}" is computed by warpimpact limit, which takes no [stop]'
            )
        if keys := self.lacking(stop.measure):
            raise ValueError(f'stop.quantity = "{stop.quantity}" needs {keys}')

    def _check_hits(self) -> None:
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

    def _check_shots(self) -> None:
        ranges = {name: (value, value) for name, value in self.impact}
        for (name, _), distribution in self.scatter.given.items():
            ranges[name] = distribution.ends
        for name, column in (self.hits.listed or {}).items():
            ranges[name] = (float(column.min()), float(column.max()))
            try:
                check_range(name, *ranges[name])
            except ValueError as error:
                raise ValueError(f"got hits.file with a column {name} that {error}") from None
        if ranges == {name: (value, value) for name, value in self.impact}:
            return
        largest = {name: max(map(abs, ends)) for name, ends in ranges.items()}
        for name in ("pitch", "yaw"):  # the axis is built from projected angles, which flip at 90°
            if largest[name] + largest["obliquity"] >= math.pi / 2:
                raise ValueError(
                    f"got shots with {name} up to {math.degrees(largest[name]):.4g} deg and obliquity up to "
                    f"{math.degrees(largest['obliquity']):.4g} deg, but their sum must stay below 90 deg"
                )

    def _check_lengths(self) -> None:
        radius, listed = self.core.max_radius, (self.hits.listed or {}).get("degradation_length", [math.inf])
        for name, plate in self.target.named:
            shortest = min(plate.degradation_length, *listed) if name == "plate" else plate.degradation_length
            if radius > _MOST_LENGTHS * shortest:
                raise ValueError(
                    f"got {name}.degradation_length = {shortest:g} m, but a core of radius {radius:g} "
                    f"m needs at least 1/{_MOST_LENGTHS} of its radius, {radius / _MOST_LENGTHS:.4g} m"
                )


def _override_count(data: dict[str, Any], count: int) -> None:
    """Replace the number of hits of the file; with a stop rule this is the largest number."""
    table, key = ("stop", "max_count") if isinstance(data.get("stop"), dict) else ("hits", "count")
    if isinstance(data.setdefault(table, {}), dict):
        data[table][key] = count
    if table == "stop" and isinstance(data.get("hits"), dict):
        data["hits"].pop("count", None)


def lacking(
    measure: Measure, standoffs: Sequence[float] | None, *, layered: bool, bending: bool, breakable: bool
) -> str:
    """Keys that a campaign needs for a measure of its hits and does not have; empty if it lacks none.

    It may have layers behind the plate, record bending, and have cores with a strength. Its stand-offs [m] are None
    where they are not known yet, but some are computed.
    """
    quantity = measure.quantity
    needed = "" if quantity.need is None else quantity.need.name
    if needed in (BASE.name, DEPTH) and not layered:
        return BASE.keys
    if needed in BROKEN_VARIABLES and not (bending and breakable):
        return f"{STRENGTH.keys} ({CORES_STAYED_WHOLE})"
    if needed in BENDING_VARIABLES and not bending:
        return "output.bending = true"
    if not quantity.has_standoff or standoffs is None:
        return ""
    if not standoffs:
        return "output.standoffs"
    if measure.standoff is None or np.isclose(measure.standoff, standoffs, rtol=1e-9, atol=0.0).any():
        return ""
    return f"{measure.standoff:g} m in output.standoffs, which are {', '.join(f'{at:g} m' for at in standoffs)}"


def with_scatter(data: dict[str, Any], name: str) -> dict[str, Any]:
    """Tables with distributions moved to `scatter`, and with their medians in the place of values."""
    data, scatter = deepcopy(data), dict[str, Any]()
    layers = data.get("layer") if isinstance(data.get("layer"), list) else []
    for field, known in SCATTERED.items():
        behind = [(layer_name(k), table) for k, table in enumerate(layers or [], start=1) if known.by_layer]
        places = [(known.table, data.get(known.table)), *behind]
        drawn = [_taken(table, field, f"{name}: {place}", k) for k, (place, table) in enumerate(places)]
        if any(drawn):
            scatter[field] = drawn if known.by_layer else drawn[0]
    return data | {"scatter": scatter} if scatter else data


def _taken(table: Any, field: str, place: str, layer: int) -> Distribution | None:
    """Take the distribution of a quantity out of a table, which keeps its median."""
    key, at = (field[:-2], "yz".index(field[-1])) if field.startswith("offset") else (field, None)
    value = table.get(key) if isinstance(table, dict) else None
    is_pair = isinstance(value, list) and len(value) == 2
    entry = value if at is None else value[at] if is_pair and value else None
    if not isinstance(entry, dict):
        return None
    known, label = SCATTERED[field], key if at is None else f"{key}[{at}]"
    given = [*[None] * layer, entry] if known.by_layer else entry
    try:
        ((_, distribution),) = Scatter.model_validate({field: given}).given.items()
    except ValidationError as error:
        problem = sentence(error, {field: given}).removeprefix(field).removeprefix(f"[{layer}]")
        raise CampaignError(f"{place}.{label}{problem}") from None
    median = quantity(known.type).as_read(float(distribution.quantile(np.array(0.5))))
    table[key] = median if at is None else [median if k == at else old for k, old in enumerate(value or ())]
    return distribution


def read_plates(path: str | Path, *, count: int | None = None) -> dict[str, Campaign]:
    """Read a campaign file with several tables `[[plate]]`, each with a `name`; everything else is shared.

    Tables `[[plate.layer]]` stand behind one of the plates, before what tables `[[layer]]` put behind every plate.

    Args:
        path: the TOML file.
        count: number of hits, instead of the file's.

    Returns:
        Name of each plate → its campaign, in the order of the file.

    Raises:
        CampaignError: the file is missing, is not TOML, has only one plate, or contains an invalid value.
    """
    path = Path(path)
    shared = parsed(read_text(path), str(path), CAMPAIGN)
    plates, behind = shared.pop("plate", None), _layers(shared.pop("layer", []), f"{path}: layer")
    if not isinstance(plates, list) or len(plates) < 2:
        raise CampaignError(f"{path}: plate: a comparison needs two or more tables [[plate]], each with a name")
    if isinstance(hits := shared.get("hits"), dict):
        shared["hits"] = {"irreducible": False} | hits  # the same hits for plates of different symmetry
    campaigns: dict[str, Campaign] = {}
    for number, plate in enumerate(plates):
        place = f"{path}: plate[{number}]"
        if not isinstance(plate, dict) or "name" not in plate:
            raise CampaignError(f"{place}.name: is missing, but must be given")
        name = plate["name"]
        if not isinstance(name, str) or not _PLATE_NAME.fullmatch(name):
            raise CampaignError(
                f"{place}.name: got {quoted(name)}, but a name begins with a letter or a digit and contains only "
                "letters, digits, blanks and the characters _ . + -, 80 at most"
            )
        if name in campaigns:
            raise CampaignError(f'{place}.name: got "{name}" again, but each plate needs its own name')
        layers = _layers(plate.get("layer", []), f"{place}.layer") + behind
        own: dict[str, Any] = {"plate": {key: value for key, value in plate.items() if key not in ("name", "layer")}}
        own |= {"layer": layers} if layers else {}
        own |= {"title": f"{shared['title']}: {name}"} if isinstance(shared.get("title"), str) else {}
        text = json.dumps(shared | own, indent=1, ensure_ascii=False, default=str)
        campaigns[name] = Campaign.from_text(text, name=f'{path}, plate "{name}"', folder=path.parent, count=count)
    return campaigns


def _layers(tables: Any, place: str) -> list[Any]:
    if not isinstance(tables, list):
        raise CampaignError(f"{place}: got {quoted(tables)}, but it must be a list: tables [[layer]]")
    return tables
