"""A user's matplotlibrc changes no figure."""

import io
import warnings

import matplotlib
import numpy as np
import pytest
from PIL import Image

from warpimpact.plotting import overview, plate_figure, variable_map
from warpimpact.scene import CirclePattern, Plate

HOSTILE = {
    "figure.constrained_layout.use": True,
    "figure.autolayout": True,
    "figure.dpi": 50,
    "savefig.transparent": True,
    "savefig.bbox": "tight",
    "font.size": 25,
    "axes.grid": True,
    "axes.facecolor": "red",
    "image.cmap": "hot",
    "lines.linewidth": 7,
    "text.usetex": True,
}
PLATE = Plate(thickness="4 mm", resistance="2 GPa", pattern=CirclePattern(diameter="5 mm", spacing="8 mm"))


def pixels(figure) -> np.ndarray:
    buffer = io.BytesIO()
    figure.savefig(buffer, dpi=60)
    return np.asarray(Image.open(buffer))


@pytest.mark.parametrize(
    "draw", [overview, lambda result: variable_map(result, "status"), lambda _: plate_figure(PLATE)]
)
def test_settings_of_a_user_change_no_pixel(make_result, draw) -> None:
    result = make_result(100)
    result.attrs["title"] = "worth 5 $ or 6 $"
    expected = pixels(draw(result))
    with warnings.catch_warnings(action="error"), matplotlib.rc_context(HOSTILE):
        np.testing.assert_array_equal(pixels(draw(result)), expected)
        assert matplotlib.rcParams["font.size"] == 25
