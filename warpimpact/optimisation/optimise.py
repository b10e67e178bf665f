"""The search for designs: generation, evaluation, next generation; then the front by answers.

NSGA-II of pymoo asks for points, and every feasible one gets the same hits: hit k lies at the same place of its
irreducible part (common random numbers), so designs are compared shot by shot. A search selects lucky hits, so its own
numbers are biased, and its front is computed again. Other optimisers: tests/benchmarks/NOTES.md.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import xarray

from warpimpact.campaign.campaign import Campaign
from warpimpact.campaign.elements import continuum_table
from warpimpact.campaign.inputs import digest
from warpimpact.campaign.places import files_in
from warpimpact.campaign.text import as_campaign_error, parsed
from warpimpact.errors import CampaignError, OutputError
from warpimpact.measures.measure import Measure
from warpimpact.optimisation.confirmation import (
    ConfirmedTarget,
    answer_campaign,
    confirm_designs,
    confirmed_target,
    limit_of_measure,
    objectives_and_excesses,
)
from warpimpact.optimisation.design import (
    Bound,
    Design,
    Objective,
    Violation,
    read_design,
    target_weights,
    violations,
)
from warpimpact.optimisation.front import design_name, designs_folder, front_dataset, write_campaigns
from warpimpact.records.kinds import FRONT
from warpimpact.records.variables import failures
from warpimpact.results import files
from warpimpact.results.dataset import narrow_dataset
from warpimpact.runs.options import RunOptions, RunProgress
from warpimpact.runs.pipeline import Computed, Pipeline, open_pipeline
from warpimpact.runs.store import Store
from warpimpact.scene import Shots
from warpimpact.scene.model import Array
from warpimpact.scene.units import count_text
from warpimpact.solver.accuracy import PILOT_LIMITS, pilot_of, pilot_size
from warpimpact.solver.device import Worker
from warpimpact.solver.fast_law import FastLaw
from warpimpact.solver.limit import limits, pilot_of_limits
from warpimpact.solver.simulate import in_threads
from warpimpact.statistics.intervals import pseudo_values

BATCH = 16
"""Number of targets with a threat that are computed side by side and saved together."""
IDLE_GENERATIONS = 25
"""Generations without a new feasible design after which a search ends."""
SEARCH_FIDELITY = "draft"
"""Fidelity of the pilots of a search, unless the campaign fixes a resolution. Hits at several layers have the accuracy
of the campaign, as in a run."""
_PART = "designs"
"""Part of all chunks of a search."""


def optimise(
    design: Design | str | Path, store: Store | str | Path = Store(), *, options: RunOptions = RunOptions()
) -> xarray.Dataset:
    """Search the best designs: the front of the objectives, confirmed by the answers of its designs.

    Args:
        design: the design, or its file.
        store: result file, as in `run_to_file`; campaigns and results of the confirmed designs go into
            `designs_folder(store.path)`. A complete search that is resumed writes the campaigns that are missing, and
            confirms its designs anew if other hits by finite elements are wanted. By default nothing is written.
        options: where to compute; the progress counts designs. A campaign that was changed is kept, with a warning.

    Returns:
        The Dataset of front.py: every computed design, and the confirmed ones.

    Raises:
        CampaignError: the file has a value that is not allowed, no design keeps the constraints, or finite elements are
            wanted of a target without a material of theirs.
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
                search = _Search(design, pipeline)
                search.compute()
                values, law = np.array([*map(np.frombuffer, search.results)]), np.array([*search.results.values()])
                attributes = pipeline.computer.made_by | search.counts
                dataset = _confirmed(design, values, law, store, options).assign_attrs(attributes)
                if store.path is None:
                    return dataset
                pipeline.write(Computed([dataset]), store)
        assert store.path is not None
        dataset, overwrite = files.read(store.path, FRONT).to_dataset(), store.overwrite
        if dataset.attrs["element_hits"] != (design.continuum_hits or 0):
            values, law = dataset["value"].values, dataset["law_result"].values
            confirmed = _confirmed(design, values, law, store, options)
            dataset = files.with_meanings(confirmed.assign_attrs(dataset.attrs | confirmed.attrs))
            files.write(dataset, store.path)
            overwrite = True  # a campaign may be that of another design now
        write_campaigns(design, dataset, designs_folder(store.path), overwrite=overwrite, warn=options.warn)
        return dataset


