"""Where a window is that slides over its plate to follow a core, and whether it may (kernels/layers.py)."""

from functools import cache
from types import SimpleNamespace

import warp as wp

from . import plate_grid
from .variant import Variant


@cache
def build(variant: Variant) -> SimpleNamespace:
    """Device functions of windows that slide for one variant."""
    use = variant.use(plate_grid)
    Window, Box = use.plate_grid.Window, use.plate_grid.Box

    @wp.func
    def extent_of(window: Window):
        """The nodes of a window, from its home."""
        extent = Box()
        extent.y_low = -window.home_y
        extent.z_low = -window.home_z
        extent.y_high = extent.y_low + window.cells_y - 1
        extent.z_high = extent.z_low + window.cells_z - 1
        return extent

    @wp.func
    def around(one: Box, other: Box):
        """The nodes about those of two boxes."""
        found = one
        found.y_low = wp.min(one.y_low, other.y_low)
        found.z_low = wp.min(one.z_low, other.z_low)
        found.y_high = wp.max(one.y_high, other.y_high)
        found.z_high = wp.max(one.z_high, other.z_high)
        return found

    @wp.func
    def moved(box: Box, rows: wp.int32, columns: wp.int32):
        """The nodes of a box as a window has them that has slid by some rows and columns."""
        found = box
        found.y_low -= rows
        found.y_high -= rows
        found.z_low -= columns
        found.z_high -= columns
        return found

    @wp.func
    def slid(window: Window, rows: wp.int32, columns: wp.int32):
        """A window that has slid over its plate by some rows and columns."""
        found = window
        found.home -= rows * window.cells_z + columns
        found.home_y -= rows
        found.home_z -= columns
        return found

    @wp.func
    def is_ahead(before: Box, after: Box, known: Box):
        """Whether a window that slides from one place to another takes in none of the nodes that it has left earlier,
        of all that are `known`."""
        return (
            wp.max(after.y_low, known.y_low) >= before.y_low
            and wp.min(after.y_high, known.y_high) <= before.y_high
            and wp.max(after.z_low, known.z_low) >= before.z_low
            and wp.min(after.z_high, known.z_high) <= before.z_high
        )

    return SimpleNamespace(**locals())
