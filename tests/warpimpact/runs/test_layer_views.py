"""Layers behind a plate: what a result, its table and its figures say of each."""

from pathlib import Path

import numpy as np
import pytest
import xarray
from matplotlib.colors import to_hex

from warpimpact import Campaign, hit_map, run, to_dataframe
from warpimpact.analysis.inspection import inspect_text
from warpimpact.kernels.status import Status
from warpimpact.plotting import trajectory
from warpimpact.plotting.cell import NO_VALUE, STATUS_COLOURS, shown
from warpimpact.plotting.maps import layers_figure
from warpimpact.report.words import result_content
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


def campaign(text: str = CAMPAIGN) -> Campaign:
    return Campaign.from_text(text, name="test", folder=Path())


@pytest.fixture(scope="module")
def result() -> xarray.Dataset:
    return run(campaign(), device="cpu")


def test_a_table_has_a_column_for_each(result: xarray.Dataset) -> None:
    table = to_dataframe(result)
    np.testing.assert_array_equal(table["layer_tilt_1"], result["layer_tilt"][:, 1])


def test_maps_choose_the_layer(result: xarray.Dataset) -> None:
    image = hit_map(result, "layer_tilt", layer=0, pixels=20)
    assert set(np.unique(image)) <= set(result["layer_tilt"].values[:, 0].astype(float))
    assert shown(result, "layer_tilt", layer=0).title.startswith("tilt, layer 0")
    np.testing.assert_array_equal(shown(result, "layer_tilt").values, result["layer_tilt"].values[:, 2])
    with pytest.raises(ValueError, match=r"has no layer 3; it has layers 0 \(the plate\) to 2"):
        hit_map(result, "layer_tilt", layer=3)


def test_the_figure_of_layers_has_a_row_for_each(result: xarray.Dataset) -> None:
    titles = [axes.get_title() for axes in layers_figure(result).axes if axes.get_title()]
    assert titles[0] == "layer 0\nperforated 100.0%"
    assert [title.splitlines()[0] for title in titles[1::3]] == [f"residual velocity, layer {k}" for k in range(3)]
    assert [title.splitlines()[0] for title in titles[2::3]] == [f"tilt, layer {k}" for k in range(3)]


def test_the_legend_of_layers_names_each_colour_once(result: xarray.Dataset) -> None:
    stopped = result.copy(deep=True)
    stopped["layer_status"][:, 2] = Status.ARRESTED
    stopped["layer_tilt"][:, 2] = np.nan
    stopped["layer_residual_velocity"][:, 2] = np.nan
    (legend,) = layers_figure(stopped).legends
    texts = [text.get_text() for text in legend.get_texts()]
    assert sorted(texts) == ["arrested", "edge of hole", "no value: arrested", "perforated"]
    colours = {patch.get_label(): to_hex(patch.get_facecolor()).upper() for patch in legend.get_patches()}
    assert colours["arrested"] == STATUS_COLOURS[Status.ARRESTED]
    assert colours["no value: arrested"] == to_hex(NO_VALUE).upper()


def test_a_report_tells_every_layer(result: xarray.Dataset) -> None:
    tables = result_content("a", result)["tables"]
    assert tables["layer 1"] == {"gap": "60 mm", "thickness": "2 mm", "resistance": "2600 MPa"}
    assert tables["layer 2"]["gap"] == "80 mm"


def test_figures_say_what_lies_behind(result: xarray.Dataset) -> None:
    weight = result.attrs["areal_density"]
    assert f"whole target {weight:.1f} kg/m²" in inspect_text(result)
    assert f"whole target {weight:.1f} kg/m²" in result_content("a", result)["asked"]
    assert shown(result, "tilt").title.startswith("tilt, 50 mm behind the target")
    assert "on impact and behind the target" in trajectory.flight(replay(result, 3, snapshots=0)).get_suptitle()
