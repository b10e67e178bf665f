"""The optimiser: NSGA-II of pymoo with mixed variables and constraints. It is asked for points and told their results.

K. Deb and others, IEEE Transactions on Evolutionary Computation 6 (2002) 182; J. Blank, K. Deb, IEEE Access 8 (2020)
89497. tests/benchmarks/NOTES.md compares it with others.
"""

from __future__ import annotations

from collections.abc import Sequence
from importlib.util import find_spec
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpimpact.campaign.text import CampaignError
from warpimpact.optimisation.space import Space
from warpimpact.scene.model import Array


def check_installed() -> None:
    """Refuse a search if a library that it needs is missing.

    Raises:
        CampaignError: the message names the library.
    """
    for library in ("pymoo", "moocore"):
        if find_spec(library) is None:
            raise CampaignError(f"a search needs {library}: pip install 'warpimpact[optimise]'")


class Searcher:
    """Points of a space, a generation at a time. They depend only on the seed and on the results of earlier points.

    Args:
        objectives, constraints: numbers of these.
        population: number of points in a generation.
    """

    def __init__(self, space: Space, objectives: int, constraints: int, population: int, seed: int) -> None:
        from pymoo.algorithms.moo.nsga2 import NSGA2
        from pymoo.core.mixed import MixedVariableDuplicateElimination, MixedVariableMating, MixedVariableSampling
        from pymoo.core.problem import Problem
        from pymoo.core.termination import NoTermination

        self._names = [f"{number:03d}" for number in range(len(space.variables))]
        kinds = {name: _kind(variable) for name, variable in zip(self._names, space.variables, strict=True)}
        self._problem = Problem(vars=kinds, n_obj=objectives, n_ieq_constr=constraints)
        again = MixedVariableDuplicateElimination()
        self._algorithm = NSGA2(
            pop_size=population,
            sampling=MixedVariableSampling(),
            mating=MixedVariableMating(eliminate_duplicates=again),
            eliminate_duplicates=again,
        )
        self._algorithm.setup(self._problem, termination=NoTermination(), seed=seed, verbose=False)
        self._asked: Any = None

    def ask(self) -> list[Sequence[float]]:
        """Coordinates of the next points, as `DesignVariable.at` takes them; empty if there are no others."""
        self._asked = self._algorithm.ask()
        if self._asked is None or not len(self._asked):
            return []
        return [[float(point[name]) for name in self._names] for point in self._asked.get("X")]

    def tell(self, objectives: Array, violations: Array) -> None:
        """Tell the results of the points that were asked for.

        Args:
            objectives: to minimise, shape [points, objectives].
            violations: positive where a constraint is violated, shape [points, constraints].
        """
        from pymoo.core.evaluator import Evaluator
        from pymoo.problems.static import StaticProblem

        Evaluator().eval(StaticProblem(self._problem, F=objectives, G=violations), self._asked)
        self._algorithm.tell(infills=self._asked)


def _kind(variable: Any) -> Any:
    from pymoo.core.variable import Choice, Integer, Real

    if variable.labels:
        return Choice(options=list(range(len(variable.labels))))
    return Real(bounds=(0.0, 1.0)) if variable.count is None else Integer(bounds=(0, variable.count - 1))


def hypervolume(points: Array, reference: Array) -> float:
    """Volume between the points to minimise, shape [points, objectives], and a reference; 0 without points.

    Exact: A. P. Guerreiro, C. M. Fonseca, L. Paquete, ACM Computing Surveys 54 (2021) 119, by moocore.
    """
    import moocore

    better = points[(points < reference).all(axis=1)]
    return float(moocore.hypervolume(better, ref=reference)) if len(better) else 0.0


def front_of(points: Array) -> NDArray[np.int64]:
    """Numbers of the points to minimise that no other dominates; the first of points that agree in seven digits."""
    import moocore

    if not len(points):
        return np.zeros(0, dtype=np.int64)
    rounded = [[float(f"{number:.7g}") for number in point] for point in points]
    return np.flatnonzero(moocore.is_nondominated(np.array(rounded)))
