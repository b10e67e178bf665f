"""The search for designs: generation, evaluation, next generation; then the front by fresh hits.

NSGA-II of pymoo asks for points, and every feasible one gets the same hits. A search selects lucky hits, so its own
numbers are biased, and its front is computed again. Other optimisers: tests/benchmarks/NOTES.md.
"""

from __future__ import annotations

import json
import warnings
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from contextlib import nullcontext
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import xarray
from numpy.typing import NDArray

from warpimpact.campaign.places import files_in
from warpimpact.campaign.text import CampaignError, parsed
from warpimpact.optimisation.design import Design, read_design
from warpimpact.optimisation.evaluate import DesignPoint, Evaluator
from warpimpact.optimisation.front import check_folder, folder_of, to_dataset, write_campaigns
from warpimpact.optimisation.objectives import Violation, excesses, to_minimise, violations, weights_of
from warpimpact.results import attributes as attr
from warpimpact.results import files
from warpimpact.results import front as f
from warpimpact.results.kinds import FRONT
from warpimpact.runs.chunks import digest, is_begun, open_chunks
from warpimpact.runs.computer import Computer, computer
from warpimpact.scene.model import Array

IDLE = 25
"""Generations without a new feasible design after which a search ends."""
SEARCH_FIDELITY, CONFIRM_FIDELITY = "draft", "standard"
"""Fidelity of the pilots of a search and of its front, unless the campaign fixes a resolution."""


Progress = Callable[[int, int, str], object]
"""Called with numbers of designs, done and in all, and with words for the front and what is being computed."""


def optimise(
    design: Design | str | Path,
    output: Path | None = None,
    *,
    device: str | Computer = "auto",
    resume: bool = False,
    overwrite: bool = False,
    progress: Progress = lambda done, total, text: None,
    warn: Callable[[str], object] = warnings.warn,
) -> xarray.Dataset:
    """Search the best designs: the front of the objectives, computed again with fresh hits.

    Args:
        design: the design, or its file.
        output: result file; the campaigns of the front go into `folder_of(output)`. By default nothing is written.
        device: "auto" (CUDA if there is one, else the CPU), "cpu", "cuda:0", or an open computer.
        resume: continue an interrupted search; of a complete one, write the campaigns that are missing.
        overwrite: replace an existing result with its campaigns, and begin anew in place of an unfinished search.
        warn: called with a sentence for damaged chunks, which are computed again, and for each changed campaign, which
            is kept.

    Returns:
        The Dataset of results/front.py: every computed design, and the front by fresh hits.

    Raises:
        CampaignError: the file has a value that is not allowed, or no design keeps the constraints.
        DeviceError: the device is absent.
        OutputError: a file cannot be written, must not be overwritten or belongs to another search.
        Interrupted: the user interrupted the search; what is saved can be resumed.
    """
    design = design if isinstance(design, Design) else read_design(design)
    if missing := [library for library in ("pymoo", "moocore") if find_spec(library) is None]:
        raise CampaignError(f"a search needs {missing[0]}: pip install 'warpimpact[optimise]'")
    if output is not None:
        check_folder(folder_of(output), overwrite=overwrite or (resume and is_begun(output)))
    tables = json.loads(json.dumps(parsed(design.text, design.name), default=str))
    named = {file: design.folder / file for file in files_in(tables)}
    content = {**tables, "files": {file: digest(path) for file, path in named.items() if path.is_file()}}
    with (
        computer(device) if isinstance(device, str) else nullcontext(device) as machine,
        open_chunks(output, content | machine.made_by, resume=resume, overwrite=overwrite, warn=warn) as chunks,
    ):
        if chunks is not None:
            dataset = _search(design, Evaluator(design, machine, chunks), progress)
            if output is not None:
                files.write(dataset.assign_attrs({attr.FINGERPRINT: chunks.fingerprint}), output)
    if output is not None:
        dataset = files.read(output, FRONT)
        write_campaigns(design, dataset, folder_of(output), overwrite=overwrite, warn=warn)
    return dataset


