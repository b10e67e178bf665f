"""Figures: a Dataset, or a plate, goes in, a matplotlib Figure comes out."""

from warpimpact.plotting.maps import hit_map, overview, save_maps, status_map
from warpimpact.plotting.plate import plate_figure
from warpimpact.plotting.study import study_figure

__all__ = ["hit_map", "overview", "plate_figure", "save_maps", "status_map", "study_figure"]
