"""Figures: a Dataset goes in, a matplotlib Figure comes out."""

from warpimpact.plotting.comparison import comparison_figure
from warpimpact.plotting.maps import hit_map, overview, save_maps, status_map
from warpimpact.plotting.study import study_figure

__all__ = ["comparison_figure", "hit_map", "overview", "save_maps", "status_map", "study_figure"]