def _search(design: Design, evaluator: Evaluator, progress: Progress) -> xarray.Dataset:
    """The search, and its front by fresh hits."""
    references = reference_points(design)  # refused before anything is computed
    search, plan = Search(evaluator, progress), design.file.search
    if design.space.size <= plan.designs:
        points = design.space.points()
        for first in range(0, len(points), plan.population):
            search.compute(points[first : first + plan.population])
    else:
        _evolve(search, design)
    if not search.points:
        raise CampaignError(f"{design.name}: {_why_none([*search.refused.values()])}")
    every, front, pilots = [*search.points.values()], search.front, len(evaluator.pilots)
    numbers = front[np.round(np.linspace(0, len(front) - 1, min(plan.confirmed, len(front)))).astype(np.int64)]
    chosen = [every[number] for number in numbers] + references
    progress(len(every), len(every), f"{len(front)} on the front")

    def report(what: str, share: float) -> None:
        progress(int(share * len(chosen)), len(chosen), f"{len(front)} on the front, {what} by fresh hits")

    unique, hits = [str(place) for place in range(len(chosen))], plan.confirm_hits
    confirmed, columns = evaluator.evaluate(chosen, unique, CONFIRM_FIDELITY, hits, design.fresh_seed, report)
    still = np.isin(np.arange(len(numbers)), front_of(design, confirmed[: len(numbers)]))
    attributes = evaluator.made_by | {f.REFUSED: len(search.refused), f.PILOTS: pilots}
    return to_dataset(design, every, front, numbers, confirmed, columns, still, attributes)


class Search:
    """The state of a search.

    Attributes:
        points: computed designs, by their values.
        refused: violations of the designs that break a constraint.
        idle: generations since the last new design.
        front: numbers of the designs on the front, sorted by the first objective.
    """

    def __init__(self, evaluator: Evaluator, progress: Progress) -> None:
        self._design, self._evaluator, self._progress = evaluator.design, evaluator, progress
        self.points, self.refused = dict[bytes, DesignPoint](), dict[bytes, tuple[Violation, ...]]()
        self.idle, self.front = 0, np.zeros(0, dtype=np.int64)

    def compute(self, generation: Iterable[Array]) -> None:
        """Compute the new feasible points of a generation, as far as the budget goes."""
        design, plan, new = self._design, self._design.file.search, dict[bytes, DesignPoint]()
        for values in generation:
            key = values.tobytes()
            if key in self.points or key in self.refused:
                continue
            if len(self.points) + len(new) == plan.designs:
                break
            tables = design.tables(values)
            campaign, broken = violations(design, tables)
            if campaign is None or broken:
                self.refused[key] = broken
            else:
                new[key] = DesignPoint(values, tables, weights_of(campaign.target))
        self.idle = 0 if new else self.idle + 1
        total = int(min(plan.designs, design.space.size))

        def report(what: str, share: float) -> None:
            self._progress(len(self.points), total, f"{len(self.front)} on the front, {what} {share:.0%}")

        is_choice = [bool(variable.labels) for variable in design.space.variables]
        names, hits = [str(point.values[is_choice]) for point in new.values()], plan.hits
        points, _ = self._evaluator.evaluate([*new.values()], names, SEARCH_FIDELITY, hits, plan.seed, report)
        self.points |= zip(new, points, strict=True)
        self.front = front_of(design, [*self.points.values()])
        report("designs", 1.0)

    def scores(self, generation: Iterable[Array]) -> tuple[Array, Array]:
        """Objectives to minimise and violations of the points of a generation."""
        objectives, broken, file = [], [], self._design.file
        for values in generation:
            if (point := self.points.get(values.tobytes())) is not None:
                objectives.append(np.nan_to_num(to_minimise(self._design, point.results), posinf=1e30))
                broken.append([0.0, *excesses(self._design, point.results)])
            else:
                shares = [violation.share for violation in self.refused.get(values.tobytes(), ())]
                objectives.append(np.zeros(len(file.objectives)))
                broken.append([sum(shares), *np.zeros(len(file.bounds))])
        return np.array(objectives), np.array(broken)


