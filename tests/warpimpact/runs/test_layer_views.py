"""Layers behind a plate: what a result, its table and its figures say of each."""

from pathlib import Path

import numpy as np
import pytest
import xarray

from warpimpact import Campaign, hit_map, run
from warpimpact.analysis.inspection import inspect_view
from warpimpact.analysis.numbers import text_of
from warpimpact.plotting import trajectory
from warpimpact.plotting.cell import map_field
from warpimpact.plotting.maps import layers_figure
from warpimpact.report.report import result_content
from warpimpact.runs.replay import replay

CAMPAIGN = """
title = "two layers"
core = { shape = "polynomial", coefficients = [3.0e-4, 0.24, -5.29], length = "27.86 mm", mass = "4 g" }
[plate]
thickness = "4 mm"
resistance = "2600 MPa"
pattern = { shape = "slot", length = "12 mm", width = "4 mm", spacing = ["8 mm", "16 mm"], staggered = true }
[[layer]]
gap = "60 mm"
thickness = "2 mm"
resistance = "2600 MPa"
[[layer]]
gap = "80 mm"
thickness = "1 mm"
resistance = "1 GPa"
[impact]
velocity = "825 m/s"
[hits]
count = 16
seed = 2
irreducible = true
[numerics]
time_step = "2 us"
[output]
standoffs = ["50 mm"]
solid_reference = false
"""


@pytest.fixture(scope="module")
def result() -> xarray.Dataset:
    return run(Campaign.from_text(CAMPAIGN, name="test", folder=Path()), device="cpu")


def test_maps_choose_the_layer(result: xarray.Dataset) -> None:
    image = hit_map(result, "layer_tilt", layer=0, pixels=20)
    assert set(np.unique(image)) <= set(result["layer_tilt"].values[:, 0].astype(float))
    assert map_field(result, "layer_tilt", layer=0).title.startswith("tilt, layer 0")
    np.testing.assert_array_equal(map_field(result, "layer_tilt").values, result["layer_tilt"].values[:, 2])
    with pytest.raises(ValueError, match=r"has no layer 3; it has layers 0 \(the plate\) to 2"):
        hit_map(result, "layer_tilt", layer=3)


def test_the_figure_of_layers_has_a_row_for_each(result: xarray.Dataset) -> None:
    figure = layers_figure(result)
    titles = [axes.get_title().splitlines()[0] for axes in figure.axes if axes.get_title()]
    behind = [(f"residual velocity, layer {layer}", f"tilt, layer {layer}") for layer in range(3)]
    assert [title for title in titles if "," in title] == [title for row in behind for title in row]
    assert "layer 0: all perforated" in figure.legends[0].get_title().get_text()


def test_figures_say_what_lies_behind(result: xarray.Dataset) -> None:
    weight = result.attrs["areal_density"]
    assert f"whole target {weight:.1f} kg/m²" in text_of(inspect_view(result))
    assert f"whole target {weight:.1f} kg/m²" in result_content("a", result)["scene"]
    assert map_field(result, "tilt").title.startswith("tilt, 50 mm behind the target")
    assert "on impact and behind the target" in trajectory.flight(replay(result, 3, snapshots=0)).get_suptitle()
