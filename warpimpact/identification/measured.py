"""What was measured of a shot: where it hit, numbers in the names of the Dataset, and how it ended."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from warpimpact.identification.parameters import FitError, is_distribution, read_distribution
from warpimpact.records.outcomes import Outcomes
from warpimpact.results import variables as v
from warpimpact.results.measures import STATUSES
from warpimpact.scene.distributions import EDGE, Distribution
from warpimpact.scene.model import Array
from warpimpact.scene.units import Angle, Length, Speed, meant, quantity, quoted

KINDS = {"m s-1": ("velocity", Speed), "degree": ("angle", Angle)}
"""Kind of discrepancy and type of a number, by the units of its variable."""
LIMIT_VELOCITY = v.Variable("limit_velocity", ("hit",), "m s-1", "impact velocity at which the core just perforates")
"""A property of plate and core, not of one shot. The median over the hits is compared."""
MEASURABLE = {
    str(variable): variable
    for variable in (v.RESIDUAL_VELOCITY, v.DEFLECTION, v.TILT, v.PITCH, v.YAW, v.TOTAL_YAW, LIMIT_VELOCITY)
}


@dataclass(frozen=True)
class Observation:
    """One measured number.

    Attributes:
        name: name of the variable in the Dataset.
        standoff: index of the stand-off in the record; None if the variable has none.
        at: the stand-off [m].
        value, std: the number and its standard uncertainty, SI and radians.
    """

    name: str
    standoff: int | None
    at: float | None
    value: float
    std: float

    @property
    def kind(self) -> str:
        """Kind of its discrepancy."""
        return KINDS[MEASURABLE[self.name].units][0]

    @property
    def label(self) -> str:
        """Name with its stand-off, such as "yaw@50mm"."""
        return self.name if self.at is None else f"{self.name}@{self.at * 1e3:.10g}mm"

    @property
    def is_limit(self) -> bool:
        """Whether it is a limit velocity."""
        return self.name == LIMIT_VELOCITY

    def of(self, outcomes: Outcomes) -> Array:
        """The computed number of every shot, shape [shots]; NaN where there is none."""
        column: Array = getattr(outcomes, self.name)
        return column if self.standoff is None else column[:, self.standoff]

    def miss(self, computed: Array) -> Array:
        """Computed minus measured, of the same shape; for an angle, the shorter way round."""
        missed = computed - self.value
        return np.remainder(missed + np.pi, 2.0 * np.pi) - np.pi if self.kind == "angle" else missed


@dataclass(frozen=True)
class HitPlace:
    """A measured hit point: each coordinate is a number [m] or a distribution."""

    y: float | Distribution
    z: float | Distribution

    @property
    def is_exact(self) -> bool:
        """Whether both coordinates are numbers."""
        return isinstance(self.y, float) and isinstance(self.z, float)

    def at(self, share_y: Array, share_z: Array) -> tuple[Array, Array]:
        """Points at uniform numbers."""

        def along(value: float | Distribution, share: Array) -> Array:
            if isinstance(value, float):
                return np.full_like(share, value)
            return value.quantile(np.clip(share, EDGE, 1.0 - EDGE))

        return along(self.y, share_y), along(self.z, share_z)


def read_hit(given: Any) -> HitPlace | None:
    """Read the place of a hit; None if it is unknown.

    Raises:
        ValueError: the message says what is allowed.
    """
    if given in (None, "unknown"):
        return None
    if not isinstance(given, dict) or set(given) != {"y", "z"}:
        raise ValueError(f'got {quoted(given)}, but it must be "unknown", or a table with y and z')
    return HitPlace(**{axis: _coordinate(value, axis) for axis, value in given.items()})


def _coordinate(value: Any, axis: str) -> float | Distribution:
    read = quantity(Length)
    if is_distribution(value):
        return read_distribution(read, value, axis)
    try:
        return float(read(value))
    except ValueError as error:
        raise ValueError(f"{axis}: {error}") from None


def read_measured(given: Any, standoffs: Sequence[float], place: str) -> tuple[tuple[Observation, ...], str | None]:
    """The table `measured` of a shot: numbers, and how it ended.

    Raises:
        FitError: the message names the key.
    """
    if not isinstance(given, dict) or not given:
        raise FitError(f"{place}: is missing, but a fit needs what was measured, such as residual_velocity")
    observations: list[Observation] = []
    status = None
    for name, value in given.items():
        if name == "status":
            if not isinstance(value, str) or value not in STATUSES:
                raise FitError(f"{place}.status: got {quoted(value)}, but it must be one of {', '.join(STATUSES)}")
            status = value
            continue
        if name not in MEASURABLE:
            hint = meant(name, (*MEASURABLE, "status"))
            raise FitError(f"{place}: got the unknown key {quoted(name)}; {hint}")
        observations += _numbers(name, value, standoffs, f"{place}.{name}")
    if status not in (None, "perforated", "untouched") and observations:
        raise FitError(
            f'{place}.status: "{status}" and {observations[0].label} cannot be combined: only a core that passed the '
            "plate has that number"
        )
    return tuple(observations), status


def _numbers(name: str, given: Any, standoffs: Sequence[float], place: str) -> list[Observation]:
    if not isinstance(given, dict) or set(given) != {"value", "std"}:
        raise FitError(
            f"{place}: got {quoted(given)}, but it must be a table of the value and its standard uncertainty, such as "
            '{ value = "714 m/s", std = "8 m/s" }'
        )
    if "standoff" not in MEASURABLE[name].dims:
        return [_observation(name, (None, None), given["value"], given["std"], place)]
    values, stds = (given[key] if isinstance(given[key], list) else [given[key]] for key in ("value", "std"))
    stds = stds * len(values) if len(stds) == 1 else stds
    if not len(values) == len(stds) == len(standoffs):
        raise FitError(
            f"{place}: got {len(values)} values and {len(stds)} std at {len(standoffs)} stand-offs, but each stand-off "
            "of [record] takes one; nan stands for one that was not measured"
        )
    return [
        _observation(name, (index, at), value, std, place)
        for index, (at, value, std) in enumerate(zip(standoffs, values, stds, strict=True))
        if not (isinstance(value, float) and math.isnan(value))
    ]


def _observation(name: str, standoff: tuple[int | None, float | None], value: Any, std: Any, place: str) -> Observation:
    read = quantity(KINDS[MEASURABLE[name].units][1])
    try:
        number, spread = float(read(value)), float(read(std))
    except ValueError as error:
        raise FitError(f"{place}: {error}") from None
    if spread <= 0.0:
        raise FitError(f"{place}.std: got {quoted(std)}, but no measurement is exact: it must be greater than 0")
    return Observation(name, *standoff, number, spread)
