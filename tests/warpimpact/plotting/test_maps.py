"""Maps and distributions: the right value at the right place, correct intervals; and stored pictures are not stale."""

import io
import warnings
from pathlib import Path

import matplotlib
import numpy as np
import pytest
import xarray
from PIL import Image

from warpimpact.campaigns import gallery
from warpimpact.kernels.status import Status
from warpimpact.measures.draws import ends_of_draws
from warpimpact.measures.references import with_references
from warpimpact.optimisation.design import design_from
from warpimpact.optimisation.optimise import optimise
from warpimpact.plotting import (
    marginals,
    measure_map,
    overview,
    plate_figure,
    save_side_by_side,
    uncertainty,
    variable_map,
    variable_maps,
    verdict,
)
from warpimpact.plotting.cell import limits, to_one_cell
from warpimpact.plotting.comparison import front_figure
from warpimpact.scene import CirclePattern, Plate

from ..conftest import CYLINDER, SEARCHED
from ..drawn import with_draws

MIXED = np.array([Status.PERFORATED, Status.ARRESTED, Status.RICOCHETED, Status.UNTOUCHED])


@pytest.fixture
def covered(make_result):
    """Enough hits of four statuses to cover the cell, with a hole in its middle."""
    return make_result(np.tile(MIXED, 128))


def legend_texts(figure):
    (legend,) = figure.legends
    return [text.get_text() for text in legend.get_texts()]


def nearest_hits(dataset, shape):
    """Brute force: the hit nearest to every eleventh pixel of the periodic cell of 16 mm by 8 mm."""
    z, y = (side * ((np.arange(0, n, 11) + 0.5) / n - 0.5) for side, n in zip((8e-3, 16e-3), shape, strict=True))
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
        assert legend_texts(figure) == ["no core passes: arrested, ricocheted", "edge of hole"]
    expected = values[nearest_hits(covered, image.shape)]
    assert (
        np.mean(np.isclose(np.ma.filled(image, np.nan)[::11, ::11], expected, equal_nan=True)) > 0.999
    )  # but for ties


@pytest.mark.parametrize("status", [Status.PERFORATED, Status.ARRESTED])
def test_uniform_results_draw_without_complaint(make_result, status):
    dataset = make_result([status] * 100)
    dataset["residual_velocity"][:] = 764.0
    dataset["tilt"][:] = np.nan
    with warnings.catch_warnings(action="error"):
        figure = overview(dataset)
        figure.savefig(io.BytesIO(), format="png")
    shown = [axes.get_title().split("\n")[0] for axes in figure.axes if axes.get_title()]
    assert shown == (["residual velocity", "deflection"] if status == Status.PERFORATED else ["energy loss"])
    with pytest.raises(ValueError, match=f"all hits are {status.name.lower()}; choose another variable"):
        variable_map(dataset, "status")


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


def test_a_solid_plate_has_a_map_as_large_as_the_others(make_result) -> None:
    holed, solid = make_result(512), make_result(128)
    solid = solid.assign({name: solid[name] / 16 for name in ("hit_y", "hit_z")})
    solid.attrs |= {"plate_period": holed.attrs["plate_period"] / 16, "campaign": '{"plate": {}}'}
    for one in to_one_cell([solid, holed]):
        np.testing.assert_allclose(limits(one), limits(holed))
    with_rim = solid.assign_attrs(campaign='{"plate": {"size": [1.0, 1.0]}}')
    assert to_one_cell([with_rim, holed])[0] is with_rim


def test_the_base_decides_where_there_is_one(covered, tmp_path):
    """Its status where that differs, and the depth of cores that it stops."""
    status = covered["status"].values
    layered = covered.assign(
        layer_status=(("hit", "layer"), np.stack([np.zeros_like(status), status], axis=1)),
        stopped_in=("hit", np.where(status == Status.ARRESTED, 1, -1).astype(np.int8)),
        depth=("hit", np.where(status == Status.ARRESTED, 0.004, np.nan), {"units": "m", "long_name": "depth"}),
    )
    figure = verdict(with_references(layered, {"solid": layered.isel(hit=slice(0, 3))}))
    titles = [axes.get_title().split("\n")[0] for axes in figure.axes if axes.get_title()]
    assert titles == ["status", "depth in base"]
    depth = np.ma.filled(figure.axes[1].images[0].get_array(), np.nan)
    assert np.unique(depth[np.isfinite(depth)]) == pytest.approx([4.0])
    note = " ".join(figure.legends[0].get_title().get_text().split())
    assert note.startswith("P(base perforated) 50%")
    assert "solid, same weight 33%" in note


