"""The search for designs: generation, evaluation, next generation; then the front by fresh hits.

NSGA-II of pymoo asks for points, and every feasible one gets the same hits: hit k lies at the same place of its
irreducible part (common random numbers), so designs are compared shot by shot. A search selects lucky hits, so its own
numbers are biased, and its front is computed again. Other optimisers: tests/benchmarks/NOTES.md.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import xarray

from warpimpact.campaign.campaign import Campaign
from warpimpact.campaign.places import files_in
from warpimpact.campaign.text import as_campaign_error, parsed
from warpimpact.errors import CampaignError, OutputError
from warpimpact.measures.measure import Measure
from warpimpact.optimisation.design import Design, Violation, read_design, target_weights, violations
from warpimpact.optimisation.front import (
    correct_front,
    designs_folder,
    front_dataset,
    goal_numbers,
    known_mean,
    nondominated,
    objectives_and_excesses,
    write_campaigns,
)
from warpimpact.records.kinds import FRONT
from warpimpact.records.variables import failures
from warpimpact.results import files
from warpimpact.results.dataset import narrow_dataset
from warpimpact.runs.compute import digest, limit_spec
from warpimpact.runs.options import RunOptions, RunProgress
from warpimpact.runs.pipeline import Answer, Pipeline, open_pipeline
from warpimpact.runs.store import Store
from warpimpact.scene import Shots
from warpimpact.scene.model import Array
from warpimpact.scene.units import count_text
from warpimpact.solver.accuracy import PILOT_LIMITS, pilot_of, pilot_size
from warpimpact.solver.device import Worker
from warpimpact.solver.fast_law import FastLaw
from warpimpact.solver.limit import LimitSpec, limits, pilot_of_limits
from warpimpact.solver.simulate import in_threads

BATCH = 16
"""Number of targets with a threat that are computed side by side and saved together."""
IDLE_GENERATIONS = 25
"""Generations without a new feasible design after which a search ends."""
SEARCH_FIDELITY, CONFIRM_FIDELITY = "draft", "standard"
"""Fidelity of the pilots of a search and of its front, unless the campaign fixes a resolution. Hits at several layers
have the accuracy of the campaign, as in a run."""
_PART = "designs"
"""Part of all chunks of a search."""


def optimise(
    design: Design | str | Path, store: Store | str | Path = Store(), *, options: RunOptions = RunOptions()
) -> xarray.Dataset:
    """Search the best designs: the front of the objectives, computed again with fresh hits.

    Args:
        design: the design, or its file.
        store: result file, as in `run_to_file`; campaigns of the front and its corrected maps go into
            `designs_folder(store.path)`. A complete search that is resumed writes the campaigns that are missing. By
            default nothing is written, and nothing is corrected.
        options: where to compute; the progress counts designs. A campaign that was changed is kept, with a warning.

    Returns:
        The Dataset of front.py: every computed design, and the front by fresh hits.

    Raises:
        CampaignError: the file has a value that is not allowed, or no design keeps the constraints.
        DeviceError, ClusterError: as in `RunOptions.computer`.
        OutputError, Interrupted: as in `Store.open`.
    """
    design, store = design if isinstance(design, Design) else read_design(design), Store.at(store)
    if missing := [library for library in ("pymoo", "moocore") if find_spec(library) is None]:
        raise CampaignError(f"a search needs {missing[0]}: pip install 'warpimpact[optimise]'")
    is_known = store.overwrite or (store.resume and store.is_begun)
    if store.path is not None and not is_known and any(designs_folder(store.path).glob("*")):
        raise OutputError(
            f"{designs_folder(store.path)}: contains files already; name another result or give --overwrite"
        )
    with options.opened() as options:
        with open_pipeline(store, _content(design), options) as pipeline:
            if not pipeline.chunks.is_complete:
                dataset = _Search(design, pipeline).front()
                if store.path is None:
                    return dataset
                pipeline.write(Answer([dataset]), store)
        assert store.path is not None
        dataset = files.read(store.path, FRONT).to_dataset()
        write_campaigns(design, dataset, designs_folder(store.path), overwrite=store.overwrite, warn=options.warn)
        count = design.file.search.continuum_hits
        if count and dataset.attrs.get("continuum_hits") != count:
            dataset = files.with_meanings(correct_front(design, dataset, store, options))
            files.write(dataset, store.path)
        return dataset


def _content(design: Design) -> dict[str, Any]:
    """What determines every bit of a search; finite elements correct a front, whenever it was found."""
    content: dict[str, Any] = json.loads(json.dumps(parsed(design.text, design.name), default=str))
    paths = {name: design.folder / name for name in files_in(content)}
    content.get("search", {}).pop("continuum_hits", None)
    return content | {"files": {name: digest(path) for name, path in paths.items() if path.is_file()}}


class _Search:
    """A search. What it computes are chunks, numbered alike each time it runs; those of an earlier search are taken.

    Attributes:
        results: objectives and bounds of the computed designs, shape [goals], by the bytes of their values.
        refused: violations of the designs that break a constraint, by the same.
        pilots: numerics that pilots have given, by fidelity, alternative and threat.
        idle: generations since the last new design.
    """

    def __init__(self, design: Design, pipeline: Pipeline) -> None:
        self._design, self._pipeline = design, pipeline
        self.results, self.refused = dict[bytes, Array](), dict[bytes, list[Violation]]()
        self.pilots, self.idle, self._begun = dict[tuple[str, str, int], FastLaw](), 0, 0

    def front(self) -> xarray.Dataset:
        """Search, and compute the front by fresh hits."""
        design, plan = self._design, self._design.file.search
        references = _references(design)  # refused before anything is computed
        if design.space.size <= plan.designs:
            points = design.space.points()
            for first in range(0, len(points), plan.population):
                self._compute(points[first : first + plan.population])
        else:
            self._evolve()
        if not self.results:
            raise CampaignError(f"{design.name}: {_why_none([*self.refused.values()])}")
        values, results = np.array([*map(np.frombuffer, self.results)]), np.array([*self.results.values()])
        front, pilots = nondominated(design, results), len(self.pilots)
        numbers = front[np.round(np.linspace(0, len(front) - 1, min(plan.confirmed, len(front)))).astype(np.int64)]
        targets = [*map(design.tables, values[numbers]), *references]
        unique, hits, seed = [*map(str, range(len(targets)))], plan.confirm_hits, design.fresh_seed
        columns = self._hits(targets, unique, CONFIRM_FIDELITY, hits, seed, "the front with fresh hits")
        attributes = self._pipeline.computer.made_by | {"refused_designs": len(self.refused), "pilots": pilots}
        return front_dataset(design, values, results, front, numbers, targets, columns).assign_attrs(attributes)

    def _compute(self, generation: Sequence[Array]) -> None:
        """Compute the new feasible points of a generation, as far as the budget goes."""
        design, plan = self._design, self._design.file.search
        is_choice = [bool(variable.labels) for variable in design.space.variables]
        new, names = dict[bytes, tuple[dict[str, Any], dict[str, float]]](), list[str]()
        for values in generation:
            key = values.tobytes()
            if any(key in known for known in (self.results, self.refused, new)):
                continue
            if len(self.results) + len(new) == plan.designs:
                break
            tables = design.tables(values)
            target, broken = violations(design, tables)
            if target is None or broken:
                self.refused[key] = broken
            else:
                new[key] = tables, target_weights(target)
                names.append(str(values[is_choice]))
        self.idle = 0 if new else self.idle + 1
        targets = [tables for tables, _ in new.values()]
        columns = self._hits(targets, names, SEARCH_FIDELITY, plan.hits, plan.seed, "designs")
        for (key, (_, weights)), of_target in zip(new.items(), columns, strict=True):
            numbers = [goal_numbers(design, weights, of_target, goal)[0] for goal in design.goals]
            self.results[key] = np.array([*map(known_mean, numbers)])

    def _hits(
        self, targets: Sequence[dict[str, Any]], names: Sequence[str], fidelity: str, hits: int, seed: int, what: str
    ) -> Array:
        """Numbers of the hits of targets, shape [targets, threats, columns, hits].

        Args:
            names: targets of the same name share the pilot of the first one.
            what: words for the targets.
        """
        design, threats = self._design, range(len(self._design.file.threats))
        if not design.columns:
            return np.empty((len(targets), len(threats), 0, 1))
        keys = [(fidelity, name, threat) for name in names for threat in threats]
        jobs = [(tables, threat) for tables in targets for threat in threats]
        new = {key: job for key, job in [*zip(keys, jobs, strict=True)][::-1] if key not in self.pilots}
        tasks = [(*job, fidelity, seed) for job in new.values()]
        words = f"choosing the resolution of {what}"
        for key, pilot in zip(new, self._computed(pilot_numerics, tasks, words), strict=True):
            self.pilots[key] = FastLaw.model_validate_json(pilot.attrs["numerics"])
        with_numerics = [(*job, self.pilots[key]) for job, key in zip(jobs, keys, strict=True)]
        batches = [(with_numerics[start : start + BATCH], hits, seed) for start in range(0, len(jobs), BATCH)]
        parts = self._computed(hit_columns, batches, f"computing {what}")
        columns = [of_job for part in parts for of_job in part["columns"].values]
        return np.array(columns).reshape(len(targets), len(threats), len(design.columns), hits)

    def _computed(
        self, function: Callable[..., xarray.Dataset], tasks: Sequence[tuple[Any, ...]], what: str
    ) -> list[xarray.Dataset]:
        """Results of tasks, except those in chunks."""
        numbers = range(self._begun, self._begun + len(tasks))
        self._begun += len(tasks)
        chunks, most = self._pipeline.chunks, int(min(self._design.file.search.designs, self._design.space.size))
        done = {number: saved for number in numbers if (saved := chunks.load((_PART, number))) is not None}
        missing = [((_PART, n), (self._design, *task)) for n, task in zip(numbers, tasks, strict=True) if n not in done]
        for (_, number), dataset in self._pipeline.computer.map(function, missing, save=chunks.save):
            done[number] = dataset
            text = f"{what}: {len(done) / len(tasks):.0%}"
            self._pipeline.options.progress(RunProgress(len(self.results), most, text=text))
        return [done[number] for number in numbers]

    def _evolve(self) -> None:
        """Compute generations of NSGA-II until the budget is spent, or no other designs come."""
        from pymoo.algorithms.moo.nsga2 import NSGA2
        from pymoo.core.mixed import MixedVariableDuplicateElimination, MixedVariableMating, MixedVariableSampling
        from pymoo.core.problem import Problem
        from pymoo.core.termination import NoTermination
        from pymoo.core.variable import Choice, Integer, Real

        search, design, kinds = self, self._design, dict[str, Any]()
        for number, variable in enumerate(design.space.variables):  # coordinates of `DesignVariable.at`
            if variable.labels:
                kinds[f"{number:03d}"] = Choice(options=list(range(len(variable.labels))))
            elif variable.count is None:
                kinds[f"{number:03d}"] = Real(bounds=(0.0, 1.0))
            else:
                kinds[f"{number:03d}"] = Integer(bounds=(0, variable.count - 1))

        class Designs(Problem):  # type: ignore[misc]
            def _evaluate(self, population: Any, out: dict[str, Array], *_: Any, **__: Any) -> None:
                points = [design.space.at([float(one[name]) for name in kinds]) for one in population]
                out["F"], out["G"] = search.fitness(points)

        duplicates, plan = MixedVariableDuplicateElimination(), design.file.search
        algorithm = NSGA2(
            pop_size=plan.population,
            sampling=MixedVariableSampling(),
            mating=MixedVariableMating(eliminate_duplicates=duplicates),
            eliminate_duplicates=duplicates,
        )
        problem = Designs(vars=kinds, n_obj=len(design.file.objectives), n_ieq_constr=1 + len(design.file.bounds))
        algorithm.setup(problem, termination=NoTermination(), seed=plan.seed, verbose=False)
        while len(self.results) < plan.designs and self.idle < IDLE_GENERATIONS and algorithm.has_next():
            algorithm.next()

    def fitness(self, generation: Sequence[Array]) -> tuple[Array, Array]:
        """Objectives to minimise, and how far the constraints and each bound are exceeded, shape [points, …] each."""
        self._compute(generation)
        keys = [values.tobytes() for values in generation]
        known = np.array([[key in self.results] for key in keys])
        results = np.array([self.results.get(key, np.zeros(len(self._design.goals))) for key in keys])
        objectives, excesses = objectives_and_excesses(self._design, results)
        shares = [[sum(share for _, share, _ in self.refused.get(key, ()))] for key in keys]
        finite = np.where(known, np.nan_to_num(objectives, posinf=1e30), 0.0)
        return finite, np.hstack([shares, np.where(known, excesses, 0.0)])


def _references(design: Design) -> list[dict[str, Any]]:
    """The tables of the reference targets, each checked."""
    targets = []
    for reference in design.file.references:
        targets.append(reference.tables(design.base))
        with as_campaign_error(f'{design.name}: the reference "{reference.name}": '):
            design.campaign(targets[-1])
    return targets


def _why_none(refused: list[list[Violation]]) -> str:
    """A sentence about the constraint that rules out most of the designs."""
    by_name = Counter(name for broken in refused for name in dict.fromkeys(one[0] for one in broken))
    name, count = by_name.most_common(1)[0]
    _, nearest = min((share, text) for broken in refused for constraint, share, text in broken if constraint == name)
    most = f"{count} break {name}, and the nearest of them has {nearest}"
    return f"constraints: none of {count_text(len(refused), 'design')} keeps all; {most}"


def hit_columns(
    design: Design, jobs: Sequence[tuple[Any, int, FastLaw]], hits: int, seed: int, *, worker: Worker, report: Any
) -> xarray.Dataset:
    """Compute targets side by side: numbers of their hits, shape [jobs, columns, hits].

    Args:
        jobs: tables of a target, number of a threat, and numerics. A result does not depend on the other jobs.
    """
    campaigns = [design.campaign(tables, threat, seed) for tables, threat, _ in jobs]
    shots = [campaign.sampler().shots(0, hits) for campaign in campaigns]
    marched = [measure for measure in design.columns if not measure.is_limit]

    def compute(number: int, share: Worker) -> list[Array]:
        campaign, of_job, numerics = campaigns[number], shots[number], jobs[number][2]
        columns: dict[Measure, Array] = {}
        if marched:
            outcomes = numerics.prepare(campaign.scene, of_job, share).compute()
            table = narrow_dataset(campaign.scene, of_job, outcomes)
            there = [measure for measure in marched if not measure.quantity.lacking(table)]
            columns = {measure: measure.display.factor * measure.values(table) for measure in there}
        for measure in (measure for measure in design.columns if measure.is_limit):
            columns[measure] = _limits(campaign, of_job, measure, numerics, share)
        return [columns.get(measure, np.full(hits, np.nan)) for measure in design.columns]

    columns = np.array([*in_threads(compute, len(jobs), worker)])
    return xarray.Dataset({"columns": (("job", "column", "hit"), columns)})


def _limit_spec(campaign: Campaign, measure: Measure) -> LimitSpec:
    """The limit behind a measure, with the tolerance of `warpimpact limit`."""
    quantity = "velocity" if measure.name == "limit_velocity" else "thickness"
    return limit_spec(campaign, quantity, measure.layer or 0)


def _limits(campaign: Campaign, shots: Shots, measure: Measure, numerics: FastLaw, worker: Worker) -> Array:
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
        levels = [numerics.at_level(pilot_of_limits(scene, some, spec, numerics, worker).level) for spec in specs]
        if len(specs) < len(design.columns):
            of_hits = numerics if len(scene.target.layers) == 1 else campaign.numerics
            levels.append(of_hits.at_level(pilot_of(scene, shots, of_hits, worker).level))
    finest = max(levels, key=lambda numerics: numerics.level or 0)
    return xarray.Dataset(attrs={"numerics": finest.model_dump_json()})
