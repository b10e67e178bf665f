"""The plate as a grid: the shared pristine pattern, and each shot's own window with its exposure.

The pattern is a periodic tile of material fractions. A window is the part of the plate that one core can
reach, aligned with the tile; it remembers each cell's exposure T [s].
"""

from functools import cache
from types import SimpleNamespace

import warp as wp

from .variant import Variant


@cache
def build(variant: Variant) -> SimpleNamespace:
    """Device functions of the grid for one variant."""
    real = variant.real
    zero, half, one = real(0.0), real(0.5), real(1.0)
    double_half, double_zero, double_one = wp.float64(0.5), wp.float64(0.0), wp.float64(1.0)

    @wp.struct
    class Plate:
        """Pristine plate: period tile [tile_y × tile_z] of material fractions, cells of dy × dz [m]; the
        half extents [m] of a finite plate (infinite if there is no rim); tent filter of the exposure."""

        tile: wp.array(dtype=real)
        tile_y: wp.int32
        tile_z: wp.int32
        dy: wp.float64
        dz: wp.float64
        half_y: wp.float64
        half_z: wp.float64
        thickness: real
        taps_y: wp.array(dtype=real)
        taps_z: wp.array(dtype=real)
        reach_y: wp.int32
        reach_z: wp.int32

    @wp.struct
    class Fields:
        """Scratch of all slots, each cells_y × cells_z: material fraction, exposure [s], exposure gained in
        the step [s], and room for the filter."""

        material: wp.array(dtype=real)
        exposure: wp.array(dtype=real)
        gain: wp.array(dtype=real)
        filtered: wp.array(dtype=real)
        cells_y: wp.int32
        cells_z: wp.int32

    @wp.struct
    class Window:
        """One slot's part of the fields. (y0, z0) is the centre of the cell under the hit, relative to the
        hit [m], and `home` that cell's index: a shot computes the same bits in a window of any size."""

        first: wp.int32
        home: wp.int32
        y0: real
        z0: real
        per_y: real
        per_z: real

    @wp.struct
    class Cell:
        """The four cells around a point: index of the first, and the point's place between them, 0 to 1."""

        index: wp.int32
        y: real
        z: real

    @wp.struct
    class Box:
        """Cell rows and columns, ends included, that a step may touch."""

        y_low: wp.int32
        y_high: wp.int32
        z_low: wp.int32
        z_high: wp.int32

    @wp.func
    def covered(centre: wp.float64, width: wp.float64, half_extent: wp.float64):
        """Share of a cell's width that lies on a finite plate."""
        low = wp.max(centre - double_half * width, -half_extent)
        high = wp.min(centre + double_half * width, half_extent)
        return wp.clamp((high - low) / width, double_zero, double_one)

    @wp.func
    def open_window(plate: Plate, fields: Fields, slot: wp.int32, hit_y: wp.float64, hit_z: wp.float64):
        """Lay a fresh window about the hit: material from the tile, no exposure.

        Cell indices are found in float64, so that a hit far from the origin loses nothing.
        """
        home_y = wp.int32(wp.floor(hit_y / plate.dy))
        home_z = wp.int32(wp.floor(hit_z / plate.dz))
        first_y = home_y - fields.cells_y // 2
        first_z = home_z - fields.cells_z // 2
        window = Window()
        window.first = slot * fields.cells_y * fields.cells_z
        window.home = window.first + (fields.cells_y // 2) * fields.cells_z + fields.cells_z // 2
        window.y0 = real((wp.float64(home_y) + double_half) * plate.dy - hit_y)
        window.z0 = real((wp.float64(home_z) + double_half) * plate.dz - hit_z)
        window.per_y = real(double_one / plate.dy)
        window.per_z = real(double_one / plate.dz)
        index = window.first
        for i in range(fields.cells_y):
            row = (first_y + i) % plate.tile_y
            if row < 0:
                row += plate.tile_y
            column = first_z % plate.tile_z
            if column < 0:
                column += plate.tile_z
            on_y = covered((wp.float64(first_y + i) + double_half) * plate.dy, plate.dy, plate.half_y)
            for j in range(fields.cells_z):
                share = plate.tile[row * plate.tile_z + column]
                if wp.isfinite(plate.half_y):
                    share *= real(
                        on_y * covered((wp.float64(first_z + j) + double_half) * plate.dz, plate.dz, plate.half_z)
                    )
                fields.material[index] = share
                if wp.static(variant.degrades):
                    fields.gain[index] = zero
                if wp.static(variant.degrades and not variant.nodal):
                    fields.exposure[index] = zero
                index += 1
                column += 1
                if column == plate.tile_z:
                    column = 0
        return window

    @wp.func
    def cell_at(fields: Fields, window: Window, y: real, z: real):
        """The cell whose centre and the next ones' enclose a point; the caller keeps it inside the window."""
        across = (y - window.y0) * window.per_y
        along = (z - window.z0) * window.per_z
        row = wp.floor(across)
        column = wp.floor(along)
        cell = Cell()
        cell.index = window.home + wp.int32(row) * fields.cells_z + wp.int32(column)
        cell.y = across - row
        cell.z = along - column
        return cell

    @wp.func
    def gather(field: wp.array(dtype=real), stride: wp.int32, cell: Cell):
        """Bilinear interpolation."""
        low = field[cell.index] + cell.z * (field[cell.index + 1] - field[cell.index])
        next = cell.index + stride
        high = field[next] + cell.z * (field[next + 1] - field[next])
        return low + cell.y * (high - low)

    @wp.func
    def scatter(field: wp.array(dtype=real), stride: wp.int32, cell: Cell, amount: real):
        """Share an amount out over the four cells, by the weights of the interpolation."""
        high = amount * cell.y
        low = amount - high
        next = cell.index + stride
        field[cell.index] = field[cell.index] + low * (one - cell.z)
        field[cell.index + 1] = field[cell.index + 1] + low * cell.z
        field[next] = field[next] + high * (one - cell.z)
        field[next + 1] = field[next + 1] + high * cell.z

    # Native, because only with pointers that do not alias does a CPU run these two loops in vector registers.
    @wp.func_native("""
    auto* __restrict__ into = target.data + to;
    const auto* __restrict__ from = source.data + start;
    for (int j = 0; j < count; ++j) into[j] += factor * from[j];
    """)
    def add_scaled(
        target: wp.array(dtype=real),
        to: wp.int32,
        source: wp.array(dtype=real),
        start: wp.int32,
        count: wp.int32,
        factor: real,
    ):
        """target[to + j] += factor × source[start + j] for j < count; target and source are different arrays."""
        ...

    @wp.func_native("""
    auto* __restrict__ into = target.data + start;
    for (int j = 0; j < count; ++j) into[j] = 0;
    """)
    def clear(target: wp.array(dtype=real), start: wp.int32, count: wp.int32):
        """target[start + j] = 0 for j < count."""
        ...

    @wp.func
    def spread(plate: Plate, fields: Fields, window: Window, box: Box):
        """Filter the gained exposure with the tent K of the law, one direction after the other, and add half
        of it to the exposure: what the mid-step sees."""
        stride = fields.cells_z
        inner = box.z_high - box.z_low + 1
        outer = inner + 2 * plate.reach_z
        left = window.first + box.z_low - plate.reach_z
        for i in range(box.y_low, box.y_high + 1):
            clear(fields.filtered, left + i * stride, outer)
            for k in range(2 * plate.reach_z + 1):
                to = left + k + i * stride
                from_ = left + plate.reach_z + i * stride
                add_scaled(fields.filtered, to, fields.gain, from_, inner, plate.taps_z[k])
        for i in range(box.y_low - plate.reach_y, box.y_high + plate.reach_y + 1):
            row = left + i * stride
            clear(fields.gain, row, outer)
            for k in range(2 * plate.reach_y + 1):
                source = i + k - plate.reach_y
                if source >= box.y_low and source <= box.y_high:
                    add_scaled(fields.gain, row, fields.filtered, left + source * stride, outer, plate.taps_y[k])
            add_scaled(fields.exposure, row, fields.gain, row, outer, half)

    @wp.func
    def settle(plate: Plate, fields: Fields, window: Window, box: Box):
        """Add the other half of the gained exposure and clear it for the next step."""
        outer = box.z_high - box.z_low + 1 + 2 * plate.reach_z
        for i in range(box.y_low - plate.reach_y, box.y_high + plate.reach_y + 1):
            row = window.first + i * fields.cells_z + box.z_low - plate.reach_z
            add_scaled(fields.exposure, row, fields.gain, row, outer, half)
            clear(fields.gain, row, outer)

    return SimpleNamespace(
        Plate=Plate,
        Fields=Fields,
        Window=Window,
        Cell=Cell,
        Box=Box,
        open_window=open_window,
        cell_at=cell_at,
        gather=gather,
        scatter=scatter,
        spread=spread,
        settle=settle,
    )
