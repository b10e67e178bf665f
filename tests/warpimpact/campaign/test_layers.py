"""Campaigns with layers behind the plate: how they are read, what a result, its table and its figures say of each."""

from pathlib import Path

import numpy as np
import pytest
import xarray

from warpimpact import Campaign, Plate, catalogue, hit_map, run
from warpimpact.campaign.campaign import read_plates
from warpimpact.errors import CampaignError
from warpimpact.kernels.status import Status
from warpimpact.measures.references import law_of
from warpimpact.plotting.cell import map_field
from warpimpact.plotting.maps import layers_figure
from warpimpact.results import files
from warpimpact.runs.run import run_to_file

from ...options import CPU

CAMPAIGN = """
title = "two layers"
[core]
shape = "polynomial"
coefficients = [3.0e-4, 0.24, -5.29]
length = "27.86 mm"
mass = "4 g"
{plate}
[[layer]]
gap = "50 mm"
thickness = "3 mm"
resistance = "2 GPa"
pattern = {{ shape = "circle", diameter = "4 mm", spacing = ["9 mm", "9 mm"] }}
offset = {offset}
[[layer]]
gap = "5 mm"
thickness = {thickness}
resistance = "8 GPa"
[impact]
velocity = "825 m/s"
[hits]
count = 16
seed = 2
replicates = 8
[numerics]
patches_axial = 14
[output]
standoffs = ["40 mm"]
solid_reference = {solid}
"""
PLATE = """
[plate]
thickness = "4 mm"
resistance = "2600 MPa"
shear_coefficient = 0.05
degradation = 0.8
pattern = { shape = "slot", length = "12 mm", width = "4 mm", spacing = ["8 mm", "16 mm"], staggered = true }
"""
UNKNOWN = '[{ distribution = "uniform", low = "-4.5 mm", high = "4.5 mm" }, "1 mm"]'
ABOUT = '{ distribution = "normal", mean = "8 mm", std = "0.5 mm" }'


def text(**changes: str) -> str:
    given = {"plate": PLATE, "offset": '["2 mm", "0 mm"]', "thickness": '"8 mm"', "solid": "true"}
    return CAMPAIGN.format(**given | changes)


def campaign(**changes: str) -> Campaign:
    return Campaign.from_text(text(**changes), name="test", folder=Path())


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> xarray.Dataset:
    path = tmp_path_factory.mktemp("layers") / "a.nc"
    run_to_file(campaign(offset=UNKNOWN, thickness=ABOUT), path, options=CPU)
    return law_of(files.read(path))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('gap = "5 mm"', 'gapp = "5 mm"', r'layer 2: got the unknown key "gapp"; did you mean "gap"\?'),
        ('"8 mm"', "{ distribution = 'normal', mean = '1 mm', std = '1 mm' }", r"layer 2.thickness: got a normal"),
        (
            "replicates = 8",
            "irreducible = true",
            r"hits.irreducible = true cannot be combined with layer 1 with a pattern",
        ),
    ],
)
def test_a_message_names_the_layer(old: str, new: str, message: str) -> None:
    with pytest.raises(CampaignError, match=message):
        Campaign.from_text(text().replace(old, new), name="test", folder=Path())


def test_layers_of_one_plate_stand_before_those_of_all(tmp_path: Path) -> None:
    first = PLATE.replace("[plate]", '[[plate]]\nname = "one"')
    second = PLATE.replace("[plate]", '[[plate]]\nname = "two"')
    liner = '[[plate.layer]]\nthickness = "1 mm"\nresistance = "1 GPa"\n'
    path = tmp_path / "two.toml"
    path.write_text(text(plate=first + second + liner))
    one, two = read_plates(path).values()
    assert [layer.thickness for layer in one.layer] == [3e-3, 8e-3]
    assert [layer.thickness for layer in two.layer] == [1e-3, 3e-3, 8e-3]


def test_a_result_tells_of_every_layer(result: xarray.Dataset) -> None:
    assert result.sizes["layer"] == 3
    assert result["layer_status"].attrs["flag_meanings"].split().count("not_reached") == 1
    status = result["layer_status"].values
    left = (status == Status.PERFORATED) | (status == Status.UNTOUCHED)
    for name in ("layer_residual_velocity", "layer_tilt"):
        np.testing.assert_array_equal(np.isfinite(result[name].values), left, err_msg=name)
    rests = result["stopped_in"].values >= 0
    np.testing.assert_array_equal(np.isfinite(result["depth"]), rests)
    assert (status[rests, result["stopped_in"].values[rests]] == Status.ARRESTED).all()
    np.testing.assert_allclose(result["layer_front"], [0.0, 54e-3, 62e-3])
    words = result["layer_offset_y"].attrs["distribution"]
    assert words == "layer 1: uniform, low = -0.0045, high = 0.0045 (SI, radians)"


