"""Rendered maps: the right colour at the right place, to scale, with labelled axes."""

import io
import warnings

import numpy as np
import pytest
from matplotlib import colormaps
from matplotlib.colors import to_rgb
from PIL import Image

from warpimpact.kernels.status import Status
from warpimpact.plotting import overview, save_beside, save_maps, variable_map, variable_maps

MIXED = np.array([Status.PERFORATED, Status.ARRESTED, Status.RICOCHETED, Status.UNTOUCHED])
GREY = (0.62, 0.62, 0.62)


@pytest.fixture
def covered(make_result):
    """Enough hits of four statuses to cover the cell, with a hole in its middle."""
    return make_result(np.tile(MIXED, 128))


@pytest.fixture
def perforated(make_result):
    return make_result(512)


class Picture:
    """A figure as a person sees it: colours at points of its first map [mm]."""

    def __init__(self, figure):
        buffer = io.BytesIO()
        figure.savefig(buffer, dpi=figure.dpi)
        self.pixels = np.asarray(Image.open(buffer).convert("RGB")) / 255.0
        self.axes = figure.axes[0]

    def colour(self, y, z):
        column, row = self.axes.transData.transform((y, z))
        return self.pixels[len(self.pixels) - 1 - int(row), int(column)]


def legend_texts(figure):
    (legend,) = figure.legends
    return [text.get_text() for text in legend.get_texts()]


def nearest_hit(dataset, y, z):
    """Brute force: the hit nearest to a point [m] of the periodic plate."""
    period = dataset.attrs["plate_period"]
    offset = np.stack([dataset["hit_y"] - y, dataset["hit_z"] - z], axis=-1)
    return np.argmin(np.hypot(*(offset - period * np.round(offset / period)).T))


def clear_points(dataset, count):
    """Pixel centres [m] well away from the outline of the hole: (y, z) pairs."""
    columns, rows = np.random.default_rng(2).integers([400, 200], size=(count, 2)).T
    y, z = (columns + 0.5) / 400 * 16e-3 - 8e-3, (rows + 0.5) / 200 * 8e-3 - 4e-3
    clear = np.abs(np.maximum(np.abs(y), np.abs(z)) - 2e-3) > 0.3e-3
    return list(zip(y[clear], z[clear], strict=True))


def test_every_pixel_has_the_value_of_the_nearest_hit_across_the_edges(perforated):
    image = variable_map(perforated, "energy_loss").axes[0].images[0].get_array()
    assert image.shape == (200, 400)
    columns, rows = np.meshgrid([0, 1, 57, 200, 398, 399], [0, 3, 100, 199])
    for column, row in zip(columns.flat, rows.flat, strict=True):
        y, z = (column + 0.5) / 400 * 16e-3 - 8e-3, (row + 0.5) / 200 * 8e-3 - 4e-3
        assert image[row, column] == perforated["energy_loss"].values[nearest_hit(perforated, y, z)]


def test_rendered_colours_are_those_of_the_colour_bar(perforated):
    figure = variable_map(perforated, "energy_loss")
    picture, norm = Picture(figure), figure.axes[0].images[0].norm
    points = clear_points(perforated, 40)
    matches = 0
    for y, z in points:
        value = perforated["energy_loss"].values[nearest_hit(perforated, y, z)]
        expected = colormaps["viridis"](norm(value))[:3]
        matches += np.allclose(picture.colour(y * 1e3, z * 1e3), expected, atol=0.02)
    assert matches >= 0.9 * len(points)  # a screen pixel on a seam may take the neighbour's colour
    assert (norm.vmin, norm.vmax) == pytest.approx((40.0, 400.0))


@pytest.mark.parametrize("variable", ["residual_velocity", "deflection", "tilt"])
def test_hits_that_did_not_pass_the_plate_are_grey(covered, variable):
    figure = variable_map(covered, variable)
    picture = Picture(figure)
    points = clear_points(covered, 60)
    status = covered["status"].values[[nearest_hit(covered, y, z) for y, z in points]]
    grey = [np.allclose(picture.colour(y * 1e3, z * 1e3), GREY, atol=0.01) for y, z in points]
    stopped = np.isin(status, [Status.ARRESTED, Status.RICOCHETED])
    assert np.mean(grey == stopped) >= 0.9
    assert legend_texts(figure) == ["no value: arrested, ricocheted", "edge of hole"]


def test_map_is_to_scale_in_millimetres(perforated):
    figure = variable_map(perforated, "residual_velocity")
    axes, _ = figure.axes
    figure.draw_without_rendering()
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("hit y [mm]", "hit z [mm]")
    np.testing.assert_allclose([*axes.get_xlim(), *axes.get_ylim()], [-8.0, 8.0, -4.0, 4.0])
    np.testing.assert_allclose(axes.images[0].get_extent(), [-8.0, 8.0, -4.0, 4.0])
    origin, right, up = axes.transData.transform([(0, 0), (1, 0), (0, 1)])
    assert right[0] - origin[0] == pytest.approx(up[1] - origin[1])
    assert axes.get_aspect() == 1.0


