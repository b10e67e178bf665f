"""From designs to the measured numbers of their hits. All computing of a search is done here."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import count
from typing import Any

import numpy as np

from warpimpact.campaign.campaign import Campaign
from warpimpact.campaign.resistances import resistance_by_thickness
from warpimpact.optimisation.design import Design, FacedThreat
from warpimpact.records.group import failures
from warpimpact.records.outcomes import Outcomes
from warpimpact.results import variables as v
from warpimpact.results.dataset import narrow_table
from warpimpact.results.measures import Measure
from warpimpact.results.table import HitTable
from warpimpact.runs.executor import Job
from warpimpact.runs.levels import aim_of
from warpimpact.runs.questions import Arrays, Question, Round, packed, unpacked
from warpimpact.scene import Numerics, Scene, Shots
from warpimpact.scene.model import Array
from warpimpact.solver.limit import (
    HIGHEST_VELOCITY,
    THICKNESS_TOLERANCE,
    VELOCITY_TOLERANCE,
    Sought,
    limits,
    pilot_of_limits,
    thickest,
)
from warpimpact.solver.many import side_by_side, simulate_many
from warpimpact.solver.pilot import limits_pilot_size, pilot_size
from warpimpact.solver.simulate import pilot_of
from warpimpact.solver.worker import Worker

SAMPLER_HITS = 2**20
"""Number of hits of the sampler of a search. Far fewer are computed."""
JOBS_TOGETHER = 16
"""Number of jobs that a worker computes side by side and saves together."""
_TURNING = ("obliquity", "azimuth", "pitch", "yaw", "spin")


@dataclass(frozen=True)
class HitJob:
    """Some hits of a target by a threat.

    Attributes:
        tables: tables of the target's campaign.
        threat: number of the threat in the design file.
        first, count: first hit and number of hits. Hits of the same number are paired across designs.
        level: numerics as JSON.
        seed: seed of the hits.
        solid: whether the solid plate of equal areal density takes the place of the target.
    """

    tables: Mapping[str, Any]
    threat: int
    first: int
    count: int
    level: str
    seed: int
    solid: bool = False


@dataclass(frozen=True)
class Said:
    """The numbers of the hits of a job.

    Attributes:
        values: value of every measure that the design file asks for, shape [measures, hits]; NaN where a hit does not
            count.
        places: y and z of the hits [m], shape [2, hits].
        seconds: processor time of preparing and marching; a share of that of the jobs side by side [s].
    """

    values: Array
    places: Array
    seconds: float


def campaign_of(design: Design, tables: Mapping[str, Any], threat: FacedThreat, seed: int | None = None) -> Campaign:
    """The campaign whose hits a search computes: hits in the irreducible part of the cell, where it has one; by default
    with the seed of the search.

    Raises:
        CampaignError: the campaign is not valid.
    """
    seed = design.search.seed if seed is None else seed
    sampling = {"sampling": "sobol", "count": SAMPLER_HITS, "seed": seed, "irreducible": is_even(tables)}
    kept = {key: value for key, value in tables.get("hits", {}).items() if key == "area"}
    return design.campaign(dict(tables) | {"hits": kept | sampling}, threat)


def is_even(tables: Mapping[str, Any]) -> bool:
    """Whether the symmetries of a target depend only on plate and shot."""
    layers, impact = tables.get("layer", ()), tables.get("impact", {})
    holed = any({"pattern", "size"} & {*layer} for layer in layers)
    return not holed and not any(isinstance(impact.get(name), dict) for name in _TURNING)


Told = Callable[[float, bool], object]
"""Called with the number of jobs done, fractions included, and with whether all of them come from the disk."""


def _hits_computed(
    design: Design, jobs: Sequence[HitJob], *, worker: Worker, report: Callable[[float], object]
) -> Arrays:
    """Compute jobs side by side, `packed`. The result of a job does not depend on the other jobs."""
    scenes = [_scene_of(design, job) for job in jobs]
    limits = [
        (number, row)
        for number, job in enumerate(jobs)
        for row, key in enumerate(design.keys)
        if key.is_limit and not (job.solid and key.layer)
    ]
    steps = 1 + len(limits)
    outcomes, seconds = _marched([job.level for job in jobs], scenes, worker, lambda share: report(share / steps))
    said = []
    needed = {v.STATUS, v.STOPPED_IN, *(name for measure in design.keys for name in measure.quantity.of)}
    for outcome, (_, scene, shots) in zip(outcomes, scenes, strict=True):
        table = narrow_table(scene, shots, outcome, needed)
        places = np.array([shots.hit_y, shots.hit_z])
        said.append(Said(said_of(design, table), places, seconds / len(jobs)))
    ended = count(1)

    def limit(which: int, share: Worker, _: Any) -> Array:
        number, row = limits[which]
        numerics = Numerics.model_validate_json(jobs[number].level)
        values = limits_said(*scenes[number], design.keys[row], numerics, share)
        report((1 + next(ended)) / steps)
        return values

    for (number, row), values in zip(limits, side_by_side(limit, len(limits), worker), strict=True):
        said[number].values[row] = values
    return packed(said)


def _scene_of(design: Design, job: HitJob) -> tuple[Campaign, Scene, Shots]:
    campaign = campaign_of(design, job.tables, design.threats[job.threat], job.seed)
    faced = campaign.solid() if job.solid else campaign
    return campaign, faced.scene, faced.sampler().shots(job.first, job.count)


def _marched(
    levels: Sequence[str],
    scenes: Sequence[tuple[Campaign, Scene, Shots]],
    worker: Worker,
    told: Callable[[float], object],
) -> tuple[list[Outcomes], float]:
    """Outcomes of the shots of scenes, each with its numerics as JSON, and their processor time [s]; reports the share
    of the shots that are done."""
    outcomes: dict[int, Outcomes] = {}
    begin, total = time.process_time(), sum(len(shots) for *_, shots in scenes)
    for level in dict.fromkeys(levels):
        numerics = Numerics.model_validate_json(level)
        same = [number for number, each_level in enumerate(levels) if each_level == level]
        before = sum(len(scenes[number][2]) for number in outcomes)

        def progress(done: int, _: int, before: int = before) -> None:
            told((before + done) / total)

        some = simulate_many([scenes[number][1:] for number in same], numerics, worker, progress)
        outcomes |= zip(same, some, strict=True)
    return [outcomes[number] for number in range(len(scenes))], time.process_time() - begin


def said_of(design: Design, table: HitTable) -> Array:
    """The value of every measure of a design file for the hits of a table, in its display unit, shape [measures, hits];
    NaN for a measure that the table lacks, as a solid plate lacks a base."""
    said = np.full((len(design.keys), table.sizes["hit"]), np.nan)
    for row, measure in enumerate(design.keys):
        if not measure.quantity.lacking(table):
            said[row] = measure.display.factor * measure.values(table)
    return said


def level_of(design: Design, job: HitJob, worker: Worker) -> str:
    """The numerics, as JSON, that a pilot finds for a job; those of the campaign where it fixes a resolution.

    At several layers the level is chosen for the measures, as in a run (runs/levels.py).

    Args:
        job: `level` is the required fidelity unless the campaign fixes a resolution; `count` is the number of hits that
            will be computed.
    """
    campaign = campaign_of(design, job.tables, design.threats[job.threat], job.seed)
    if campaign.numerics.explicit is not None:
        return campaign.numerics.model_dump_json()
    asked = campaign.numerics.model_copy(update={"fidelity": job.level, "accuracy": None})
    shots = campaign.sampler().shots(0, pilot_size(asked.asked))
    found_levels = [limits_level(campaign, shots, key, asked, worker) for key in design.keys if key.is_limit]
    if len(found_levels) < len(design.keys):
        found_levels.append(pilot_of(campaign.scene, shots, asked, worker, aim=aim_of(campaign, job.count)).numerics)
    return max(found_levels, key=lambda numerics: numerics.level or 0).model_dump_json()


def sought_by(campaign: Campaign, scene: Scene, key: Measure) -> Sought:
    """The limit behind a measure, with the tolerance of `warpimpact limit`."""
    if key.name == "limit_velocity":
        return Sought("velocity", VELOCITY_TOLERANCE, HIGHEST_VELOCITY)
    layer = key.layer or 0
    highest = thickest(scene, layer)
    curve = resistance_by_thickness(campaign, layer, highest)
    return Sought("thickness", THICKNESS_TOLERANCE, highest, layer, curve)


def limits_said(
    campaign: Campaign, scene: Scene, shots: Shots, key: Measure, numerics: Numerics, worker: Worker
) -> Array:
    """The values of a measure of limits, in its display unit, shape [shots]; NaN where the computation failed."""
    sought = sought_by(campaign, scene, key)
    limits_found = limits(scene, shots, sought, numerics, worker)
    value = np.minimum(limits_found.value, sought.highest)
    value = np.where(failures(limits_found.outcomes.status), np.nan, value)
    if key.name == "limit_areal_density":
        layer = scene.target.layers[sought.layer]
        value = scene.target.areal_density + layer.areal_density * (value / layer.thickness - 1.0)
    return np.asarray(key.display.factor * key.counted(value))


def limits_level(campaign: Campaign, shots: Shots, key: Measure, numerics: Numerics, worker: Worker) -> Numerics:
    """The numerics that a pilot finds for a limit."""
    some = shots[: limits_pilot_size(numerics.asked)]
    sought = sought_by(campaign, campaign.scene, key)
    return pilot_of_limits(campaign.scene, some, sought, numerics, worker).numerics


def hits_asked(design: Design, jobs: Sequence[HitJob], tell: Told) -> Question[list[Said]]:
    """The numbers of the hits of jobs, in their order, as a round of a question; reports how many jobs are done."""
    if not jobs:
        return []
    groups = [jobs[first : first + JOBS_TOGETHER] for first in range(0, len(jobs), JOBS_TOGETHER)]
    results = yield Round(
        [Job(_hits_computed, (design, group)) for group in groups],
        [_key(group) for group in groups],
        lambda now: tell(min(now.done * JOBS_TOGETHER, len(jobs)), now.resumed == len(groups)),
    )
    return [said for arrays in results for said in unpacked(Said, arrays)]


def levels_asked(design: Design, jobs: Sequence[HitJob], tell: Told) -> Question[list[str]]:
    """The levels that the pilots of jobs find, as a round of a question; reports how many jobs are done."""
    if not jobs:
        return []
    results = yield Round(
        [Job(_level_computed, (design, job)) for job in jobs],
        [_key([job]) for job in jobs],
        lambda now: tell(now.done, now.resumed == len(jobs)),
    )
    return [str(arrays["level"]) for arrays in results]


def _level_computed(design: Design, job: HitJob, *, worker: Worker, report: Callable[[float], object]) -> Arrays:
    return {"level": np.array(level_of(design, job, worker))}


def _key(jobs: Sequence[HitJob]) -> str:
    return hashlib.sha256(json.dumps([asdict(job) for job in jobs], default=str).encode()).hexdigest()