def test_layers_scatter_and_say_so(result: xarray.Dataset) -> None:
    thickness, offset = result["layer_thickness"].values, result["layer_offset_y"].values
    assert (thickness[:, :2] == [4e-3, 3e-3]).all()
    assert len(np.unique(thickness[:, 2])) == len(np.unique(offset[:, 1])) == result.sizes["hit"]
    assert np.abs(offset[:, 1]).max() <= 4.5e-3
    assert (offset[:, [0, 2]] == 0.0).all()
    # Draws depend on seed and number alone.
    every = campaign(offset=UNKNOWN, thickness=ABOUT).sampler()
    np.testing.assert_array_equal(every.shots(5, 4).offset_y, every.shots(0, 16).offset_y[5:9])


def test_the_references_are_a_solid_add_on_before_the_same_base_and_the_base_alone() -> None:
    made = campaign(thickness=ABOUT)
    solid, alone, given = made.solid(), made.base_alone(), made.target
    shots, of_solid, of_base = (one.sampler().shots(0, 4) for one in (made, solid, alone))
    assert all(layer.open_area == 0.0 for layer in solid.target.layers)
    assert solid.target.weights == pytest.approx(given.weights, rel=1e-12)
    assert solid.target.gaps == given.gaps
    assert solid.target.layers[2] == given.layers[2]
    np.testing.assert_array_equal(
        of_solid.layer_value(solid.target, "thickness", 2), shots.layer_value(given, "thickness", 2)
    )
    assert not alone.layer
    assert all(getattr(alone.plate, name) == getattr(given.layers[2], name) for name in Plate.model_fields)
    np.testing.assert_array_equal(
        of_base.layer_value(alone.target, "thickness", 0), shots.layer_value(given, "thickness", 2)
    )


def test_a_solid_add_on_of_the_catalogue_has_the_resistance_of_its_thickness() -> None:
    friction = "shear_coefficient = 0.05\n"
    named = {"plate": PLATE.replace('resistance = "2600 MPa"', 'material = "HHA Class 1"').replace(friction, "")}
    made = campaign(**named)
    plate, solid = made.plate, made.solid().plate
    alone = catalogue.plate("HHA Class 1", made.core, 0.0, thickness=solid.thickness)
    assert solid.resistance == pytest.approx(alone.resistance)
    assert solid.resistance < 0.97 * plate.resistance
    scattered = campaign(plate=PLATE.replace('"2600 MPa"', '{ distribution = "uniform", low = 2e9, high = 3e9 }'))
    shots = scattered.sampler().shots(0, 4)
    np.testing.assert_array_equal(scattered.solid().sampler().shots(0, 4).resistance, shots.resistance)


TWO_LAYERS = """
title = "two layers"
core = { shape = "polynomial", coefficients = [3.0e-4, 0.24, -5.29], length = "27.86 mm", mass = "4 g" }
[plate]
thickness = "4 mm"
resistance = "2600 MPa"
shear_coefficient = 0.05
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
def two_layers() -> xarray.Dataset:
    return law_of(run(Campaign.from_text(TWO_LAYERS, name="test", folder=Path()), options=CPU))


def test_maps_choose_the_layer(two_layers: xarray.Dataset) -> None:
    image = hit_map(two_layers, "layer_tilt", layer=0, pixels=20)
    assert set(np.unique(image)) <= set(two_layers["layer_tilt"].values[:, 0].astype(float))
    assert map_field(two_layers, "layer_tilt", layer=0).title.startswith("tilt, layer 0")
    np.testing.assert_array_equal(map_field(two_layers, "layer_tilt").values, two_layers["layer_tilt"].values[:, 2])
    with pytest.raises(ValueError, match=r"has no layer 3; it has layers 0 \(the plate\) to 2"):
        hit_map(two_layers, "layer_tilt", layer=3)


def test_the_figure_of_layers_has_a_row_for_each(two_layers: xarray.Dataset) -> None:
    figure = layers_figure(two_layers)
    titles = [axes.get_title().splitlines()[0] for axes in figure.axes if axes.get_title()]
    behind = [(f"residual velocity, layer {layer}", f"tilt, layer {layer}") for layer in range(3)]
    assert [title for title in titles if "," in title] == [title for row in behind for title in row]
    assert "layer 0: all perforated" in figure.legends[0].get_title().get_text()
