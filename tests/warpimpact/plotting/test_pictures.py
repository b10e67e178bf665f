"""Pictures of the README are what the code draws, whatever a user's matplotlibrc says; the figure of a search."""

import io
import warnings
from pathlib import Path

import matplotlib
import numpy as np
import pytest
import xarray
from PIL import Image

from warpimpact.campaigns import gallery
from warpimpact.plotting import overview, plate_figure, variable_map
from warpimpact.plotting.comparison import front_figure
from warpimpact.results import front as f
from warpimpact.scene import CirclePattern, Plate

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
    figure, confirmed = front_figure(searched), np.flatnonzero(searched[f.CONFIRMED].values)
    titles = [axes.get_title() for axes in figure.axes]
    assert sum(title.startswith(tuple("ABCDEF")) for title in titles) == min(6, len(confirmed)) > 1
    (front,) = [axes for axes in figure.axes if axes.get_xlabel().startswith("areal density [kg/m²], less")]
    drawn = {tuple(point) for line in front.lines for point in np.transpose(line.get_data())}
    for point in [*searched[f.FRESH].values[confirmed], *searched[f.REFERENCE_RESULT].values]:
        assert tuple(point) in drawn
    assert "published" in [text.get_text() for text in front.get_legend().get_texts()]
    assert {"thickness", "pattern"} <= {axes.get_title(loc="left") for axes in figure.axes}
