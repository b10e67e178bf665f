"""Error and speed of the numerics, measured on a campaign's scene and on this machine.

The converged answer comes from patches, grid and time step refined together. On every level, a second run with twice
the time step serves to extrapolate the error of first order in the step to zero. The error of grid and patches is not
extrapolated, because for a single hit it follows no power of the spacing. It halves, about, from level to level. So the
change on the last level bounds the remaining error; it is given as the uncertainty.
"""

from __future__ import annotations

import math
import time
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import xarray
from numpy.typing import NDArray

from warpimpact.campaign.campaign import Campaign
from warpimpact.campaign.text import CampaignError
from warpimpact.records.outcomes import Outcomes
from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.results.dataset import study_dataset
from warpimpact.scene import Hits, Numerics, Scene, Shots, make_shots
from warpimpact.solver.device import find_device
from warpimpact.solver.marching import Progress
from warpimpact.solver.materials import weakens
from warpimpact.solver.prepare import prepare
from warpimpact.solver.resolution import Level, Resolution, resolve
from warpimpact.solver.simulate import simulate

Array = NDArray[np.float64]

LEVELS = (
    Level(72, 72, 5.0, 0.06),
    Level(108, 108, 7.5, 0.04),
    Level(162, 160, 11.0, 0.027),
)
"""Levels of the converged answer, coarse to fine; the uncertainty is the change from the second last to the last."""

SWEEP = (
    Level(8, 12, 0.7, 0.8),
    Level(12, 16, 1.0, 0.8),
    Level(12, 16, 1.0, 0.6),
    Level(16, 24, 1.0, 0.4),
    Level(24, 24, 1.0, 0.4),
    Level(24, 24, 1.5, 0.4),
    Level(24, 32, 2.0, 0.3),
    Level(32, 24, 1.5, 0.3),
    Level(40, 32, 2.0, 0.2),
    Level(48, 40, 2.5, 0.15),
    Level(56, 48, 4.0, 0.1),
    Level(72, 72, 6.0, 0.07),
)
"""Settings to measure besides levels of the ladder, coarse to fine. They are close to the best of 280 settings on the
slotted plate."""

LADDER_LEVELS = (0, 2, 4, 6)
"""Levels of the ladder that are measured."""

NODAL_STEPS = (1.0e-6, 0.5e-6)
"""Time steps of the paper's literal scheme [s]."""

QUANTILES = (0.5, 0.9, 1.0)
QUOTED = 0.9
MEASURED_TIME = 1.0
"""Shortest total time of measuring the speed of a setting [s]."""
SHORTEST_RUN = 0.3
"""Shortest time of the last run of a setting [s]."""
SINGLES = 10.0
"""Shortest time of the last run of a setting, as a multiple of that of a single hit. It makes preparation negligible
and fills a GPU. The hits are repeated if they are too few for this."""


class Answer(NamedTuple):
    """What the study compares: status and residual velocity [m/s] of shape [hits], tilt [rad] of [hits, stand-offs]."""

    status: NDArray[np.int8]
    residual_velocity: Array
    tilt: Array


@dataclass(frozen=True)
class Converged:
    """The converged answer, and its changes from level to level.

    Attributes:
        answer: the answer of the finest level.
        settled: whether the status is the same in all runs of all levels, shape [hits].
        changes: of each quantity from the answer of the level before, SI and radians, shape [levels, hits] or [levels,
            hits, stand-offs]; NaN on the first level and for hits that are not settled.
    """

    answer: Answer
    settled: NDArray[np.bool_]
    changes: dict[str, Array]


def study(
    campaign: Campaign,
    *,
    hits: int = 512,
    device: str = "auto",
    progress: Progress | None = None,
    settings: Mapping[str, Numerics] | None = None,
    levels: Sequence[Level] = LEVELS,
) -> xarray.Dataset:
    """Measure error and speed of settings of the numerics on a campaign's scene.

    Args:
        hits: how many hits, spread evenly over the campaign's cell.
        device: "auto" (CUDA if there is one, else CPU), "cpu", "cuda:0", …
        progress: called with (hits done, all hits); their ratio is the finished share of the estimated work.
        settings: settings to measure, by name, each fixing a resolution; None for levels of the ladder, a sweep and
            the literal scheme (`default_settings`).
        levels: levels of the converged answer, at least two, coarse to fine.

    Returns:
        The Dataset of results/dataset.py with dimensions setting, quantile, standoff, level and hit.

    Raises:
        DeviceError: the device is absent.
        CampaignError: the campaign has bursts.
    """
    if campaign.burst is not None:
        raise CampaignError(
            "got a burst, but a study measures hits on fresh plates: leave out the table [burst]; the first hit of a "
            "burst has the errors of such a hit"
        )
    settings = default_settings(campaign, hits) if settings is None else settings
    bench = _Bench(campaign, hits, device, progress or (lambda done, total: None))
    pairs = [(spelt_out(_doubled(level), campaign), spelt_out(level, campaign)) for level in levels]
    bench.expect([*settings.values(), *(numerics for pair in pairs for numerics in pair)])
    measured = [bench.measure(numerics) for numerics in settings.values()]
    truth = converged([(bench.compute(double)[0], bench.compute(single)[0]) for double, single in pairs])
    rates = np.array([rate for _, rate in measured])
    values = _numerics_values(campaign, settings) | _error_values([answer for answer, _ in measured], truth)
    values |= _converged_values(truth) | {
        v.SETTING: list(settings),
        v.QUANTILE: np.array(QUANTILES),
        v.STUDY_LEVEL: [label(campaign, numerics) for _, numerics in pairs],
        v.STANDOFF: np.array(campaign.output.standoffs),
        v.HIT_Y: bench.shots.hit_y,
        v.HIT_Z: bench.shots.hit_z,
        v.HITS_PER_SECOND: rates,
    }
    quoted = QUANTILES.index(QUOTED)
    for name in v.STUDIED:
        errors = values[v.ERRORS[name]][:, quoted].reshape(len(rates), -1)[:, -1]  # at the last stand-off
        values[v.FRONTS[name]] = front(rates, errors).astype(np.int8)
    return study_dataset(
        values,
        {
            attr.TITLE: campaign.title,
            attr.HISTORY: attr.history_line("study"),
            attr.CAMPAIGN: campaign.text,
            **attr.versions(),
            attr.DEVICE: f"{bench.device.alias} ({bench.device.name})",
            attr.SEED: campaign.hits.seed,
            attr.STANDOFF_POINT: campaign.output.standoff_point,
        },
    )


