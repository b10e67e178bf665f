"""The exposure T [s] that each node of a window remembers, and how a contact spreads it (docs/model.md §4): over the
degradation length in the plane of the plate, by the tent filter, and over the degradation depth through its thickness.

A window has one plane of nodes for the whole thickness, or several where a plate is thicker than the depth. Where shots
have thicknesses of their own, a window of several planes serves both: a shot at a plate that is no thicker than the
depth uses the first.
"""

from functools import cache
from types import SimpleNamespace

import warp as wp

from . import lanes, memory, plate_grid
from .variant import Variant


@cache
def build(variant: Variant) -> SimpleNamespace:
    """Device functions of the exposure for one variant."""
    real = variant.real
    half = real(0.5)
    read, write, part_of = memory.build(real).read, memory.build(real).write, memory.build(real).part_of
    use, split = variant.use(lanes, plate_grid), lanes.split(variant)
    Plate, Window, Box = use.plate_grid.Plate, use.plate_grid.Window, use.plate_grid.Box

    @wp.struct
    class Fields:
        """Scratch of all slots, or of one: exposure [s], exposure gained in the step [s], and room for the filter.

        A slot has `nodes` of each. The window of a layer has planes of cells_y × cells_z of them, from number `first`
        on; shape [layers].
        """

        exposure: wp.array(dtype=real)
        gain: wp.array(dtype=real)
        filtered: wp.array(dtype=real)
        nodes: wp.int32
        first: wp.array(dtype=wp.int32)
        cells_y: wp.array(dtype=wp.int32)
        cells_z: wp.array(dtype=wp.int32)

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
        """Distribute an amount over the four nodes by the weights of the interpolation."""
        high = amount * y
        low = amount - high
        next = index + stride
        write(field, index, read(field, index) + (low - low * z))
        write(field, index + 1, read(field, index + 1) + low * z)
        write(field, next, read(field, next) + (high - high * z))
        write(field, next + 1, read(field, next + 1) + high * z)

    # Native and volatile, because a compiler would store neighbours in pairs. The pair of the next patch overlaps with
    # this one, so the next patch would wait for the memory.
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

    # Native, because a compiler vectorises these loops only if the pointers do not alias.
    @wp.func_native(
        split("""
    assert(start - step >= 0 && start + count + step <= source.shape[0]);
    auto* __restrict__ into = target.data + start;
    const auto* __restrict__ from = source.data + start;
    const auto* __restrict__ before = from - step;
    const auto* __restrict__ after = from + step;
    for (int j = 0; j < count; ++j) into[j] = middle * from[j] + side * (before[j] + after[j]);
    """)
    )
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

    @wp.func_native(
        split("""
    assert(start - step >= 0 && start + count + step <= source.shape[0]);
    auto* __restrict__ into = target.data + start;
    const auto* __restrict__ before = source.data + start - step;
    const auto* __restrict__ after = source.data + start + step;
    for (int j = 0; j < count; ++j) into[j] += side * (before[j] + after[j]);
    """)
    )
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

    @wp.func_native(
        split("""
    assert(start >= 0 && start + count <= source.shape[0]);
    auto* __restrict__ into = target.data + start;
    const auto* __restrict__ from = source.data + start;
    for (int j = 0; j < count; ++j) into[j] += factor * from[j];
    """)
    )
    def add_scaled(
        target: wp.array(dtype=real), source: wp.array(dtype=real), start: wp.int32, count: wp.int32, factor: real
    ):
        """target[j] += factor × source[j] for start ≤ j < start + count; target and source are different arrays."""
        ...

    @wp.func_native(
        split("""
    assert(start >= 0 && start + count <= source.shape[0]);
    auto* __restrict__ into = target.data + start;
    auto* __restrict__ from = source.data + start;
    for (int j = 0; j < count; ++j) { into[j] += factor * from[j]; from[j] = 0; }
    """)
    )
    def take_scaled(
        target: wp.array(dtype=real), source: wp.array(dtype=real), start: wp.int32, count: wp.int32, factor: real
    ):
        """As `add_scaled`; then source[j] = 0."""
        ...

    @wp.func_native(
        split("""
    auto* __restrict__ into = target.data + start;
    for (int j = 0; j < count; ++j) into[j] = 0;
    """)
    )
    def clear(target: wp.array(dtype=real), start: wp.int32, count: wp.int32):
        """target[start + j] = 0 for j < count."""
        ...

    @wp.func
    def own_fields(fields: Fields, slot: wp.int32):
        """The fields of one slot."""
        own = fields
        if wp.static(variant.degrades):
            own.exposure = part_of(fields.exposure, slot * fields.nodes, fields.nodes)
            own.gain = part_of(fields.gain, slot * fields.nodes, fields.nodes)
            own.filtered = part_of(fields.filtered, slot * fields.nodes, fields.nodes)
        return own

    @wp.func
    def open_window(
        plate: Plate, thickness: real, fields: Fields, layer: wp.int32, hit_y: wp.float64, hit_z: wp.float64
    ):
        """The window of a layer about a hit, on an untouched plate: no exposure."""
        cells_y, cells_z = fields.cells_y[layer], fields.cells_z[layer]
        window = use.plate_grid.window_at(plate, thickness, fields.first[layer], cells_y, cells_z, hit_y, hit_z)
        if wp.static(variant.degrades):
            clear(fields.exposure, window.first, window.planes * window.nodes)
            clear(fields.gain, window.first, window.planes * window.nodes)
        return window

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
    def filter_plane(plate: Plate, fields: Fields, start: wp.int32, count: wp.int32, stride: wp.int32):
        """Filter the gained exposure of some rows, whose first node is `start`, one direction after the other."""
        above = plate.reach * stride
        filter_(fields.filtered, fields.gain, plate, start - 2 * above, count + 4 * above, 1)
        if wp.static(variant.window > 0):
            use.lanes.barrier()  # the other direction reads what other lanes filter, and overwrites what they read
        filter_(fields.gain, fields.filtered, plate, start - above, count + 2 * above, stride)

    # Σ over |i − plane| < reach, and half of the planes at ± reach: the trapezoidal rule over twice the depth. From one
    # plane to the next two planes come in by halves, and two go.
    @wp.func_native("""
    const int first = low - reach - 2 > 0 ? low - reach - 2 : 0;
    const int last = high + reach + 2 < planes ? high + reach + 2 : planes - 1;
    assert(start + first * nodes >= 0 && start + last * nodes + count <= sum.shape[0]);
    for (int plane = first; plane <= last; ++plane) {
        auto* __restrict__ into = sum.data + start + plane * nodes;
        for (int j = 0; j < count; ++j) into[j] = plane > first ? into[j - nodes] : 0;
        const auto add = [&](int from, decltype(0 * sum.data[0]) share) {
            if (from < low || from > high) return;
            const auto* __restrict__ gained = gain.data + start + from * nodes;
            for (int j = 0; j < count; ++j) into[j] += share * gained[j];
        };
        if (plane == first)
            for (int from = low; from < first + reach && from <= high; ++from) add(from, 1);
        add(plane + reach, 0.5f);
        if (plane > first) {
            add(plane + reach - 1, 0.5f);
            add(plane - reach, -0.5f);
            add(plane - reach - 1, -0.5f);
        }
    }
    """)
    def sum_planes(
        sum: wp.array(dtype=real),
        gain: wp.array(dtype=real),
        start: wp.int32,
        count: wp.int32,
        nodes: wp.int32,
        planes: wp.int32,
        low: wp.int32,
        high: wp.int32,
        reach: wp.int32,
    ):
        """Sum a gain over the planes up to `reach` away, of `nodes` each, for `count` nodes from `start` on in each.
        Only the planes from `low` to `high` have gained."""
        ...

    # The sums are those of a kernel with ends that three linear interpolations blur (of what is scattered, of the
    # trapezoidal rule, and of what is gathered), each with the variance 1/6 of a spacing squared. What a quarter of the
    # second difference takes off makes up for that: the error is of fourth order.
    @wp.func_native("""
    const int first = low - reach - 1 > 1 ? low - reach - 1 : 1;
    const int last = high + reach + 1 < planes - 1 ? high + reach + 1 : planes - 2;
    for (int plane = first; plane <= last; ++plane) {
        auto* __restrict__ into = exposure.data + start + plane * nodes;
        const auto* __restrict__ from = sum.data + start + plane * nodes;
        for (int j = 0; j < count; ++j) into[j] += 0.75f * from[j] - 0.125f * (from[j - nodes] + from[j + nodes]);
    }
    """)
    def add_half_sharpened(
        exposure: wp.array(dtype=real),
        sum: wp.array(dtype=real),
        start: wp.int32,
        count: wp.int32,
        nodes: wp.int32,
        planes: wp.int32,
        low: wp.int32,
        high: wp.int32,
        reach: wp.int32,
    ):
        """Add half of what `sum_planes` found to the exposure."""
        ...

    @wp.func
    def add_half_through(plate: Plate, fields: Fields, window: Window, box: Box, start: wp.int32, count: wp.int32):
        """Add half of the sums over planes to the exposure."""
        low, high, reach = box.plane_low, box.plane_high, plate.plane_reach
        add_half_sharpened(
            fields.exposure, fields.filtered, start, count, window.nodes, window.planes, low, high, reach
        )

    # In one plane, whole rows are filtered at once. Values that wrap from one row to the next are zero, because the box
    # keeps the filter's reach away from the window's edge.
    @wp.func
    def spread_in_one(plate: Plate, fields: Fields, start: wp.int32, count: wp.int32, stride: wp.int32):
        """`spread` for the whole thickness at once."""
        above = plate.reach * stride
        filter_plane(plate, fields, start, count, stride)
        add_scaled(fields.exposure, fields.gain, start - above, count + 2 * above, half)

    @wp.func
    def spread_through(plate: Plate, fields: Fields, window: Window, box: Box, start: wp.int32, count: wp.int32):
        """`spread` over several planes."""
        low, high, above = box.plane_low, box.plane_high, plate.reach * window.cells_z
        for plane in range(low, high + 1):
            filter_plane(plate, fields, start + plane * window.nodes, count, window.cells_z)
        start, count = start - above, count + 2 * above
        sum_planes(
            fields.filtered, fields.gain, start, count, window.nodes, window.planes, low, high, plate.plane_reach
        )
        add_half_through(plate, fields, window, box, start, count)

    @wp.func
    def settle_through(plate: Plate, fields: Fields, window: Window, box: Box, start: wp.int32, count: wp.int32):
        """`settle` over several planes."""
        add_half_through(plate, fields, window, box, start, count)
        for plane in range(box.plane_low, box.plane_high + 1):
            clear(fields.gain, start + plane * window.nodes, count)

    @wp.func
    def spread(plate: Plate, fields: Fields, window: Window, box: Box):
        """Spread the gained exposure by the tent K of the law and over the degradation depth, and add half of it to the
        exposure. The sum is the exposure at mid-step."""
        stride = window.cells_z
        start, count = window.first + box.y_low * stride, (box.y_high - box.y_low + 1) * stride
        if wp.static(variant.deep):
            if window.planes > 1:
                spread_through(plate, fields, window, box, start, count)
            else:
                spread_in_one(plate, fields, start, count, stride)
        else:
            spread_in_one(plate, fields, start, count, stride)

    @wp.func
    def settle(plate: Plate, fields: Fields, window: Window, box: Box):
        """Add the other half of the gained exposure and clear it for the next step."""
        start = window.first + (box.y_low - plate.reach) * window.cells_z
        count = (box.y_high - box.y_low + 1 + 2 * plate.reach) * window.cells_z
        if wp.static(variant.deep):
            if window.planes > 1:
                settle_through(plate, fields, window, box, start, count)
            else:
                take_scaled(fields.exposure, fields.gain, start, count, half)
        else:
            take_scaled(fields.exposure, fields.gain, start, count, half)

    return SimpleNamespace(**locals())
