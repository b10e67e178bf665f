"""What a replay tells of the layers behind the plate: what is left of their resistance, its figure, and ParaView."""

from pathlib import Path

import numpy as np
import pytest
import xarray

from warpimpact import Campaign, run
from warpimpact.analysis.slabs import LayerField, fields_behind
from warpimpact.export.paraview import write_vtk
from warpimpact.plotting.trajectory import layers
from warpimpact.results import files
from warpimpact.results.kinds import HISTORY, HIT_MAP
from warpimpact.runs.replay import replay

CAMPAIGN = """
title = "two plates that weaken"
core = {{ shape = "polynomial", coefficients = [3.0e-4, 0.24, -5.29], length = "27.86 mm", mass = "4 g" }}
[plate]
thickness = "4 mm"
resistance = "{front} MPa"
degradation = {degradation}
pattern = {{ shape = "slot", length = "12 mm", width = "4 mm", spacing = ["8 mm", "16 mm"], staggered = true }}
{layer}
[impact]
velocity = "825 m/s"
[hits]
count = 8
seed = 2
[numerics]
time_step = "1 us"
[output]
standoffs = ["50 mm"]
solid_reference = false
"""
BEHIND = """
[[layer]]
gap = "60 mm"
thickness = "3 mm"
resistance = "2600 MPa"
degradation = 0.8
"""
SLOTS = '{ shape = "slot", length = "12 mm", width = "4 mm", spacing = ["8 mm", "16 mm"], staggered = true }'


def history(hit: int, snapshots: int = 6, **given: object) -> xarray.Dataset:
    text = CAMPAIGN.format(**{"front": 2600, "degradation": 0.8, "layer": BEHIND} | given)
    campaign = Campaign.from_text(text, name="test", folder=Path())
    found = replay(run(campaign, device="cpu"), hit, snapshots=snapshots)
    assert found.attrs["agreement"] == "bit-identical"
    return found


@pytest.fixture(scope="module")
def hit() -> xarray.Dataset:
    return history(3)


def taken(layer: LayerField, snapshot: int = -1) -> np.ndarray:
    return layer.share[0] - layer.share[snapshot]


def centre(layer: LayerField) -> np.ndarray:
    weight = taken(layer)
    return np.array([(weight.sum(1) * layer.cell_y).sum(), (weight.sum(0) * layer.cell_z).sum()]) / weight.sum()


def test_a_layer_weakens_where_the_core_meets_it_and_not_before(hit: xarray.Dataset) -> None:
    (layer,) = fields_behind(hit)
    assert layer.number == 1
    assert layer.share.max() <= 1.0
    assert layer.share[-1].min() < 0.5  # the channel
    reached = float(hit["time"].values[np.argmax(hit["plate_position"][:, 0].values > 0.064 - 0.028)])
    before = hit["snapshot"].values < reached
    assert before.any()
    for snapshot in np.flatnonzero(before):
        assert not taken(layer, snapshot).any()
    path = hit["plate_position"].values
    there = path[np.argmax(path[:, 0] > 0.0655)]
    np.testing.assert_allclose(centre(layer), there[1:], atol=2e-3)


def test_behind_a_plate_of_no_resistance_it_is_the_plate_alone() -> None:
    alone = history(3, layer="")
    behind = BEHIND.replace('"3 mm"', f'"4 mm"\npattern = {SLOTS}')
    (layer,) = fields_behind(history(3, front=0, degradation=1.0, layer=behind))
    share = alone["resistance_share"].values
    expected = (share[0] - share[-1]).sum()
    assert expected > 100.0
    assert taken(layer).sum() == pytest.approx(expected, rel=0.03)


def test_a_file_a_figure_and_paraview_keep_it(hit: xarray.Dataset, tmp_path: Path) -> None:
    files.write(hit, tmp_path / "hit.nc")
    with files.opened(tmp_path / "hit.nc", HIT_MAP, HISTORY) as again:
        np.testing.assert_array_equal(fields_behind(again)[0].share, fields_behind(hit)[0].share)
    panels = [axes for axes in layers(hit).axes if axes.images]
    assert len(panels) == hit.sizes["snapshot"]
    pyvista = pytest.importorskip("pyvista")
    paths = write_vtk(hit, tmp_path / "hit")
    assert [path.name for path in paths] == ["core.pvd", "plate.pvd", "layer_1.pvd"]
    mesh = pyvista.read(tmp_path / "hit" / "layer_1_0000.vti")
    assert mesh.bounds[:2] == (pytest.approx(0.064), pytest.approx(0.067))


def test_layers_that_do_not_weaken_have_no_field() -> None:
    solid = BEHIND.replace("degradation = 0.8", "degradation = 1.0")
    found = history(3, layer=solid)
    assert fields_behind(found) == []
    assert "layer_resistance_share" not in found


def test_without_snapshots_all_but_the_fields_is_the_same(hit: xarray.Dataset) -> None:
    bare = history(3, snapshots=0)
    assert bare["resistance_share"].shape[0] == 0
    assert fields_behind(bare) == []
    fields = [name for name in hit.variables if "snapshot" in hit[name].dims or name.startswith("layer_cell")]
    xarray.testing.assert_identical(bare.drop_dims("snapshot").drop_attrs(), hit.drop_vars(fields).drop_attrs())