def default_settings(campaign: Campaign, hits: int = 512) -> dict[str, Numerics]:
    """Levels of the ladder by their numbers; the sweep and, where it knows all of the scene, the literal scheme, by
    their settings."""
    levels = {f"level {level}": Numerics(level=level) for level in LADDER_LEVELS}
    sweep = [spelt_out(setting, campaign) for setting in SWEEP]
    nodal = {f"nodal, {step * 1e6:.3g} µs": Numerics(scheme="nodal", time_step=step) for step in NODAL_STEPS}
    swept = levels | {label(campaign, numerics): numerics for numerics in sweep}
    try:
        prepare(*_compared(campaign, hits), next(iter(nodal.values())))
    except ValueError:  # layers, a depth of weakening, a distance
        return swept
    return swept | nodal


def _compared(campaign: Campaign, hits: int) -> tuple[Scene, Shots]:
    """The scene with what every scheme computes, and shots spread over the campaign's cell."""
    plain = campaign.scene.record.model_copy(update={"bending": False})  # the literal scheme computes no bending
    core = campaign.core if campaign.core.strength is None else campaign.core.model_copy(update={"strength": None})
    spread = Hits(count=hits, seed=campaign.hits.seed, replicates=1)
    shots = make_shots(campaign.impact, spread, campaign.plate, campaign.scatter)
    return campaign.scene.model_copy(update={"core": core, "record": plain}), shots


def spelt_out(level: Level, campaign: Campaign) -> Numerics:
    """Numerics with the settings of a level that is none of the ladder."""
    return Numerics(
        patches_axial=level.patches_axial,
        patches_around=level.patches_around,
        grid_spacing=campaign.plate.degradation_length / level.cells_per_length,
        travel=level.travel,
    )


def label(campaign: Campaign, numerics: Numerics) -> str:
    """Patches, cells per degradation length and time step as one short name."""
    resolution = _resolution(campaign, numerics)
    cells = campaign.plate.degradation_length / resolution.grid_spacing
    step = _time_step(campaign, resolution)
    return f"{resolution.patches_axial}×{resolution.patches_around}, ℓ/{cells:.3g}, {step * 1e6:.3g} µs"


def _resolution(campaign: Campaign, numerics: Numerics) -> Resolution:
    return resolve(campaign.scene, numerics, weakens(campaign.target))


def _time_step(campaign: Campaign, resolution: Resolution) -> float:
    """Time step at the campaign's impact velocity [s]."""
    return resolution.step_in(campaign.impact, campaign.target)


def extrapolated(double: Answer, single: Answer) -> Answer:
    """The answer without its error of first order in the time step.

    Args:
        double, single: runs with twice the time step and with the time step.
    """
    return Answer(
        single.status,
        np.maximum(2.0 * single.residual_velocity - double.residual_velocity, 0.0),
        np.maximum(2.0 * single.tilt - double.tilt, 0.0),
    )


def converged(runs: Sequence[tuple[Answer, Answer]]) -> Converged:
    """The converged answer from the levels, coarse to fine: on each a run with twice the time step and one with it."""
    statuses = np.array([run.status for pair in runs for run in pair])
    settled = (statuses == statuses[-1]).all(axis=0)
    answers = [extrapolated(*pair) for pair in runs]

    def changes(name: str) -> Array:
        moved = np.abs(np.diff([getattr(answer, name) for answer in answers], axis=0, prepend=np.nan))
        moved[:, ~settled] = np.nan
        return moved

    return Converged(answers[-1], settled, {name: changes(name) for name in v.STUDIED})


