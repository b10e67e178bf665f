"""The figure of a search shows the front by fresh hits, its plates and what they are compared with."""

import numpy as np
import xarray

from warpimpact.plotting.front import front_figure
from warpimpact.results import front as f


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
