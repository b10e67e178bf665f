"""From designs to the numbers of their hits. All computing of a search is done here."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
import xarray

from warpimpact.campaign.campaign import Campaign
from warpimpact.campaign.evidence import resistance_by_thickness
from warpimpact.optimisation.design import Design
from warpimpact.optimisation.objectives import goal_numbers, mean_of
from warpimpact.records.variable import failures
from warpimpact.results import variables as v
from warpimpact.results.dataset import narrow_dataset
from warpimpact.results.measures import Measure
from warpimpact.runs.chunks import Chunks
from warpimpact.runs.computer import Computer
from warpimpact.scene import Numerics, Shots
from warpimpact.scene.model import Array
from warpimpact.solver.accuracy import PILOT_LIMITS, pilot_size
from warpimpact.solver.device import Worker
from warpimpact.solver.limit import (
    HIGHEST_VELOCITY,
    THICKNESS_TOLERANCE,
    VELOCITY_TOLERANCE,
    LimitSpec,
    limits,
    pilot_of_limits,
    thickest,
)
from warpimpact.solver.simulate import in_threads, pilot_of, simulate_many

BATCH = 16
"""Number of hit jobs that are computed side by side and saved together."""


@dataclass(frozen=True)
class DesignPoint:
    """A target, before or after its hits are computed.

    Attributes:
        values: values of the variables, shape [variables]; empty for a reference.
        tables: tables of its campaign.
        weights: masses per area [kg/m²], by the names of the measures (results/measures.py).
        numerics: numerics for every threat, as JSON.
        results: objectives and bounds, shape [goals]; NaN where no hit counts.
    """

    values: Array
    tables: dict[str, Any]
    weights: Mapping[str, float]
    numerics: tuple[str, ...] = ()
    results: Array = field(default_factory=lambda: np.zeros(0))


Report = Callable[[float], object]
"""Called with the share that is done."""
Job = tuple[dict[str, Any], int, str]
"""Tables of a target, number of a threat, and numerics as JSON; for a pilot, its fidelity."""


class Evaluator:
    """Computes the hits of designs, except those in the chunks of an earlier search.

    Attributes:
        pilots: numerics that pilots have given, as JSON, by fidelity, alternative and threat.
    """

    def __init__(self, design: Design, machine: Computer, chunks: Chunks) -> None:
        self.design, self.made_by = design, machine.made_by
        self.pilots = dict[tuple[str, str, int], str]()
        self._machine, self._chunks, self._begun = machine, chunks, 0

    def evaluate(
        self,
        points: Sequence[DesignPoint],
        alternatives: Sequence[str],
        fidelity: str,
        hits: int,
        seed: int,
        report: Callable[[str, float], object],
    ) -> tuple[list[DesignPoint], Array]:
        """Designs with their results, and the numbers of their hits, shape [designs, threats, columns, hits].

        Args:
            alternatives: a name of each design. Designs of the same name share the pilot of the first one.
            fidelity: of the pilots.
            report: called with "pilots" or "designs", and the share of them that is done.
        """
        design, threats = self.design, range(len(self.design.file.threats))
        counted = [*zip(points, alternatives, strict=True)] if design.columns else []
        keys = [(fidelity, name, threat) for _, name in counted for threat in threats]
        targets = [(point.tables, threat) for point, _ in counted for threat in threats]
        first = dict[tuple[str, str, int], Job]()
        for key, target in zip(keys, targets, strict=True):
            if key not in self.pilots:
                first.setdefault(key, (*target, fidelity))
        pilots = self._computed(_pilot_level, [(job, seed) for job in first.values()], partial(report, "pilots"))
        self.pilots |= zip(first, (str(pilot.attrs["numerics"]) for pilot in pilots), strict=True)
        jobs = [(*target, self.pilots[key]) for key, target in zip(keys, targets, strict=True)]
        batches = [(jobs[start : start + BATCH], hits, seed) for start in range(0, len(jobs), BATCH)]
        parts = self._computed(_hit_columns, batches, partial(report, "designs"))
        shape = len(points), len(threats), len(design.columns), hits if jobs else 1
        columns = np.array([of_job for part in parts for of_job in part["columns"].values]).reshape(shape)
        evaluated = []
        for number, (point, of_point) in enumerate(zip(points, columns, strict=True)):
            numerics = tuple(level for _, _, level in jobs[number * len(threats) : (number + 1) * len(threats)])
            means = [mean_of(goal_numbers(design, point.weights, of_point, goal)[0]) for goal in design.goals]
            evaluated.append(replace(point, numerics=numerics, results=np.array(means)))
        return evaluated, columns

    def _computed(
        self,
        function: Callable[..., xarray.Dataset],
        tasks: Sequence[tuple[Any, ...]],
        report: Report,
    ) -> list[xarray.Dataset]:
        """Results of tasks. Those of a search have the same numbers each time it runs, and so have their chunks."""
        numbers = range(self._begun, self._begun + len(tasks))
        self._begun += len(tasks)
        done = {number: saved for number in numbers if (saved := self._chunks.load(number)) is not None}
        missing = [(n, (self.design, *task)) for n, task in zip(numbers, tasks, strict=True) if n not in done]

        def tick(parts: Sequence[float] = ()) -> None:
            report((len(done) + sum(parts)) / max(1, len(tasks)))

        tick()
        for number, dataset in self._machine.map(function, missing, tick):
            self._chunks.save(number, dataset)
            done[number] = dataset
            tick()
        return [done[number] for number in numbers]


def _hit_columns(
    design: Design,
    jobs: Sequence[Job],
    hits: int,
    seed: int,
    *,
    worker: Worker,
    report: Report,
) -> xarray.Dataset:
    """Compute jobs side by side. The result of a job does not depend on the other jobs."""
    campaigns = [design.campaign(tables, threat, seed) for tables, threat, _ in jobs]
    numerics = [Numerics.model_validate_json(level) for _, _, level in jobs]
    shots = [campaign.sampler().shots(0, hits) for campaign in campaigns]
    needed = {v.STATUS, v.STOPPED_IN, *(name for measure in design.columns for name in measure.quantity.of)}
    columns = np.full((len(jobs), len(design.columns), hits), np.nan)
    for level in dict.fromkeys(level for _, _, level in jobs):
        same = [number for number, job in enumerate(jobs) if job[2] == level]
        scenes = [(campaigns[number].scene, shots[number]) for number in same]

        def progress(now: int, total: int) -> None:
            report(0.9 * now / total)

        marched = simulate_many(scenes, numerics[same[0]], worker, progress)
        for number, (scene, of_job), outcomes in zip(same, scenes, marched, strict=True):
            table = narrow_dataset(scene, of_job, outcomes, needed)
            columns[number] = [_column(measure, table) for measure in design.columns]
    searches = [(number, row) for number in range(len(jobs)) for row, one in enumerate(design.columns) if one.is_limit]

    def search(which: int, share: Worker) -> Array:
        number, row = searches[which]
        return _limits(campaigns[number], shots[number], design.columns[row], numerics[number], share)

    for (number, row), values in zip(searches, in_threads(search, len(searches), worker), strict=True):
        columns[number, row] = values
    return xarray.Dataset({"columns": (("job", "column", "hit"), columns)})


def _column(measure: Measure, table: Any) -> Array:
    """A measure of every hit in its display unit; NaN where the table lacks it, as before a search of limits."""
    if measure.quantity.lacking(table):
        return np.full(table.sizes["hit"], np.nan)
    return np.asarray(measure.display.factor * measure.values(table))


def _limit_spec(campaign: Campaign, measure: Measure) -> LimitSpec:
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
    spec, target = _limit_spec(campaign, measure), campaign.scene.target
    searched = limits(campaign.scene, shots, spec, numerics, worker)
    value = np.where(failures(searched.outcomes.status), np.nan, np.minimum(searched.value, spec.highest))
    if measure.name == "limit_areal_density":
        layer = target.layers[spec.layer]
        value = target.areal_density + layer.areal_density * (value / layer.thickness - 1.0)
    return np.asarray(measure.display.factor * measure.counted(value))


def _pilot_level(design: Design, job: Job, seed: int, *, worker: Worker, report: Report) -> xarray.Dataset:
    """The numerics that a pilot finds, unless the campaign fixes the resolution."""
    tables, threat, fidelity = job
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
