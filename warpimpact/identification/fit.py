"""A fit file: measured shots, their scenes, and priors of the unknown numbers.

A parameter is an unknown number at a dotted place of the scene, such as "plate.pattern.spacing.0". Priors are in SI and
radians. A mistake in the file becomes one sentence, a doubt a warning.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple, get_args

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Field, TypeAdapter, ValidationError
from scipy.special import ndtr

from warpimpact.campaign.names import catalogue_of, with_core, with_materials
from warpimpact.campaign.places import put
from warpimpact.campaign.plausible import check_plausible
from warpimpact.campaign.resistance import resistance_under
from warpimpact.campaign.text import CampaignError, parsed, read_text
from warpimpact.catalogue.catalogue import Catalogue
from warpimpact.catalogue.entries import Material
from warpimpact.records.outcomes import Outcomes
from warpimpact.results import variables as v
from warpimpact.results.kinds import FIT
from warpimpact.results.measures import STATUSES
from warpimpact.scene import AnyCore, Impact, Interaction, Numerics, Plate, Record, Scatter, Scene, Target
from warpimpact.scene.model import Array, Model, complaint, sentence
from warpimpact.scene.quantities import OF_THE_SCENE, QUANTITIES
from warpimpact.scene.scatter import EDGE, AnyDistribution, Distribution, check_range, in_si
from warpimpact.scene.units import (
    Angle,
    Length,
    PositiveSpeed,
    Speed,
    Title,
    Whole,
    meant,
    quantity,
    quoted,
    reader_in,
    typed,
)
from warpimpact.solver.limit import check_arrests
from warpimpact.solver.materials import decay_rate

_Table = dict[str, Any]
COLUMN_OF = {f"{QUANTITIES[name].table}.{name}": name for name in OF_THE_SCENE}
"""Name of the column of Shots by the place of its quantity."""
UNITS_OF_EXPOSURE = ("plate.degradation_interval", "plate.degradation_distance")
"""β per Δt_β is the same law as β^(Δt₀/Δt_β) per Δt₀, so these become a degradation of the shot."""
TABLES: dict[str, Any] = {"plate": Plate, "interaction": Interaction, "core": AnyCore}
"""Tables of the scene whose numbers may be parameters."""
_DISTRIBUTION: TypeAdapter[Distribution] = TypeAdapter(AnyDistribution)
MIRRORS = {str(one): one.mirror for one in (v.RESIDUAL_VELOCITY, v.DEFLECTION, v.TILT, v.PITCH, v.YAW, v.TOTAL_YAW)}
"""Factor of a symmetry that a mirror image applies to a measured number; None if it does not change."""


class FitError(CampaignError):
    """A fit that cannot be computed: one sentence naming file, field, value and what is allowed."""


@dataclass(frozen=True)
class Parameter:
    """An unknown number of the scene, or the scale of a discrepancy.

    Attributes:
        place: dotted place, such as "plate.pattern.spacing.0" or "discrepancy.velocity".
        name: short name, such as "spacing_y".
        unit: SI unit; "rad" for an angle, "" for a pure number.
        prior: distribution in SI and radians.
    """

    place: str
    name: str
    unit: str
    prior: Distribution

    def at(self, normal: Array) -> Array:
        """Values at standard normal numbers, of their shape. If these are normal, the values follow the prior."""
        return self.prior.quantile(np.clip(ndtr(normal), EDGE, 1.0 - EDGE))

    @property
    def ends(self) -> tuple[float, float]:
        """Smallest and largest value that can be drawn."""
        low, high = self.prior.quantile(np.array([EDGE, 1.0 - EDGE]))
        return float(low), float(high)

    @property
    def median(self) -> float:
        return float(self.prior.quantile(np.array(0.5)))

    @property
    def is_of_scene(self) -> bool:
        """Whether it is a number of the scene, and no discrepancy."""
        return not self.place.startswith("discrepancy.")

    @property
    def is_column(self) -> bool:
        """Whether its values may differ from shot to shot of one computation."""
        return self.place in COLUMN_OF or self.place in UNITS_OF_EXPOSURE or not self.is_of_scene

    def as_read(self, value: float) -> Any:
        """A value in SI as tables hold it."""
        return f"{value!r} rad" if self.unit == "rad" else value


class Observation(NamedTuple):
    """One measured number.

    Attributes:
        name: name of the variable in the Dataset; "limit_velocity" is a property of plate and core.
        standoff: index of the stand-off in the record; None if the variable has none.
        value, std: the number and its standard uncertainty, SI and radians.
    """

    name: str
    standoff: int | None
    value: float
    std: float

    @property
    def kind(self) -> str:
        """Kind of its discrepancy."""
        return "velocity" if self.name.endswith("velocity") else "angle"

    @property
    def is_limit(self) -> bool:
        """Whether it is a limit velocity, the median over the hits."""
        return self.name == "limit_velocity"

    def of(self, outcomes: Outcomes) -> Array:
        """The computed number of every shot, shape [shots]; NaN where there is none."""
        column: Array = getattr(outcomes, self.name)
        return column if self.standoff is None else column[:, self.standoff]

    def miss(self, computed: Array) -> Array:
        """Computed minus measured, of the same shape; for an angle, the shorter way round."""
        missed = computed - self.value
        return np.remainder(missed + np.pi, 2.0 * np.pi) - np.pi if self.kind == "angle" else missed


def read_distribution(read: Any, given: Mapping[str, Any], place: str) -> Distribution:
    """A distribution of a quantity, in SI.

    Raises:
        FitError: the message names the place.
    """
    try:
        return _DISTRIBUTION.validate_python(in_si(read, given))
    except ValidationError as error:
        problem = error.errors(include_url=False)[0]
        where = ".".join(str(part) for part in problem["loc"] if part != given.get("distribution"))
        words = complaint(problem)
        words = f"got {quoted(dict(given))}, but: {words}" if problem["type"] == "value_error" else words
        raise FitError(f"{place}{'.' if where else ''}{where}: {words}") from None
    except ValueError as error:
        raise FitError(f"{place}.{error}") from None


def _is_distribution(value: Any) -> bool:
    return isinstance(value, Mapping) and "distribution" in value


# --- The tables of a fit file ---


def _coordinate(given: Any) -> float | Distribution:
    read = quantity(Length)
    return read_distribution(read, given, "") if _is_distribution(given) else float(read(given))


class HitPlace(Model):
    """A measured hit point: each coordinate is a length or a distribution."""

    y: Annotated[Any, BeforeValidator(_coordinate)]
    z: Annotated[Any, BeforeValidator(_coordinate)]

    @property
    def is_exact(self) -> bool:
        """Whether both coordinates are numbers."""
        return isinstance(self.y, float) and isinstance(self.z, float)

    def at(self, share_y: Array, share_z: Array) -> tuple[Array, Array]:
        """Points at uniform numbers."""
        y, z = (
            np.full_like(share, value) if isinstance(value, float) else value.quantile(np.clip(share, EDGE, 1.0 - EDGE))
            for value, share in ((self.y, share_y), (self.z, share_z))
        )
        return y, z


class MeasuredSpeed(Model):
    """A speed and its standard uncertainty."""

    value: Speed
    std: PositiveSpeed


def _by_standoff(given: Any) -> Any:
    values = given if isinstance(given, list) else [given]
    return [None if isinstance(value, float) and math.isnan(value) else value for value in values]


class MeasuredAngles(Model):
    """Angles and their standard uncertainties, one for each stand-off; nan for one that was not measured.

    A single number is a list of one.
    """

    value: Annotated[tuple[Angle | None, ...], BeforeValidator(_by_standoff)]
    std: Annotated[tuple[Annotated[Angle, Field(gt=0)] | None, ...], BeforeValidator(_by_standoff)]


def _known_status(status: str) -> str:
    if status not in STATUSES:
        raise ValueError(f"got {quoted(status)}, but it must be one of {', '.join(STATUSES)}")
    return status


class Measured(Model):
    """What was measured of a shot.

    Attributes:
        residual_velocity, limit_velocity, deflection: a number and its uncertainty, { value, std }.
        tilt, pitch, yaw, total_yaw: the same with a list for the stand-offs.
        status: how the core ended, such as "perforated" or "arrested".
    """

    residual_velocity: MeasuredSpeed | None = None
    limit_velocity: MeasuredSpeed | None = None
    deflection: MeasuredAngles | None = None
    tilt: MeasuredAngles | None = None
    pitch: MeasuredAngles | None = None
    yaw: MeasuredAngles | None = None
    total_yaw: MeasuredAngles | None = None
    status: Annotated[str, AfterValidator(_known_status)] | None = None


class _WithScene(Model):
    """Tables of a scene, which are read when their priors are known."""

    core: _Table = Field(default_factory=dict)
    plate: _Table = Field(default_factory=dict)
    interaction: _Table = Field(default_factory=dict)

    @property
    def tables(self) -> dict[str, _Table]:
        return {"core": self.core, "plate": self.plate, "interaction": self.interaction}


class ShotTable(_WithScene):
    """A measured shot; its own values of the scene override those of the fit."""

    name: Title = ""
    hit: Annotated[
        HitPlace | None,
        BeforeValidator(
            lambda given: None if given == "unknown" else given,
            json_schema_input_type=HitPlace | Literal["unknown"],
        ),
    ] = None
    impact: _Table = Field(default_factory=dict)
    measured: Measured


class DiscrepancyTable(Model):
    """Scales of what the model itself misses, each a number or a prior; by default half of a normal distribution."""

    velocity: Any = Field(
        {"distribution": "truncated_normal", "mean": "0 m/s", "std": "10 m/s", "low": "0 m/s", "high": "50 m/s"}
    )
    angle: Any = Field(
        {"distribution": "truncated_normal", "mean": "0 deg", "std": "5 deg", "low": "0 deg", "high": "25 deg"}
    )


class Sampling(Model):
    """How much is computed.

    Attributes:
        sets: most sets of parameters.
        hits: hit points per set over the part of the cell that differs.
        draws: draws of the posterior in the file.
        effective: effective sample size of every parameter at which the sampling ends.
        seed: seed of all random numbers.
    """

    sets: Annotated[Whole, Field(ge=64, le=2**24)] = 16384
    hits: Annotated[Whole, Field(ge=32, le=2**16, multiple_of=8)] = 256
    draws: Annotated[Whole, Field(ge=50, le=2**16)] = 1000
    effective: Annotated[Whole, Field(ge=10, le=2**16)] = 400
    seed: Annotated[Whole, Field(ge=0, le=2**63 - 1)] = 0


def _at_a_level(numerics: Any) -> Any:
    """Numerics of level 0 by default. They may not ask for an accuracy."""
    if not isinstance(numerics, dict):
        return numerics
    if named := next((key for key in ("fidelity", "accuracy") if key in numerics), None):
        raise ValueError(f"got {named}, but a fit has no pilot; give level = 0 to 9, or single settings")
    return {"level": 0} | numerics


class FitFile(_WithScene):
    """A fit file."""

    title: Title = ""
    record: Record = Record()
    numerics: Annotated[Numerics, BeforeValidator(_at_a_level)] = Numerics(level=0)
    prior: Annotated[_Table, Field(min_length=1)]
    discrepancy: DiscrepancyTable = DiscrepancyTable()
    sampling: Sampling = Sampling()
    shot: Annotated[tuple[ShotTable, ...], Field(min_length=1, max_length=256)]
    catalogue: Any = None


# --- The fit ---


@dataclass(frozen=True)
class MeasuredShot:
    """A fired shot and its measurements.

    Attributes:
        hit: place of its hit; None if unknown.
        impact, scatter: how the core arrived, and the uncertainty of that.
        tables: tables of its scene, with the medians of the priors.
        own: places of the values that the shot itself gives, for which no prior counts.
        observations: measured numbers.
        status: how it ended; None if not reported.
    """

    name: str
    hit: HitPlace | None
    impact: Impact
    scatter: Scatter
    tables: dict[str, Any]
    own: frozenset[str]
    observations: tuple[Observation, ...]
    status: str | None


@dataclass(frozen=True)
class Fit:
    """Measured shots, and what is unknown.

    Attributes:
        file: tables of the file; `text` is its text, and names in it count from `folder`.
        parameters: unknown numbers of the scene, and the scales of discrepancy that the observations need. Those that
            need a scene of their own come first.
        discrepancy: fixed standard deviations of the model's error, by kind of observation.
    """

    file: FitFile
    text: str
    folder: Path
    parameters: tuple[Parameter, ...]
    discrepancy: Mapping[str, float]
    shots: tuple[MeasuredShot, ...]

    @property
    def scene_parameters(self) -> tuple[Parameter, ...]:
        return tuple(parameter for parameter in self.parameters if parameter.is_of_scene)

    def largest_discrepancy(self, kind: str) -> float:
        """The discrepancy of a kind that its prior exceeds in 1 of 100 draws."""
        priors = (parameter.prior for parameter in self.parameters if parameter.place == f"discrepancy.{kind}")
        return max((float(prior.quantile(np.array(0.99))) for prior in priors), default=self.discrepancy.get(kind, 0.0))

    def scene_of(self, shot: MeasuredShot, values: Mapping[str, float] | None = None) -> Scene:
        """The scene of a shot at these values of the parameters, by place, at the medians of the others.

        Raises:
            ValidationError: such a scene is not possible.
        """
        tables, values = deepcopy(dict(shot.tables)), values or {}
        for unknown in self.scene_parameters:
            if unknown.place in values and unknown.place not in shot.own:
                put(tables, unknown.place, unknown.as_read(float(values[unknown.place])), "fit")
        context = {"folder": self.folder}
        target = Target(layers=(Plate.model_validate(tables["plate"], context=context),))
        interaction = Interaction.model_validate(tables.get("interaction", {}), context=context)
        parts = {"core": tables["core"], "target": target, "interaction": interaction, "record": self.file.record}
        return Scene.model_validate(parts, context=context)

    @property
    def warning(self) -> str:
        """A sentence if the data say less than they seem to; else empty."""
        numbers = sum(len(shot.observations) + (shot.status is not None) for shot in self.shots)
        unknown = len(self.scene_parameters)
        if numbers >= unknown:
            return ""
        return (
            f"got {numbers} measured number{'s' if numbers > 1 else ''} against {unknown} parameters: the posterior "
            "keeps its prior in most directions"
        )


def read_fit(path: str | Path) -> Fit:
    """Read a fit file; file names in it count from its folder.

    Raises:
        FitError: the file has a value that is not allowed.
        CampaignError: the file is missing, or is not TOML.
    """
    path = Path(path)
    return fit_from(read_text(path), str(path), path.parent)


def fit_from(text: str, name: str, folder: Path) -> Fit:
    """Read a fit from its text; `name` is the name of the file in errors."""
    data = parsed(text, name, FIT)
    catalogue = catalogue_of(data, name, folder)
    data = with_core(data, catalogue, name)
    if isinstance(shots := data.get("shot"), list):
        data["shot"] = [
            with_core(shot, catalogue, f"{name}: shot[{k}]") if isinstance(shot, dict) else shot
            for k, shot in enumerate(shots)
        ]
    file: FitFile = _validated(FitFile, data, name)
    tables = deepcopy(file.tables)
    parameters = [*_read_priors(file.prior, "", tables, name)]
    names = [_short_name(parameter.place) for parameter in parameters]
    parameters = [
        replace(parameter, name=short if names.count(short) == 1 else parameter.place.replace(".", "_"))
        for short, parameter in zip(names, parameters, strict=True)
    ]
    given = [
        _shot(shot, [*data["shot"][k]["measured"]], tables, file.record, f"{name}: shot[{k}]", parameters, catalogue)
        for k, shot in enumerate(file.shot)
    ]
    shots = tuple(shot for shot, _ in given)
    scales, fixed = _discrepancy(file.discrepancy, {one.kind for shot in shots for one in shot.observations}, name)
    ordered = sorted((*parameters, *scales), key=lambda parameter: parameter.is_column)
    fit = Fit(file, text, folder, tuple(ordered), fixed, shots)
    for k, (shot, material) in enumerate(given):
        _check_scene(fit, shot, material, catalogue, f"{name}: shot[{k}]")
    return fit


def _validated(kind: Any, data: Any, place: str) -> Any:
    try:
        return kind.model_validate(data)
    except ValidationError as error:
        raise FitError(f"{place}: {sentence(error, data)}") from None


def _read_priors(node: Any, place: str, tables: _Table, name: str) -> Iterator[Parameter]:
    """The parameters of a part of the table [prior]; their medians, and known entries of lists, go into the tables."""
    if place and _is_distribution(node):
        where, (table, _, key) = f"{name}: prior.{place}", place.partition(".")
        read = _reader(place, tables, where)
        parameter = Parameter(place, "", read.unit, read_distribution(read, node, where))
        if key in QUANTITIES and QUANTITIES[key].table == table:
            try:
                check_range(key, *parameter.ends)
            except ValueError as error:
                raise FitError(f"{where}: {error}; bound it, as uniform and truncated_normal do") from None
        put(tables, place, parameter.as_read(parameter.median), name)
        yield parameter
    elif isinstance(node, Mapping):
        for key, inner in node.items():
            yield from _read_priors(inner, f"{place}.{key}".strip("."), tables, name)
    elif isinstance(node, list) and any(map(_is_distribution, node)):
        put(tables, place, [*node], name)
        for index, inner in enumerate(node):
            if _is_distribution(inner):
                yield from _read_priors(inner, f"{place}.{index}", tables, name)
    else:
        raise FitError(
            f"{name}: prior.{place}: got {quoted(node)}, but a prior is a distribution such as "
            '{ distribution = "uniform", low = 1, high = 2 }; a known value belongs in the table of the scene'
        )


def _short_name(place: str) -> str:
    *_, before, last = place.split(".")
    if not last.isdecimal():
        return last
    return f"{before}_{'yz'[int(last)] if before in ('spacing', 'size') and last in '01' else last}"


def _reader(place: str, tables: _Table, where: str) -> Any:
    """The reader of the quantity at a place of the scene."""
    table, *path = place.split(".")
    if table not in TABLES:
        raise FitError(f'{where}: got the table "{table}", but a prior belongs in one of {", ".join(TABLES)}')
    annotation, node, reader = TABLES[table], tables.get(table, {}), None
    for part in path:
        if part.isdecimal():  # an entry of a list
            reader = next(_readers(annotation), None)
            break
        models, shape = [*_models(annotation)], node.get("shape", "none") if isinstance(node, Mapping) else "none"
        named = [model for model in models if getattr(model.model_fields.get("shape"), "default", None) == shape]
        fields = next((model.model_fields for model in named or models), {})
        if part not in fields:
            raise FitError(f'{where}: got the unknown key "{part}"; {meant(part, fields)}')
        annotation, node = typed(fields[part]), node.get(part, {}) if isinstance(node, Mapping) else {}
        reader = reader_in(annotation)
    if reader is None:
        raise FitError(f"{where}: is no number, but only a number can have a prior")
    return reader


def _readers(annotation: Any) -> Iterator[Any]:
    if (reader := reader_in(annotation)) is not None:
        yield reader
    for inner in get_args(annotation):
        yield from _readers(inner)


def _models(annotation: Any) -> Iterator[type[Model]]:
    if isinstance(annotation, type) and issubclass(annotation, Model):
        yield annotation
    for inner in get_args(annotation):
        yield from _models(inner)


def _shot(
    given: ShotTable,
    measured: Sequence[str],
    tables: _Table,
    record: Record,
    place: str,
    parameters: Sequence[Parameter],
    catalogue: Catalogue,
) -> tuple[MeasuredShot, Material | None]:
    """A shot, and the material that gives its Y; `measured` are the names of its measured numbers in their order."""
    impact = dict(given.impact)
    scattered = {key: value for key, value in impact.items() if isinstance(value, dict)}
    for key, value in scattered.items():
        if key not in QUANTITIES or QUANTITIES[key].table != "impact":
            raise FitError(f"{place}.impact.{key}: got {quoted(value)}, but no such quantity of an impact scatters")
        read = quantity(QUANTITIES[key].type)
        median = float(read_distribution(read, value, f"{place}.impact.{key}").quantile(np.array(0.5)))
        impact[key] = read.as_read(median)
    observations = [one for name in measured for one in _observations(given.measured, name, record.standoffs, place)]
    status = given.measured.status
    if status in ("arrested", "ricocheted") and observations:
        raise FitError(
            f'{place}.measured.status: "{status}" and {observations[0].name} cannot be combined: only a core that '
            "passed the plate has that number"
        )
    limits = [observation.value for observation in observations if observation.is_limit]
    if limits:  # the search of limits begins at these values
        impact.setdefault("velocity", limits[0])
    # The known values of the plate's material; a prior overrides them.
    resolved, materials = with_materials(_merged(tables, given.tables), catalogue, place)
    shot = MeasuredShot(
        name=given.name or place.partition(": ")[2],
        hit=given.hit,
        impact=_validated(Impact, impact, f"{place}.impact"),
        scatter=_validated(Scatter, scattered, f"{place}.impact"),
        tables={name: resolved[name] for name in given.tables},
        own=frozenset(parameter.place for parameter in parameters if _has(given.tables, parameter.place)),
        observations=tuple(observations),
        status=status,
    )
    return shot, materials.get(0)


def _observations(measured: Measured, name: str, standoffs: Sequence[float], place: str) -> Iterator[Observation]:
    """The measured numbers of a name."""
    given = getattr(measured, name)
    if isinstance(given, MeasuredSpeed):
        yield Observation(name, None, float(given.value), float(given.std))
    elif isinstance(given, MeasuredAngles):
        places = [None] if name == "deflection" else [*range(len(standoffs))]
        stds = given.std * len(given.value) if len(given.std) == 1 else given.std
        if not len(given.value) == len(stds) == len(places):
            raise FitError(
                f"{place}.measured.{name}: got {len(given.value)} values and {len(stds)} std at {len(places)} "
                "stand-offs, but each stand-off of [record] takes one; nan stands for one that was not measured"
            )
        for index, value, std in zip(places, given.value, stds, strict=True):
            if value is not None and std is not None:
                yield Observation(name, index, float(value), float(std))


def _merged(tables: Any, of_shot: Any) -> Any:
    """Tables of the fit, overridden by a shot's own values. A table with another shape replaces the fit's table."""
    is_table = isinstance(tables, Mapping) and isinstance(of_shot, Mapping)
    if not is_table or of_shot.get("shape", tables.get("shape")) != tables.get("shape"):
        return of_shot
    return {**tables, **{key: _merged(tables.get(key), value) for key, value in of_shot.items()}}


def _has(tables: Any, place: str) -> bool:
    """Whether nested tables have a value at a place."""
    for part in place.split("."):
        if part.isdecimal():
            return isinstance(tables, list)
        if not isinstance(tables, Mapping) or part not in tables:
            return False
        tables = tables[part]
    return True


def _discrepancy(given: DiscrepancyTable, kinds: set[str], name: str) -> tuple[list[Parameter], dict[str, float]]:
    """Scales of discrepancy: the unknown ones as parameters, and the fixed ones by kind."""
    scales, fixed = list[Parameter](), dict[str, float]()
    for kind, value in given:
        read, place = quantity(Speed if kind == "velocity" else Angle), f"{name}: discrepancy.{kind}"
        if isinstance(value, dict):
            prior = read_distribution(read, value, place)
            least = float(prior.quantile(np.array(EDGE)))
            if kind in kinds:
                scales.append(Parameter(f"discrepancy.{kind}", f"discrepancy_{kind}", read.unit, prior))
        else:
            try:
                least = fixed[kind] = float(read(value))
            except ValueError as error:
                raise FitError(f"{place}: {error}") from None
        if least < 0.0:
            raise FitError(f"{place}: got {quoted(value)}, but a scale is at least 0")
    return scales, fixed


def _check_scene(fit: Fit, shot: MeasuredShot, material: Material | None, catalogue: Catalogue, where: str) -> None:
    """Refuse a scene that is not possible at the medians of the priors, or stops no core if a limit is measured. A
    material gives its Y there."""
    try:
        scene = fit.scene_of(shot)
        if material is not None:
            of_plate = scene.interaction, material, scene.core, scene.target.layers[0], shot.impact.obliquity
            shot.tables["plate"]["resistance"] = resistance_under(*of_plate, catalogue).median
        check_plausible(scene.core, scene.target, scene.record, shot.impact)
        if any(observation.is_limit for observation in shot.observations):
            weakest = [parameter for parameter in fit.scene_parameters if "degradation" in parameter.place]
            check_arrests(fit.scene_of(shot, {parameter.place: parameter.ends[0] for parameter in weakest}))
    except ValueError as error:
        reason = sentence(error, dict(shot.tables)) if isinstance(error, ValidationError) else error
        raise FitError(f"{where}: {reason}") from None


def columns_of(values: Mapping[str, Array], plate: Plate) -> dict[str, Array]:
    """Columns of Shots for some values, each of their shape.

    Args:
        values: values by place. Places that make no column are left out.
        plate: plate of the scene. Its degradation and unit of exposure hold where no value replaces them.
    """
    columns = {name: values[place] for place, name in COLUMN_OF.items() if place in values}
    for place in UNITS_OF_EXPOSURE:
        if place in values:
            base = columns.get("degradation", np.full_like(values[place], plate.degradation))
            columns["degradation"] = np.exp(decay_rate(base, 1.0) * plate.degradation_unit / values[place])
    return columns
