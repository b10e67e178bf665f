"""The place of a window that slides over its plate to follow a core, and whether it may slide (kernels/layers.py)."""

from functools import cache
from types import SimpleNamespace

import warp as wp

from . import structs
from .variant import Variant


@cache
def build(variant: Variant) -> SimpleNamespace:
    """Device functions of windows that slide for one variant."""
    struct = structs.build(variant)

    @wp.func
    def extent_of(window: struct.Window):
        """The nodes of a window, counted from its home."""
        extent = struct.Box()
        extent.y_low = -window.home_y
        extent.z_low = -window.home_z
        extent.y_high = extent.y_low + window.cells_y - 1
        extent.z_high = extent.z_low + window.cells_z - 1
        return extent

    @wp.func
    def around(a: struct.Box, b: struct.Box):
        """The smallest box that holds two boxes."""
        both = a
        both.y_low = wp.min(a.y_low, b.y_low)
        both.z_low = wp.min(a.z_low, b.z_low)
        both.y_high = wp.max(a.y_high, b.y_high)
        both.z_high = wp.max(a.z_high, b.z_high)
        return both

    @wp.func
    def moved(box: struct.Box, rows: wp.int32, columns: wp.int32):
        """A box in the node numbers of a window that has slid by some rows and columns."""
        seen = box
        seen.y_low -= rows
        seen.y_high -= rows
        seen.z_low -= columns
        seen.z_high -= columns
        return seen

    @wp.func
    def slid(window: struct.Window, rows: wp.int32, columns: wp.int32):
        """A window after it has slid over its plate by some rows and columns."""
        moved_window = window
        moved_window.home -= rows * window.cells_z + columns
        moved_window.home_y -= rows
        moved_window.home_z -= columns
        return moved_window

    @wp.func
    def is_ahead(before: struct.Box, after: struct.Box, known: struct.Box):
        """Whether a window that slides takes in only nodes that it has never held, of all that it has held
        (`known`)."""
        return (
            wp.max(after.y_low, known.y_low) >= before.y_low
            and wp.min(after.y_high, known.y_high) <= before.y_high
            and wp.max(after.z_low, known.z_low) >= before.z_low
            and wp.min(after.z_high, known.z_high) <= before.z_high
        )

    return SimpleNamespace(**locals())