def front(rates: Array, errors: Array) -> NDArray[np.bool_]:
    """Settings that no other one beats in both speed and error; arrays of shape [settings]."""
    no_worse = (rates[:, None] >= rates) & (errors[:, None] <= errors)
    better = (rates[:, None] > rates) | (errors[:, None] < errors)
    return np.isfinite(errors) & ~(no_worse & better).any(axis=0)


class _Bench:
    """A campaign's shots on a device, ready to be computed by any numerics."""

    def __init__(self, campaign: Campaign, hits: int, device: str, progress: Progress) -> None:
        self.campaign, self.device = campaign, find_device(device)
        self.scene, self.shots = _compared(campaign, hits)
        self.progress, self.work, self.total = progress, 0.0, 0.0

    def expect(self, runs: Sequence[Numerics]) -> None:
        """Announce all runs to come, for the progress."""
        self.total = sum(self._work(numerics) for numerics in runs)

    def compute(self, numerics: Numerics) -> tuple[Answer, float]:
        """Answer, and its computing time [s]; it counts as progress."""
        work, hits = self._work(numerics), len(self.shots)

        def show(done: int, total: int) -> None:
            self.progress(int(hits * (self.work + work * done / total) / self.total), hits)

        begin = time.perf_counter()
        outcomes = self._simulate(numerics, self.shots, show)
        elapsed = time.perf_counter() - begin
        self.work += work
        return Answer(outcomes.status, outcomes.residual_velocity, outcomes.tilt), elapsed

    def measure(self, numerics: Numerics) -> tuple[Answer, float]:
        """Answer, and the highest measured hits per second; building the kernels does not count."""
        single = min(self._seconds(numerics, self.shots[:1]) for _ in range(2))  # the first time builds kernels
        shortest = max(SHORTEST_RUN, SINGLES * single)
        answer, elapsed = self.compute(numerics)
        copies, spent, best = 1, elapsed, len(self.shots) / elapsed
        while spent < MEASURED_TIME or elapsed < shortest:
            copies *= max(1, math.ceil(shortest / elapsed))
            elapsed = self._seconds(numerics, Shots.joined([self.shots] * copies))
            spent, best = spent + elapsed, max(best, copies * len(self.shots) / elapsed)
        return answer, best

    def _seconds(self, numerics: Numerics, shots: Shots) -> float:
        begin = time.perf_counter()
        self._simulate(numerics, shots, lambda done, total: None)
        return time.perf_counter() - begin

    def _work(self, numerics: Numerics) -> float:
        """Estimated work of a hit: proportional to patches times steps."""
        resolution = _resolution(self.campaign, numerics)
        return resolution.patches_axial * resolution.patches_around / _time_step(self.campaign, resolution)

    def _simulate(self, numerics: Numerics, shots: Shots, progress: Progress) -> Outcomes:
        return simulate(self.scene, shots, numerics=numerics, device=str(self.device), progress=progress)


def _doubled(level: Level) -> Level:
    """The same patches and grid with twice the time step."""
    return replace(level, travel=2.0 * level.travel)


def _numerics_values(campaign: Campaign, settings: Mapping[str, Numerics]) -> dict[str, Any]:
    """The numerics of every setting, with every default filled in."""
    resolutions = [_resolution(campaign, numerics) for numerics in settings.values()]
    values: dict[str, Any] = {
        name: np.array([getattr(resolution, name) for resolution in resolutions])
        for name in (v.PATCHES_AXIAL, v.PATCHES_AROUND, v.GRID_SPACING)
    }
    steps = [_time_step(campaign, resolution) for resolution in resolutions]
    return values | {v.SCHEME: [numerics.scheme for numerics in settings.values()], v.TIME_STEP: np.array(steps)}


def _error_values(answers: Sequence[Answer], truth: Converged) -> dict[str, Any]:
    """Errors of every setting over the settled hits whose status is that of the converged answer."""
    same = np.array([answer.status == truth.answer.status for answer in answers])

    def errors(name: str, index: int) -> Array:
        off: Array = np.abs(getattr(answers[index], name) - getattr(truth.answer, name))
        off[~(truth.settled & same[index])] = np.nan
        return off

    values: dict[str, Any] = {
        v.ERRORS[name]: np.stack([_quantiles(errors(name, index)) for index in range(len(answers))])
        for name in v.STUDIED
    }
    return values | {v.OTHER_STATUS: (truth.settled & ~same).sum(axis=1)}


def _converged_values(truth: Converged) -> dict[str, Any]:
    values: dict[str, Any] = {v.SETTLED: truth.settled.astype(np.int8), v.CONVERGED_STATUS: truth.answer.status}
    for name in v.STUDIED:
        changes = truth.changes[name]
        values[v.CONVERGED[name]] = getattr(truth.answer, name)
        values[v.UNCERTAINTIES[name]] = changes[-1]
        values[v.CHANGES[name]] = np.stack([_quantiles(change) for change in changes])
    return values


def _quantiles(errors: Array) -> Array:
    """QUANTILES over the first axis, without NaN; NaN where there is no value."""
    with warnings.catch_warnings(action="ignore", category=RuntimeWarning):  # numpy warns of a slice without values
        return np.asarray(np.nanquantile(errors, QUANTILES, axis=0))