@pytest.mark.parametrize(
    ("variable", "standoff", "label", "ends"),
    [
        ("residual_velocity", None, "residual velocity [m/s]", (710.0, 800.0)),
        ("tilt", 0.05, "tilt [°]", (np.degrees(0.05), np.degrees(0.5))),
        ("tilt", None, "tilt [°]", (np.degrees(0.15), np.degrees(1.5))),  # at the largest stand-off
        ("pitch", None, "pitch [°]", (-np.degrees(1.3), np.degrees(1.3))),  # signed, with a neutral zero
    ],
)
def test_colour_bar_states_quantity_and_unit(perforated, variable, standoff, label, ends):
    axes, bar = variable_map(perforated, variable, standoff).axes
    norm = axes.images[0].norm
    assert bar.get_ylabel() == label
    assert (norm.vmin, norm.vmax) == pytest.approx(ends)


def test_few_hits_are_points(make_result):
    dataset = make_result(np.tile(MIXED, 10))
    figure = variable_map(dataset, "residual_velocity")
    axes = figure.axes[0]
    assert len(axes.images) == 0
    (points,) = axes.collections
    np.testing.assert_allclose(points.get_offsets(), np.stack([dataset["hit_y"], dataset["hit_z"]], -1) * 1e3)
    expected = np.where(np.isin(dataset["status"], [0, 3]), dataset["residual_velocity"], np.nan)
    np.testing.assert_array_equal(np.ma.filled(points.get_array(), np.nan), expected)
    picture = Picture(figure)
    stopped = np.flatnonzero(np.isnan(expected))
    colours = [picture.colour(*points.get_offsets()[hit]) for hit in stopped]
    assert np.mean(np.isclose(colours, GREY, atol=0.01).all(axis=1)) > 0.7  # some lie under other points


def test_status_map_has_a_colour_and_a_share_for_each_status_that_occurs(covered):
    figure = variable_map(covered, "status")
    assert legend_texts(figure) == ["perforated", "arrested", "ricocheted", "untouched", "edge of hole"]
    assert "perforated 25.0%" in figure.axes[0].get_title()
    colours = [to_rgb(handle.get_color()) for handle in figure.legends[0].legend_handles]
    picture = Picture(figure)
    matches = [
        np.allclose(
            picture.colour(y * 1e3, z * 1e3), colours[covered["status"].values[nearest_hit(covered, y, z)]], atol=0.01
        )
        for y, z in clear_points(covered, 60)
    ]
    assert np.mean(matches) >= 0.9


@pytest.mark.parametrize("status", [Status.PERFORATED, Status.ARRESTED])
def test_uniform_results_draw_without_complaint(make_result, status):
    dataset = make_result([status] * 100)
    dataset["residual_velocity"][:] = 764.0
    dataset["tilt"][:] = np.nan
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        figure = overview(dataset)
        figure.savefig("/dev/null", format="png")
    shown = [axes.get_title().split("\n")[0] for axes in figure.axes if axes.get_title()]
    assert shown == (["residual velocity", "deflection"] if status == Status.PERFORATED else ["status"])


@pytest.mark.parametrize("variable", ["angular_velocity", "velocity"])
def test_what_cannot_be_mapped_is_named(perforated, variable):
    with pytest.raises(ValueError, match=f'"{variable}" cannot be mapped; choose one of .*residual_velocity'):
        variable_map(perforated, variable)


def test_save_maps_writes_one_png_per_map(covered, tmp_path):
    paths = save_maps(covered, tmp_path / "maps", "plate")
    assert [path.name for path in paths] == [
        "plate_overview.png",
        "plate_residual_velocity.png",
        "plate_deflection.png",
        "plate_tilt_50mm.png",
        "plate_tilt_130mm.png",
        "plate_marginals.png",
        "plate_dispersion.png",
    ]
    for path in paths:
        with Image.open(path) as image:
            assert image.format == "PNG"
            assert np.asarray(image.convert("L")).std() > 10.0


def test_maps_beside_each_other_have_one_scale_of_colour_and_of_length(make_result, tmp_path):
    wide, small = make_result(512), make_result(256)
    small = small.assign(residual_velocity=small["residual_velocity"] - 300.0)
    small.attrs["plate_period"] = wide.attrs["plate_period"] / 2
    for axis in "yz":
        small[f"hit_{axis}"] = small[f"hit_{axis}"] / 2
    figure = variable_maps({"wide": wide, "small": small}, "residual_velocity")
    maps_, bars = [axes for axes in figure.axes if axes.images], [axes for axes in figure.axes if not axes.images]
    assert [axes.get_title().split("\n")[0] for axes in maps_] == ["wide", "small"]
    norms = [axes.images[0].norm for axes in maps_]
    assert [(norm.vmin, norm.vmax) for norm in norms] == [pytest.approx((410.0, 800.0))] * 2
    assert [bar.get_ylim() for bar in bars] == [pytest.approx((410.0, 800.0))]  # one bar for equal scales
    figure.draw_without_rendering()
    lengths = [np.diff(axes.transData.transform([(0, 0), (1, 0)])[:, 0]).item() for axes in maps_]
    assert lengths[0] == pytest.approx(lengths[1])
    paths = save_beside({"wide": wide, "small": small}, tmp_path, "both")
    assert [path.name for path in paths] == [f"both_{name}.png" for name in ("residual_velocity", "deflection", "tilt")]
