"""The error that is told of limits: levels that err alike do not make a promise."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike

from warpimpact.scene import Numerics
from warpimpact.solver.limit import Limits, short_steps
from warpimpact.solver.limit_promise import FINEST, PILOT, PROMISED, keep_limits
from warpimpact.solver.promise import MARGIN
from warpimpact.solver.resolution import LADDER, Fidelity


def search(values: Mapping[int, ArrayLike]) -> Any:
    """A search that finds limits [m/s] on a level: the same for all hits, or one for each."""

    def found(fidelity: Fidelity) -> Limits:
        level = next(k for k, one in enumerate(LADDER) if short_steps(one) == fidelity)
        value = np.full(PILOT, values[level])
        none: Any = None
        return Limits(value, value, value, np.ones(PILOT, dtype=np.int8), np.ones(PILOT, dtype=bool), none, none)

    return found


def test_levels_next_to_each_other_that_err_alike_are_seen_through() -> None:
    share, _ = PROMISED["draft"]
    # The first two levels agree, and so do the others; the limit lies 4 % away from the first ones.
    values = dict.fromkeys((0, 1), 104.0) | dict.fromkeys(range(2, FINEST + 2), 100.0)
    found = keep_limits(search(values), Numerics(fidelity="draft"), squared=False)
    assert found.kept
    assert found.fidelity == short_steps(LADDER[2])
    assert found.error <= share * 100.0


def test_the_error_told_is_that_to_a_level_two_finer() -> None:
    values = {k: 100.0 + 1.0 / 2**k for k in range(FINEST + 2)}
    found = keep_limits(search(values), Numerics(fidelity="draft"), squared=False)
    assert found.fidelity == short_steps(LADDER[0])
    assert found.error == pytest.approx(MARGIN[2] * 0.75)


def test_the_finest_level_that_is_taken_has_one_finer_beside_it() -> None:
    values = {k: 100.0 * 1.5**-k for k in range(FINEST + 2)}
    found = keep_limits(search(values), Numerics(fidelity="draft"), squared=False)
    assert not found.kept
    assert found.fidelity == short_steps(LADDER[FINEST])
    assert found.error == pytest.approx(MARGIN[1] * (values[FINEST] - values[FINEST + 1]))


def test_limits_that_come_and_go_end_the_climb() -> None:
    # Most limits err by less than the promise; one in eight exists on every second pair of levels.
    values = {k: np.full(PILOT, 100.0 + 1.0 / 2**k) for k in range(FINEST + 2)}
    for level, value in values.items():
        value[:2] = np.inf if level // 2 % 2 else 100.0
    asked: list[Fidelity] = []

    def counted(fidelity: Fidelity) -> Limits:
        asked.append(fidelity)
        return search(values)(fidelity)

    found = keep_limits(counted, Numerics(fidelity="draft"), squared=False)
    assert not found.kept
    assert found.error == np.inf  # told as it is
    assert found.fidelity == short_steps(LADDER[0])
    assert short_steps(LADDER[FINEST]) not in asked


def test_errors_that_halve_are_followed_to_the_promise() -> None:
    # One in eight errs three times as much as the others: two levels on, they are within the promise, too.
    share, _ = PROMISED["draft"]
    values = {k: 100.0 * (1.0 + np.where(np.arange(PILOT) < 2, 3.0, 1.0) * share / 2**k) for k in range(FINEST + 2)}
    found = keep_limits(search(values), Numerics(fidelity="draft"), squared=False)
    assert found.kept
    assert found.fidelity == short_steps(LADDER[2])
