"""Outcomes to a tolerance: every shot on coarse levels of resolution, and on finer ones until it has converged."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from warpimpact.records.layers import LAYER_RESIDUAL_VELOCITY
from warpimpact.records.outcomes import Outcomes
from warpimpact.scene import Numerics, Scene, Shots, Tolerance
from warpimpact.solver.bursts import whole_plates
from warpimpact.solver.marching import Progress
from warpimpact.solver.resolution import level
from warpimpact.solver.simulate import simulate

Array = NDArray[np.float64]

LEVELS = (0, 2, 4, 6, 8)
"""Levels of LADDER that a shot goes through."""
GROWTH = 4.0
"""How many times as much a level costs as the one before, about."""
CLOSE, FAR = 0.25, 1.0
"""A shot has converged where its last change is at most CLOSE of the tolerance; or where its last change is within the
tolerance and the change from two levels before within FAR times that. Two levels may agree by chance, three rarely."""


@dataclass(frozen=True)
class Refining:
    """How far some shots are on their way to a tolerance.

    Attributes:
        level, levels: the one under way, 1 the coarsest, and how many there are: a shot that has not converged on the
            last one ends there.
        pending: shots that it computes.
        seconds_left: about the longest time that they may still take, if all of them need the last level; None before
            the first level has been measured.
    """

    level: int
    levels: int
    pending: int
    seconds_left: float | None


def simulate_to_tolerance(
    scene: Scene,
    shots: Shots,
    *,
    numerics: Numerics,
    device: str = "auto",
    threads: int | None = None,
    progress: Progress | None = None,
    refining: Callable[[Refining], None] | None = None,
) -> Outcomes:
    """Compute every shot on the first two levels, and on finer ones until it has converged (CLOSE, FAR).

    The outcome is that of the finest level computed. The estimate is its change from the level before: where levels
    converge, the outcome is nearer to the limit (docs/model.md §4) than that. Shots at one plate go on together until
    all of them have converged.

    Returns:
        The outcomes, with the columns of records/estimates.py: the errors are infinite where the status changed, and 0
        where there is no value.

    Args:
        numerics: its tolerance and precision; the others as in `simulate`.
        refining: called with the level under way whenever `progress` is, and before.

    Raises:
        ValueError: the numerics have no tolerance.
        DeviceError: the device is absent.
    """
    if numerics.tolerance is None:
        raise ValueError("the numerics have no tolerance")
    tolerance, cost = numerics.tolerance, _Cost()

    def on(index: int, which: NDArray[np.int64]) -> Outcomes:
        def follow(done: int, _: int) -> None:
            if refining is not None:
                refining(cost.after(done))
            show(len(shots) - len(pending))  # nothing new, but a chance to end the computation

        cost.begin(index, len(which))
        follow(0, 0)
        fidelity = level(index, numerics)
        return simulate(scene, shots[which], numerics=fidelity, device=device, threads=threads, progress=follow)

    def show(done: int) -> None:
        if progress is not None:
            progress(done, len(shots))

    pending = np.arange(len(shots))
    outcomes = before = on(LEVELS[0], pending)
    velocity_error, tilt_error = np.full(len(shots), np.inf), np.full(outcomes.tilt.shape, np.inf)
    converged, reached = np.zeros(len(shots), dtype=bool), np.zeros(len(shots), dtype=np.int8)
    for index in LEVELS[1:]:
        finer, last = on(index, pending), outcomes[pending]
        change, since_before = Change.between(last, finer), Change.between(before[pending], finer)
        near, far = change.in_tolerances(tolerance), since_before.in_tolerances(tolerance)
        three_agree = (near <= 1.0) & (far <= FAR) if index > LEVELS[1] else False
        velocity_error[pending] = change.residual_velocity
        tilt_error[pending] = change.tilt
        converged[pending] = (near <= CLOSE) | three_agree
        reached[pending] = index
        before, outcomes = before.with_rows(pending, last), outcomes.with_rows(pending, finer)
        pending = whole_plates(~converged, shots.at_a_plate)
        show(len(shots) - len(pending))
        if not len(pending):
            break
    show(len(shots))
    return outcomes.assign(
        residual_velocity_error=velocity_error, tilt_error=tilt_error, converged=converged, level=reached
    )


class _Cost:
    """Measures what a level costs, and tells what the others may cost yet."""

    def __init__(self) -> None:
        self._place, self._pending, self._begin = 0, 0, 0.0
        self._per_shot: float | None = None

    def begin(self, index: int, pending: int) -> None:
        """A level of LADDER begins, for so many shots."""
        if self._per_shot is not None:
            self._per_shot *= GROWTH
        self._place, self._pending, self._begin = LEVELS.index(index), pending, time.perf_counter()

    def after(self, done: int) -> Refining:
        """Where the shots are when so many of them are through the level."""
        if done:
            self._per_shot = (time.perf_counter() - self._begin) / done
        finer = sum(GROWTH**k for k in range(1, len(LEVELS) - self._place))
        left = None
        if self._per_shot is not None:
            left = self._per_shot * (self._pending - done + finer * self._pending)
        return Refining(self._place + 1, len(LEVELS), self._pending, left)


@dataclass(frozen=True)
class Change:
    """What changes between two levels: of the residual velocity [m/s], or that behind a layer if it changes by more,
    shape [shots]; and of the tilt [rad], shape [shots, stand-offs]. 0 where neither has a value, infinite where the
    status differs or only one has a value."""

    residual_velocity: Array
    tilt: Array

    @classmethod
    def between(cls, coarse: Outcomes, fine: Outcomes) -> Self:
        """The change from the outcomes of one level to those of another, of the same shots."""
        same = coarse.status == fine.status
        velocity, tilt = _apart(coarse.residual_velocity, fine.residual_velocity), _apart(coarse.tilt, fine.tilt)
        if LAYER_RESIDUAL_VELOCITY in coarse:
            behind = _apart(coarse.layer_residual_velocity, fine.layer_residual_velocity)
            velocity = np.maximum(velocity, behind.max(axis=1))
        return cls(np.where(same, velocity, np.inf), np.where(same[:, None], tilt, np.inf))

    def in_tolerances(self, tolerance: Tolerance) -> Array:
        """The larger of both in units of the tolerance, shape [shots]."""
        tilt = self.tilt.max(axis=1, initial=0.0) / tolerance.tilt
        return np.asarray(np.maximum(self.residual_velocity / tolerance.residual_velocity, tilt))


def _apart(coarse: Array, fine: Array) -> Array:
    missing = np.isnan(coarse), np.isnan(fine)
    change = np.where(missing[0] & missing[1], 0.0, np.abs(fine - coarse))
    return np.where(np.isnan(change), np.inf, change)
