"""Maps: the right value at the right place, to scale, with labelled axes."""

import warnings

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from PIL import Image

from warpimpact.kernels.status import Status
from warpimpact.plotting import overview, save_maps, save_side_by_side, variable_map, variable_maps, verdict
from warpimpact.plotting.cell import STATUS_COLOURS

MIXED = np.array([Status.PERFORATED, Status.ARRESTED, Status.RICOCHETED, Status.UNTOUCHED])


@pytest.fixture
def covered(make_result):
    """Enough hits of four statuses to cover the cell, with a hole in its middle."""
    return make_result(np.tile(MIXED, 128))


def legend_texts(figure):
    (legend,) = figure.legends
    return [text.get_text() for text in legend.get_texts()]


def nearest_hits(dataset, shape):
    """Brute force: the hit nearest to each pixel of the periodic cell of 16 mm by 8 mm."""
    z, y = (side * ((np.arange(n) + 0.5) / n - 0.5) for side, n in zip((8e-3, 16e-3), shape, strict=True))
    places = np.stack(np.meshgrid(y, z), axis=-1)[:, :, None]
    offset = np.stack([dataset["hit_y"], dataset["hit_z"]], axis=-1) - places
    period = np.array(dataset.attrs["plate_period"])
    return np.hypot(*np.moveaxis(offset - period * np.round(offset / period), -1, 0)).argmin(axis=-1)


@pytest.mark.parametrize("variable", ["energy_loss", "residual_velocity", "deflection", "tilt"])
def test_a_pixel_has_the_value_of_the_nearest_hit_that_has_one(covered, variable):
    figure = variable_map(covered, variable)
    image = figure.axes[0].images[0].get_array()
    assert image.shape == (200, 400)
    values = covered[variable].values.reshape(512, -1)[:, -1]
    if variable != "energy_loss":  # only cores behind the plate have it
        values = np.where(np.isin(covered["status"], [Status.PERFORATED, Status.UNTOUCHED]), values, np.nan)
        assert legend_texts(figure) == ["no value: arrested, ricocheted", "edge of hole"]
    expected = values[nearest_hits(covered, image.shape)]
    assert np.mean(np.isclose(np.ma.filled(image, np.nan), expected, equal_nan=True)) > 0.999  # but for ties


def test_map_is_to_scale_in_millimetres(covered):
    axes, _ = variable_map(covered, "residual_velocity").axes
    assert (axes.get_xlabel(), axes.get_ylabel(), axes.get_aspect()) == ("hit y [mm]", "hit z [mm]", 1.0)
    np.testing.assert_allclose([axes.get_xlim(), axes.get_ylim()], [(-8.0, 8.0), (-4.0, 4.0)])
    np.testing.assert_allclose(axes.images[0].get_extent(), [-8.0, 8.0, -4.0, 4.0])


@pytest.mark.parametrize(
    ("variable", "standoff", "label", "ends"),
    [
        ("tilt", 0.05, "tilt [°]", (np.degrees(0.05), np.degrees(0.5))),
        ("pitch", None, "pitch [°]", (-np.degrees(1.3), np.degrees(1.3))),  # signed, with a neutral zero
    ],
)
def test_colour_bar_states_quantity_and_unit(make_result, variable, standoff, label, ends):
    axes, bar = variable_map(make_result(512), variable, standoff).axes
    assert bar.get_ylabel() == label
    assert axes.images[0].get_clim() == pytest.approx(ends)


def test_few_hits_are_points(make_result):
    dataset = make_result(np.tile(MIXED, 10))
    axes = variable_map(dataset, "residual_velocity").axes[0]
    (points,) = axes.collections
    assert not axes.images
    np.testing.assert_allclose(points.get_offsets(), np.stack([dataset["hit_y"], dataset["hit_z"]], -1) * 1e3)
    expected = np.where(np.isin(dataset["status"], [0, 3]), dataset["residual_velocity"], np.nan)
    np.testing.assert_array_equal(np.ma.filled(points.get_array(), np.nan), expected)


