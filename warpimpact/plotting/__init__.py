"""Figures: from a Dataset or a plate to a matplotlib Figure.

Change axes, colours and layout here; a number that a figure shows is computed in analysis or statistics. It imports
analysis and the rooms below it, but neither export nor report. Text in figures is never mathtext.
"""

from warpimpact.plotting.comparison import comparison_figure, impact_figure
from warpimpact.plotting.maps import (
    breaks,
    layers_figure,
    marginals,
    measure_map,
    overview,
    save_maps,
    save_side_by_side,
    uncertainty,
    variable_map,
    variable_maps,
    verdict,
)
from warpimpact.plotting.plate import plate_figure
from warpimpact.plotting.studies import limit_figure
from warpimpact.plotting.trajectory import course, flight, passage, pressure
