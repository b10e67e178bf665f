"""Limits: the impact velocity at which each core just passes, or the thickness of plate that it just passes.

A search keeps two ends: a value at which the core passes, and one at which it does not. A stopped core says no more
than that, so root finders that need a value on both sides (scipy.optimize.elementwise) do not serve. The residual
velocities r of passing cores determine the limit: with the drive D, which is v² or a thickness, |D − D_limit| = c r²,
because the work of a straight passage is nearly constant (docs/model.md §6.1). Two passages give D_limit and c; one
gives D_limit with c = 1, as for a core of constant mass. Bisection takes over where this does not help.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from warpimpact.kernels.status import Status
from warpimpact.records.outcomes import Outcomes
from warpimpact.records.variables import LIMITS, failures
from warpimpact.scene import Scene, Shots, Target
from warpimpact.solver.accuracy import (
    PILOT_LIMITS,
    LevelErrors,
    PilotResult,
    choose_level,
    cost_by_level,
    limit_errors,
    pilot_size,
    spread,
)
from warpimpact.solver.device import Worker
from warpimpact.solver.marching import FastLawComputation, Progress
from warpimpact.solver.prepare import prepare
from warpimpact.solver.resolution import coarsest_level, level_of, weakens
from warpimpact.solver.settings import PRESETS, FastLawSettings

Array = NDArray[np.float64]
Settings = TypeVar("Settings", bound=FastLawSettings)

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
MOST_RUNS = 20
"""Most runs of a shot."""
PASSAGE_DOUBT = 0.15, 0.08
"""Doubt of a limit that follows from one passage, and from two, as a share of its distance from the nearer one."""
CLOSE_RUN, END_RUN = 0.4, 0.98
"""Distance [tolerances] from the expected limit of a run that shall pass close to it; and from a near end of a run that
shall settle a limit."""
NEXT_RATIO = 3.0
"""Next distance from an expected limit at which a core was stopped, over the last one."""
MOST_DOUBT = 1.2
"""Largest doubt [tolerances] at which such close runs are made."""
EXPANSION = 1.4, 2.0, 4.0
"""Ratio of the next value to the last one while all runs have stopped: after the first run, the second, later ones."""

_without_warnings = np.errstate(invalid="ignore", divide="ignore")


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

    @classmethod
    def of(cls, scene: Scene, quantity: str = "velocity", layer: int = 0, tolerance: float | None = None) -> Self:
        """The limit of a scene, by default within the default tolerance, at the same resistance at all thicknesses."""
        if quantity == "velocity":
            return cls(quantity, tolerance or VELOCITY_TOLERANCE, HIGHEST_VELOCITY)
        highest = THICKEST * scene.target.layers[layer].thickness
        return cls(quantity, tolerance or THICKNESS_TOLERANCE, highest, layer)

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


def pilot_of_limits(
    scene: Scene,
    pilot: Shots,
    spec: LimitSpec,
    numerics: FastLawSettings,
    worker: Worker,
    trying: Callable[[int], object] = lambda level: None,
) -> PilotResult:
    """Find the level of resolution for an accuracy of limits; arguments as in `pilot_of`.

    Raises:
        ValueError: the accuracy has no bound on limits.
    """
    required, draft = numerics.required, PRESETS["draft"].limit
    if required.limit is None or draft is None:
        raise ValueError("accuracy: needs limit, the error of a limit as a share of the median limit")
    name = str(LIMITS[spec.quantity].value)

    def compute(level: int) -> Outcomes:
        trying(level)
        return limits(scene, pilot, spec, numerics.at_level(level), worker).recorded(spec.quantity)

    def errors(coarse: Outcomes, fine: Outcomes) -> LevelErrors:
        return limit_errors(getattr(coarse, name), getattr(fine, name), required, spec.quantity)

    first, cost = coarsest_level(draft / required.limit), cost_by_level(scene, pilot, numerics, PASSAGES)
    FastLawComputation(prepare(scene, pilot, numerics.at_level(first)), worker).build()
    return choose_level(first, compute, errors, cost)


def limits(
    scene: Scene,
    shots: Shots,
    spec: LimitSpec,
    numerics: FastLawSettings | None = None,
    worker: Worker | None = None,
    progress: Progress | None = None,
) -> Limits:
    """Find the limit of every shot, within MOST_RUNS runs of a shot. Each run computes all pending shots.

    A lower end of 0 was not computed: where the rest of the target stops a core, no thickness above 0 is found.

    Args:
        shots: their velocities or thicknesses, or the scene's thickness, are the first ones tried.
        numerics: settings of the fast law; of an accuracy, `limit` counts. A level has shorter steps (STEPS_OF_LIMITS).
        worker: by default all cores, or a GPU if there is one.
        progress: as in `simulate`; it counts shots whose search has ended.

    Raises:
        ValueError: the plate weakens by time (`check_arrests`).
        DeviceError: the device is absent.
    """
    check_arrests(scene, shots)
    numerics, worker = numerics or FastLawSettings(), worker or Worker()
    if numerics.explicit is None:
        pilot = spread(shots, pilot_size(numerics.required, PILOT_LIMITS))
        numerics = numerics.at_level(pilot_of_limits(scene, pilot, spec, numerics, worker).level)
    start, passed, speed = shots.velocity, np.inf, np.zeros(len(shots))
    if spec.quantity == "thickness":
        start = np.broadcast_to(shots.layer_value(scene.target, "thickness", spec.layer), len(shots))
        passed, speed = 0.0, shots.velocity
    search, which = LimitSearch(start, passed, speed, spec.tolerance, spec.highest), np.arange(len(shots))
    runs: dict[str, tuple[Array, Outcomes]] = {}  # of every shot, the last ones at its limit, and that failed
    while len(which):
        tried = search.trial()[which]
        trial = spec.with_trial(scene.target, shots[which], tried)
        ended = FastLawComputation(prepare(scene, trial, short_steps(numerics)), worker).compute()
        for name, counts in (("limit", search.learn(which, tried, ended)), ("failure", failures(ended.status))):
            runs[name] = _updated(runs.get(name), which, tried, ended, counts)
        which = np.flatnonzero(search.pending)
        if progress is not None:
            progress(len(shots) - len(which), len(shots))
    failed, (tried, ended) = np.flatnonzero(search.failed), runs["failure"]
    values, outcomes = _updated(runs["limit"], failed, tried[failed], ended[failed], np.full(len(failed), True))
    return Limits(
        search.value(),
        *search.ends,
        search.runs,
        search.ended & ~search.failed,
        spec.with_trial(scene.target, shots, values),
        outcomes,
    )


def short_steps(numerics: Settings) -> Settings:
    """Settings for limits: a level gets steps that are STEPS_OF_LIMITS times shorter."""
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
    for (place, plate), does in zip(scene.target.named, weakens(scene.target, shots), strict=True):
        if does and plate.degradation_distance is None:
            raise ValueError(
                f"{place}: got a plate that weakens by time (degradation_interval), which stops no core, however slow, "
                "so no limit exists; give degradation_distance in its place: impact velocity × degradation_interval "
                "has the same effect at that velocity"
            )


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


class LimitSearch:
    """The state of all searches; arrays of shape [shots].

    `passed` is the value nearest to the limit at which the core passed, `stopped` the nearest at which it was stopped.
    At first one of them is 0 and the other infinite: a core at rest is stopped, a core that meets no plate passes.

    Args:
        start: first values to try.
        passed: initial `passed`: infinite for a velocity, 0 for a thickness.
        speed: residual velocity of a core that passes there.
        tolerance: largest distance of the ends.
        highest: largest value tried.
    """

    def __init__(self, start: Array, passed: float, speed: Array, tolerance: float, highest: float) -> None:
        count = len(start)
        self.tolerance, self.highest, self.rising = tolerance, highest, passed > 0.0
        self.start = np.minimum(start, highest)
        self.passed, self.stopped = np.full(count, passed), np.full(count, 0.0 if self.rising else np.inf)
        self.drives, self.speeds = np.full((2, 2, count), np.nan)  # of the last two passages, the nearest first
        if not self.rising:
            self.drives[0], self.speeds[0] = 0.0, speed
        self.runs = np.zeros(count, dtype=np.int8)
        self.beyond, self.failed = np.zeros((2, count), dtype=bool)  # failed: at `stopped`

    @property
    def ends(self) -> tuple[Array, Array]:
        """The lower and the upper end."""
        return np.minimum(self.passed, self.stopped), np.maximum(self.passed, self.stopped)

    @property
    def ended(self) -> NDArray[np.bool_]:
        """Whether the ends are within the tolerance, or the limit lies beyond the largest value tried."""
        low, high = self.ends
        return np.asarray(self.beyond | (low == high) | (low >= high - self.tolerance))

    @property
    def pending(self) -> NDArray[np.bool_]:
        """Whether a shot needs another run."""
        return ~self.ended & (self.runs < MOST_RUNS)

    @_without_warnings
    def trial(self) -> Array:
        """The values of the next runs."""
        low, high = self.ends
        aimed, further = self._aimed(), np.array(EXPANSION)[np.clip(self.runs - 1, 0, 2)] * low
        hurried = (low > 0.0) & (MOST_RUNS - self.runs <= np.ceil(np.log2((high - low) / self.tolerance)))
        wild = ~((aimed > low) & (aimed < high))
        outward = np.where(wild, further, np.minimum(aimed, np.where(low > 0.0, EXPANSION[-1] * low, np.inf)))
        chosen = np.where(np.isinf(high), outward, np.where(wild | hurried, 0.5 * (low + high), aimed))
        return np.asarray(np.minimum(np.where(self.runs == 0, self.start, chosen), self.highest))

    def learn(self, which: NDArray[np.int64], tried: Array, outcomes: Outcomes) -> NDArray[np.bool_]:
        """Take in one run of some shots; returns which of the runs show how a shot ends at its limit."""
        status = outcomes.status
        passes, untouched = status == Status.PERFORATED, which[status == Status.UNTOUCHED]
        through, back = which[passes], which[~passes]
        self.runs[which] += 1
        drive = tried**2 if self.rising else tried
        for known, new in ((self.drives, drive), (self.speeds, outcomes.residual_velocity)):
            known[1:, through] = known[:-1, through]
            known[0, through] = new[passes]
        self.passed[through], self.stopped[back] = tried[passes], tried[~passes]
        self.failed[back] = failures(status)[~passes]
        self.passed[untouched] = self.stopped[untouched] = 0.0 if self.rising else np.inf
        self.beyond[which] = (tried >= self.highest) & (passes != self.rising)
        never = np.isinf(self.passed[which]) if self.rising else self.passed[which] == 0.0
        return np.asarray(passes | never)

    @_without_warnings
    def value(self) -> Array:
        """The expected limits, or the middles between the ends where none is expected there."""
        (low, high), expected = self.ends, self._expected()
        limit = np.where((expected > low) & (expected < high), expected, 0.5 * (low + high))
        return np.where(self.failed, np.nan, np.where(self.beyond, np.inf, limit))

    def _expected(self) -> Array:
        """The values at which no speed is left, from the passages; NaN where there are none."""
        sign = 1.0 if self.rising else -1.0
        (d1, d2), (r1, r2) = sign * self.drives, self.speeds
        slope = (d1 - d2) / (r1**2 - r2**2)
        limit = sign * (d1 - r1**2 * np.where(slope > 0.0, slope, 1.0 if self.rising else np.nan))
        return np.asarray(np.sqrt(limit) if self.rising else limit)

    def _aimed(self) -> Array:
        """The next values; NaN or beyond the ends where nothing is expected.

        While the limit is uncertain, runs are made where the core is expected to pass, because only passages say where
        the limit lies. If all of them pass, runs follow where it is expected to stop. Signs are such that `passed` lies
        ahead of the limit and `stopped` behind it.
        """
        sign, tolerance, value = 1.0 if self.rising else -1.0, self.tolerance, self._expected()
        passages = np.isfinite(self.drives).sum(axis=0)
        doubt = np.array(PASSAGE_DOUBT)[np.clip(passages - 1, 0, 1)] * np.abs(self.passed - value)
        ahead, behind, expected = sign * self.passed, sign * self.stopped, sign * value
        close = doubt <= MOST_DOUBT * tolerance
        beyond = behind + np.clip(NEXT_RATIO * (behind - expected), CLOSE_RUN * tolerance, 0.5 * (ahead - behind))
        aimed = np.where(expected <= behind, beyond, expected + np.where(close, CLOSE_RUN * tolerance, doubt))
        near = END_RUN * tolerance - np.maximum(1.2 * doubt, 0.1 * tolerance)  # the limit then hardly lies farther
        settles = close & (expected - behind > -MOST_DOUBT * tolerance)
        aimed = np.where(settles & (expected - behind <= near), behind + END_RUN * tolerance, aimed)
        return np.asarray(sign * np.where(settles & (ahead - expected <= near), ahead - END_RUN * tolerance, aimed))