def test_status_map_has_a_colour_and_a_share_for_each_status_that_occurs(covered):
    figure = variable_map(covered, "status")
    assert legend_texts(figure) == ["perforated", "arrested", "ricocheted", "untouched", "edge of hole"]
    assert "perforated 25.0%" in figure.axes[0].get_title()
    image = figure.axes[0].images[0]
    np.testing.assert_allclose(image.to_rgba(MIXED)[:, :3], [to_rgb(STATUS_COLOURS[code]) for code in MIXED], atol=4e-3)


@pytest.mark.parametrize("status", [Status.PERFORATED, Status.ARRESTED])
def test_uniform_results_draw_without_complaint(make_result, status):
    dataset = make_result([status] * 100)
    dataset["residual_velocity"][:] = 764.0
    dataset["tilt"][:] = np.nan
    with warnings.catch_warnings(action="error"):
        figure = overview(dataset)
        figure.savefig("/dev/null", format="png")
    shown = [axes.get_title().split("\n")[0] for axes in figure.axes if axes.get_title()]
    assert shown == (["residual velocity", "deflection"] if status == Status.PERFORATED else ["contact duration"])
    with pytest.raises(ValueError, match=f"all hits are {status.name.lower()}; choose another variable"):
        variable_map(dataset, "status")


def test_save_maps_writes_one_png_per_map(covered, tmp_path):
    paths = save_maps(covered, tmp_path / "maps", "plate", every=True)
    maps = ["overview", "verdict", "residual_velocity", "deflection", "tilt_50mm", "tilt_130mm", "marginals"]
    assert [path.name for path in paths] == [f"plate_{name}.png" for name in maps]
    for path in paths:
        with Image.open(path) as image:
            assert np.asarray(image.convert("L")).std() > 10.0


def test_maps_side_by_side_have_one_scale_of_colour_and_of_length(make_result, tmp_path):
    wide, small = make_result(512), make_result(256)
    small = small.assign({name: small[name] / 2 for name in ("hit_y", "hit_z")})
    small = small.assign(residual_velocity=small["residual_velocity"] - 300.0)
    small.attrs["plate_period"] = wide.attrs["plate_period"] / 2
    figure = variable_maps({"wide": wide, "small": small}, "residual_velocity")
    *maps_, bar = figure.axes  # one bar for equal scales
    assert [axes.get_title().split("\n")[0] for axes in maps_] == ["wide", "small"]
    for scale in (*(axes.images[0].get_clim() for axes in maps_), bar.get_ylim()):
        assert scale == pytest.approx((410.0, 800.0))
    figure.draw_without_rendering()
    lengths = [np.diff(axes.transData.transform([(0, 0), (1, 0)])[:, 0]).item() for axes in maps_]
    assert lengths[0] == pytest.approx(lengths[1])
    paths = save_side_by_side({"wide": wide, "small": small}, tmp_path, "both", every=True)
    assert [path.name for path in paths] == [f"both_{name}.png" for name in ("residual_velocity", "deflection", "tilt")]


def test_the_base_decides_where_there_is_one(covered, tmp_path):
    """Its status where that differs, and the depth of cores that it stops; else velocity and tilt."""
    status = covered["status"].values
    layered = covered.assign(
        layer_status=(("hit", "layer"), np.stack([np.zeros_like(status), status], axis=1)),
        stopped_in=("hit", np.where(status == Status.ARRESTED, 1, -1).astype(np.int8)),
        depth=("hit", np.where(status == Status.ARRESTED, 0.004, np.nan), {"units": "m", "long_name": "depth"}),
    )
    figure = verdict(layered)
    titles = [axes.get_title().split("\n")[0] for axes in figure.axes if axes.get_title()]
    assert titles == ["base", "depth in base"]
    depth = np.ma.filled(figure.axes[1].images[0].get_array(), np.nan)
    assert np.unique(depth[np.isfinite(depth)]) == pytest.approx([4.0])
    assert "P(base perforated) 50.0%" in figure.legends[0].get_title().get_text()
    assert [axes.get_xlabel() for axes in verdict(covered).axes][1] == "tilt, 130 mm behind the plate [°]"
