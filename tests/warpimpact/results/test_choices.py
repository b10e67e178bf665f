"""Hits that were chosen from a result with plain xarray: small, readable, and still a result."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import xarray

from warpimpact import open_result
from warpimpact.analysis.effectiveness import effectiveness
from warpimpact.cli import main
from warpimpact.measures.hits import is_choice
from warpimpact.measures.measure import sampling_design
from warpimpact.measures.references import reference, with_references
from warpimpact.results import files
from warpimpact.results.dataset import outlines
from warpimpact.runs.run import run

from ...options import CPU
from ..slotted import slotted


@pytest.fixture(scope="module")
def result() -> xarray.Dataset:
    return run(slotted(count=128), options=CPU)


@pytest.fixture
def plain(result: xarray.Dataset, tmp_path: Path) -> xarray.Dataset:
    """As plain xarray opens the file."""
    files.write(result, tmp_path / "a.nc")
    return xarray.load_dataset(tmp_path / "a.nc")


def tilted(dataset: xarray.Dataset) -> xarray.Dataset:
    return dataset.where(dataset["tilt"].isel(standoff=-1, drop=True) > 20.0, drop=True)


def test_a_choice_made_with_plain_xarray_is_still_a_result(
    plain: xarray.Dataset, result: xarray.Dataset, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    few = tilted(plain)
    few.to_netcdf(tmp_path / "few.nc")
    path, hit = str(tmp_path / "few.nc"), int(few["hit"][3])
    assert main(["inspect", path]) == 0
    shown = capsys.readouterr().out
    assert f"A choice of {few.sizes['hit']} hits of a larger result." in shown
    assert " ratio" not in shown
    assert main(["plot", path]) == 0
    assert main(["report", path, "--trajectories", "1"]) == 0
    capsys.readouterr()
    assert main(["replay", path, "--hit", str(hit), "--snapshots", "2"]) == 0
    assert "The end is bit-identical to the stored outcome." in capsys.readouterr().out
    with xarray.open_dataset(tmp_path / f"few_hit{hit}.nc") as history:
        np.testing.assert_array_equal(history["tilt"], result["tilt"].sel(hit=hit))
        assert history.sizes["snapshot"] == 2
    missing = int(np.setdiff1d(result["hit"], few["hit"])[0])
    assert main(["replay", path, "--hit", str(missing)]) == 2
    assert f"hit: got {missing}, but the result has {few.sizes['hit']} of the hits" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("choose", "sentence"),
    [
        (lambda d: d.isel(hit=[]), 'has no hits along "hit"; choose hits as a list'),
        (lambda d: d.isel(hit=3), 'has no hits along "hit"; choose hits as a list'),
        (lambda d: d.drop_attrs(deep=False), 'its attribute "warpimpact_kind" is ""'),
    ],
)
def test_what_a_choice_lacks_is_reported_in_a_sentence(
    plain: xarray.Dataset,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    choose: Callable[[xarray.Dataset], xarray.Dataset],
    sentence: str,
) -> None:
    choose(plain).to_netcdf(tmp_path / "b.nc")
    assert main(["inspect", str(tmp_path / "b.nc")]) == 2
    message = capsys.readouterr().err
    assert sentence in message
    assert message.count("\n") == 1


def test_chosen_hits_are_no_longer_sample_out_in_turn(result: xarray.Dataset) -> None:
    first = result.isel(hit=slice(64))
    assert [is_choice(one) for one in (result, first, result.isel(hit=slice(1, None)))] == [False, False, True]
    assert sampling_design(first)["replicates"] == 16
    assert sampling_design(result.isel(hit=slice(None, None, 2)))["replicates"] == 1


def test_a_number_names_the_same_hit_in_a_choice(result: xarray.Dataset) -> None:
    worst = effectiveness(result).hit["worst_point(residual_energy_fraction)"]
    rest = result.isel(hit=slice(worst, None))
    few = effectiveness(rest).hit
    assert few["worst_point(residual_energy_fraction)"] == worst == int(result["residual_velocity"].idxmax())


def test_shots_at_the_solid_plate_stay_with_their_hits() -> None:
    campaign = slotted(('"825 m/s" ', '{ distribution = "uniform", low = 700, high = 850 } '), count=64)
    result = with_references(run(campaign, options=CPU), {"solid": run(campaign.solid(), options=CPU)})
    solid, later = (reference(one, "solid") for one in (result, result.isel(hit=slice(10, 50, 2))))
    assert solid is not None
    assert later is not None
    chosen = solid.isel(hit=slice(10, 50, 2))
    for name in ("residual_velocity", "tilt", "impact_velocity"):
        np.testing.assert_array_equal(later[name], chosen[name])


def test_results_of_different_plates_are_joined(result: xarray.Dataset, tmp_path: Path) -> None:
    other = run(slotted(("staggered = true", "staggered = false"), ('"12 mm"', '"11 mm"'), count=128), options=CPU)
    for name, one in (("a", result), ("b", other)):
        files.write(one, tmp_path / f"{name}.nc")
    with open_result(tmp_path / "a.nc") as a, open_result(tmp_path / "b.nc") as b:
        lengths = [outlines(one).shape[1] for one in (a, b)]
        how = {"data_vars": "all", "coords": "different", "compat": "equals", "join": "outer"}
        along_hits, by_plate = (xarray.concat([a, b], dimension, **how) for dimension in ("hit", "plate"))
    assert lengths[0] != lengths[1]
    assert along_hits["tilt"].shape == (256, 2)
    assert reference(along_hits, "solid") is None  # each plate has its own
    assert len(effectiveness(along_hits)) == len(effectiveness(result))
    assert by_plate["residual_velocity"].shape == (2, 128)
    np.testing.assert_array_equal(by_plate["residual_velocity"][1], other["residual_velocity"])