def _confirmed(design: Design, values: Array, law: Array, store: Store, options: RunOptions) -> xarray.Dataset:
    """The Dataset of a search whose designs have these values and goals by the fast law, with answers."""
    folder = None if store.path is None else designs_folder(store.path)
    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)

    def answer(tables: dict[str, Any], name: str, words: str) -> ConfirmedTarget:
        def follow(now: RunProgress) -> None:
            text = f"{name}, {now.done} of {count_text(now.total, 'hit')}"
            options.progress(RunProgress(len(values), len(values), text=text))

        own = replace(options, progress=follow)
        return confirmed_target(design, tables, name, words, replace(store, path=folder), own)

    def confirm(place: int, number: int) -> ConfirmedTarget:
        of = values[number]
        return answer(design.tables(of), design_name(place), design.space.text(of))

    confirmed, goals = confirm_designs(design, values, law, confirm)
    references = [
        answer(reference.tables(design.base), f"reference_{place:02d}", reference.name)
        for place, reference in enumerate(design.file.references)
    ]
    return front_dataset(design, values, law, goals, confirmed, references)


def _content(design: Design) -> dict[str, Any]:
    """What determines every bit of a search; finite elements confirm its designs, whenever they were found."""
    content: dict[str, Any] = json.loads(json.dumps(parsed(design.text, design.name), default=str))
    paths = {name: design.folder / name for name in files_in(content)}
    content.get("search", {}).pop("elements", None)
    content.get("continuum", {}).pop("hits", None)
    return content | {"files": {name: digest(path) for name, path in paths.items() if path.is_file()}}


class _Search:
    """A search. What it computes are chunks, numbered alike each time it runs; those of an earlier search are taken.

    Attributes:
        results: objectives and bounds of the computed designs, shape [goals], by the bytes of their values.
        refused: violations of the designs that break a constraint, by the same.
        pilots: numerics that pilots have given, by alternative and threat.
        idle: generations since the last new design.
    """

    def __init__(self, design: Design, pipeline: Pipeline) -> None:
        self._design, self._pipeline = design, pipeline
        self.results, self.refused = dict[bytes, Array](), dict[bytes, list[Violation]]()
        self.pilots, self.idle, self._begun = dict[tuple[str, int], FastLaw](), 0, 0

    @property
    def counts(self) -> dict[str, int]:
        """Numbers of the designs that break a constraint, and of pilots."""
        return {"refused_designs": len(self.refused), "pilots": len(self.pilots)}

    def compute(self) -> None:
        """Search, and refuse before anything is computed what could not be confirmed."""
        design, plan = self._design, self._design.file.search
        _check_references(design)
        if design.space.size <= plan.designs:
            points = design.space.points()
            for first in range(0, len(points), plan.population):
                self._compute(points[first : first + plan.population])
        else:
            self._evolve()
        if not self.results:
            raise CampaignError(f"{design.name}: {_why_none([*self.refused.values()])}")

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
        if new and not self.results:
            _check_elements(design, next(iter(new.values()))[0])
        targets = [tables for tables, _ in new.values()]
        columns = self._hits(targets, names)
        for (key, (_, weights)), of_target in zip(new.items(), columns, strict=True):
            self.results[key] = np.array([law_goal(design, weights, of_target, goal) for goal in design.goals])

    def _hits(self, targets: Sequence[dict[str, Any]], names: Sequence[str]) -> Array:
        """Numbers of the hits of targets, shape [targets, threats, columns, hits].

        Args:
            names: targets of the same name share the pilot of the first one.
        """
        design, hits, threats = self._design, self._design.file.search.hits, range(len(self._design.file.threats))
        if not design.columns:
            return np.empty((len(targets), len(threats), 0, 1))
        keys = [(name, threat) for name in names for threat in threats]
        jobs = [(tables, threat) for tables in targets for threat in threats]
        new = {key: job for key, job in [*zip(keys, jobs, strict=True)][::-1] if key not in self.pilots}
        words = "choosing the resolution"
        for key, pilot in zip(new, self._computed(pilot_numerics, [*new.values()], words), strict=True):
            self.pilots[key] = FastLaw.model_validate_json(pilot.attrs["numerics"])
        with_numerics = [(*job, self.pilots[key]) for job, key in zip(jobs, keys, strict=True)]
        batches = [(with_numerics[start : start + BATCH], hits) for start in range(0, len(jobs), BATCH)]
        parts = self._computed(hit_columns, batches, "computing designs")
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


def _check_references(design: Design) -> None:
    """Refuse references that are no campaign, or that finite elements cannot compute."""
    for reference in design.file.references:
        with as_campaign_error(f'{design.name}: the reference "{reference.name}": '):
            tables = reference.tables(design.base)
            design.campaign(tables)
            _check_elements(design, tables)


