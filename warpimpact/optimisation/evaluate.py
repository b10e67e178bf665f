"""From designs to the numbers of their hits. All computing of a search is done here."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import count
from typing import Any

import numpy as np

from warpimpact.campaign.campaign import Campaign
from warpimpact.campaign.resistances import resistance_by_thickness
from warpimpact.optimisation.design import Design
from warpimpact.records.variable import failures
from warpimpact.results import variables as v
from warpimpact.results.dataset import narrow_dataset
from warpimpact.results.measures import Measure
from warpimpact.runs.executor import Job
from warpimpact.runs.questions import Arrays, Question, Round
from warpimpact.scene import Numerics, Shots
from warpimpact.scene.model import Array
from warpimpact.solver.accuracy import PILOT_LIMITS, pilot_size
from warpimpact.solver.limit import (
    HIGHEST_VELOCITY,
    THICKNESS_TOLERANCE,
    VELOCITY_TOLERANCE,
    LimitSpec,
    limits,
    pilot_of_limits,
    thickest,
)
from warpimpact.solver.many import side_by_side, simulate_many
from warpimpact.solver.simulate import pilot_of
from warpimpact.solver.worker import Worker

JOBS_TOGETHER = 16
"""Number of jobs that a worker computes side by side and saves together."""


@dataclass(frozen=True)
class HitJob:
    """The hits of a target by a threat.

    Attributes:
        tables: tables of the target's campaign.
        threat: number of the threat in the design file.
        count: number of hits. Hits of the same number are paired across designs.
        level: numerics as JSON.
        seed: seed of the hits.
    """

    tables: Mapping[str, Any]
    threat: int
    count: int
    level: str
    seed: int


Report = Callable[[float], object]
"""Called with the number of jobs done, fractions included."""


def columns_of(design: Design, jobs: Sequence[HitJob], report: Report) -> Question[list[Array]]:
    """`Design.columns` of the hits of jobs, each of shape [columns, hits], as a round of a question."""
    results = yield from _results(_columns_computed, design, jobs, JOBS_TOGETHER, report)
    return [columns for arrays in results for columns in arrays.values()]


def levels_of(design: Design, jobs: Sequence[HitJob], report: Report) -> Question[list[str]]:
    """The levels that the pilots of jobs find, as a round of a question."""
    results = yield from _results(_level_computed, design, jobs, 1, report)
    return [str(arrays["level"]) for arrays in results]


def _results(
    compute: Callable[..., Arrays], design: Design, jobs: Sequence[HitJob], together: int, report: Report
) -> Question[list[Arrays]]:
    """The results of jobs, of which some are computed together."""
    if not jobs:
        return []
    groups = [jobs[first : first + together] for first in range(0, len(jobs), together)]
    keys = [
        hashlib.sha256(json.dumps([asdict(job) for job in group], default=str).encode()).hexdigest() for group in groups
    ]
    work = [Job(compute, (design, group)) for group in groups]
    return (yield Round(work, keys, lambda done, _: report(min(done * together, len(jobs)))))


def _columns_computed(
    design: Design, jobs: Sequence[HitJob], *, worker: Worker, report: Callable[[float], object]
) -> Arrays:
    """Compute jobs side by side. The result of a job does not depend on the other jobs."""
    campaigns = [design.campaign(job.tables, job.threat, job.seed) for job in jobs]
    shots = [campaign.sampler().shots(0, job.count) for campaign, job in zip(campaigns, jobs, strict=True)]
    searches = [
        (number, row) for number in range(len(jobs)) for row, measure in enumerate(design.columns) if measure.is_limit
    ]
    steps, total, done = 1 + len(searches), sum(map(len, shots)), 0
    needed = {v.STATUS, v.STOPPED_IN, *(name for measure in design.columns for name in measure.quantity.of)}
    columns: dict[int, Array] = {}
    for level in dict.fromkeys(job.level for job in jobs):
        same = [number for number, job in enumerate(jobs) if job.level == level]
        scenes = [(campaigns[number].scene, shots[number]) for number in same]

        def progress(now: int, _: int, before: int = done) -> None:
            report((before + now) / total / steps)

        marched = simulate_many(scenes, Numerics.model_validate_json(level), worker, progress)
        for number, (scene, of_job), outcomes in zip(same, scenes, marched, strict=True):
            table = narrow_dataset(scene, of_job, outcomes, needed)
            columns[number] = np.array([_column(measure, table) for measure in design.columns])
        done += sum(len(of_job) for _, of_job in scenes)
    ended = count(1)

    def search(which: int, share: Worker, _: Any) -> Array:
        number, row = searches[which]
        numerics = Numerics.model_validate_json(jobs[number].level)
        found = _limits(campaigns[number], shots[number], design.columns[row], numerics, share)
        report((1 + next(ended)) / steps)
        return found

    for (number, row), found in zip(searches, side_by_side(search, len(searches), worker), strict=True):
        columns[number][row] = found
    return {str(number): columns[number] for number in range(len(jobs))}


def _column(measure: Measure, table: Any) -> Array:
    """A measure of every hit of a table in its display unit; NaN where the table lacks it, as before a search of
    limits."""
    if measure.quantity.lacking(table):
        return np.full(table.sizes["hit"], np.nan)
    return np.asarray(measure.display.factor * measure.values(table))


def _limit_of(campaign: Campaign, measure: Measure) -> LimitSpec:
    """The limit behind a measure, with the tolerance of `warpimpact limit`."""
    if measure.name == "limit_velocity":
        return LimitSpec("velocity", VELOCITY_TOLERANCE, HIGHEST_VELOCITY)
    layer = measure.layer or 0
    highest = thickest(campaign.scene, layer)
    return LimitSpec(
        "thickness", THICKNESS_TOLERANCE, highest, layer, resistance_by_thickness(campaign, layer, highest)
    )


def _limits(campaign: Campaign, shots: Shots, measure: Measure, numerics: Numerics, worker: Worker) -> Array:
    """The values of a measure of limits, in its display unit, shape [shots]; NaN where the computation failed."""
    limit, target = _limit_of(campaign, measure), campaign.scene.target
    found = limits(campaign.scene, shots, limit, numerics, worker)
    value = np.where(failures(found.outcomes.status), np.nan, np.minimum(found.value, limit.highest))
    if measure.name == "limit_areal_density":
        layer = target.layers[limit.layer]
        value = target.areal_density + layer.areal_density * (value / layer.thickness - 1.0)
    return np.asarray(measure.display.factor * measure.counted(value))


def _level_computed(
    design: Design, jobs: Sequence[HitJob], *, worker: Worker, report: Callable[[float], object]
) -> Arrays:
    """The level that a pilot finds for one job, whose `level` is the fidelity, unless the campaign fixes the
    resolution."""
    (job,) = jobs
    campaign = design.campaign(job.tables, job.threat, job.seed)
    found = [campaign.numerics]
    if campaign.numerics.explicit is None:
        numerics = campaign.numerics.model_copy(update={"fidelity": job.level, "accuracy": None})
        scene, shots = campaign.scene, campaign.sampler().shots(0, pilot_size(numerics.asked))
        some = shots[: pilot_size(numerics.asked, PILOT_LIMITS)]
        searched = [_limit_of(campaign, measure) for measure in design.columns if measure.is_limit]
        found = [pilot_of_limits(scene, some, limit, numerics, worker).numerics for limit in searched]
        if len(searched) < len(design.columns):
            found.append(pilot_of(scene, shots, numerics, worker).numerics)
    return {"level": np.array(max(found, key=lambda numerics: numerics.level or 0).model_dump_json())}
