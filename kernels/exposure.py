"""The exposure T [s] that each node of a window remembers, and how a contact spreads it (docs/model.md §4): over the
degradation length in the plane of the plate, by the tent filter, and through the whole thickness. Lanes that share a
window add it as whole numbers, whose sum is the same in any order.
"""

from functools import cache
from types import SimpleNamespace

import warp as wp

from . import constants, interaction, lanes, plate_grid, structs
from .memory import ACROSS, part_of
from .variant import Variant


@cache
def build(variant: Variant) -> SimpleNamespace:
    """Device functions of the exposure for one variant."""
    struct, real, reals = structs.build(variant), variant.real, variant.reals
    zero, half, one = real(0.0), real(0.5), real(1.0)
    vector, sheet, tiny = constants.VECTOR.value, real(constants.SHEET.value), real(constants.TINY.value)
    use, share = variant.use(interaction, lanes, plate_grid), lanes.share(variant)

    @wp.func_native(
        ACROSS
        + """
    assert(index >= 0 && index + 1 < field.shape[0]);
    return across(field.data + index, z);
    """
    )
    def across(field: reals, index: wp.int32, z: real) -> real:
        """Linear interpolation between the node `index` and the next one."""
        ...

    @wp.func
    def gather(field: reals, stride: wp.int32, index: wp.int32, y: real, z: real):
        """Bilinear interpolation between the four nodes from `index` on."""
        low, high = across(field, index, z), across(field, index + stride, z)
        return low + y * (high - low)

    # Native and volatile, because a compiler would store neighbours in pairs. The pair of the next patch overlaps with
    # this pair, so the next patch would wait for the memory.
    @wp.func_native("""
    assert(index >= 0 && index + stride + 1 < field.shape[0]);
    using Real = decltype(0 * amount);
    volatile Real* const at = field.data + index;
    const Real a = at[0], b = at[1], c = at[stride], d = at[stride + 1];
    const Real high = amount * y, low = amount - high;
    at[0] = a + (low - low * z);
    at[1] = b + low * z;
    at[stride] = c + (high - high * z);
    at[stride + 1] = d + high * z;
    """)
    def scatter(field: reals, stride: wp.int32, index: wp.int32, y: real, z: real, amount: real):
        """Distribute an amount over the four nodes from `index` on by the weights of the interpolation."""
        ...

    # Native, because a compiler vectorises the loops of strips only if the pointers do not alias.

    @wp.func_native(
        share
        + """
    assert(start >= 0 && start + count <= field.shape[0]);
    auto* __restrict__ into = field.data + start;
    for (int j = lane; j < count; j += lanes) into[j] = value;
    """
    )
    def fill(field: reals, start: wp.int32, count: wp.int32, value: real):
        """field[start + j] = value for j < count."""
        ...

    def by_rows(loop: str) -> str:
        """Native code that runs a loop over j < count in each row of a strip. Whole rows are one loop."""
        return (
            share
            + "int start = strip.start, rows = strip.rows, count = strip.count;"
            + "if (count == strip.stride) { count *= rows; rows = 1; }"
            + "for (int row = 0; row < rows; ++row, start += strip.stride) {"
            + loop
            + "}"
        )

    @wp.func_native(
        by_rows("""
    assert(start - step >= 0 && start + count + step <= source.shape[0]);
    auto* __restrict__ into = target.data + start;
    const auto* __restrict__ from = source.data + start;
    const auto* __restrict__ before = from - step;
    const auto* __restrict__ after = from + step;
    for (int j = lane; j < count; j += lanes) into[j] = middle * from[j] + side * (before[j] + after[j]);
    """)
    )
    def filter_near(target: reals, source: reals, strip: struct.Strip, step: wp.int32, middle: real, side: real):
        """target[j] = middle × source[j] + side × (source[j − step] + source[j + step]) in a strip."""
        ...

    @wp.func_native(
        by_rows("""
    assert(start - step >= 0 && start + count + step <= source.shape[0]);
    auto* __restrict__ into = target.data + start;
    const auto* __restrict__ before = source.data + start - step;
    const auto* __restrict__ after = source.data + start + step;
    for (int j = lane; j < count; j += lanes) into[j] += side * (before[j] + after[j]);
    """)
    )
    def filter_far(target: reals, source: reals, strip: struct.Strip, step: wp.int32, side: real):
        """target[j] += side × (source[j − step] + source[j + step]) in a strip."""
        ...

    @wp.func_native(
        by_rows("""
    assert(start >= 0 && start + count <= source.shape[0]);
    auto* __restrict__ into = target.data + start;
    const auto* __restrict__ from = source.data + start;
    for (int j = lane; j < count; j += lanes) into[j] += factor * from[j];
    """)
    )
    def add_scaled(target: reals, source: reals, strip: struct.Strip, factor: real):
        """target[j] += factor × source[j] in a strip; target and source are different arrays."""
        ...

    @wp.func_native(
        by_rows("""
    assert(start >= 0 && start + count <= source.shape[0]);
    auto* __restrict__ into = target.data + start;
    auto* __restrict__ from = source.data + start;
    for (int j = lane; j < count; j += lanes) { into[j] += factor * from[j]; from[j] = 0; }
    """)
    )
    def take_scaled(target: reals, source: reals, strip: struct.Strip, factor: real):
        """target[j] += factor × source[j], and then source[j] = 0, in a strip."""
        ...

    @wp.func
    def fields_of_slot(fields: struct.Fields, slot: wp.int32):
        """The fields of one slot."""
        part = fields
        if wp.static(variant.nodal):
            part.share = part_of(fields.share, slot * fields.nodes, fields.nodes)
            part.touched = part_of(fields.touched, slot * fields.nodes, fields.nodes)
        elif wp.static(variant.degrades):
            part.exposure = part_of(fields.exposure, slot * fields.nodes, fields.nodes)
            part.gain = part_of(fields.gain, slot * fields.nodes, fields.nodes)
            part.filtered = part_of(fields.filtered, slot * fields.nodes, fields.nodes)
        return part

    @wp.func
    def open_window(plate: struct.Plate, thickness: real, fields: struct.Fields, layer: wp.int32, hit: wp.vec2d):
        """The window of a layer about a hit, on an untouched plate: no exposure."""
        cells_y, cells_z = fields.cells_y[layer], fields.cells_z[layer]
        window = use.plate_grid.window_at(plate, thickness, fields.first[layer], cells_y, cells_z, hit)
        if wp.static(variant.degrades):
            fill(fields.exposure, window.first, window.nodes, zero)
            fill(fields.gain, window.first, window.nodes, zero)
        return window

    # Native, because a CPU copies whole rows.
    @wp.func_native("""
    assert(start >= 0 && start + cells_y * cells_z <= field.shape[0]);
    for (int n = 0; n < cells_y; ++n) {
        const int row = rows >= 0 ? n : cells_y - 1 - n;  // in an order that overwrites nothing that is still read
        auto* const into = field.data + start + row * cells_z;
        const auto* const from = into + rows * cells_z + columns;
        const bool known = row + rows >= 0 && row + rows < cells_y;
        for (int m = 0; m < cells_z; ++m) {
            const int column = columns >= 0 ? m : cells_z - 1 - m;
            const bool kept = known && column + columns >= 0 && column + columns < cells_z;
            into[column] = kept ? from[column] : 0;
        }
    }
    """)
    def slide_nodes(
        field: reals, start: wp.int32, cells_y: wp.int32, cells_z: wp.int32, rows: wp.int32, columns: wp.int32
    ):
        """Move the nodes of a window that has slid over its plate by some rows and columns. New nodes are 0."""
        ...

    @wp.func
    def strip_of(plate: struct.Plate, window: struct.Window, box: struct.Box):
        """The nodes of a box and those within the filter's reach: whole vectors of columns, or whole rows where these
        are not much more, because whole rows are one loop."""
        first = box.z_low - plate.reach
        columns = box.z_high - box.z_low + 1 + 2 * plate.reach
        columns = wp.static(vector) * ((columns + wp.static(vector - 1)) // wp.static(vector))
        whole = wp.static(variant.window > 0) or 4 * columns > 3 * window.cells_z
        first = wp.where(whole, 0, wp.min(first, window.cells_z - columns))
        columns = wp.where(whole, window.cells_z, columns)
        strip = struct.Strip()
        strip.start = window.first + (box.y_low - plate.reach) * window.cells_z + first
        strip.rows = box.y_high - box.y_low + 1 + 2 * plate.reach
        strip.count = columns
        strip.stride = window.cells_z
        return strip

    @wp.func
    def filter_(target: reals, source: reals, plate: struct.Plate, strip: struct.Strip, step: wp.int32):
        """Apply the tent's taps along one direction, `step` apart, to `source` in a strip, and put the result in
        `target`."""
        filter_near(target, source, strip, step, plate.taps[0], plate.taps[1])
        for k in range(2, plate.reach + 1):
            filter_far(target, source, strip, k * step, plate.taps[k])

    @wp.func
    def spread(plate: struct.Plate, fields: struct.Fields, window: struct.Window, box: struct.Box):
        """Spread the gained exposure by the tent K of the law, one direction after the other, and add half of it to the
        exposure. The sum is the exposure at mid-step.

        Values that wrap from one row to the next are zero, because the box keeps the filter's reach away from the
        window's edge.
        """
        strip = strip_of(plate, window, box)
        wider = strip
        wider.start -= plate.reach * strip.stride
        wider.rows += 2 * plate.reach
        filter_(fields.filtered, fields.gain, plate, wider, 1)
        use.lanes.barrier()  # the other direction reads what other lanes filter, and overwrites what they read
        filter_(fields.gain, fields.filtered, plate, strip, strip.stride)
        add_scaled(fields.exposure, fields.gain, strip, half)

    @wp.func
    def settle(plate: struct.Plate, fields: struct.Fields, window: struct.Window, box: struct.Box):
        """Add the other half of the gained exposure and clear it for the next step."""
        take_scaled(fields.exposure, fields.gain, strip_of(plate, window, box), half)

    @wp.func
    def units(law: struct.Law, window: struct.Window, coarsest: real, velocity: real, dt: real):
        """Units per exposure [1/s]: one advancing sheet, or the coarsest patch, gives `sheet` units to a node. The
        rounding is then that of float32, and 128 times as much still fits. A node lies below a few sheets of a core."""
        patches = wp.max(one, coarsest * window.per_cell * window.per_cell)
        return sheet / (wp.max(use.interaction.exposure_in(law, dt, velocity), tiny) * patches)

    # Bits are copied, because a compiler assumes that numbers of different types do not share memory.
    @wp.func_native("""
    assert(index >= 0 && index + stride + 1 < field.shape[0]);
    const float high = amount * y, low = amount - high;
    const auto add = [](float* at, float share) {
    #if defined(__CUDA_ARCH__)
        atomicAdd(reinterpret_cast<int*>(at), __float2int_rn(share));
    #else
        int held;
        __builtin_memcpy(&held, at, 4);
        held += (int)__builtin_rintf(share);
        __builtin_memcpy(at, &held, 4);
    #endif
    };
    float* const at = field.data + index;
    add(at, low - low * z);
    add(at + 1, low * z);
    add(at + stride, high - high * z);
    add(at + stride + 1, high * z);
    """)
    def scatter_units(
        field: wp.array(dtype=wp.float32),
        stride: wp.int32,
        index: wp.int32,
        y: wp.float32,
        z: wp.float32,
        amount: wp.float32,
    ):
        """Distribute an amount over four nodes, as `scatter` does, in whole numbers."""
        ...

    @wp.func_native(
        share
        + """
    assert(start >= 0 && start + count <= field.shape[0]);
    for (int j = lane; j < count; j += lanes) {
    #if defined(__CUDA_ARCH__)
        const int held = __float_as_int(field.data[start + j]);
    #else
        int held;
        __builtin_memcpy(&held, field.data + start + j, 4);
    #endif
        field.data[start + j] = (float)held * unit;
    }
    """
    )
    def convert(field: wp.array(dtype=wp.float32), start: wp.int32, count: wp.int32, unit: wp.float32):
        """Convert whole numbers of a unit to numbers."""
        ...

    @wp.func
    def measure(field: wp.array(dtype=wp.float32), window: struct.Window, box: struct.Box, units: real):
        """Convert the whole numbers in the rows of a box to exposure [s]."""
        start, count = window.first + box.y_low * window.cells_z, (box.y_high - box.y_low + 1) * window.cells_z
        convert(field, start, count, one / units)

    return SimpleNamespace(**locals())
