"""The error that is told of limits: levels that err alike do not make a promise."""

from collections.abc import Callable, Mapping

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from warpimpact.scene import PRESETS, Numerics
from warpimpact.solver.climb import MARGIN
from warpimpact.solver.limit_pilot import FINEST_LIMIT, LIMITS, limits_pilot_size, pilot_limits

DRAFT = Numerics(fidelity="draft")
SHARE = PRESETS["draft"].limit


def search(values: Mapping[int, ArrayLike]) -> Callable[[int], NDArray[np.float64]]:
    """Finds limits [m/s] on a level: the same for all hits, or one for each."""
    return lambda level: np.full(LIMITS, values[level])


def test_levels_next_to_each_other_that_err_alike_are_seen_through() -> None:
    # The first two levels agree, and so do the others; the limit lies 4 % away from the first ones.
    values = dict.fromkeys((0, 1), 104.0) | dict.fromkeys(range(2, FINEST_LIMIT + 2), 100.0)
    found = pilot_limits(search(values), DRAFT, "velocity")
    assert found.kept
    assert found.numerics == Numerics(level=2)
    assert found.error <= SHARE * 100.0


def test_the_error_told_is_that_to_a_level_two_finer() -> None:
    values = {k: 100.0 + 1.0 / 2**k for k in range(FINEST_LIMIT + 2)}
    found = pilot_limits(search(values), DRAFT, "velocity")
    assert found.numerics == Numerics(level=0)
    assert found.error == pytest.approx(MARGIN[2] * 0.75)


def test_the_finest_level_that_is_taken_has_one_finer_beside_it() -> None:
    values = {k: 100.0 * (1.0 + 0.9 * 0.6**k) for k in range(FINEST_LIMIT + 2)}
    found = pilot_limits(search(values), DRAFT, "velocity")
    assert not found.kept
    assert found.numerics == Numerics(level=FINEST_LIMIT)
    assert found.error == pytest.approx(MARGIN[1] * (values[FINEST_LIMIT] - values[FINEST_LIMIT + 1]))


def test_limits_that_come_and_go_end_the_climb() -> None:
    # Most limits err by less than the promise; one in eight exists on every second pair of levels.
    values = {k: np.full(LIMITS, 100.0 + 1.0 / 2**k) for k in range(FINEST_LIMIT + 2)}
    for level, value in values.items():
        value[:2] = np.inf if level // 2 % 2 else 100.0
    asked: list[int] = []

    def counted(level: int) -> NDArray[np.float64]:
        asked.append(level)
        return search(values)(level)

    found = pilot_limits(counted, DRAFT, "velocity")
    assert not found.kept
    assert found.error == np.inf  # told as it is
    assert found.numerics == Numerics(level=0)
    assert FINEST_LIMIT not in asked


def test_errors_that_halve_are_followed_to_the_promise() -> None:
    # One in eight errs three times as much as the others: two levels on, they are within the promise, too.
    values = {
        k: 100.0 * (1.0 + np.where(np.arange(LIMITS) < 2, 3.0, 1.0) * SHARE / 2**k) for k in range(FINEST_LIMIT + 2)
    }
    found = pilot_limits(search(values), DRAFT, "velocity")
    assert found.kept
    assert found.numerics == Numerics(level=2)


def test_an_accuracy_in_numbers_is_that_of_the_name() -> None:
    values = {k: 100.0 * (1.0 + 3.0 * SHARE / 2**k) for k in range(FINEST_LIMIT + 2)}
    asked = Numerics(accuracy={"limit": SHARE})
    assert pilot_limits(search(values), asked, "velocity") == pilot_limits(search(values), DRAFT, "velocity")
    assert limits_pilot_size(asked.asked) == LIMITS
    assert limits_pilot_size(Numerics(accuracy={"limit": SHARE, "share": 0.99}).asked) == 160
    with pytest.raises(ValueError, match="needs limit"):
        pilot_limits(search(values), Numerics(accuracy={"tilt": "1 deg"}), "velocity")
