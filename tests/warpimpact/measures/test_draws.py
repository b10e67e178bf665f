"""Draws of a result: one mechanism gives values, intervals and differences of all measures."""

from pathlib import Path

import numpy as np
import pytest
import xarray

from warpimpact.analysis.comparison import compare
from warpimpact.kernels.status import Status
from warpimpact.measures.draws import Draws, estimate_of_draws
from warpimpact.measures.estimates import estimated
from warpimpact.measures.measure import Measure
from warpimpact.measures.references import with_nodes
from warpimpact.results import files

from ..conftest import ResultMaker, plate_result

HITS, COUNT = 40, 128
MEAN = Measure.parse("mean(residual_velocity)")


def drawn(velocity: np.ndarray, passes: np.ndarray | bool = True, title: str = "a") -> xarray.DataTree:
    """A result with these velocities of all draws and hits, shape [draws, hits]."""
    velocity = np.broadcast_to(velocity, (COUNT, HITS))
    status = np.where(np.broadcast_to(passes, velocity.shape), Status.PERFORATED, Status.ARRESTED).astype(np.int8)
    dims = ("draw", "drawn_hit")
    columns = {"status": (dims, status), "residual_velocity": (dims, velocity)}
    result = plate_result(velocity.mean(axis=0), campaign=title).assign_coords(hit=np.arange(HITS))
    return with_nodes(result, {"draws": xarray.Dataset(columns, {"drawn_hit": np.arange(HITS)})})


def test_a_value_is_the_mean_of_all_draws_and_its_interval_holds_one_more() -> None:
    """Of m ordered draws the k-th has a share of k / (m + 1) below it."""
    of_draws = np.random.default_rng(0).permutation(np.linspace(700.0, 800.0, COUNT))
    estimate = estimated(drawn(of_draws[:, None]), [MEAN])[MEAN]
    assert estimate.value == pytest.approx(750.0)
    low = 700.0 + 100.0 * (0.025 * (COUNT + 1) - 1.0) / (COUNT - 1)
    assert (estimate.low, estimate.high) == pytest.approx((low, 1500.0 - low))
    wider = estimate_of_draws(of_draws, of_draws, 0.99)
    assert wider.high - 750.0 == pytest.approx((750.0 - low) * 2.5758 / 1.95996, rel=1e-4)


def test_the_sample_of_hits_is_in_the_interval() -> None:
    """Draws that agree leave the error of the sample: that of a mean of independent hits."""
    velocity = np.random.default_rng(1).normal(700.0, 20.0, HITS)
    estimate = estimated(drawn(velocity), [MEAN])[MEAN]
    assert estimate.value == pytest.approx(velocity.mean())
    assert estimate.half_width == pytest.approx(1.96 * velocity.std() / HITS**0.5, rel=0.25)


@pytest.mark.parametrize("share", [0.0, 0.25, 1.0])
def test_equal_draws_do_not_make_a_share_exact(share: float) -> None:
    result = drawn(np.array(700.0), np.arange(HITS) < share * HITS)
    passes, stops = (estimated(result, [Measure.parse(f"P({one})")]) for one in ("perforated", "stopped"))
    (one,), (other,) = passes.values(), stops.values()
    assert one.value == share
    assert one.value + other.value == pytest.approx(1.0)
    assert 0.01 < one.high - one.low < 0.4
    assert 0.0 <= one.low <= share <= one.high <= 1.0


def test_a_difference_is_that_of_each_draw() -> None:
    """What two plates have in common cancels, however uncertain it is."""
    common = np.random.default_rng(2).normal(700.0, 50.0, (COUNT, 1)) + np.linspace(-30.0, 30.0, HITS)
    plates = {"a": drawn(common), "b": drawn(common + 4.0, title="b")}
    comparison = compare(plates, ["mean(residual_velocity)"])
    (row,) = comparison.differences["mean(residual_velocity)"].itertuples()
    assert (row.value, row.low, row.high) == pytest.approx((-4.0, -4.0, -4.0))
    assert row.significant
    table = comparison.scores["mean(residual_velocity)"]
    assert row.value == pytest.approx(table.value["a"] - table.value["b"])
    assert table.high["a"] > table.low["b"]  # alone, the two cannot be told apart


def test_a_file_has_the_same_answer(tmp_path: Path) -> None:
    result = drawn(np.random.default_rng(3).normal(700.0, 50.0, (COUNT, HITS)))
    files.write(result, tmp_path / "a.nc")
    with xarray.open_datatree(tmp_path / "a.nc") as stored:
        assert estimated(stored.load(), [MEAN])[MEAN].value == estimated(result, [MEAN])[MEAN].value


def test_hits_without_draws_have_no_answer(make_result: ResultMaker) -> None:
    result = drawn(np.array(700.0))
    assert Draws.of(result.isel(hit=slice(0))) is None
    assert Draws.of(make_result()) is None
