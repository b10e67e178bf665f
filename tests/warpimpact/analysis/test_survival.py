"""Verdicts of a comparison under the uncertainty of the parameters, where the answer is known."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import xarray

from warpimpact.analysis.comparison import Comparison, compare
from warpimpact.analysis.comparison_text import comparison_text
from warpimpact.analysis.contestants import Difference

MEAN = "mean(residual_energy_fraction)"
DRAWS, HITS = 50, 2000


def two_plates(make: Callable[..., xarray.Dataset], effects: np.ndarray, seed: int = 1) -> list[xarray.Dataset]:
    """Results of shots with a draw each; `effects` is by how much less energy the second plate lets through, shape
    [draws]."""
    numbers = np.random.default_rng(seed)
    draw = numbers.integers(0, len(effects), HITS)
    fraction = numbers.uniform(0.5, 0.7, HITS)
    less = fraction - effects[draw] - numbers.uniform(-0.05, 0.05, HITS)
    return [
        make(1000.0 * np.sqrt(part)).assign(posterior_draw=("hit", draw.astype(np.float64)))
        for part in (fraction, less)
    ]


def mean_difference(comparison: Comparison) -> Difference:
    (found,) = (pair for pair in comparison.differences if pair.measure == MEAN)
    return found


def sentence(comparison: Comparison, after: str = "residual energy fraction, mean;") -> str:
    """What is said about the pair in a measure."""
    lines = comparison_text(comparison).splitlines()
    start = next(place for place, line in enumerate(lines) if line.startswith(after))
    return next(line for line in lines[start:] if "better than" in line)


def test_a_sign_that_depends_on_the_draw_does_not_survive(make_plate_result: Any) -> None:
    """The second plate is better for three draws of five only, which any number of hits tells apart shot by shot."""
    effects = np.where(np.arange(DRAWS) % 5 < 3, 0.1, -0.05)
    plates = two_plates(make_plate_result, effects)
    alone = compare([plate.drop_vars("posterior_draw") for plate in plates], ["a", "b"])
    assert mean_difference(alone).told_apart
    assert mean_difference(alone).survival is None
    assert "parameters" not in comparison_text(alone)
    drawn = compare(plates, ["a", "b"])
    pair = mean_difference(drawn)
    assert (pair.value, pair.low, pair.high) == tuple(
        getattr(mean_difference(alone), name) for name in ("value", "low", "high")
    )
    assert pair.survival is not None
    assert pair.survival.survives is False
    assert pair.survival.probability == pytest.approx(0.6, abs=0.01)
    assert "; does not survive the uncertainty of the parameters (P = 0.6" in sentence(drawn)
    best = next(line for line in comparison_text(drawn).splitlines() if line.startswith("residual energy fraction, m"))
    assert best.endswith("b (not certain under the uncertainty of the parameters)")


@pytest.mark.parametrize("first", [0, 1])
def test_a_sign_that_is_that_of_all_draws_survives(make_plate_result: Any, first: int) -> None:
    plates = two_plates(make_plate_result, 0.1 + np.linspace(-0.04, 0.04, DRAWS))
    comparison = compare([plates[first], plates[1 - first]], ["ab"[first], "ab"[1 - first]])
    survival = mean_difference(comparison).survival
    assert survival is not None
    assert survival.survives is True
    assert "b better than a" in sentence(comparison)
    assert "; survives the uncertainty of the parameters (P = 1.00, at least 0.9" in sentence(comparison)
    assert "parameters if P is at least 95% even at the lower end" in comparison_text(comparison)


def test_hits_that_do_not_tell(make_plate_result: Any) -> None:
    """Twelve draws, all with the same sign by far less than their spread allows to say."""
    comparison = compare(two_plates(make_plate_result, np.linspace(0.01, 0.1, 12)), ["a", "b"])
    survival = mean_difference(comparison).survival
    assert survival is not None
    assert survival.survives is None
    assert "; these hits do not tell whether it survives the uncertainty of the parameters (P = " in sentence(
        comparison
    )


def test_what_is_not_known_says_why(make_plate_result: Any) -> None:
    one, other = two_plates(make_plate_result, np.full(DRAWS, 0.1))
    unknown = "whether this survives the uncertainty of the parameters is not known: "
    for changed, reason in (
        (other.drop_vars("posterior_draw"), "only one of the plates draws its parameters from a posterior"),
        (other.assign(posterior_draw=other["posterior_draw"][::-1].variable), "their shots have different draws"),
        (other.assign_coords(hit_y=0.5 * other["hit_y"]), "their shots hit other places of the cell"),
    ):
        assert sentence(compare([one, changed], ["a", "b"])).endswith(unknown + reason)
    few = [plate.assign(posterior_draw=plate["posterior_draw"] % 7) for plate in (one, other)]
    assert sentence(compare(few, ["a", "b"])).endswith("fewer than 8 draws have the shots that it takes")


def test_differences_and_ratios_have_an_interval_by_the_parameters(make_plate_result: Any) -> None:
    """The second plate lets through 0.05 to 0.15 less, by the draw: the worst tenth, too."""
    plates = two_plates(make_plate_result, np.linspace(0.05, 0.15, DRAWS))
    comparison = compare([plate.assign_attrs(open_area=0.0) for plate in plates], ["a", "b"])
    for measure in (MEAN, "worst_tenth(residual_energy_fraction)"):
        (pair,) = (one for one in comparison.differences if one.measure == measure)
        assert pair.parameters == pytest.approx((0.0525, 0.1475), abs=0.03)
        assert pair.survival is not None
        assert pair.survival.survives
        (told,) = (one for one in comparison.plates[1].measures if one.name == measure)
        assert told.ratio_parameters == pytest.approx((1.0, 1.0), abs=0.02)  # a solid plate is its own reference
    line = sentence(comparison)
    assert line.startswith("b better than a by 0.1")
    assert "by hits 0.09" in line
    assert "by parameters 0.0" in line
