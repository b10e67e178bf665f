"""The plate: the shared pristine pattern, and each shot's own window of it.

The pattern is a periodic tile of material fractions. The tile is so fine that a point reads only the cell under it. A
window is the part of the plate that one core can reach, as a grid about the hit.
"""

from functools import cache
from types import SimpleNamespace

import warp as wp

from . import lanes, structs
from .variant import Variant


@cache
def build(variant: Variant) -> SimpleNamespace:
    """Device functions of the plate for one variant."""
    struct = structs.build(variant)
    real, reals = variant.real, variant.reals
    zero, half, one = real(0.0), real(0.5), real(1.0)

    @wp.func
    def window_at(
        plate: struct.Plate,
        thickness: real,
        first: wp.int32,
        cells_y: wp.int32,
        cells_z: wp.int32,
        hit: wp.vec2d,
    ):
        """The window about a hit, from node `first` of its slot on. It is computed in float64, so a hit far from the
        origin loses no accuracy."""
        window = struct.Window()
        window.first = first
        window.nodes = cells_y * cells_z
        window.home_y = cells_y // 2
        window.home_z = cells_z // 2
        window.home = window.first + window.home_y * cells_z + window.home_z
        window.cells_y = cells_y
        window.cells_z = cells_z
        window.thickness = thickness
        window.per_cell = one / plate.spacing
        # Whole cells of the tile are kept apart from the rest, so two hits that differ by a lattice vector of whole
        # cells compute the same bits.
        across = hit[0] * wp.float64(plate.tile_y) / plate.period_y
        along = hit[1] * wp.float64(plate.tile_z) / plate.period_z
        window.row = wp.int32(wp.floor(across)) % plate.tile_y
        window.column = wp.int32(wp.floor(along)) % plate.tile_z
        window.tile_y = real(across - wp.floor(across))
        window.tile_z = real(along - wp.floor(along))
        window.per_row = real(wp.float64(plate.tile_y) / plate.period_y)
        window.per_column = real(wp.float64(plate.tile_z) / plate.period_z)
        window.low_y = real(-plate.half_y - hit[0])
        window.high_y = real(plate.half_y - hit[0])
        window.low_z = real(-plate.half_z - hit[1])
        window.high_z = real(plate.half_z - hit[1])
        return window

    @wp.func
    def within(place: real, period: wp.int32):
        """Wrap a whole number, at most a few periods away, into 0 … period − 1. A compiler vectorises floor, but no
        remainder."""
        return wp.int32(place - real(period) * wp.floor((place + half) / real(period)))

    @wp.func
    def tile_at(plate: struct.Plate, window: struct.Window, y: real, z: real):
        """Index of the tile's cell that holds a point."""
        row = real(window.row) + wp.floor(window.tile_y + y * window.per_row)
        column = real(window.column) + wp.floor(window.tile_z + z * window.per_column)
        return within(row, plate.tile_y) * plate.tile_z + within(column, plate.tile_z)

    # Native, because a compiler reads several cells at once only if the pointers do not alias.
    @wp.func_native(
        lanes.share(variant)
        + """
    assert(start >= 0 && start + count <= area.shape[0]);
    const auto scale = [=](auto* __restrict__ area, auto* __restrict__ slope, auto* __restrict__ gain,
                               const int* __restrict__ at, const auto* __restrict__ tile, int cells) {
        decltype(0 * area[0]) total = 0;
        for (int j = lane; j < count; j += lanes) {
            assert(at[j] >= 0 && at[j] < cells);
            const auto share = tile[at[j]];
            area[j] *= share;
            slope[j] *= share;
            gain[j] *= share;
            total += area[j];
        }
        return total;
    };
    return scale(area.data + start, slope.data + start, gain.data + start, at.data + start, tile.data, tile.shape[0]);
    """
    )
    def meet(
        area: reals,
        slope: reals,
        gain: reals,
        at: wp.array(dtype=wp.int32),
        tile: reals,
        start: wp.int32,
        count: wp.int32,
    ) -> real:
        """Multiply three lists by tile[at], from `start` on; return the new sum of the first one."""
        ...

    @wp.func
    def on_plate(plate: struct.Plate, window: struct.Window, y: real, z: real):
        """Share of half a grid cell about a point that lies on a finite plate."""
        width = half * plate.spacing
        inside_y = wp.min(y - window.low_y, window.high_y - y) / width + half
        inside_z = wp.min(z - window.low_z, window.high_z - z) / width + half
        return wp.clamp(inside_y, zero, one) * wp.clamp(inside_z, zero, one)

    @wp.func
    def cell_at(window: struct.Window, y: real, z: real):
        """The grid cell around a point. The caller keeps the point inside the window."""
        across, along = y * window.per_cell, z * window.per_cell
        row, column = wp.floor(across), wp.floor(along)
        cell = struct.Cell()
        cell.index = window.home + wp.int32(row) * window.cells_z + wp.int32(column)
        cell.row = wp.int32(row) + window.home_y
        cell.column = wp.int32(column) + window.home_z
        cell.y = across - row
        cell.z = along - column
        return cell

    return SimpleNamespace(**locals())
