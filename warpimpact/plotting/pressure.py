"""Figure of the normal stress on the core's surface (the paper's fig. 5)."""

from __future__ import annotations

import numpy as np
import xarray
from matplotlib import colormaps
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from warpimpact.analysis.surface import POINTS_AROUND, largest_in_plate, pressed
from warpimpact.plotting.heading import inscribe_hit
from warpimpact.results import variables as v

_MM, _US = 1e3, 1e6
_LONGEST_STRESS = 5.0  # length of the largest stress [mm]
_SECTIONS, _SPOKES = 3, 3  # every third section and azimuth gets an arrow


def pressure(dataset: xarray.Dataset) -> Figure:
    """The core at its largest force; arrows into its surface show the normal stress.

    Colour and length show the stress as a share of that of the untouched plate at rest (`analysis.surface.pressed`).
    """
    step = largest_in_plate(dataset)
    surface = pressed(dataset, step)
    figure = Figure(figsize=(9.0, 6.0), layout="constrained")
    when = f"at {float(dataset[v.TIME][step]) * _US:.1f} µs"
    inscribe_hit(figure, dataset, f"normal stress under the largest force, {when}")
    axes = figure.add_subplot(projection="3d")
    x, y, z = np.moveaxis(np.concatenate([surface.point, surface.point[:, :1]], axis=1) * _MM, -1, 0)
    axes.plot_wireframe(x, y, z, rcount=24, ccount=POINTS_AROUND // _SPOKES, color="0.75", linewidth=0.5)
    some = np.zeros(surface.stress.shape, dtype=bool)
    some[::_SECTIONS, ::_SPOKES] = True
    some &= surface.stress > 0.0
    scale, colours = Normalize(0.0, 1.0), colormaps["viridis"]
    arrows = -surface.normal[some] * surface.stress[some][:, None] * _LONGEST_STRESS
    tails = surface.point[some] * _MM - arrows
    axes.quiver(
        *tails.T, *arrows.T, colors=colours(scale(surface.stress[some])), linewidths=1.2, arrow_length_ratio=0.3
    )
    axes.set(xlabel="x [mm]", ylabel="y [mm]", zlabel="z [mm]", aspect="equal")
    axes.set_box_aspect([np.ptp(axes.get_xlim()), np.ptp(axes.get_ylim()), np.ptp(axes.get_zlim())], zoom=1.3)
    for side in (axes.yaxis, axes.zaxis):
        side.set_major_locator(MaxNLocator(4))
    label = "normal stress, share of the untouched plate's"
    figure.colorbar(ScalarMappable(scale, colours), ax=axes, shrink=0.6, pad=0.1, label=label)
    return figure
