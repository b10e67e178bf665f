"""The search: NSGA-II of pymoo asks for points, and every feasible one gets the same hits.

The front is confirmed with fresh hits: a search selects lucky hits, so its own numbers are biased. Other optimisers:
tests/benchmarks/NOTES.md.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from importlib.util import find_spec
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from warpimpact.campaign.text import CampaignError
from warpimpact.optimisation.design import Design
from warpimpact.optimisation.evaluate import HitJob, Report, columns_of, levels_of
from warpimpact.optimisation.objectives import (
    Candidate,
    Violation,
    excesses,
    results_of,
    to_minimise,
    violations,
    weights_of,
)
from warpimpact.runs.questions import Question
from warpimpact.scene.model import Array

IDLE = 25
"""Generations without a new feasible design after which a search ends."""
SEARCH_FIDELITY, CONFIRM_FIDELITY = "draft", "standard"
"""Fidelity of the pilots of a search and of its front, unless the campaign fixes a resolution."""


class SearchProgress(NamedTuple):
    """The progress of a search.

    Attributes:
        done, total: numbers of designs, first of the search, where `total` is the most, then of those with fresh hits.
        front: designs on the front.
        what: words for what is being computed.
    """

    done: int
    total: int
    front: int
    what: str


Follow = Callable[[SearchProgress], object]


class Searched(NamedTuple):
    """A search that has ended.

    Attributes:
        candidates: all computed designs, in the order of computing.
        front: numbers of the designs on the front, sorted by the first objective.
        refused: number of designs that broke a constraint and were not computed.
        pilots: number of pilots.
    """

    candidates: tuple[Candidate, ...]
    front: NDArray[np.int64]
    refused: int
    pilots: int


def search(design: Design, follow: Follow) -> Question[Searched]:
    """Search until the budget of designs is computed, or there are no others.

    Raises:
        CampaignError: no design keeps the constraints; the message names the constraint that rules them out.
    """
    state, plan = _State(design, follow), design.search
    if design.space.size <= plan.designs:
        points = design.space.points()
        for first in range(0, len(points), plan.population):
            yield from state.compute(points[first : first + plan.population])
    else:
        optimiser = Optimiser(design)
        while len(state.candidates) < plan.designs and state.idle < IDLE and (points := optimiser.ask()):
            yield from state.compute(points)
            optimiser.tell(*state.scores(points))
    if not state.candidates:
        raise CampaignError(f"{design.name}: {_why_none(list(state.refused.values()))}")
    state.tell("", complete=True)
    candidates = tuple(state.candidates.values())
    return Searched(candidates, front_of(design, candidates), len(state.refused), len(state.pilots))


@dataclass
class _State:
    """The state of a search.

    Attributes:
        candidates: computed designs, by their points.
        refused: violations of the designs that break a constraint.
        pilots: levels, by alternatives and number of the threat.
        idle: generations since the last new design.
        front: as in `SearchProgress`.
    """

    design: Design
    follow: Follow
    candidates: dict[bytes, Candidate] = field(default_factory=dict)
    refused: dict[bytes, tuple[Violation, ...]] = field(default_factory=dict)
    pilots: dict[tuple[bytes, int], str] = field(default_factory=dict)
    idle: int = 0
    front: int = 0

    def compute(self, points: Iterable[Array]) -> Question[None]:
        """Compute the new feasible points among these, as far as the budget goes."""
        new: dict[bytes, Candidate] = {}
        for point in points:
            key = point.tobytes()
            if key in self.candidates or key in self.refused:
                continue
            if len(self.candidates) + len(new) == self.design.search.designs:
                break
            tables = self.design.tables(point)
            campaign, broken = violations(self.design, tables)
            if campaign is None or broken:
                self.refused[key] = broken
            else:
                new[key] = Candidate(point, tables, weights_of(campaign.target))
        self.idle = 0 if new else self.idle + 1
        levels = yield from self._levels(list(new.values()))
        for key, of_threats in zip(list(new), levels, strict=True):
            new[key] = replace(new[key], levels=of_threats)
        yield from self._hits(new)

    def _hits(self, new: dict[bytes, Candidate]) -> Question[None]:
        design, plan, threats = self.design, self.design.search, range(len(self.design.threats))
        jobs = [
            HitJob(candidate.tables, threat, plan.hits, candidate.levels[threat], plan.seed)
            for candidate in (new.values() if design.columns else ())
            for threat in threats
        ]
        report = lambda done: self.tell(f"{len(new)} designs, {done / len(jobs):.0%}")  # noqa: E731
        columns = yield from columns_of(design, jobs, report)
        for number, (key, candidate) in enumerate(new.items()):
            of_threats = np.array(columns[number * len(threats) : (number + 1) * len(threats)])
            self.candidates[key] = replace(candidate, results=results_of(design, candidate.weights, of_threats))
        self.front = len(front_of(design, tuple(self.candidates.values())))
        self.tell("")

    def _levels(self, new: Sequence[Candidate]) -> Question[list[tuple[str, ...]]]:
        """Numerics of designs for every threat, from the pilot of the first design of the same alternatives."""
        if not self.design.columns:
            return [() for _ in new]
        is_choice, plan = [bool(variable.labels) for variable in self.design.space.variables], self.design.search
        threats = range(len(self.design.threats))
        keys = [[(one.point[is_choice].tobytes(), threat) for threat in threats] for one in new]
        jobs = {
            key: HitJob(one.tables, key[1], plan.hits, SEARCH_FIDELITY, plan.seed)
            for one, of_threats in reversed(list(zip(new, keys, strict=True)))
            for key in of_threats
            if key not in self.pilots
        }
        report = lambda done: self.tell(f"{done:.0f} of {len(jobs)} pilots")  # noqa: E731
        levels = yield from levels_of(self.design, list(jobs.values()), report)
        self.pilots |= zip(jobs, levels, strict=True)
        return [tuple(self.pilots[key] for key in of_threats) for of_threats in keys]

    def scores(self, points: Sequence[Array]) -> tuple[Array, Array]:
        """Objectives to minimise and violations of the points of a generation."""
        objectives, broken = [], []
        for point in points:
            candidate = self.candidates.get(point.tobytes())
            if candidate is None:
                shares = [violation.share for violation in self.refused.get(point.tobytes(), ())]
                objectives.append(np.zeros(len(self.design.objectives)))
                broken.append([sum(shares), *np.zeros(len(self.design.bounds))])
            else:
                objectives.append(np.nan_to_num(to_minimise(self.design, candidate.results), posinf=1e30))
                broken.append([0.0, *excesses(self.design, candidate.results)])
        return np.array(objectives), np.array(broken)

    def tell(self, what: str, *, complete: bool = False) -> None:
        """Report the progress of the search, and what is being computed."""
        done = len(self.candidates)
        total = done if complete else int(min(self.design.search.designs, self.design.space.size))
        self.follow(SearchProgress(done, total, self.front, what))


def _why_none(refused: Sequence[Sequence[Violation]]) -> str:
    """A sentence about the constraint that rules out most of the designs."""
    name = Counter(violation.constraint for broken in refused for violation in broken).most_common(1)[0][0]
    of_it = (violation for broken in refused for violation in broken if violation.constraint == name)
    nearest = min(of_it, key=lambda violation: violation.share)
    return f"constraints: none of {len(refused)} designs keeps {name}; the nearest has {nearest.text}"


def front_of(design: Design, candidates: Sequence[Candidate]) -> NDArray[np.int64]:
    """Numbers of the designs within the bounds that no other one dominates, sorted by the first objective; the first of
    designs that agree in seven digits."""
    import moocore

    points = [to_minimise(design, candidate.results) for candidate in candidates]
    within = [
        number
        for number, (point, candidate) in enumerate(zip(points, candidates, strict=True))
        if np.isfinite(point).all() and not excesses(design, candidate.results).any()
    ]
    if not within:
        return np.zeros(0, dtype=np.int64)
    rounded = np.array([[float(f"{number:.7g}") for number in points[place]] for place in within])
    front = np.array(within)[moocore.is_nondominated(rounded)]
    return np.array(sorted(front, key=lambda number: tuple(points[number])), dtype=np.int64)


@dataclass(frozen=True)
class Confirmed:
    """The front by fresh hits.

    Attributes:
        numbers: numbers of its designs in the search.
        candidates: its designs, then the references, with fresh hits.
        columns: numbers of their hits, shape [candidates, threats, columns, hits].
        on_front: whether each design is still on the front and within the bounds by fresh hits.
    """

    numbers: NDArray[np.int64]
    candidates: tuple[Candidate, ...]
    columns: Array
    on_front: NDArray[np.bool_]


def confirm(design: Design, searched: Searched, follow: Follow) -> Question[Confirmed]:
    """Compute the front and the references with fresh hits at the standard fidelity."""
    numbers = spread(searched.front, design.search.confirmed)
    targets = [searched.candidates[number] for number in numbers] + references(design)
    seed, count = fresh_seed(design), design.search.confirm_hits if design.columns else 1
    threats = len(design.threats)

    def report(what: str) -> Report:
        return lambda done: follow(SearchProgress(int(done / threats), len(targets), len(searched.front), what))

    jobs = [
        HitJob(target.tables, threat, count, CONFIRM_FIDELITY, seed)
        for target in (targets if design.columns else ())
        for threat in range(threats)
    ]
    levels = yield from levels_of(design, jobs, report("pilots for fresh hits"))
    jobs = [replace(job, level=level) for job, level in zip(jobs, levels, strict=True)]
    found = yield from columns_of(design, jobs, report("fresh hits"))
    columns = np.array(found).reshape(len(targets), threats, len(design.columns), count)
    candidates = [
        replace(
            target,
            levels=tuple(levels[number * threats : (number + 1) * threats]),
            results=results_of(design, target.weights, of_target),
        )
        for number, (target, of_target) in enumerate(zip(targets, columns, strict=True))
    ]
    on_front = np.isin(np.arange(len(numbers)), front_of(design, candidates[: len(numbers)]))
    return Confirmed(numbers, tuple(candidates), columns, on_front)


def spread(front: NDArray[np.int64], most: int) -> NDArray[np.int64]:
    """At most `most` designs at even distances along a front, including both ends."""
    places = np.linspace(0, len(front) - 1, min(most, len(front)))
    return np.asarray(front[np.round(places).astype(np.int64)])


def fresh_seed(design: Design) -> int:
    """Seed of hits that the search has not computed."""
    return int(np.random.SeedSequence(design.search.seed, spawn_key=(24,)).generate_state(1)[0] >> 1)


def references(design: Design) -> list[Candidate]:
    """The reference targets, before their hits are computed.

    Raises:
        CampaignError: a reference is no campaign; the message names it.
    """
    targets = []
    for place, reference in enumerate(design.references):
        tables: dict[str, Any] = dict(design.base) | {"plate": dict(reference.plate)}
        if reference.layer is not None:
            tables["layer"] = [dict(layer) for layer in reference.layer]
        try:
            campaign = design.campaign(tables)
        except CampaignError as error:
            text = str(error).removeprefix(f"{design.name}: ")
            raise CampaignError(f'{design.name}: references[{place}] "{reference.name}": {text}') from None
        targets.append(Candidate(np.zeros(0), tables, weights_of(campaign.target)))
    return targets


def check_installed() -> None:
    """Refuse a search if a library that it needs is missing.

    Raises:
        CampaignError: the message names the library.
    """
    for library in ("pymoo", "moocore"):
        if find_spec(library) is None:
            raise CampaignError(f"a search needs {library}: pip install 'warpimpact[optimise]'")


class Optimiser:
    """Points of a space, a generation at a time. They depend on the seed and on the results of earlier points."""

    def __init__(self, design: Design) -> None:
        from pymoo.algorithms.moo.nsga2 import NSGA2
        from pymoo.core.mixed import MixedVariableDuplicateElimination, MixedVariableMating, MixedVariableSampling
        from pymoo.core.problem import Problem
        from pymoo.core.termination import NoTermination

        self._space = design.space
        self._names = [f"{number:03d}" for number in range(len(design.space.variables))]
        kinds = {name: _kind(variable) for name, variable in zip(self._names, design.space.variables, strict=True)}
        self._problem = Problem(vars=kinds, n_obj=len(design.objectives), n_ieq_constr=1 + len(design.bounds))
        duplicates = MixedVariableDuplicateElimination()
        self._algorithm = NSGA2(
            pop_size=design.search.population,
            sampling=MixedVariableSampling(),
            mating=MixedVariableMating(eliminate_duplicates=duplicates),
            eliminate_duplicates=duplicates,
        )
        self._algorithm.setup(self._problem, termination=NoTermination(), seed=design.search.seed, verbose=False)
        self._population: Any = None

    def ask(self) -> list[Array]:
        """The next points; empty if there are no others."""
        self._population = self._algorithm.ask()
        if self._population is None or not len(self._population):
            return []
        return [self._space.at([float(one[name]) for name in self._names]) for one in self._population.get("X")]

    def tell(self, objectives: Array, broken: Array) -> None:
        """Tell the results of these points.

        Args:
            objectives: to minimise, shape [points, objectives].
            broken: positive where a constraint is violated, shape [points, constraints].
        """
        from pymoo.core.evaluator import Evaluator
        from pymoo.problems.static import StaticProblem

        Evaluator().eval(StaticProblem(self._problem, F=objectives, G=broken), self._population)
        self._algorithm.tell(infills=self._population)


def _kind(variable: Any) -> Any:
    from pymoo.core.variable import Choice, Integer, Real

    if variable.labels:
        return Choice(options=list(range(len(variable.labels))))
    return Real(bounds=(0.0, 1.0)) if variable.count is None else Integer(bounds=(0, variable.count - 1))