def _check_elements(design: Design, tables: dict[str, Any]) -> None:
    """Refuse a target that finite elements shall confirm and cannot compute."""
    if design.continuum_hits:
        continuum_table(answer_campaign(design, tables))


def law_goal(design: Design, weights: Mapping[str, float], columns: Array, goal: Objective | Bound) -> float:
    """A goal by the hits of a search; NaN if none counts.

    Args:
        weights: masses per area of the target.
        columns: numbers of every hit by each threat, shape [threats, columns, hits].
    """
    measure = goal.spec
    if measure.kind == "target":
        return weights[measure.name]
    numbers = columns[:, design.columns.index(measure.column)]
    if measure.kind == "quantile":  # of Harrell and Davis, a smooth function of the hits (statistics/intervals.py)
        numbers = np.array([pseudo_values(of_hits, measure.share) for of_hits in numbers])
    elif not measure.is_binary:
        numbers = np.array([measure.averaged(measure.counted(of_hits)) for of_hits in numbers])
    means = np.array([known_mean(of_hits) for of_hits in numbers])
    if goal.threats == "mean":
        return float(np.average(means, weights=[threat.weight for threat in design.file.threats]))
    return float(means[np.argmax(np.nan_to_num(goal.sign * means, nan=np.inf))])


def known_mean(numbers: Array) -> float:
    """Mean of the numbers that count; NaN if none does."""
    known = numbers[~np.isnan(numbers)]
    return float(known.mean()) if len(known) else float("nan")


def _why_none(refused: list[list[Violation]]) -> str:
    """A sentence about the constraint that rules out most of the designs."""
    by_name = Counter(name for broken in refused for name in dict.fromkeys(one[0] for one in broken))
    name, count = by_name.most_common(1)[0]
    _, nearest = min((share, text) for broken in refused for constraint, share, text in broken if constraint == name)
    most = f"{count} break {name}, and the nearest of them has {nearest}"
    return f"constraints: none of {count_text(len(refused), 'design')} keeps all; {most}"


def hit_columns(
    design: Design, jobs: Sequence[tuple[Any, int, FastLaw]], hits: int, *, worker: Worker, report: Any
) -> xarray.Dataset:
    """Compute targets side by side: numbers of their hits, shape [jobs, columns, hits].

    Args:
        jobs: tables of a target, number of a threat, and numerics. A result does not depend on the other jobs.
    """
    campaigns = [design.campaign(tables, threat) for tables, threat, _ in jobs]
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


def _limits(campaign: Campaign, shots: Shots, measure: Measure, numerics: FastLaw, worker: Worker) -> Array:
    """The values of a measure of limits, in its display unit, shape [shots]; NaN where the computation failed."""
    spec, target = limit_of_measure(campaign, measure), campaign.scene.target
    searched = limits(campaign.scene, shots, spec, numerics, worker)
    value = np.where(failures(searched.outcomes.status), np.nan, np.minimum(searched.value, spec.highest))
    if measure.name == "limit_areal_density":
        layer = target.layers[spec.layer]
        value = target.areal_density + layer.areal_density * (value / layer.thickness - 1.0)
    return np.asarray(measure.display.factor * measure.counted(value))


def pilot_numerics(
    design: Design, tables: dict[str, Any], threat: int, *, worker: Worker, report: Any
) -> xarray.Dataset:
    """The numerics that a pilot finds, unless the campaign fixes the resolution."""
    campaign = design.campaign(tables, threat)
    levels = [campaign.numerics]
    if campaign.numerics.explicit is None:
        numerics = campaign.numerics.model_copy(update={"fidelity": SEARCH_FIDELITY, "accuracy": None})
        scene, shots = campaign.scene, campaign.sampler().shots(0, pilot_size(numerics.required))
        some = shots[: pilot_size(numerics.required, PILOT_LIMITS)]
        specs = [limit_of_measure(campaign, measure) for measure in design.columns if measure.is_limit]
        levels = [numerics.at_level(pilot_of_limits(scene, some, spec, numerics, worker).level) for spec in specs]
        if len(specs) < len(design.columns):
            of_hits = numerics if len(scene.target.layers) == 1 else campaign.numerics
            levels.append(of_hits.at_level(pilot_of(scene, shots, of_hits, worker).level))
    finest = max(levels, key=lambda numerics: numerics.level or 0)
    return xarray.Dataset(attrs={"numerics": finest.model_dump_json()})
