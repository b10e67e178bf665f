"""Optimisers on three searches for plates: hypervolume per evaluation and per second, beside Sobol points and a grid.

Every method asks for designs in batches and is told objectives of 64 hits at level 0 of each design that keeps the
constraints, and by how much the others break them, which costs no evaluation. The hypervolume is a share of that of
the front of all designs of all methods, in the box of that front.

    python tests/benchmarks/optimisers.py            # pip install optuna pymoo; writes results/optimisers.json
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from warpimpact.optimisation.design import Design, design_from
from warpimpact.optimisation.evaluate import Job, said_by
from warpimpact.optimisation.feasible import checked
from warpimpact.optimisation.judged import Record, objectives
from warpimpact.optimisation.searcher import front_of, hypervolume
from warpimpact.optimisation.space import DesignVariable, Space

BUDGET, BATCH, SEEDS = 160, 20, (0, 1, 2)
LEVEL, HITS = '{"level": 0}', 64
CHECKOUT = Path(__file__).parents[2]
STORED = Path(__file__).with_name("results") / "optimisers.json"

_SLOTS = """
[variables]
thickness = { low = "3 mm", high = "8 mm" }
"plate.pattern.width" = { low = "3 mm", high = "8 mm" }
"plate.pattern.length" = { low = "4 mm", high = "16 mm" }
"plate.pattern.spacing.0" = { low = "5 mm", high = "14 mm" }
"plate.pattern.spacing.1" = { low = "6 mm", high = "24 mm" }
[constraints]
smallest_ligament = "1.5 mm"
"""
_MIXED = """
[variables]
thickness = { low = "3 mm", high = "8 mm", step = "0.5 mm" }
"impact.obliquity" = ["0 deg", "10 deg"]
[[variables."plate.pattern"]]
name = "slots"
shape = "slot"
width = { low = "3 mm", high = "8 mm", step = "0.5 mm" }
length = "12 mm"
spacing = [{ low = "5 mm", high = "14 mm", step = "0.5 mm" }, "16 mm"]
staggered = true
[[variables."plate.pattern"]]
name = "round"
shape = "circle"
diameter = { low = "3 mm", high = "9 mm", step = "0.5 mm" }
spacing = { low = "5 mm", high = "14 mm", step = "0.5 mm" }
staggered = true
[[variables."plate.pattern"]]
name = "squares"
shape = "square"
side = { low = "3 mm", high = "9 mm", step = "0.5 mm" }
spacing = { low = "6 mm", high = "16 mm", step = "0.5 mm" }
rotation = "45 deg"
[constraints]
smallest_ligament = "1.5 mm"
"""


def _asked(*measures: str) -> str:
    return "".join(f'[[objectives]]\nmeasure = "{measure}"\n' for measure in measures)


PROBLEMS = {
    "slots, areal density and mean proxy": _SLOTS + _asked("areal_density", "residual_energy_density"),
    "slots, areal density, proxy and P(inclined)": _SLOTS
    + _asked("areal_density", "residual_energy_density", "tilted_share"),
    "three shapes, areal density and worst tenth of the proxy": _MIXED
    + _asked("areal_density", "residual_energy_density_worst_tenth"),
}


def design_of(problem: str) -> Design:
    """A problem as a design of the bundled slotted plate."""
    campaign = (CHECKOUT / "campaigns" / "slotted_plate.toml").read_text(encoding="utf-8")
    return design_from(campaign + PROBLEMS[problem], problem, CHECKOUT / "campaigns")


Coordinates = Sequence[float]
Ask = Callable[[int], list[Coordinates]]
Tell = Callable[[list[Coordinates], np.ndarray, np.ndarray], None]
Method = Callable[[Space, int, int], tuple[Ask, Tell]]


def _unit(one: DesignVariable, share: float) -> float:
    """A coordinate from a share of the range."""
    return share if one.count is None else float(min(int(share * one.count), one.count - 1))


def sobol(space: Space, count: int, seed: int) -> tuple[Ask, Tell]:
    from scipy.stats import qmc

    points = qmc.Sobol(len(space.variables), seed=seed)
    return (
        lambda n: [[_unit(v, s) for v, s in zip(space.variables, row, strict=True)] for row in points.random(n)],
        lambda asked, found, broken: None,
    )


def grid(space: Space, count: int, seed: int) -> tuple[Ask, Tell]:
    """A grid with as many steps per variable as twice the budget fills, in random order: half of it is feasible."""
    steps = max(2, round((2 * BUDGET) ** (1.0 / len(space.variables))))
    every = np.array(list(np.ndindex(*[steps] * len(space.variables))))
    every = every[np.random.default_rng(seed).permutation(len(every))]
    rows = iter((every + 0.5) / steps)
    return (
        lambda n: [
            [_unit(v, s) for v, s in zip(space.variables, row, strict=True)]
            for row, _ in zip(rows, range(n), strict=False)
        ],
        lambda asked, found, broken: None,
    )


def pymoo_method(name: str, population: int = BATCH) -> Method:
    def method(space: Space, count: int, seed: int) -> tuple[Ask, Tell]:
        from pymoo.algorithms.moo.nsga2 import NSGA2
        from pymoo.algorithms.moo.sms import SMSEMOA
        from pymoo.core.evaluator import Evaluator
        from pymoo.core.mixed import MixedVariableDuplicateElimination, MixedVariableMating, MixedVariableSampling
        from pymoo.core.problem import Problem
        from pymoo.core.termination import NoTermination
        from pymoo.problems.static import StaticProblem

        from warpimpact.optimisation.searcher import _kind

        kinds = {f"{k:03d}": _kind(one) for k, one in enumerate(space.variables)}
        problem, again = Problem(vars=kinds, n_obj=count, n_ieq_constr=1), MixedVariableDuplicateElimination()
        algorithm = {"NSGA-II": NSGA2, "SMS-EMOA": SMSEMOA}[name](
            pop_size=population,
            n_offsprings=BATCH,
            sampling=MixedVariableSampling(),
            mating=MixedVariableMating(eliminate_duplicates=again),
            eliminate_duplicates=again,
        )
        algorithm.setup(problem, termination=NoTermination(), seed=seed, verbose=False)
        now: list[Any] = []

        def ask(n: int) -> list[Coordinates]:
            now[:] = [algorithm.ask()]
            return [[float(x[key]) for key in kinds] for x in now[0].get("X")]

        def tell(asked: list[Coordinates], found: np.ndarray, broken: np.ndarray) -> None:
            Evaluator().eval(StaticProblem(problem, F=found, G=broken[:, None]), now[0])
            algorithm.tell(infills=now[0])

        return ask, tell

    return method


def optuna_method(name: str) -> Method:
    def method(space: Space, count: int, seed: int) -> tuple[Ask, Tell]:
        import optuna

        optuna.logging.set_verbosity(optuna.logging.ERROR)
        kinds: dict[str, Any] = {}
        for k, one in enumerate(space.variables):
            if one.labels:
                kinds[f"{k:03d}"] = optuna.distributions.CategoricalDistribution(range(len(one.labels)))
            elif one.count is None:
                kinds[f"{k:03d}"] = optuna.distributions.FloatDistribution(0.0, 1.0)
            else:
                kinds[f"{k:03d}"] = optuna.distributions.IntDistribution(0, one.count - 1)
        constraint = lambda trial: (trial.user_attrs["broken"],)  # noqa: E731
        if name == "TPE":
            sampler: Any = optuna.samplers.TPESampler(
                seed=seed,
                multivariate=True,
                constant_liar=True,
                n_startup_trials=2 * BATCH,
                constraints_func=constraint,
            )
        else:
            sampler = optuna.samplers.NSGAIISampler(seed=seed, population_size=BATCH, constraints_func=constraint)
        study, now = optuna.create_study(directions=["minimize"] * count, sampler=sampler), []

        def ask(n: int) -> list[Coordinates]:
            now[:] = [study.ask(kinds) for _ in range(n)]
            return [[float(trial.params[key]) for key in kinds] for trial in now]

        def tell(asked: list[Coordinates], found: np.ndarray, broken: np.ndarray) -> None:
            for trial, values, excess in zip(now, found, broken, strict=True):
                trial.set_user_attr("broken", float(excess))
                study.tell(trial, [float(value) for value in values])

        return ask, tell

    return method


METHODS: dict[str, Method] = {
    "grid": grid,
    "Sobol points": sobol,
    "pymoo NSGA-II, 20": pymoo_method("NSGA-II"),
    "pymoo NSGA-II, 40": pymoo_method("NSGA-II", 40),
    "pymoo SMS-EMOA, 40": pymoo_method("SMS-EMOA", 40),
    "Optuna NSGA-II, 20": optuna_method("NSGA-II"),
    "Optuna TPE": optuna_method("TPE"),
}


def searched(design: Design, method: Method, seed: int, known: dict[bytes, np.ndarray]) -> Iterator[tuple[Any, ...]]:
    """Objectives of every computed design, and the time that the method took so far [s]."""
    count, done, own, idle = len(design.objectives), 0, 0.0, 0
    begin = time.perf_counter()
    ask, tell = method(design.space, count, seed)
    own += time.perf_counter() - begin
    seen: set[bytes] = set()
    while done < BUDGET and idle < 25:
        begin = time.perf_counter()
        asked = ask(BATCH)
        own += time.perf_counter() - begin
        found, broken, fresh = np.zeros((len(asked), count)), np.zeros(len(asked)), 0
        points = [design.space.at(coordinates) for coordinates in asked]
        _learn(design, points, known)
        for row, values in enumerate(points):
            key = values.tobytes()
            if len(known[key]) == 1:
                broken[row], found[row] = known[key][0], 1e3
                continue
            found[row] = known[key]
            if key not in seen:
                seen.add(key)
                done, fresh = done + 1, fresh + 1
                yield known[key], own
            if done == BUDGET:
                return
        idle = 0 if fresh else idle + 1
        if not asked:
            return
        begin = time.perf_counter()
        tell(asked, found, broken)
        own += time.perf_counter() - begin


def _learn(design: Design, points: list[np.ndarray], known: dict[bytes, np.ndarray]) -> None:
    """Objectives of designs that are not known; of one that breaks a constraint, by how much."""
    new: dict[bytes, Record] = {}
    for values in points:
        if (key := values.tobytes()) in known:
            continue
        result = checked(design, tables := design.tables(values))
        known[key] = np.array([result.excess])
        if not result.violations and result.campaign is not None:
            density = result.campaign.target.areal_density
            new[key] = Record(values, tables, density, (LEVEL,), np.zeros((1, len(design.keys), 0)))
    said = said_by(design, [Job(one.tables, 0, 0, HITS, LEVEL, 0) for one in new.values()]) if new else []
    for (key, one), of in zip(new.items(), said, strict=True):
        known[key] = objectives(design, one.more(of.values[None], of.seconds))


def main() -> None:
    chosen = sys.argv[1:] or list(METHODS)
    stored = json.loads(STORED.read_text()) if STORED.exists() else {}
    for problem in PROBLEMS:
        if problem in stored:  # measured before; remove the file to measure again
            continue
        design, known = design_of(problem), dict[bytes, np.ndarray]()
        runs = {}
        for name in chosen:
            for seed in SEEDS:
                found = list(searched(design, METHODS[name], seed, known))
                runs[name, seed] = np.array([one for one, _ in found]), found[-1][1]
        every = np.concatenate([points for points, _ in runs.values()])
        best = every[front_of(every)]
        low, high = best.min(axis=0), best.max(axis=0)
        unit = lambda points: (points - low) / (high - low)  # noqa: E731, B023
        reference = np.full(len(low), 1.1)
        whole = hypervolume(unit(best), reference)
        rows = stored.setdefault(problem, {})
        for name in chosen:
            shares = [
                [hypervolume(unit(runs[name, seed][0][:n]), reference) / whole for n in (100, BUDGET)] for seed in SEEDS
            ]
            own = float(np.mean([runs[name, seed][1] for seed in SEEDS]))
            rows[name] = {"share": shares, "seconds": own, "computed": [len(runs[name, seed][0]) for seed in SEEDS]}
            mean, least = np.mean(shares, axis=0), np.min(shares, axis=0)
            print(
                f"{problem}; {name}: {mean[0]:.3f} (least {least[0]:.3f}) after 100, {mean[1]:.3f} ({least[1]:.3f}) "
                f"after {BUDGET}; {1e3 * own / BUDGET:.1f} ms of its own per design",
                flush=True,
            )
        STORED.write_text(json.dumps(stored, indent=1))


if __name__ == "__main__":
    main()
