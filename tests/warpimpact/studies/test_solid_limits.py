"""The solid plate beside a search of limits: what it is, what it costs, and what is told of it."""

from pathlib import Path

import numpy as np
import pytest
import xarray

from warpimpact import Campaign
from warpimpact.analysis.comparison import compare
from warpimpact.analysis.effectiveness import effectiveness
from warpimpact.analysis.numbers import text_of
from warpimpact.results import files
from warpimpact.results.references import references_of
from warpimpact.runs.run import run_to_file
from warpimpact.studies.limit import limit_of, limit_view

LAYER = '[[layer]]\ngap = "60 mm"\nthickness = "2 mm"\nresistance = "2600 MPa"\n'
TEXT = """\
title = "limits"
core = {{ shape = "ogive", diameter = "6.17 mm", length = "27 mm", crh = 3.0, mass = "5.25 g" }}
[plate]
thickness = "4 mm"
resistance = "2600 MPa"
shear_coefficient = 0.05
pattern = {pattern}
{layer}
[impact]
velocity = "500 m/s"
[hits]
count = 16
[numerics]
patches_axial = 14
patches_around = 16
time_step = "0.5 us"
[output]
standoffs = ["50 mm"]
solid_reference = {solid}
"""
HOLES = '{ shape = "circle", diameter = "5 mm", spacing = ["8 mm", "8 mm"] }'
NONE = '{ shape = "none" }'


def search(path: Path, quantity: str = "velocity", of_layer: int = 0, **given: str) -> xarray.Dataset:
    text = TEXT.format(**{"pattern": HOLES, "layer": "", "solid": "true"} | given)
    of = Campaign.from_text(text, name="text", folder=Path())
    run_to_file(of, path, device="cpu", limit=limit_of(of, quantity, layer=of_layer))
    return files.read(path)


@pytest.fixture(scope="module")
def velocity(tmp_path_factory: pytest.TempPathFactory) -> xarray.Dataset:
    return search(tmp_path_factory.mktemp("limit") / "velocity.nc")


@pytest.fixture(scope="module")
def thickness(tmp_path_factory: pytest.TempPathFactory) -> xarray.Dataset:
    return search(tmp_path_factory.mktemp("limit") / "thickness.nc", "thickness", 1, layer=LAYER)


def solid_limit(dataset: xarray.Dataset, reference: str = "solid") -> float:
    return float(references_of(dataset)[reference][f"limit_{dataset.attrs['limit']}"][0])


def test_it_is_the_search_of_a_solid_plate_that_is_as_heavy(velocity: xarray.Dataset, tmp_path: Path) -> None:
    density = 7850.0 * 4e-3 * (1.0 - np.pi * 2.5**2 / 64.0)
    assert velocity.attrs["areal_density"] == pytest.approx(density, rel=1e-6)
    alone = search(tmp_path / "a.nc", pattern=NONE)
    thin = TEXT.format(pattern=NONE, layer="", solid="true").replace('"4 mm"', f"{density / 7850.0}")
    of = Campaign.from_text(thin, name="text", folder=Path(), count=1)
    run_to_file(of, tmp_path / "b.nc", device="cpu", limit=limit_of(of))
    assert not references_of(alone)  # it is its own
    expected = files.read(tmp_path / "b.nc")["limit_velocity"].values
    assert solid_limit(velocity) == pytest.approx(expected.item(), abs=1.0)
    assert references_of(velocity)["solid"].sizes["hit"] == 1  # the hits differ in their places alone


def test_the_base_alone_is_a_plate_of_its_own(tmp_path: Path) -> None:
    with_base = search(tmp_path / "a.nc", layer=LAYER)
    text = TEXT.format(pattern=NONE, layer="", solid="true").replace('"4 mm"', '"2 mm"')
    base = Campaign.from_text(text.replace("shear_coefficient = 0.05", ""), name="text", folder=Path(), count=1)
    run_to_file(base, tmp_path / "b.nc", device="cpu", limit=limit_of(base))
    expected = files.read(tmp_path / "b.nc")["limit_velocity"].values
    assert solid_limit(with_base, "base_alone") == pytest.approx(expected.item(), abs=1.0)
    measure = effectiveness(with_base).loc["V50"]
    assert measure.alone == pytest.approx(expected.item() * measure.measure.display.factor, rel=2e-3)
    assert "base alone: limit" in text_of(limit_view(with_base))


def test_a_limit_velocity_has_measures_and_a_ratio(velocity: xarray.Dataset) -> None:
    v50, v05, worst_tenth, worst = effectiveness(velocity).itertuples()
    values, solid = velocity["limit_velocity"].values, solid_limit(velocity)
    assert [one.Index for one in (v50, v05)] == ["V50", "V05"]
    assert v50.value == pytest.approx(np.median(values))
    assert v50.measure.higher_is_better
    assert v50.ratio == pytest.approx(v50.value / solid)
    assert worst.value == values.min() == values[worst.hit]
    assert worst.value <= worst_tenth.value < v50.value
    assert worst_tenth.value == pytest.approx(np.sort(values)[:2].dot([1.0, 0.6]) / 1.6, rel=1e-6)


@pytest.mark.parametrize(("more", "ranks"), [(1.0, [(1, 2), (1, 2)]), (3.0, [(2, 2), (1, 1)])])
def test_limits_within_their_tolerance_are_not_distinguished(
    velocity: xarray.Dataset, more: float, ranks: list[tuple[int, int]]
) -> None:
    """Each limit is known to 1 m/s."""
    other = velocity.assign(limit_velocity=velocity["limit_velocity"] + more)
    actual = compare([velocity, other], ["one", "other"])
    assert [actual.ranks("V50")[name] for name in ("one", "other")] == ranks


def test_of_a_thickness_it_tells_the_areal_density_that_a_solid_plate_needs(thickness: xarray.Dataset) -> None:
    measures = effectiveness(thickness)
    plate = 7850.0 * 4e-3 * (1.0 - np.pi * 2.5**2 / 64.0)
    solid = plate + 7850.0 * solid_limit(thickness)
    density = measures.loc["quantile(limit_areal_density, 0.5)"]
    assert (density.solid, density.ratio) == (pytest.approx(solid), pytest.approx(density.value / solid))
    assert measures.solid["H50"] == pytest.approx(1e3 * solid_limit(thickness))
    assert f"{solid:.4g} kg/m² (the target as given has" in text_of(limit_view(thickness))
