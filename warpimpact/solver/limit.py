"""Limits: the impact velocity at which each shot just perforates, or the thickness of plate that it just perforates.

All shots are searched together, one run of each at a time. A search keeps two ends: a value at which the core passes,
and one at which it is stopped. The energy that a passing core has left tells where the limit lies. In a solid plate
that does not weaken it is linear in v² and in the thickness, because the work of a straight passage is constant
(docs/model.md §6.1). Bisection takes over where this does not help.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from warpimpact.kernels.status import Status
from warpimpact.scene import Numerics, Plate, Scene, Shots
from warpimpact.solver.marching import Progress
from warpimpact.solver.refinement import picked, with_rows
from warpimpact.solver.resolution import FIDELITIES, Fidelity, computed_as
from warpimpact.solver.simulate import Outcomes, simulate

Array = NDArray[np.float64]

MOST_RUNS = 14
"""Runs of a shot at most."""
VELOCITY_TOLERANCE, THICKNESS_TOLERANCE = 1.0, 1.0e-5
"""Of a limit velocity [m/s] and of a limit thickness [m]."""
HIGHEST_VELOCITY = 3000.0
"""Largest impact velocity tried [m/s]."""
THICKEST = 16.0
"""Largest thickness tried, in thicknesses of the plate."""
BESIDE = 0.4
"""How far beside the expected limit a run is made, in tolerances: two runs on both sides of it then settle it."""
MARGIN = 0.15
"""The least such distance, as a share of that of the nearer end: the farther this is, the less certain is what is
expected."""

STEPS = 6.0
"""How many times shorter than elsewhere a step is. It follows from the impact velocity, but near its limit a core is
slow for a while, and touches by a small share of its speed. With the step of a hit map limit velocities in a slotted
plate are off by 140 m/s of 210 m/s (90 % of the hits), with this one by 2 m/s."""
SLOW = 0.6
"""Of the distance of the ends: where a run leaves more of it, the next one bisects. From then on a search aims at what
is expected only as long as bisection could still finish it after that."""


@dataclass(frozen=True)
class Limits:
    """What was found of every shot, each of shape [shots]; the limit of velocity [m/s] or of thickness [m].

    Attributes:
        value: the limit, between lower and upper; 0 of velocity and infinite thickness where the core touches nothing;
            infinite where the largest value tried did not reach it; NaN where a run failed.
        lower, upper: values tried, or 0, that enclose the limit: the core passed at one and was stopped at the other.
            Where passing is not monotone this is one such change among several.
        runs: how often the shot was computed.
        converged: whether lower and upper are within the tolerance, or the limit needs no search (0 or infinite).
        shots: the shots as they last passed, or those at the largest value tried where they never did.
        outcomes: theirs.
    """

    value: Array
    lower: Array
    upper: Array
    runs: NDArray[np.int8]
    converged: NDArray[np.bool_]
    shots: Shots
    outcomes: Outcomes


def limit_velocity(
    scene: Scene,
    shots: Shots,
    *,
    numerics: Numerics | Fidelity | None = None,
    tolerance: float = VELOCITY_TOLERANCE,
    highest: float = HIGHEST_VELOCITY,
    device: str = "auto",
    threads: int | None = None,
    progress: Progress | None = None,
) -> Limits:
    """Find the impact velocity at which each shot just perforates the target, within MOST_RUNS runs of a shot.

    Args:
        shots: their own velocities are the first ones tried.
        numerics: as in `simulate`, but the steps of a named fidelity are STEPS times shorter.
        device, threads, progress: as in `simulate`; progress counts shots whose search has ended.
        tolerance: how far lower and upper may lie apart [m/s].
        highest: largest velocity tried [m/s].

    Raises:
        ValueError: the plate weakens by time (`check_arrests`); the numerics have a tolerance.
        DeviceError: the device is absent.
    """
    compute = _Computing(scene, _in_short_steps(numerics), device, threads)
    search = _Search(shots.velocity, np.inf, np.zeros(len(shots)), tolerance, highest)
    return _searched(compute, shots, search, with_velocity, progress)


def limit_thickness(
    scene: Scene,
    shots: Shots,
    *,
    numerics: Numerics | Fidelity | None = None,
    layer: int = 0,
    tolerance: float = THICKNESS_TOLERANCE,
    device: str = "auto",
    threads: int | None = None,
    progress: Progress | None = None,
) -> Limits:
    """Find the thickness of a plate with which each shot just perforates the target, within MOST_RUNS runs of a shot.

    It is at most THICKEST times the thickness in the scene. A lower end of 0 was not computed: where the rest of the
    target stops a core, no thickness is found above 0.

    Args:
        shots: their own thicknesses, or the scene's, are the first ones tried.
        layer: whose thickness it is; 0 is the plate, 1 the first layer behind it.
        tolerance: how far lower and upper may lie apart [m].
        numerics, device, threads, progress: as in `limit_velocity`.

    Raises:
        ValueError, DeviceError: as `limit_velocity`.
    """
    own = scene.target.plates[layer].thickness
    start = shots.own("thickness", own) if layer == 0 else shots.own_of_layer("thickness", layer - 1, own)
    start = np.broadcast_to(start, len(shots))
    search = _Search(start, 0.0, shots.velocity**2, tolerance, THICKEST * own)
    compute = _Computing(scene, _in_short_steps(numerics), device, threads)
    return _searched(compute, shots, search, partial(with_thickness, scene, layer), progress)


def with_velocity(shots: Shots, values: Array) -> Shots:
    """Shots with impact velocities of their own [m/s], shape [shots]."""
    return replace(shots, velocity=values)


def with_thickness(scene: Scene, layer: int, shots: Shots, values: Array) -> Shots:
    """Shots with thicknesses of a layer of their own [m], shape [shots]; layer 0 is the plate."""
    if layer == 0:
        return replace(shots, thickness=values)
    columns = shots.layer_thickness
    columns = np.full((len(shots), len(scene.target.layers)), np.nan) if columns is None else columns.copy()
    columns[:, layer - 1] = values
    return replace(shots, layer_thickness=columns)


def short_steps(fidelity: Fidelity) -> Fidelity:
    """A fidelity as limits need it."""
    return replace(fidelity, travel=fidelity.travel / STEPS)


def _in_short_steps(numerics: Numerics | Fidelity | None) -> Numerics | Fidelity:
    """The numerics of a search: those given, unless they are a name alone."""
    numerics = numerics or Numerics()
    if isinstance(numerics, Fidelity) or numerics.explicit is not None:
        return numerics
    return computed_as(short_steps(FIDELITIES[numerics.fidelity]), numerics)


def check_arrests(scene: Scene, shots: Shots | None = None) -> None:
    """Refuse a target with a plate that weakens by time: it stops no core, however slow, so there is no limit
    (docs/model.md §4).

    Args:
        shots: whose own degradation counts, too.

    Raises:
        ValueError: names what to give instead.
    """
    for k, (place, plate) in enumerate(scene.target.named):
        if plate.degradation_distance is not None or not _weakens(plate, shots, k):
            continue
        raise ValueError(
            f"{place}: got a plate that weakens by time (degradation_interval), which stops no core, however slow, so "
            "no limit exists; give degradation_distance in its place: impact velocity × degradation_interval has the "
            "same effect at that velocity"
        )


def _weakens(plate: Plate, shots: Shots | None, layer: int) -> bool:
    """Whether a plate, layer 0, or a layer behind it weakens in any shot."""
    own = None if shots is None else shots.degradation if layer == 0 else shots.layer_degradation
    column = own if own is None or layer == 0 else own[:, layer - 1]
    return plate.degradation < 1.0 or (column is not None and bool((column < 1.0).any()))


class _Computing(NamedTuple):
    """What stays the same from run to run."""

    scene: Scene
    numerics: Numerics | Fidelity
    device: str
    threads: int | None

    def __call__(self, shots: Shots, progress: Progress) -> Outcomes:
        rest = self._asdict()
        return simulate(rest.pop("scene"), shots, **rest, progress=progress)


def _searched(
    compute: _Computing,
    shots: Shots,
    search: _Search,
    put: Callable[[Shots, Array], Shots],
    progress: Progress | None,
) -> Limits:
    check_arrests(compute.scene, shots)
    total = len(shots)

    def show(*_: Any) -> None:  # within a round nothing new, but a chance to end the computation
        if progress is not None:
            progress(total - len(search.pending), total)

    kept, outcomes = np.empty(total), None
    while len(which := search.pending):
        tried = search.trial(which)
        ended = compute(put(shots[which], tried), show)
        telling = search.learn(which, tried, ended)
        outcomes = ended if outcomes is None else with_rows(outcomes, which[telling], picked(ended, telling))
        kept[which[telling]] = tried[telling]
        show()
    assert outcomes is not None  # there is a shot
    return Limits(search.value(), *search.ends(), search.runs, search.converged, put(shots, kept), outcomes)


class _Search:
    """The state of all searches; arrays of shape [shots].

    `passed` is the value nearest to the limit at which the core passed, `stopped` that at which it was stopped. One of
    them is 0 at first and the other infinite: a core at rest is stopped, one that meets no plate passes. The energy is
    given per half of the mass [m²/s²]. It is nearly linear in the `drive`: the square of a velocity, or a thickness.

    Args:
        start: values to try first.
        passed: infinite for a velocity, 0 for a thickness.
        left: energy of a core that passed there.
        tolerance, highest: as in `limit_velocity`.
    """

    def __init__(self, start: Array, passed: float, left: Array, tolerance: float, highest: float) -> None:
        count = len(start)
        self.tolerance, self.highest, self.rising = tolerance, highest, passed > 0.0
        self.start = np.minimum(start, highest)
        self.passed, self.stopped = np.full(count, passed), np.full(count, 0.0 if self.rising else np.inf)
        self.left, self.slope = left.copy(), np.full(count, 1.0 if self.rising else np.nan)  # over the drive
        self.runs = np.zeros(count, dtype=np.int8)
        self.slow, self.doubtful, self.beyond, self.failed = np.zeros((4, count), dtype=bool)

    @property
    def width(self) -> Array:
        """Distance of the two ends; 0 where both are infinite."""
        same = self.passed == self.stopped
        return np.asarray(np.abs(np.where(same, 0.0, self.passed) - np.where(same, 0.0, self.stopped)))

    @property
    def converged(self) -> NDArray[np.bool_]:
        """Whether the ends are within the tolerance, or the limit lies beyond the largest value tried."""
        return ~self.failed & (self.beyond | (self.width <= self.tolerance))

    @property
    def pending(self) -> NDArray[np.int64]:
        """The shots that need another run."""
        return np.flatnonzero(~self.converged & ~self.failed & (self.runs < MOST_RUNS))

    def trial(self, which: NDArray[np.int64]) -> Array:
        """The values of the next runs of some shots."""
        passed, stopped, aimed = self.passed[which], self.stopped[which], self._aimed()[which]
        low, high = np.minimum(passed, stopped), np.maximum(passed, stopped)
        open_ended, wild = np.isinf(high), ~((aimed > low) & (aimed < high))
        with np.errstate(divide="ignore"):
            needed = np.ceil(np.log2((high - low) / self.tolerance))
        hurried = self.slow[which] | (self.doubtful[which] & (MOST_RUNS - self.runs[which] - 1 < needed))
        outward = np.where(wild, 2.0 * low, np.minimum(aimed, 4.0 * low))
        inward = np.where(wild | hurried, 0.5 * (low + high), aimed)
        chosen = np.minimum(np.where(open_ended, outward, inward), self.highest)
        return np.where(self.runs[which] == 0, self.start[which], chosen)

    def learn(self, which: NDArray[np.int64], tried: Array, outcomes: Outcomes) -> NDArray[np.int64]:
        """Take in one run of some shots; returns the places of those that say how a shot ends at its limit."""
        status, before = outcomes.status, self.width[which]
        passes, failed, untouched = status == Status.PERFORATED, status >= Status.UNFINISHED, status == Status.MISSED
        through, back = which[passes], which[~passes]
        self.runs[which] += 1
        self._take_energy(through, tried[passes], outcomes.residual_velocity[passes] ** 2)
        self.passed[through], self.stopped[back] = tried[passes], tried[~passes]
        self.slow[which] = self.width[which] > SLOW * before
        self.doubtful[which] |= self.slow[which]
        self.failed[which] = failed
        self.passed[which[untouched]] = self.stopped[which[untouched]] = 0.0 if self.rising else np.inf
        self.beyond[which] = (tried >= self.highest) & (passes != self.rising)
        never = np.isinf(self.passed[which]) if self.rising else self.passed[which] == 0.0
        return np.flatnonzero(passes | failed | never)

    def value(self) -> Array:
        """The limits: where a core is expected to have no energy left, or the middle of the ends."""
        lower, upper = self.ends()
        expected = self._expected()
        inside = (expected > lower) & (expected < upper)
        found = np.where(inside, expected, 0.5 * (lower + upper))
        return np.where(self.failed, np.nan, np.where(self.beyond, np.inf, found))

    def ends(self) -> tuple[Array, Array]:
        """The lower and the upper end."""
        return np.minimum(self.passed, self.stopped), np.maximum(self.passed, self.stopped)

    def _drive(self, value: Array) -> Array:
        return value**2 if self.rising else value

    def _expected(self) -> Array:
        """Where a core has no energy left, if it is linear; NaN or beyond the ends where that cannot be told."""
        with np.errstate(invalid="ignore"):
            drive = self._drive(self.passed) - self.left / self.slope
            return np.asarray(np.sqrt(drive) if self.rising else drive)

    def _aimed(self) -> Array:
        """Values beside the limit as it is expected, on the side of the farther end, which then comes close."""
        expected = self._expected()
        with np.errstate(invalid="ignore"):
            passed, stopped = np.abs(self.passed - expected), np.abs(self.stopped - expected)
            beside = np.maximum(BESIDE * self.tolerance, MARGIN * np.minimum(passed, stopped))
            return np.asarray(expected + np.where((passed > stopped) == self.rising, beside, -beside))

    def _take_energy(self, which: NDArray[np.int64], tried: Array, left: Array) -> None:
        """Take in the energy left of shots that passed, and its slope where two runs tell one."""
        with np.errstate(invalid="ignore", divide="ignore"):
            slope = (left - self.left[which]) / (self._drive(tried) - self._drive(self.passed[which]))
        usable = np.isfinite(slope) & ((slope > 0.0) == self.rising) & (slope != 0.0)
        self.slope[which] = np.where(usable, slope, self.slope[which])
        self.left[which] = left