@pytest.mark.parametrize("ends", [MIXED, [Status.PERFORATED] * 4, [Status.ARRESTED] * 4])
def test_curves_are_the_shares_of_hits_above_an_energy(make_result, ends) -> None:
    plate, solid = make_result(np.tile(ends, 128)), make_result(np.tile([Status.ARRESTED, Status.PERFORATED], 20))
    figure = verdict(with_references(plate, {"solid": solid}))
    left, right, *_ = figure.axes
    mixed = len(set(ends)) > 1
    assert left.get_title().split("\n")[0] == ("status" if mixed else "residual energy fraction")
    assert (right.get_xlabel(), right.get_ylabel()) == (
        "residual energy [J]",
        "share of the hits above this energy [%]",
    )
    assert [line.get_label() for line in right.lines] == ["plate", "solid, same weight"]
    for line, result in zip(right.lines, (plate, solid), strict=True):
        passes = np.isin(result["status"], [Status.PERFORATED, Status.UNTOUCHED])
        energy = np.where(passes, 0.5 * CYLINDER.mass_properties.mass * result["residual_velocity"] ** 2, 0.0)
        x, y = line.get_data()
        for above in (0.0, 1.0, 1050.0, 1200.0, 2000.0):
            assert y[np.searchsorted(x, above, side="right") - 1] == pytest.approx(np.mean(energy > above))
    assert "solid, same weight 50%" in " ".join(figure.legends[0].get_title().get_text().split())


@pytest.fixture
def answered(make_result):
    """512 hits, 3 of them by elements: cores at y < 0 never pass, others in the first 24 of 32 draws."""
    dataset = make_result(512)
    passes = (np.arange(32) < 24)[:, None] & (dataset["hit_y"].values > 0.0)
    return with_draws(dataset, passes, elements=[5, 70, 200])


@pytest.mark.parametrize(
    "draw", [lambda one: variable_map(one, "perforated"), lambda one: measure_map(one, "P(perforated)")]
)
def test_a_map_of_an_answer_has_the_share_of_the_draws(answered, draw):
    figure = draw(answered)
    image = figure.axes[0].images[0].get_array()
    expected = np.where(answered["hit_y"].values > 0.0, 75.0, 0.0)[nearest_hits(answered.to_dataset(), image.shape)]
    assert np.mean(np.isclose(image[::11, ::11], expected)) > 0.999  # but for ties
    assert legend_texts(figure) == ["edge of hole", "hit by finite elements"]
    (marks,) = [line for line in figure.axes[0].lines if line.get_label() == "hit by finite elements"]
    np.testing.assert_allclose(marks.get_xdata(), 1e3 * answered["hit_y"].values[[5, 70, 200]])


def test_where_draws_pass_in_part_a_map_has_their_mean(answered):
    figure = variable_map(answered, "residual_velocity")
    image = np.ma.filled(figure.axes[0].images[0].get_array(), np.nan)[::11, ::11]
    nearest = nearest_hits(answered.to_dataset(), (200, 400))
    velocity = answered["residual_velocity"].values
    expected = np.where(answered["hit_y"].values > 0.0, velocity, np.nan)[nearest]
    assert np.mean(np.isclose(image, expected, equal_nan=True)) > 0.999
    assert legend_texts(figure)[0] == "no core passes: arrested"


def test_a_failed_shot_does_not_look_like_a_core_that_stops(make_result):
    status = np.tile([Status.PERFORATED, Status.ARRESTED, Status.UNFINISHED, Status.PERFORATED], 128)
    figure = variable_map(make_result(status), "tilt")
    assert legend_texts(figure) == ["no core passes: arrested", "not known: the computation failed", "edge of hole"]


def test_the_overview_begins_with_what_decides(answered):
    titles = [axes.get_title().split("\n")[0] for axes in overview(answered).axes]
    assert titles[0] == "share that passes the plate"
    note = overview(answered).legends[0].get_title().get_text()
    assert "512 hits, 3 of them by finite elements" in note


def test_curves_of_an_answer_have_bands(answered):
    right = verdict(answered).axes[1]
    (line,), (band,) = right.lines, right.collections
    share = np.mean(answered["hit_y"].values > 0.0)
    assert line.get_ydata()[0] == pytest.approx(0.75 * share)
    low, high = (pick(band.get_paths()[0].vertices[:, 1]) for pick in (np.min, np.max))
    assert low < 0.02
    assert share < high < share + 0.1


def test_uncertainty_is_that_of_the_draws(make_result):
    dataset = make_result(512)
    with pytest.raises(ValueError, match="result without draws"):
        uncertainty(dataset, "residual_velocity")
    answer = with_draws(dataset, np.ones((64, 512), dtype=bool))
    shifts = np.random.default_rng(3).normal(0.0, 10.0, 64)
    draws = answer["draws"].to_dataset()
    draws["residual_velocity"].values[:] = 700.0 + shifts[:, None]
    answer["draws"] = xarray.DataTree(draws)
    mean, half_width = (axes.images[0].get_array() for axes in uncertainty(answer, "residual_velocity").axes[:2])
    np.testing.assert_allclose(mean, 700.0 + shifts.mean(), rtol=1e-6)
    np.testing.assert_allclose(half_width, np.diff(ends_of_draws(shifts)).item() / 2.0, rtol=1e-4)


