"""The figure of a search shows the front by fresh hits, its plates and what they are compared with."""

from pathlib import Path

import numpy as np

from warpimpact.optimisation.design import design_from
from warpimpact.optimisation.optimise import optimise
from warpimpact.plotting.front import front_figure, front_leaders
from warpimpact.results import front as f

DESIGN = """
title = "plates"
core = { shape = "cone", diameter = "6 mm", length = "20 mm", cone_length = "8 mm", mass = "4 g" }
impact = { velocity = "825 m/s" }
numerics = { level = 0 }
plate = { thickness = "4 mm", resistance = "2600 MPa" }
objectives = [{ measure = "areal_density" }, { measure = "residual_energy_fraction" }]
search = { designs = 6, hits = 16, most_hits = 16, confirm_hits = 64 }
[[references]]
name = "published"
[references.plate]
thickness = "3 mm"
resistance = "2600 MPa"
pattern = { shape = "circle", diameter = "4 mm", spacing = "8 mm" }
[variables]
thickness = ["2 mm", "3 mm", "4 mm"]
[[variables."plate.pattern"]]
name = "holes"
shape = "circle"
diameter = "5 mm"
spacing = "8 mm"
[[variables."plate.pattern"]]
name = "solid"
shape = "none"
"""


def test_the_front_its_plates_and_the_references_are_drawn() -> None:
    found = optimise(design_from(DESIGN, "design", Path()))
    figure, leaders = front_figure(found), front_leaders(found)
    titles = [axes.get_title() for axes in figure.axes]
    assert sum(title.startswith(tuple("ABCDEF")) for title in titles) == min(6, len(leaders)) > 1
    (front,) = [axes for axes in figure.axes if axes.get_xlabel().startswith("areal density [kg/m²], less")]
    drawn = {tuple(point) for line in front.lines for point in np.transpose(line.get_data())}
    for point in [*found[f.FRESH].values[leaders], *found[f.REFERENCE_FOUND].values, *found[f.SOLID].values]:
        assert tuple(point) in drawn
    assert "published" in [text.get_text() for text in front.get_legend().get_texts()]
    assert {"thickness", "pattern"} <= {axes.get_title(loc="left") for axes in figure.axes}
