"""Figures of a hit map: a Dataset goes in, a matplotlib Figure comes out."""

from warpimpact.plotting.maps import hit_map, overview, save_maps, status_map

__all__ = ["hit_map", "overview", "save_maps", "status_map"]
