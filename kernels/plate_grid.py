"""The plate: the shared pristine pattern, and each shot's own window of exposure.

The pattern is a periodic tile of material fractions, so fine that the cell under a point is enough. A window is the
part of the plate that one core can reach, a grid about the hit; it remembers each node's exposure T [s].
"""

from functools import cache
from types import SimpleNamespace

import warp as wp

from . import memory
from .variant import Variant


@cache
def build(variant: Variant) -> SimpleNamespace:
    """Device functions of the plate for one variant."""
    real = variant.real
    zero, half, one = real(0.0), real(0.5), real(1.0)
    read, write = memory.build(real).read, memory.build(real).write

    @wp.struct
    class Plate:
        """Pristine plate: one period [m] as a tile [tile_y × tile_z] of material fractions, corner at the origin; how
        far at least each of its cells is from any material [m]; the half extents [m] of a finite plate (infinite if
        there is no rim); the spacing [m] of the exposure's grid, and half of the tent filter on it, which reaches at
        least one node far."""

        tile: wp.array(dtype=real)
        clear: wp.array(dtype=real)
        tile_y: wp.int32
        tile_z: wp.int32
        period_y: wp.float64
        period_z: wp.float64
        half_y: wp.float64
        half_z: wp.float64
        spacing: real
        taps: wp.array(dtype=real)
        reach: wp.int32

    @wp.struct
    class Fields:
        """Scratch of all slots, each cells_y × cells_z: exposure [s], exposure gained in the step [s], and room for
        the filter."""

        exposure: wp.array(dtype=real)
        gain: wp.array(dtype=real)
        filtered: wp.array(dtype=real)
        cells_y: wp.int32
        cells_z: wp.int32

    @wp.struct
    class Window:
        """One slot's part of the fields, and how to find the tile. The hit is the node of index `home`: a shot
        computes the same bits in a window of any size. The cell of the tile that holds the hit, the hit's place in it,
        and cells per metre; the thickness of the plate and, seen from the hit, its rims [m]. (y0, z0): where the
        literal scheme has its node `home` [m]."""

        first: wp.int32
        home: wp.int32
        cells_y: wp.int32
        cells_z: wp.int32
        per_cell: real
        row: wp.int32
        column: wp.int32
        tile_y: real
        tile_z: real
        per_row: real
        per_column: real
        thickness: real
        low_y: real
        high_y: real
        low_z: real
        high_z: real
        y0: real
        z0: real

    @wp.struct
    class Cell:
        """The four nodes around a point: index of the first, and the point's place between them, 0 to 1."""

        index: wp.int32
        y: real
        z: real

    @wp.struct
    class Box:
        """Rows and columns of nodes, ends included, that a step may touch."""

        y_low: wp.int32
        y_high: wp.int32
        z_low: wp.int32
        z_high: wp.int32

    @wp.func
    def window_at(
        plate: Plate,
        thickness: real,
        cells_y: wp.int32,
        cells_z: wp.int32,
        slot: wp.int32,
        hit_y: wp.float64,
        hit_z: wp.float64,
    ):
        """The window about a hit, found in float64, so that a hit far from the origin loses nothing."""
        window = Window()
        window.first = slot * cells_y * cells_z
        window.home = window.first + (cells_y // 2) * cells_z + cells_z // 2
        window.cells_y = cells_y
        window.cells_z = cells_z
        window.thickness = thickness
        window.per_cell = one / plate.spacing
        # Whole cells of the tile and the rest apart, so that hits a lattice vector of whole cells apart compute the
        # same bits.
        across = hit_y * wp.float64(plate.tile_y) / plate.period_y
        along = hit_z * wp.float64(plate.tile_z) / plate.period_z
        window.row = wp.int32(wp.floor(across)) % plate.tile_y
        window.column = wp.int32(wp.floor(along)) % plate.tile_z
        window.tile_y = real(across - wp.floor(across))
        window.tile_z = real(along - wp.floor(along))
        window.per_row = real(wp.float64(plate.tile_y) / plate.period_y)
        window.per_column = real(wp.float64(plate.tile_z) / plate.period_z)
        window.low_y = real(-plate.half_y - hit_y)
        window.high_y = real(plate.half_y - hit_y)
        window.low_z = real(-plate.half_z - hit_z)
        window.high_z = real(plate.half_z - hit_z)
        return window

    @wp.func
    def within(place: real, period: wp.int32):
        """A whole number, of a few periods, brought into 0 … period − 1; a CPU vectorises floor, but no remainder."""
        return wp.int32(place - real(period) * wp.floor((place + half) / real(period)))

    @wp.func
    def tile_at(plate: Plate, window: Window, y: real, z: real):
        """Index of the tile's cell that holds a point."""
        row = real(window.row) + wp.floor(window.tile_y + y * window.per_row)
        column = real(window.column) + wp.floor(window.tile_z + z * window.per_column)
        return within(row, plate.tile_y) * plate.tile_z + within(column, plate.tile_z)

    # Native, because only of pointers that do not alias does a CPU read so many cells at a time.
    @wp.func_native("""
    assert(start >= 0 && start + count <= area.shape[0]);
    const auto scale = [count](auto* __restrict__ area, auto* __restrict__ slope, auto* __restrict__ gain,
                               const int* __restrict__ at, const auto* __restrict__ tile, int cells) {
        auto total = 0 * area[0];
        for (int j = 0; j < count; ++j) {
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
    """)
    def meet(
        area: wp.array(dtype=real),
        slope: wp.array(dtype=real),
        gain: wp.array(dtype=real),
        at: wp.array(dtype=wp.int32),
        tile: wp.array(dtype=real),
        start: wp.int32,
        count: wp.int32,
    ) -> real:
        """Scale three lists by tile[at], from `start` on, and return the sum of what is left of the first."""
        ...

    @wp.func
    def clearance(plate: Plate, window: Window):
        """How far at least the hit is from any material [m]."""
        return plate.clear[tile_at(plate, window, zero, zero)]

    @wp.func
    def on_plate(plate: Plate, window: Window, y: real, z: real):
        """Share of half a grid cell about a point that lies on a finite plate."""
        width = half * plate.spacing
        inside_y = wp.min(y - window.low_y, window.high_y - y) / width + half
        inside_z = wp.min(z - window.low_z, window.high_z - z) / width + half
        return wp.clamp(inside_y, zero, one) * wp.clamp(inside_z, zero, one)

    @wp.func
    def cell_at(window: Window, y: real, z: real):
        """The cell of the grid around a point; the caller keeps it inside the window."""
        across, along = y * window.per_cell, z * window.per_cell
        row, column = wp.floor(across), wp.floor(along)
        cell = Cell()
        cell.index = window.home + wp.int32(row) * window.cells_z + wp.int32(column)
        cell.y = across - row
        cell.z = along - column
        return cell

    @wp.func
    def gather(field: wp.array(dtype=real), stride: wp.int32, index: wp.int32, y: real, z: real):
        """Bilinear interpolation between the four nodes from `index` on."""
        next = index + stride
        low, high = read(field, index), read(field, next)
        low += z * (read(field, index + 1) - low)
        high += z * (read(field, next + 1) - high)
        return low + y * (high - low)

    @wp.func
    def scatter_plain(field: wp.array(dtype=real), stride: wp.int32, index: wp.int32, y: real, z: real, amount: real):
        """Share an amount out over the four nodes, by the weights of the interpolation."""
        high = amount * y
        low = amount - high
        next = index + stride
        write(field, index, read(field, index) + (low - low * z))
        write(field, index + 1, read(field, index + 1) + low * z)
        write(field, next, read(field, next) + (high - high * z))
        write(field, next + 1, read(field, next + 1) + high * z)

    # Native and volatile, because a compiler would store neighbours in pairs, and the next patch, whose pair overlaps
    # this one, would wait for the memory.
    @wp.func_native("""
    assert(index >= 0 && index + stride + 1 < field.shape[0]);
    volatile float* const at = field.data + index;
    const float a = at[0], b = at[1], c = at[stride], d = at[stride + 1];
    const float high = amount * y, low = amount - high;
    at[0] = a + (low - low * z);
    at[1] = b + low * z;
    at[stride] = c + (high - high * z);
    at[stride + 1] = d + high * z;
    """)
    def scatter_single(
        field: wp.array(dtype=wp.float32),
        stride: wp.int32,
        index: wp.int32,
        y: wp.float32,
        z: wp.float32,
        amount: wp.float32,
    ):
        """The same in float32."""
        ...

    scatter = scatter_plain if variant.double else scatter_single

    # Native, because only with pointers that do not alias does a CPU run these loops in vector registers.
    @wp.func_native("""
    assert(start - step >= 0 && start + count + step <= source.shape[0]);
    auto* __restrict__ into = target.data + start;
    const auto* __restrict__ from = source.data + start;
    const auto* __restrict__ before = from - step;
    const auto* __restrict__ after = from + step;
    for (int j = 0; j < count; ++j) into[j] = middle * from[j] + side * (before[j] + after[j]);
    """)
    def filter_near(
        target: wp.array(dtype=real),
        source: wp.array(dtype=real),
        start: wp.int32,
        count: wp.int32,
        step: wp.int32,
        middle: real,
        side: real,
    ):
        """target[j] = middle × source[j] + side × (source[j − step] + source[j + step]), start ≤ j < start + count."""
        ...

    @wp.func_native("""
    assert(start - step >= 0 && start + count + step <= source.shape[0]);
    auto* __restrict__ into = target.data + start;
    const auto* __restrict__ before = source.data + start - step;
    const auto* __restrict__ after = source.data + start + step;
    for (int j = 0; j < count; ++j) into[j] += side * (before[j] + after[j]);
    """)
    def filter_far(
        target: wp.array(dtype=real),
        source: wp.array(dtype=real),
        start: wp.int32,
        count: wp.int32,
        step: wp.int32,
        side: real,
    ):
        """target[j] += side × (source[j − step] + source[j + step]) for start ≤ j < start + count."""
        ...

    @wp.func_native("""
    assert(start >= 0 && start + count <= source.shape[0]);
    auto* __restrict__ into = target.data + start;
    const auto* __restrict__ from = source.data + start;
    for (int j = 0; j < count; ++j) into[j] += factor * from[j];
    """)
    def add_scaled(
        target: wp.array(dtype=real), source: wp.array(dtype=real), start: wp.int32, count: wp.int32, factor: real
    ):
        """target[j] += factor × source[j] for start ≤ j < start + count; target and source are different arrays."""
        ...

    @wp.func_native("""
    assert(start >= 0 && start + count <= source.shape[0]);
    auto* __restrict__ into = target.data + start;
    auto* __restrict__ from = source.data + start;
    for (int j = 0; j < count; ++j) { into[j] += factor * from[j]; from[j] = 0; }
    """)
    def take_scaled(
        target: wp.array(dtype=real), source: wp.array(dtype=real), start: wp.int32, count: wp.int32, factor: real
    ):
        """The same, and source[j] = 0."""
        ...

    @wp.func_native("""
    auto* __restrict__ into = target.data + start;
    for (int j = 0; j < count; ++j) into[j] = 0;
    """)
    def clear(target: wp.array(dtype=real), start: wp.int32, count: wp.int32):
        """target[start + j] = 0 for j < count."""
        ...

    @wp.func
    def blank(fields: Fields, window: Window):
        """A plate that nothing has touched."""
        nodes = window.cells_y * window.cells_z
        clear(fields.exposure, window.first, nodes)
        clear(fields.gain, window.first, nodes)

    @wp.func
    def filter_(
        target: wp.array(dtype=real),
        source: wp.array(dtype=real),
        plate: Plate,
        start: wp.int32,
        count: wp.int32,
        step: wp.int32,
    ):
        """target = the tent's taps along one direction, `step` apart, applied to source."""
        filter_near(target, source, start, count, step, plate.taps[0], plate.taps[1])
        for k in range(2, plate.reach + 1):
            filter_far(target, source, start, count, k * step, plate.taps[k])

    @wp.func
    def spread(plate: Plate, fields: Fields, window: Window, box: Box):
        """Filter the gained exposure with the tent K of the law, one direction after the other, and add half
        of it to the exposure: what the mid-step sees.

        Whole rows at once: what wraps round from one row to the next is zero, for the box keeps the filter's
        reach away from the window's edge.
        """
        stride = window.cells_z
        above = plate.reach * stride
        start = window.first + box.y_low * stride
        count = (box.y_high - box.y_low + 1) * stride
        filter_(fields.filtered, fields.gain, plate, start - 2 * above, count + 4 * above, 1)
        filter_(fields.gain, fields.filtered, plate, start - above, count + 2 * above, stride)
        add_scaled(fields.exposure, fields.gain, start - above, count + 2 * above, half)

    @wp.func
    def settle(plate: Plate, fields: Fields, window: Window, box: Box):
        """Add the other half of the gained exposure and clear it for the next step."""
        start = window.first + (box.y_low - plate.reach) * window.cells_z
        count = (box.y_high - box.y_low + 1 + 2 * plate.reach) * window.cells_z
        take_scaled(fields.exposure, fields.gain, start, count, half)

    return SimpleNamespace(
        Plate=Plate,
        Fields=Fields,
        Window=Window,
        Cell=Cell,
        Box=Box,
        window_at=window_at,
        within=within,
        tile_at=tile_at,
        meet=meet,
        clearance=clearance,
        on_plate=on_plate,
        cell_at=cell_at,
        gather=gather,
        scatter=scatter,
        scatter_plain=scatter_plain,
        blank=blank,
        spread=spread,
        settle=settle,
    )