def _evolve(search: Search, design: Design) -> None:
    """Compute generations of NSGA-II until the budget is spent, or no other designs come."""
    from pymoo.algorithms.moo.nsga2 import NSGA2
    from pymoo.core.evaluator import Evaluator as PymooEvaluator
    from pymoo.core.mixed import MixedVariableDuplicateElimination, MixedVariableMating, MixedVariableSampling
    from pymoo.core.problem import Problem
    from pymoo.core.termination import NoTermination
    from pymoo.core.variable import Choice, Integer, Real
    from pymoo.problems.static import StaticProblem

    plan, kinds = design.file.search, dict[str, Any]()
    for number, variable in enumerate(design.space.variables):  # coordinates of `DesignVariable.at`
        if variable.labels:
            kinds[f"{number:03d}"] = Choice(options=list(range(len(variable.labels))))
        elif variable.count is None:
            kinds[f"{number:03d}"] = Real(bounds=(0.0, 1.0))
        else:
            kinds[f"{number:03d}"] = Integer(bounds=(0, variable.count - 1))
    problem = Problem(vars=kinds, n_obj=len(design.file.objectives), n_ieq_constr=1 + len(design.file.bounds))
    duplicates = MixedVariableDuplicateElimination()
    algorithm = NSGA2(
        pop_size=plan.population,
        sampling=MixedVariableSampling(),
        mating=MixedVariableMating(eliminate_duplicates=duplicates),
        eliminate_duplicates=duplicates,
    )
    algorithm.setup(problem, termination=NoTermination(), seed=plan.seed, verbose=False)
    while len(search.points) < plan.designs and search.idle < IDLE:
        population = algorithm.ask()
        if population is None or not len(population):
            return
        generation = [design.space.at([float(one[name]) for name in kinds]) for one in population.get("X")]
        search.compute(generation)
        objectives, broken = search.scores(generation)
        PymooEvaluator().eval(StaticProblem(problem, F=objectives, G=broken), population)
        algorithm.tell(infills=population)


def reference_points(design: Design) -> list[DesignPoint]:
    """The reference targets, before their hits are computed.

    Raises:
        CampaignError: a reference is no campaign; the message names it.
    """
    points = []
    for place, reference in enumerate(design.file.references):
        tables: dict[str, Any] = {**design.base, "plate": reference.plate}
        if reference.layer is not None:
            tables["layer"] = [*reference.layer]
        named = replace(design, name=f'{design.name}: references[{place}] "{reference.name}"')
        points.append(DesignPoint(np.zeros(0), tables, weights_of(named.campaign(tables).target)))
    return points


def _why_none(refused: Sequence[Sequence[Violation]]) -> str:
    """A sentence about the constraint that rules out most of the designs."""
    counts = Counter(name for broken in refused for name in {violation.constraint for violation in broken})
    name, count = counts.most_common(1)[0]
    of_it = (violation for broken in refused for violation in broken if violation.constraint == name)
    nearest = min(of_it, key=lambda violation: violation.share).text
    if count == len(refused):
        return f"constraints: none of {count} designs keeps {name}; the nearest has {nearest}"
    return (
        f"constraints: none of {len(refused)} designs keeps all; {count} break {name}, and the nearest of them has "
        f"{nearest}"
    )


def front_of(design: Design, points: Sequence[DesignPoint]) -> NDArray[np.int64]:
    """Numbers of the designs within the bounds that no other one dominates, sorted by the first objective.

    Of designs that agree in seven digits the first counts.
    """
    import moocore

    objectives = [to_minimise(design, point.results) for point in points]
    within = [
        number
        for number, (values, point) in enumerate(zip(objectives, points, strict=True))
        if np.isfinite(values).all() and not excesses(design, point.results).any()
    ]
    if not within:
        return np.zeros(0, dtype=np.int64)
    rounded = np.array([[float(f"{number:.7g}") for number in objectives[place]] for place in within])
    front = np.array(within)[moocore.is_nondominated(rounded)]
    return np.array(sorted(front, key=lambda number: tuple(objectives[number])), dtype=np.int64)