def test_marginals_are_the_quantiles_of_strips(make_result):
    dataset = make_result(1000)
    dataset["residual_velocity"].values[:] = 700.0 + 1e3 * dataset["hit_y"]
    above, centre, neighbour, histogram, _ = marginals(dataset, "residual_velocity").axes
    (median,) = above.lines
    np.testing.assert_allclose(median.get_ydata(), 700.0 + median.get_xdata(), atol=0.2)
    assert len(median.get_xdata()) == 20
    (median,) = neighbour.lines
    np.testing.assert_allclose(median.get_xdata(), 700.0, atol=4.0)
    assert sum(patch.get_width() for patch in histogram.patches) == 1000
    assert (above.get_xlim(), neighbour.get_ylim()) == (centre.get_xlim(), centre.get_ylim())


CAMPAIGNS = Path(__file__).parents[3] / "campaigns"
ALIKE = 0.03
"""Mean difference of coarse pictures, of the range of a colour: fonts and hits on an edge differ between machines."""
HOSTILE = {
    "figure.constrained_layout.use": True,
    "figure.autolayout": True,
    "savefig.transparent": True,
    "font.size": 25,
    "text.usetex": True,
}
PLATE = Plate(thickness="4 mm", resistance="2 GPa", pattern=CirclePattern(diameter="5 mm", spacing="8 mm"))


def pixels(figure, dpi: float = 60.0) -> Image.Image:
    buffer = io.BytesIO()
    figure.savefig(buffer, dpi=dpi)
    return Image.open(buffer)


def coarse(picture: Image.Image) -> np.ndarray:
    return np.asarray(picture.convert("RGB").resize((64, 64), Image.Resampling.BOX), dtype=float) / 255.0


@pytest.mark.usefixtures("all_draws")
def test_stored_pictures_are_not_stale() -> None:
    drawn, stale = [], {}
    for name, figure, width in gallery.pictures():
        drawn.append(name)
        with Image.open(CAMPAIGNS / name) as stored:
            off = np.abs(coarse(pixels(figure, width / figure.get_figwidth())) - coarse(stored)).mean()
        stale |= {name: round(float(off), 3)} if off >= ALIKE else {}
        assert (CAMPAIGNS / name).stat().st_size <= gallery.LARGEST
    assert not stale, "these differ from what the code draws; run make gallery"
    kept = {path.relative_to(CAMPAIGNS).as_posix() for path in (CAMPAIGNS / "gallery").glob("*.png")}
    by_browser = {name for name in kept if name.startswith("gallery/design_")}  # tests/benchmarks/design_film.py
    assert kept - by_browser == {name for name in drawn if name.startswith("gallery/")}


@pytest.mark.parametrize("draw", [overview, lambda result: variable_map(result, "tilt"), lambda _: plate_figure(PLATE)])
def test_settings_of_a_user_change_no_pixel(make_result, draw) -> None:
    result = make_result(100)
    result.attrs["title"] = "worth 5 $ or 6 $"
    expected = np.asarray(pixels(draw(result)))
    with warnings.catch_warnings(action="error"), matplotlib.rc_context(HOSTILE):
        np.testing.assert_array_equal(pixels(draw(result)), expected)
        assert matplotlib.rcParams["font.size"] == 25


def test_the_front_its_plates_and_the_references_are_drawn(searched: xarray.Dataset) -> None:
    figure, confirmed = front_figure(searched), np.flatnonzero(searched["front_confirmed"].values)
    titles = [axes.get_title() for axes in figure.axes]
    assert sum(title.startswith(tuple("ABCDEF")) for title in titles) == min(6, len(confirmed)) > 1
    (front,) = [axes for axes in figure.axes if axes.get_xlabel().startswith("areal density [kg/m²], less")]
    drawn = {tuple(point) for line in front.lines for point in np.transpose(line.get_data())}
    for point in [*searched["front_result"].values[confirmed], *searched["reference_result"].values]:
        assert tuple(point) in drawn
    assert "published" in [text.get_text() for text in front.get_legend().get_texts()]
    assert {"thickness", "pattern"} <= {axes.get_title(loc="left") for axes in figure.axes}


@pytest.mark.parametrize(
    ("old", "new", "label", "line"),
    [
        ('measure = "areal_density" }, {', "", "thickness", None),
        ("objectives = [{", 'bounds = [{ measure = "areal_density", at_most = 30 }]\nobjectives = [{', "areal", 30.0),
        ("search = {", "constraints = { largest_areal_density = '29 kg/m^2' }\nsearch = {", "areal density", 29.0),
    ],
)
def test_a_front_has_two_quantities_and_its_bound(old: str, new: str, label: str, line: float | None) -> None:
    figure = front_figure(optimise(design_from(SEARCHED.replace(old, new), "design", Path())))
    (front,) = [axes for axes in figure.axes if "residual energy" in axes.get_ylabel()]
    assert front.get_xlabel().startswith(label)
    bounds = [list(drawn.get_xdata()) for drawn in front.lines if drawn.get_label().startswith("bound")]
    assert bounds == ([[line, line]] if line else [])
    others = [axes.get_title(loc="left") for axes in figure.axes]  # of what stands on no axis
    assert not any(title.startswith(label) for title in others)
