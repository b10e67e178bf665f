"""The figure of a search shows the front by fresh hits, its plates and what they are compared with."""

import numpy as np
import xarray

from warpimpact.plotting.front import front_figure, front_leaders, holding
from warpimpact.results import front as f


def test_the_front_its_plates_and_the_references_are_drawn(searched: xarray.Dataset) -> None:
    figure, leaders = front_figure(searched), front_leaders(searched)
    titles = [axes.get_title() for axes in figure.axes]
    assert sum(title.startswith(tuple("ABCDEF")) for title in titles) == min(6, len(leaders)) > 1
    (front,) = [axes for axes in figure.axes if axes.get_xlabel().startswith("areal density [kg/m²], less")]
    drawn = {tuple(point) for line in front.lines for point in np.transpose(line.get_data())}
    for point in [*searched[f.FRESH].values[leaders], *searched[f.REFERENCE_FOUND].values, *searched[f.SOLID].values]:
        assert tuple(point) in drawn
    assert "published" in [text.get_text() for text in front.get_legend().get_texts()]
    assert {"thickness", "pattern"} <= {axes.get_title(loc="left") for axes in figure.axes}


def test_what_lies_beyond_the_front_by_few_hits_is_counted_and_not_drawn(searched: xarray.Dataset) -> None:
    lucky = int(searched[f.NUMBER][-1])  # it is taken off the front
    changed = searched.isel(front=slice(None, -1)).copy(deep=True)
    goals = np.isnan(changed[f.ASKED_LIMIT].values)
    changed[f.FOUND][lucky] = np.where(goals, -1e6 * changed[f.SIGN], changed[f.ASKED_LIMIT])
    assert not holding(changed)[lucky]
    figure = front_figure(changed)
    (front,) = [axes for axes in figure.axes if axes.get_xlabel().startswith("areal density [kg/m²], less")]
    assert -1e6 not in front.lines[0].get_xdata()
    assert "left out: " in figure.get_supxlabel()
