"""What a pilot finds: a level of resolution, and what its errors are."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import NamedTuple, Self, TypeAlias

from warpimpact.records.outcomes import Outcomes
from warpimpact.scene import Numerics
from warpimpact.solver.pilot_text import errors_text, hits_text, limit_error_text

DEAR = 10.0
"""Times the cost of the first level, from which on the cost of another is announced."""


@dataclass(frozen=True)
class Found:
    """What a pilot found.

    Attributes:
        numerics: the level to compute all shots with.
        kept: whether the errors are within what was asked for.
        share: of the shots that are within the errors.
        finer: outcomes of the first shots of the pilot at the finer level that it was compared with; None where there
            are none.
    """

    numerics: Numerics
    kept: bool
    share: float
    finer: Outcomes | None = field(default=None, compare=False, repr=False, kw_only=True)

    @property
    @abstractmethod
    def errors(self) -> str:
        """Upper estimates of the errors, with units."""

    @property
    def told(self) -> Self:
        """The same without outcomes of shots."""
        return replace(self, finer=None)

    @property
    def phrase(self) -> str:
        """The errors, for a line of progress."""
        return f"accuracy {self.errors} for {hits_text(self.share)}{'' if self.kept else ', not as promised'}"


class Cost(NamedTuple):
    """What a shot costs at the level that was found, and at the first one that was tried [s], and the errors there."""

    seconds: float
    first_seconds: float
    first_level: int
    first_errors: str

    def announced(self, level: int, shots: int) -> str:
        """A sentence on the time that some shots will take, where it is DEAR times that of the first level; else
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
    """Upper estimates of the errors of what becomes of the shots; infinite where the pilot could not tell.

    Attributes:
        residual_velocity_error: [m/s]; the residual velocities behind all layers count.
        tilt_error: at the last stand-off [rad].
        depth_error: of the shots that stop in a layer [m]; NaN where none does.
        status_error: share of the shots that end otherwise on a finer level; NaN of a single plate.
        cost: what the level costs beside the first one that was tried; None if that is not known.
        shifts: levels that were tried, each with what the numerics may shift the means of a run by.
        tried: what was found at every level, coarse to fine, with outcomes of shots there and at a finer level.
    """

    residual_velocity_error: float
    tilt_error: float
    depth_error: float = math.nan
    status_error: float = math.nan
    cost: Cost | None = field(default=None, compare=False)
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


@dataclass(frozen=True)
class LimitErrors(Found):
    """Upper estimate of the errors of limits.

    Attributes:
        error: of velocities [m/s] or of thicknesses [m]; infinite where the pilot could not tell.
        quantity: "velocity" or "thickness".
        finer_level: that the limits were compared with; None where it did not fit the memory.
    """

    error: float
    quantity: str
    finer_level: int | None = field(default=None, compare=False)

    @property
    def errors(self) -> str:
        return limit_error_text(self.error, self.quantity)


Tried: TypeAlias = tuple[HitErrors, Outcomes, Outcomes]
"""What was found at a level, and outcomes of shots there and at a finer level."""
