"""Hits that were chosen from a result with plain xarray: small, readable, and still a result."""

from collections.abc import Callable
from pathlib import Path

import netCDF4
import numpy as np
import pytest
import xarray

from warpimpact import open_result
from warpimpact.analysis.effectiveness import effectiveness
from warpimpact.cli import main
from warpimpact.measures.hits import is_choice
from warpimpact.measures.measure import sampling_design
from warpimpact.measures.references import law_of, reference, with_references
from warpimpact.results import files
from warpimpact.results.dataset import outlines
from warpimpact.runs.run import run

from ...options import CPU
from ..slotted import slotted


@pytest.fixture(scope="module")
def result() -> xarray.DataTree:
    return run(slotted(count=128), options=CPU)


@pytest.fixture
def plain(result: xarray.DataTree, tmp_path: Path) -> xarray.Dataset:
    """As plain xarray opens the file."""
    files.write(result, tmp_path / "a.nc")
    return xarray.load_dataset(tmp_path / "a.nc")


def tilted(dataset: xarray.Dataset) -> xarray.Dataset:
    return dataset.where(dataset["tilt"].isel(standoff=-1, drop=True) > 20.0, drop=True)


def test_a_choice_made_with_plain_xarray_is_still_a_result(
    plain: xarray.Dataset, result: xarray.DataTree, tmp_path: Path, capsys: pytest.CaptureFixture[str]
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
    assert "How the fast law ended is not in the result" in capsys.readouterr().out
    with xarray.open_dataset(tmp_path / f"few_hit{hit}.nc") as history:
        np.testing.assert_array_equal(history["tilt"], law_of(result)["tilt"].sel(hit=hit))
        assert history.sizes["snapshot"] == 2
    missing = int(np.setdiff1d(result["hit"], few["hit"])[0])
    assert main(["replay", path, "--hit", str(missing)]) == 2
    assert f"hit: got {missing}, but the result has {few.sizes['hit']} of the hits" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("choose", "sentence"),
    [
        (lambda d: d.isel(hit=[]), 'has no hits along "hit"; choose hits as a list'),
        (lambda d: d.isel(hit=3), 'has no hits along "hit"; choose hits as a list'),
        (lambda d: d.drop_attrs(deep=False), 'it has no attribute "warpimpact_kind"'),
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


def test_chosen_hits_are_no_longer_sample_out_in_turn(result: xarray.DataTree) -> None:
    first = result.isel(hit=slice(64))
    assert [is_choice(one.to_dataset()) for one in (result, first, result.isel(hit=slice(1, None)))] == [
        False,
        False,
        True,
    ]
    assert sampling_design(first.to_dataset())["replicates"] == 16
    assert sampling_design(result.isel(hit=slice(None, None, 2)).to_dataset())["replicates"] == 1


def test_a_number_names_the_same_hit_in_a_choice(result: xarray.DataTree) -> None:
    worst = effectiveness(result).hit["worst_point(residual_energy_fraction)"]
    rest = result.isel(hit=slice(worst, None))
    few = effectiveness(rest).hit
    assert few["worst_point(residual_energy_fraction)"] == worst == int(result["residual_velocity"].idxmax())


def test_shots_at_the_solid_plate_stay_with_their_hits() -> None:
    campaign = slotted(('"825 m/s" ', '{ distribution = "uniform", low = 700, high = 850 } '), count=64)
    own, solid = (run(one, options=CPU).to_dataset() for one in (campaign, campaign.solid()))
    result = with_references(own, {"solid": solid})
    solid, later = (reference(one, "solid") for one in (result, result.isel(hit=slice(10, 50, 2))))
    assert solid is not None
    assert later is not None
    chosen = solid.isel(hit=slice(10, 50, 2))
    for name in ("residual_velocity", "tilt", "impact_velocity"):
        np.testing.assert_array_equal(later[name], chosen[name])


def test_results_of_different_plates_are_joined(result: xarray.DataTree, tmp_path: Path) -> None:
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


@pytest.fixture(scope="module")
def with_nodes() -> xarray.DataTree:
    """A result with the solid plate and a finer level, each at some of its hits."""
    campaign = slotted(('"825 m/s" ', '{ distribution = "uniform", low = 700, high = 850 } '), count=512)
    return run(campaign, references=True, options=CPU)


CHOICES: dict[str, Callable[[xarray.DataTree], xarray.DataTree]] = {
    "isel": lambda tree: tree.isel(hit=slice(0, None, 3)),
    "sel": lambda tree: tree.sel(hit=[7, 3, 400]),
    "where": lambda tree: tree.map_over_datasets(lambda node: node.where(tree.hit_y > 0.0, drop=True)),
}


@pytest.mark.parametrize("choose", CHOICES.values(), ids=CHOICES)
def test_nodes_stay_with_their_hits(
    choose: Callable[[xarray.DataTree], xarray.DataTree], with_nodes: xarray.DataTree, tmp_path: Path
) -> None:
    choose(with_nodes).to_netcdf(tmp_path / "a.nc")
    with open_result(tmp_path / "a.nc") as chosen:
        hits = chosen["hit"].values
        for name in ("solid/residual_velocity", "finer/tilt", "finer/status"):
            expected = with_nodes[name].values[hits]
            np.testing.assert_array_equal(chosen[name], expected)
        solid = reference(chosen, "solid")
        given = chosen["impact_velocity"].values
        assert solid is None or np.array_equal(solid["impact_velocity"], given[: solid.sizes["hit"]])


def test_plain_xarray_opens_the_map_or_the_whole(with_nodes: xarray.DataTree, tmp_path: Path) -> None:
    files.write(with_nodes, tmp_path / "a.nc")
    with xarray.open_dataset(tmp_path / "a.nc") as plain:
        xarray.testing.assert_identical(plain.load(), with_nodes.to_dataset())
    with xarray.open_datatree(tmp_path / "a.nc") as tree, open_result(tmp_path / "a.nc") as result:
        for one in (tree, result):
            for name, node in with_nodes.children.items():
                expected = files.with_meanings(node.to_dataset(inherit=False)).drop_indexes(
                    "drawn_hit", errors="ignore"
                )
                stored = one[name].to_dataset(inherit=False).load().drop_indexes("drawn_hit", errors="ignore")
                xarray.testing.assert_identical(stored, expected)
    with netCDF4.Dataset(tmp_path / "a.nc") as file:
        assert file["solid/status"].dtype == np.int8
        of_hits = [node for name, node in file.groups.items() if name != "draws"]
        assert {node.variables["status"].dimensions for node in of_hits} == {("hit",)}
