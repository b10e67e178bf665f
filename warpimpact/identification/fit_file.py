"""The tables of a fit file: measured shots, what the model itself misses, and how much is computed.

Tables of the scene stay as they are read, until the priors of their unknown numbers are known (fit.py).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Field, TypeAdapter, ValidationError

from warpimpact.measures.measure import STATUSES
from warpimpact.records.outcomes import Outcomes
from warpimpact.scene import Record, units
from warpimpact.scene.model import Array, Model, sentence
from warpimpact.scene.scatter import EDGE, AnyDistribution, Distribution, in_si
from warpimpact.solver.fast_law import FastLaw

Table = dict[str, Any]
_DISTRIBUTION: TypeAdapter[Distribution] = TypeAdapter(AnyDistribution)


def is_distribution(value: Any) -> bool:
    return isinstance(value, Mapping) and "distribution" in value


def distribution_in(read: Any, given: Mapping[str, Any]) -> Distribution:
    """A distribution of a quantity, in SI.

    Raises:
        ValueError: the message names the parameter of the distribution.
    """
    try:
        return _DISTRIBUTION.validate_python(in_si(read, given))
    except ValidationError as error:
        raise ValueError(sentence(error, dict(given))) from None


def _or_distribution(kind: Any) -> BeforeValidator:
    """The reader of a quantity, or of its distribution."""
    read = units.quantity(kind)
    return BeforeValidator(lambda given: distribution_in(read, given) if is_distribution(given) else read(given))


class HitPlace(Model):
    """A measured hit point: each coordinate is a length or a distribution."""

    y: Annotated[Any, _or_distribution(units.Length)]
    z: Annotated[Any, _or_distribution(units.Length)]

    def at(self, share_y: Array, share_z: Array) -> tuple[Array, Array]:
        """Points at uniform numbers."""
        y, z = (
            np.full_like(share, value) if isinstance(value, float) else value.quantile(np.clip(share, EDGE, 1.0 - EDGE))
            for value, share in ((self.y, share_y), (self.z, share_z))
        )
        return y, z


def _listed(given: Any) -> Any:
    """A list of numbers, None for nan; a single number is a list of one."""
    values = given if isinstance(given, list) else [given]
    return [None if isinstance(value, float) and math.isnan(value) else value for value in values]


class MeasuredSpeed(Model):
    """A speed and its standard uncertainty."""

    value: units.Speed
    std: units.PositiveSpeed


class MeasuredAngles(Model):
    """Angles and their standard uncertainties, one for each stand-off; nan for one that was not measured."""

    value: Annotated[tuple[units.Angle | None, ...], BeforeValidator(_listed)]
    std: Annotated[tuple[units.PositiveAngle | None, ...], BeforeValidator(_listed)]


def _known_status(status: str) -> str:
    if status not in STATUSES:
        raise ValueError(f"got {units.quoted(status)}, but it must be one of {', '.join(STATUSES)}")
    return status


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


class Measurements(Model):
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

    def observations(self, name: str, standoffs: int) -> Iterator[Observation]:
        """The measured numbers of a name, with so many stand-offs.

        Raises:
            ValueError: it has another number of values.
        """
        given = getattr(self, name)
        if not isinstance(given, MeasuredSpeed | MeasuredAngles):
            return
        places = [*range(standoffs)] if name in ("tilt", "pitch", "yaw", "total_yaw") else [None]
        values, stds = (one if isinstance(one, tuple) else (one,) for one in (given.value, given.std))
        stds = stds * len(values) if len(stds) == 1 else stds
        if not len(values) == len(stds) == len(places):
            raise ValueError(
                f"{name}: got values: {len(values)}, std: {len(stds)}, stand-offs: {len(places)}, but each "
                "stand-off of [record] takes one; nan stands for one that was not measured"
            )
        for index, value, std in zip(places, values, stds, strict=True):
            if value is not None and std is not None:
                yield Observation(name, index, float(value), float(std))


class _WithScene(Model):
    """Tables of a scene, which are read when their priors are known."""

    core: Table = Field(default_factory=dict)
    plate: Table = Field(default_factory=dict)
    interaction: Table = Field(default_factory=dict)

    @property
    def tables(self) -> dict[str, Table]:
        return {"core": self.core, "plate": self.plate, "interaction": self.interaction}


class ShotTable(_WithScene):
    """A measured shot; its own values of the scene override those of the fit."""

    name: units.Title = ""
    hit: Annotated[
        HitPlace | None,
        BeforeValidator(
            lambda given: None if given == "unknown" else given,
            json_schema_input_type=HitPlace | Literal["unknown"],
        ),
    ] = None
    impact: Table = Field(default_factory=dict)
    measured: Measurements


class DiscrepancyTable(Model):
    """Scales of what the model itself misses, each a number or a prior; by default half of a normal distribution."""

    velocity: Annotated[Any, _or_distribution(units.Speed)] = Field(
        {"distribution": "truncated_normal", "mean": "0 m/s", "std": "10 m/s", "low": "0 m/s", "high": "50 m/s"},
        validate_default=True,
    )
    angle: Annotated[Any, _or_distribution(units.Angle)] = Field(
        {"distribution": "truncated_normal", "mean": "0 deg", "std": "5 deg", "low": "0 deg", "high": "25 deg"},
        validate_default=True,
    )


class Sampling(Model):
    """How much is computed.

    Attributes:
        sets: most sets of parameters; the first look at the chains needs at least 19 for each walker.
        hits: hit points per set over the part of the cell that differs.
        draws: draws of the posterior in the file.
        effective: effective sample size of every parameter at which the sampling ends.
        seed: seed of all random numbers.
    """

    sets: Annotated[units.Whole, Field(ge=64, le=2**24)] = 16384
    hits: Annotated[units.Whole, Field(ge=32, le=2**16, multiple_of=8)] = 256
    draws: Annotated[units.Whole, Field(ge=50, le=2**16)] = 1000
    effective: Annotated[units.Whole, Field(ge=10, le=2**16)] = 400
    seed: Annotated[units.Whole, Field(ge=0, le=2**63 - 1)] = 0


class FitFile(_WithScene):
    """A fit file. It has no pilot, so its numerics have a level, 0 by default."""

    title: units.Title = ""
    record: Record = Record()
    numerics: Annotated[
        FastLaw, BeforeValidator(lambda given: {"level": 0} | given if isinstance(given, dict) else given)
    ] = FastLaw(level=0)
    prior: Annotated[Table, Field(min_length=1)]
    discrepancy: DiscrepancyTable = DiscrepancyTable()
    sampling: Sampling = Sampling()
    shot: Annotated[tuple[ShotTable, ...], Field(max_length=256)]
    catalogue: Any = None
