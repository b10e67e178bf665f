"""The error that is told of limits: levels that err alike do not make a promise."""

from typing import Any

import numpy as np
import pytest

from warpimpact.scene import Numerics
from warpimpact.solver.limit import Limits, short_steps
from warpimpact.solver.limit_promise import FINEST, PILOT, PROMISED, keep_limits
from warpimpact.solver.promise import MARGIN
from warpimpact.solver.resolution import LADDER, Fidelity


def search(values: dict[int, float]) -> Any:
    """A search that finds the same limit [m/s] for all hits on a level."""

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
