"""Limits: the impact velocity at which each shot just perforates, or the thickness of plate that it just perforates."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from warpimpact.records.outcomes import Outcomes
from warpimpact.records.registry import LIMITS
from warpimpact.records.variable import failures
from warpimpact.scene import PRESETS, Numerics, Plate, Scene, Shots, Target
from warpimpact.solver.accuracy import PILOT_LIMITS, LevelErrors, PilotResult, choose_level, limit_errors, pilot_size
from warpimpact.solver.limit_search import LimitSearch
from warpimpact.solver.marching import Progress
from warpimpact.solver.prepare import prepare
from warpimpact.solver.resolution import at_level, coarsest_level, level_of
from warpimpact.solver.simulate import build_kernels, computed, spread
from warpimpact.solver.worker import Worker

Array = NDArray[np.float64]

VELOCITY_TOLERANCE, THICKNESS_TOLERANCE = 1.0, 1.0e-5
"""Default tolerance of a limit velocity [m/s] and of a limit thickness [m]."""
PASSAGES = 35
"""Time of the search of one limit over that of a passage: some five shots, slow near the limit. It was 34 to 65 for
campaigns/limit_velocity.toml."""
HIGHEST_VELOCITY = 3000.0
"""Largest impact velocity tried [m/s]."""
THICKEST = 16.0
"""Largest thickness tried, in thicknesses of the plate."""
STEPS_OF_LIMITS = 6.0
"""How many times shorter the steps of a search are than those of a hit map. The step follows from the impact velocity,
but near its limit a core is slow for a while and moves by a small share of its speed per step. With the step of a hit
map, limit velocities in a slotted plate are wrong by 140 m/s of 210 m/s (90 % of the hits), with this one by 2 m/s."""


@dataclass(frozen=True)
class Limits:
    """The limits of all shots: velocities [m/s] or thicknesses [m]; arrays of shape [shots].

    Attributes:
        value: the limit, between lower and upper. Where the core touches nothing, a limit velocity is 0 and a limit
            thickness infinite. It is infinite where even the largest value tried lies below the limit, and NaN where
            the run at the end at which the core does not pass failed. A run that fails elsewhere counts as one that
            does not pass.
        lower, upper: values tried, or 0, that enclose the limit: the core passed at one and was stopped at the other.
            If passing is not monotone, they enclose one of several such changes.
        runs: how often the shot was computed.
        converged: whether lower and upper are within the tolerance, or the limit needs no search (0 or infinite).
        shots: the shots at the value at which they last passed; at the largest value tried where they never passed; at
            the value that failed where the limit is NaN.
        outcomes: outcomes of `shots`.
    """

    value: Array
    lower: Array
    upper: Array
    runs: NDArray[np.int8]
    converged: NDArray[np.bool_]
    shots: Shots
    outcomes: Outcomes

    def recorded(self, quantity: str) -> Outcomes:
        """The outcomes with the columns of the search."""
        return self.outcomes.assign(**{str(name): getattr(self, name.field) for name in LIMITS[quantity]})


@dataclass(frozen=True)
class LimitSpec:
    """The limit that is searched.

    Attributes:
        quantity: "velocity" or "thickness".
        tolerance: largest distance of lower and upper [m/s] or [m].
        highest: largest value tried [m/s] or [m].
        layer: number of the layer whose thickness is varied; 0 is the plate.
        by_thickness: thicknesses of the layer, ascending [m], and its resistance there as a share of the shot's; linear
            in ln h between them. None where the resistance does not depend on the thickness.
    """

    quantity: str
    tolerance: float
    highest: float
    layer: int = 0
    by_thickness: tuple[tuple[float, ...], tuple[float, ...]] | None = None

    def with_trial(self, target: Target, shots: Shots, values: Array) -> Shots:
        """The shots with the values to try, shape [shots]: velocities [m/s] or thicknesses [m]."""
        if self.quantity == "velocity":
            return replace(shots, velocity=values)
        values_of_layer = {"thickness": values}
        if self.by_thickness is not None:
            thickness, share = self.by_thickness
            there = np.interp(np.log(np.maximum(values, thickness[0])), np.log(thickness), share)
            values_of_layer["resistance"] = shots.layer_value(target, "resistance", self.layer) * there
        return shots.assign(values_of_layer, self.layer)


def limit_velocity(
    scene: Scene,
    shots: Shots,
    *,
    numerics: Numerics | None = None,
    tolerance: float = VELOCITY_TOLERANCE,
    highest: float = HIGHEST_VELOCITY,
    device: str = "auto",
    threads: int | None = None,
    progress: Progress | None = None,
) -> Limits:
    """Find the impact velocity at which each shot just perforates the target, within MOST_RUNS runs of a shot.

    Args:
        shots: their velocities are the first ones tried.
        numerics: as in `simulate`; of an accuracy, `limit` counts. A level has shorter steps (STEPS_OF_LIMITS).
        device, threads, progress: as in `simulate`; progress counts shots whose search has ended.
        tolerance: largest distance of lower and upper [m/s].
        highest: largest velocity tried [m/s].

    Raises:
        ValueError: the plate weakens by time (`check_arrests`).
        DeviceError: the device is absent.
    """
    spec = LimitSpec("velocity", tolerance, highest)
    return _limits(scene, shots, spec, numerics or Numerics(), Worker(device, threads), progress)


def limit_thickness(
    scene: Scene,
    shots: Shots,
    *,
    numerics: Numerics | None = None,
    layer: int = 0,
    tolerance: float = THICKNESS_TOLERANCE,
    device: str = "auto",
    threads: int | None = None,
    progress: Progress | None = None,
) -> Limits:
    """Find the thickness of a layer that each shot just perforates, within MOST_RUNS runs of a shot.

    The thickness is at most THICKEST times that of the scene, and the resistance is the same at all thicknesses. A
    lower end of 0 was not computed: where the rest of the target stops a core, no thickness above 0 is found.

    Args:
        shots: their thicknesses, or the scene's, are the first ones tried.
        layer: number of the layer whose thickness is varied; 0 is the plate.
        tolerance: largest distance of lower and upper [m].
        numerics, device, threads, progress: as in `limit_velocity`.

    Raises:
        ValueError, DeviceError: as `limit_velocity`.
    """
    spec = LimitSpec("thickness", tolerance, thickest(scene, layer), layer)
    return _limits(scene, shots, spec, numerics or Numerics(), Worker(device, threads), progress)


def thickest(scene: Scene, layer: int) -> float:
    """Largest thickness of a layer that is tried [m]."""
    return THICKEST * scene.target.layers[layer].thickness


def _limits(
    scene: Scene, shots: Shots, spec: LimitSpec, numerics: Numerics, worker: Worker, progress: Progress | None
) -> Limits:
    if numerics.explicit is None:
        pilot = spread(shots, pilot_size(numerics.required, PILOT_LIMITS))
        numerics = pilot_of_limits(scene, pilot, spec, numerics, worker).numerics
    return limits(scene, shots, spec, numerics, worker, progress)


def pilot_of_limits(
    scene: Scene,
    pilot: Shots,
    spec: LimitSpec,
    numerics: Numerics,
    worker: Worker,
    trying: Callable[[int], object] = lambda level: None,
) -> PilotResult:
    """Find the level of resolution for an accuracy of limits; arguments as in `simulate.pilot_of`.

    Raises:
        ValueError: the accuracy has no bound on limits.
    """
    required, draft = numerics.required, PRESETS["draft"].limit
    if required.limit is None or draft is None:
        raise ValueError("accuracy: needs limit, the error of a limit as a share of the median limit")
    name = str(LIMITS[spec.quantity].value)

    @cache
    def outcomes(level: int) -> Outcomes:
        trying(level)
        return limits(scene, pilot, spec, at_level(level, numerics), worker).recorded(spec.quantity)

    @cache
    def seconds(level: int) -> float:
        return PASSAGES * len(pilot) * prepare(scene, pilot[:1], at_level(level, numerics)).seconds

    def errors(coarse: Outcomes, fine: Outcomes) -> LevelErrors:
        return limit_errors(getattr(coarse, name), getattr(fine, name), required, spec.quantity)

    first = coarsest_level(draft / required.limit)
    build_kernels(scene, pilot, at_level(first, numerics), worker)
    return choose_level(numerics, first, outcomes, errors, seconds)


def limits(
    scene: Scene,
    shots: Shots,
    spec: LimitSpec,
    numerics: Numerics,
    worker: Worker,
    progress: Progress | None = None,
) -> Limits:
    """Find the limit of every shot, with numerics that fix the resolution. Each run computes all pending shots."""
    check_arrests(scene, shots)
    search, which = _search_of(scene, shots, spec), np.arange(len(shots))
    at_limit: tuple[Array, Outcomes] | None = None
    at_failure = at_limit
    while len(which):
        tried = search.trial()[which]
        trial = spec.with_trial(scene.target, shots[which], tried)
        ended = computed(prepare(scene, trial, short_steps(numerics)), worker)
        at_limit = _updated(at_limit, which, tried, ended, search.learn(which, tried, ended))
        at_failure = _updated(at_failure, which, tried, ended, failures(ended.status))
        which = np.flatnonzero(search.pending)
        if progress is not None:
            progress(len(shots) - len(which), len(shots))
    assert at_limit is not None
    assert at_failure is not None
    failed = np.flatnonzero(search.failed)
    values, outcomes = _updated(
        at_limit, failed, at_failure[0][failed], at_failure[1][failed], np.ones(len(failed), dtype=bool)
    )
    return Limits(
        search.value(),
        *search.ends,
        search.runs,
        search.ended & ~search.failed,
        spec.with_trial(scene.target, shots, values),
        outcomes,
    )


def short_steps(numerics: Numerics) -> Numerics:
    """Numerics for limits: a level gets steps that are STEPS_OF_LIMITS times shorter."""
    if numerics.level is None or numerics.travel is not None or numerics.explicit == "scheme" or numerics.time_step:
        return numerics
    return numerics.model_copy(update={"travel": level_of(numerics).travel / STEPS_OF_LIMITS})


def check_arrests(scene: Scene, shots: Shots | None = None) -> None:
    """Refuse a target with a plate that weakens by time: such a plate stops no core, however slow, so there is no limit
    (docs/model.md §4).

    Args:
        shots: shots whose own degradation counts, too.

    Raises:
        ValueError: the message says what to give instead.
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
    """Whether a layer weakens in any of the shots."""
    if plate.degradation < 1.0 or shots is None or not shots.varies("degradation", layer):
        return plate.degradation < 1.0
    return bool((shots.columns["degradation"][:, layer] < 1.0).any())


def _updated(
    last: tuple[Array, Outcomes] | None,
    which: NDArray[np.int64],
    tried: Array,
    ended: Outcomes,
    counts: NDArray[np.bool_],
) -> tuple[Array, Outcomes]:
    """Values and outcomes of one run of every shot, where the runs that count replace those before."""
    values, outcomes = last or (tried.copy(), ended)
    values[which[counts]], rows = tried[counts], outcomes.with_rows(which[counts], ended[counts])
    return values, rows


def _search_of(scene: Scene, shots: Shots, spec: LimitSpec) -> LimitSearch:
    """A search of the limits of all shots."""
    if spec.quantity == "velocity":
        return LimitSearch(shots.velocity, np.inf, np.zeros(len(shots)), spec.tolerance, spec.highest)
    start = np.broadcast_to(shots.layer_value(scene.target, "thickness", spec.layer), len(shots))
    return LimitSearch(start, 0.0, shots.velocity, spec.tolerance, spec.highest)
