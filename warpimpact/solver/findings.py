"""What a pilot finds: the resolution of a run, its errors, and the words for them."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from decimal import ROUND_CEILING, Context
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from warpimpact.records.outcomes import Outcomes
from warpimpact.scene import Numerics

DEAR = 10.0
"""Ratio to the cost of the first level above which the cost of another level is announced."""


@dataclass(frozen=True)
class Found:
    """What a pilot found.

    Attributes:
        numerics: numerics for all shots: a level, with coarser settings where these keep the promise.
        kept: whether the errors are within the promise.
        share: share of the shots that are within the errors.
        finer: outcomes of the pilot's first shots at the finer level of the comparison; None without a comparison.
        numbers: numbers of all the pilot's hits in their campaign; None without a campaign.
    """

    numerics: Numerics
    kept: bool
    share: float
    finer: Outcomes | None = field(default=None, compare=False, repr=False, kw_only=True)
    numbers: NDArray[np.int64] | None = field(default=None, compare=False, repr=False, kw_only=True)

    @property
    @abstractmethod
    def errors(self) -> str:
        """Upper estimates of the errors, with units."""

    @property
    def told(self) -> Self:
        """These findings without outcomes of shots."""
        return replace(self, finer=None, numbers=None)

    @property
    def phrase(self) -> str:
        """A phrase with the errors for a line of progress."""
        return f"accuracy {self.errors} for {hits_text(self.share)}{'' if self.kept else ', not as promised'}"


class LevelCost(NamedTuple):
    """Cost of a shot [s] at the level that was found and at the first level tried, and the errors at the first
    level."""

    seconds: float
    first_seconds: float
    first_level: int
    first_errors: str

    def announced(self, level: int, shots: int) -> str:
        """A sentence on the time that the shots will take if it exceeds DEAR times that of the first level; else
        empty."""
        times = self.seconds / self.first_seconds
        if times < DEAR:
            return ""
        return (
            f"level {level} costs {times:.0f} times level {self.first_level}: about {self.seconds * shots:.3g} s for "
            f"{shots} hits in place of {self.first_seconds * shots:.2g} s. Level {self.first_level} errs by "
            f"{self.first_errors} (numerics.level)"
        )


@dataclass(frozen=True)
class HitErrors(Found):
    """Upper estimates of the errors of outcomes; infinite where the pilot could not estimate them.

    Attributes:
        residual_velocity_error: [m/s], the largest behind any layer.
        tilt_error: at the last stand-off [rad].
        depth_error: of the shots that stop in a layer [m]; NaN where none stops.
        status_error: share of the shots that end otherwise at a finer level; NaN for a single plate.
        cost: cost of the level beside that of the first level tried; None if unknown.
        shifts: by level tried, the shift of a run's mean measures at this level.
        tried: levels that were judged, coarse to fine.
    """

    residual_velocity_error: float
    tilt_error: float
    depth_error: float = math.nan
    status_error: float = math.nan
    cost: LevelCost | None = field(default=None, compare=False)
    shifts: Mapping[int, tuple[float, ...]] = field(default_factory=dict, compare=False)
    tried: tuple[Tried, ...] = field(default=(), compare=False, repr=False)

    @property
    def told(self) -> Self:
        return replace(super().told, tried=())

    @property
    def errors(self) -> str:
        return errors_text(
            self.residual_velocity_error, math.degrees(self.tilt_error), self.depth_error, self.status_error
        )


class Tried(NamedTuple):
    """A level that a pilot judged: its errors, and outcomes of the same shots at this level and at a finer one."""

    errors: HitErrors
    coarse: Outcomes
    fine: Outcomes


@dataclass(frozen=True)
class LimitErrors(Found):
    """Upper estimate of the errors of limits.

    Attributes:
        error: error of limit velocities [m/s] or thicknesses [m]; infinite where the pilot could not estimate it.
        quantity: "velocity" or "thickness".
        finer_level: level that the limits were compared with; None where it did not fit the memory.
    """

    error: float
    quantity: str
    finer_level: int | None = field(default=None, compare=False)

    @property
    def errors(self) -> str:
        return limit_error_text(self.error, self.quantity)


def hits_text(share: float) -> str:
    """Words for a share of the hits."""
    return f"{100.0 * share:.3g} % of the hits"


def errors_text(velocity: float, tilt: float, depth: float = math.nan, status: float = math.nan) -> str:
    """Words for the errors of residual velocity [m/s] and tilt [degree], and of depth [m] and status unless NaN."""
    parts = [f"{upper_digits(velocity)} m/s", f"{upper_digits(tilt)} deg"]
    if not math.isnan(depth):
        parts.append(f"{upper_digits(1e3 * depth)} mm of depth")
    if status > 0.0:
        parts.append(f"the status of {100.0 * status:.2g} % of the hits")
    return _listed(parts)


def limit_error_text(error: float, quantity: str) -> str:
    """Words for the error of a limit velocity [m/s] or a limit thickness [m]."""
    return f"{upper_digits(error)} m/s" if quantity == "velocity" else f"{upper_digits(1e3 * error)} mm"


def accuracy_text(asked: Mapping[str, float], *, layered: bool) -> str:
    """Words for an accuracy, by the names and in the units of `Accuracy`. A bound that it lacks is not asked for."""

    def bound(name: str, unit: str, factor: float = 1.0) -> str:
        share = asked.get(f"{name}_share", 0.0) if layered else 0.0
        return f"{factor * asked[name]:g} {unit}" + (f" + {100.0 * share:g} %" if share else "")

    parts = [bound("residual_velocity", "m/s")] if "residual_velocity" in asked else []
    parts += [bound("tilt", "deg", math.degrees(1.0))] if "tilt" in asked else []
    if layered and "depth" in asked:
        parts.append(f"{1e3 * asked['depth']:g} mm of depth")
    stated = f"{_listed(parts)} for {hits_text(asked['share'])}"
    if layered and asked.get("status_share", 1.0) < 1.0:
        stated += f", another status for at most {100.0 * asked['status_share']:g} %"
    return stated


def upper_digits(error: float) -> str:
    """An error rounded up to two digits, so that one above a bound never reads as if it were at the bound."""
    up = Context(prec=2, rounding=ROUND_CEILING).create_decimal(f"{error:.9g}")  # nine digits: noise does not count
    return f"{float(up):g}"


def _listed(parts: Sequence[str]) -> str:
    return " and ".join([", ".join(parts[:-1]), parts[-1]] if len(parts) > 1 else parts)
