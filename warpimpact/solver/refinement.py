"""Outcomes to a tolerance: every shot on two levels of resolution, and those that change too much on finer ones."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from warpimpact.scene import Numerics, Scene, Shots, Tolerance
from warpimpact.solver.marching import Progress
from warpimpact.solver.resolution import Fidelity
from warpimpact.solver.simulate import Outcomes, simulate

Array = NDArray[np.float64]

LADDER = (
    Fidelity(24, 24, 1.5, 0.35),
    Fidelity(36, 36, 2.2, 0.22),
    Fidelity(54, 52, 3.5, 0.13),
    Fidelity(80, 76, 5.5, 0.08),
    Fidelity(120, 112, 9.0, 0.05),
)
"""Levels of resolution, coarse to fine, each about three times as expensive as the one before it. A shot that does
not meet its tolerance on the last is told as not converged."""


def level(index: int, numerics: Numerics) -> Fidelity:
    """A level of the ladder, in the precision of the numerics."""
    return replace(LADDER[index], double=numerics.precision == "double")


@dataclass(frozen=True)
class Estimates:
    """How far off the outcomes may be, and how fine they were computed.

    Attributes:
        residual_velocity_error: change from the last but one level to the last [m/s], shape [shots]; likewise
        tilt_error: [rad], shape [shots, stand-offs]. Infinite where the status changed, 0 where there is no value.
        converged: whether both meet the tolerance, shape [shots].
        level: index of the last level in LADDER, shape [shots].
    """

    residual_velocity_error: Array
    tilt_error: Array
    converged: NDArray[np.bool_]
    level: NDArray[np.int8]


def simulate_to_tolerance(
    scene: Scene,
    shots: Shots,
    *,
    numerics: Numerics,
    device: str = "auto",
    threads: int | None = None,
    progress: Progress | None = None,
) -> tuple[Outcomes, Estimates]:
    """Compute every shot on the first two levels, and on finer ones while two levels differ by too much.

    The outcome is that of the finer level, the estimate its change from the coarser one; where levels converge,
    the finer outcome is nearer to the limit (docs/model.md §4) than that.

    Args:
        numerics: its tolerance and precision; the others as in `simulate`.

    Raises:
        ValueError: the numerics have no tolerance.
        DeviceError: the device is absent.
    """
    if numerics.tolerance is None:
        raise ValueError("the numerics have no tolerance")
    tolerance = numerics.tolerance

    def on(index: int, which: NDArray[np.int64]) -> Outcomes:
        return simulate(
            scene,
            shots[which],
            numerics=level(index, numerics),
            device=device,
            threads=threads,
            progress=lambda *_: show(len(shots) - len(pending)),  # nothing new, but a chance to end the computation
        )

    def show(done: int) -> None:
        if progress is not None:
            progress(done, len(shots))

    pending = np.arange(len(shots))
    outcomes = on(0, pending)
    estimates = Estimates(
        residual_velocity_error=np.full(len(shots), np.inf),
        tilt_error=np.full(outcomes.tilt.shape, np.inf),
        converged=np.zeros(len(shots), dtype=bool),
        level=np.zeros(len(shots), dtype=np.int8),
    )
    for index in range(1, len(LADDER)):
        finer = on(index, pending)
        _estimate(estimates, pending, _picked(outcomes, pending), finer, tolerance)
        _put(outcomes, pending, finer)
        estimates.level[pending] = index
        pending = np.flatnonzero(~estimates.converged)
        show(len(shots) - len(pending))
        if not len(pending):
            break
    show(len(shots))
    return outcomes, estimates


def _estimate(
    estimates: Estimates, which: NDArray[np.int64], coarse: Outcomes, fine: Outcomes, tolerance: Tolerance
) -> None:
    """Write the estimates of some shots from their last two levels."""
    same = coarse.status == fine.status
    velocity = np.where(same, _change(coarse.residual_velocity, fine.residual_velocity), np.inf)
    tilt = np.where(same[:, None], _change(coarse.tilt, fine.tilt), np.inf)
    estimates.residual_velocity_error[which] = velocity
    estimates.tilt_error[which] = tilt
    estimates.converged[which] = (velocity <= tolerance.residual_velocity) & (tilt <= tolerance.tilt).all(axis=1)


def _change(coarse: Array, fine: Array) -> Array:
    """|fine − coarse|; 0 where neither exists, infinite where only one does."""
    missing = np.isnan(coarse), np.isnan(fine)
    change = np.where(missing[0] & missing[1], 0.0, np.abs(fine - coarse))
    return np.where(np.isnan(change), np.inf, change)


def _picked(outcomes: Outcomes, which: NDArray[np.int64]) -> Outcomes:
    """The rows of some shots."""
    return replace(outcomes, **{field.name: getattr(outcomes, field.name)[which] for field in fields(outcomes)})


def _put(outcomes: Outcomes, which: NDArray[np.int64], finer: Outcomes) -> None:
    """Put the finer outcomes of some shots in place."""
    for field in fields(outcomes):
        getattr(outcomes, field.name)[which] = getattr(finer, field.name)
