"""Numbers and intervals as text: one form each, and no NaN in any of them."""

import math

import pytest

from warpimpact.analysis.numbers import interval_text, number_text, plus_minus
from warpimpact.statistics.intervals import Estimate

NAN = math.nan


@pytest.mark.parametrize(
    ("low", "high", "text"),
    [(1.0, 2.0, "1.000 to 2.000"), (NAN, NAN, "-"), (NAN, 2.0, "at most 2.000"), (1.0, NAN, "at least 1.000")],
)
def test_an_interval_names_the_ends_that_it_has(low: float, high: float, text: str) -> None:
    assert interval_text(low, high) == text


def test_a_mean_without_an_interval_stands_alone() -> None:
    assert plus_minus(Estimate(731.25, 730.5, 732.0, 9, 10.0), ".5g", ".2g") == "731.25 ± 0.75"
    assert plus_minus(Estimate(731.25, NAN, NAN, 1, 0.0), ".5g", ".2g") == "731.25"
    assert number_text(NAN) == "-"
    assert [number_text(number) for number in (9e-6, -9e-6, 2e-5)] == ["0.000", "0.000", "2.000e-05"]
