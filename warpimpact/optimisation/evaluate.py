"""From designs to their goals: what a search computes, and objectives and bounds from the numbers of the hits.

Goals are means of the numbers of hits. Hit k of every design lies at the same place of its irreducible part (common
random numbers), so designs are compared shot by shot.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray
from numpy.typing import NDArray

from warpimpact.campaign.campaign import Campaign
from warpimpact.optimisation.design import Bound, Design, Objective
from warpimpact.records.variable import failures
from warpimpact.results import variables as v
from warpimpact.results.dataset import narrow_dataset
from warpimpact.results.measures import Measure
from warpimpact.runs.compute import limit_spec
from warpimpact.scene import Numerics, Shots
from warpimpact.scene.model import Array
from warpimpact.solver.accuracy import PILOT_LIMITS, pilot_size
from warpimpact.solver.device import Worker
from warpimpact.solver.limit import LimitSpec, limits, pilot_of_limits
from warpimpact.solver.prepare import prepare
from warpimpact.solver.simulate import computed, in_threads, pilot_of
from warpimpact.statistics.comparisons import ROUNDED
from warpimpact.statistics.intervals import estimate_of, pseudo_values

SCRAMBLINGS = 16
"""Number of scramblings of the hits of a search: hit k belongs to scrambling k modulo this number."""


def hit_columns(
    design: Design, jobs: Sequence[tuple[Any, int, Numerics]], hits: int, seed: int, *, worker: Worker, report: Any
) -> xarray.Dataset:
    """Compute targets side by side: numbers of their hits, shape [jobs, columns, hits].

    Args:
        jobs: tables of a target, number of a threat, and numerics. A result does not depend on the other jobs.
    """
    campaigns = [design.campaign(tables, threat, seed) for tables, threat, _ in jobs]
    shots = [campaign.sampler().shots(0, hits) for campaign in campaigns]
    marched = [measure for measure in design.columns if not measure.is_limit]
    needed = {v.STATUS, v.STOPPED_IN, *(name for measure in marched for name in measure.quantity.of)}

    def compute(number: int, share: Worker) -> list[Array]:
        campaign, of_job, numerics = campaigns[number], shots[number], jobs[number][2]
        columns: dict[Measure, Array] = {}
        if marched:
            outcomes = computed(prepare(campaign.scene, of_job, numerics), share)
            table = narrow_dataset(campaign.scene, of_job, outcomes, needed)
            there = [measure for measure in marched if not measure.quantity.lacking(table)]
            columns = {measure: measure.display.factor * measure.values(table) for measure in there}
        for measure in (measure for measure in design.columns if measure.is_limit):
            columns[measure] = _limits(campaign, of_job, measure, numerics, share)
        return [columns.get(measure, np.full(hits, np.nan)) for measure in design.columns]

    columns = np.array(in_threads(compute, len(jobs), worker))
    return xarray.Dataset({"columns": (("job", "column", "hit"), columns)})


def _limit_spec(campaign: Campaign, measure: Measure) -> LimitSpec:
    """The limit behind a measure, with the tolerance of `warpimpact limit`."""
    quantity = "velocity" if measure.name == "limit_velocity" else "thickness"
    return limit_spec(campaign, quantity, measure.layer or 0)


def _limits(campaign: Campaign, shots: Shots, measure: Measure, numerics: Numerics, worker: Worker) -> Array:
    """The values of a measure of limits, in its display unit, shape [shots]; NaN where the computation failed."""
    spec, target = _limit_spec(campaign, measure), campaign.scene.target
    searched = limits(campaign.scene, shots, spec, numerics, worker)
    value = np.where(failures(searched.outcomes.status), np.nan, np.minimum(searched.value, spec.highest))
    if measure.name == "limit_areal_density":
        layer = target.layers[spec.layer]
        value = target.areal_density + layer.areal_density * (value / layer.thickness - 1.0)
    return np.asarray(measure.display.factor * measure.counted(value))


def pilot_numerics(
    design: Design, tables: dict[str, Any], threat: int, fidelity: str, seed: int, *, worker: Worker, report: Any
) -> xarray.Dataset:
    """The numerics that a pilot finds, unless the campaign fixes the resolution."""
    campaign = design.campaign(tables, threat, seed)
    levels = [campaign.numerics]
    if campaign.numerics.explicit is None:
        numerics = campaign.numerics.model_copy(update={"fidelity": fidelity, "accuracy": None})
        scene, shots = campaign.scene, campaign.sampler().shots(0, pilot_size(numerics.required))
        some = shots[: pilot_size(numerics.required, PILOT_LIMITS)]
        specs = [_limit_spec(campaign, measure) for measure in design.columns if measure.is_limit]
        levels = [pilot_of_limits(scene, some, spec, numerics, worker).numerics for spec in specs]
        if len(specs) < len(design.columns):
            levels.append(pilot_of(scene, shots, numerics, worker).numerics)
    finest = max(levels, key=lambda numerics: numerics.level or 0)
    return xarray.Dataset(attrs={"numerics": finest.model_dump_json()})


def goal_numbers(
    design: Design, weights: Mapping[str, float], columns: Array, goal: Objective | Bound
) -> tuple[Array, str]:
    """Numbers whose mean is a goal, shape [hits], and the threat that they are of; "" if of all threats, or of none.

    Args:
        weights: masses per area of the target.
        columns: numbers of every hit by each threat, shape [threats, columns, hits].
    """
    measure, threats = goal.spec, design.file.threats
    if measure.kind == "target":
        return np.array([weights[measure.name]]), ""
    numbers = columns[:, design.columns.index(measure.column)]
    if measure.kind == "quantile":  # of Harrell and Davis, a smooth function of the hits (statistics/intervals.py)
        numbers = np.array([pseudo_values(of_hits, measure.share) for of_hits in numbers])
    elif not measure.is_binary:
        numbers = np.array([measure.averaged(measure.counted(of_hits)) for of_hits in numbers])
    if goal.threats == "mean":
        shares = np.array([threat.weight for threat in threats])
        return np.asarray(shares @ numbers / shares.sum()), ""
    signed = goal.sign * np.array([known_mean(of_hits) for of_hits in numbers])
    worst = int(np.argmax(np.nan_to_num(signed, nan=np.inf)))
    return np.asarray(numbers[worst]), threats[worst].name


def known_mean(numbers: Array) -> float:
    """Mean of the numbers that count; NaN if none does."""
    known = numbers[~np.isnan(numbers)]
    return float(known.mean()) if len(known) else float("nan")


def interval(design: Design, goal: Objective | Bound, numbers: Array) -> tuple[float, float, float]:
    """A goal with the ends of its interval, from `goal_numbers`."""
    if goal.spec.kind == "target":
        return (float(numbers[0]),) * 3
    is_share = goal.spec.is_binary and (goal.threats == "worst" or len(design.file.threats) == 1)
    estimate = estimate_of("share" if is_share else "mean", numbers, replicates=SCRAMBLINGS)
    return estimate.value, estimate.low, estimate.high


def objectives_and_excesses(design: Design, results: Array) -> tuple[Array, Array]:
    """Objectives to minimise, and by how much each bound is exceeded, of designs with these goals, shape [designs, …].

    An objective is infinite where no hit counts. An excess is a share of the limit, 0 where the bound is kept to
    rounding, and 1 where no hit counts.
    """
    signed, count = np.array([goal.sign for goal in design.goals]) * results, len(design.file.objectives)
    limits = np.array([bound.sign * bound.limit for bound in design.file.bounds])
    shares = np.nan_to_num((signed[:, count:] - limits) / np.where(limits, np.abs(limits), 1.0), nan=1.0)
    objectives = np.nan_to_num(signed[:, :count], nan=np.inf, posinf=np.inf, neginf=-np.inf)
    return objectives, np.where(shares > ROUNDED, shares, 0.0)


def nondominated(design: Design, results: Array) -> NDArray[np.int64]:
    """Numbers of the designs within the bounds that no other one dominates, sorted by the first objective.

    Of designs that agree in seven digits the first counts.
    """
    import moocore

    objectives, excesses = objectives_and_excesses(design, results)
    within = np.flatnonzero(np.isfinite(objectives).all(axis=1) & ~excesses.any(axis=1))
    if not len(within):
        return within
    rounded = np.array([[float(f"{number:.7g}") for number in row] for row in objectives[within]])
    front = within[moocore.is_nondominated(rounded)]
    return np.asarray(front[np.lexsort(objectives[front].T[::-1])])
