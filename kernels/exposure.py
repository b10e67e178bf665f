"""The exposure T [s] that each node of a window remembers, and how a contact spreads it (docs/model.md §4): over the
degradation length in the plane of the plate, by the tent filter, and over the degradation depth through its thickness.

A window has one plane of nodes for the whole thickness, or several where a plate is thicker than the depth. Where shots
have thicknesses of their own, a window of several planes serves both: a shot at a plate that is no thicker than the
depth uses the first.

Long because all that is spread goes over the same strips of a window.
"""

from functools import cache
from types import SimpleNamespace

import warp as wp

from . import lanes, memory, plate_grid
from .variant import Variant

LANES = 16
"""Nodes that a CPU's vector holds: the columns of a strip are whole vectors."""


@cache
def build(variant: Variant) -> SimpleNamespace:
    """Device functions of the exposure for one variant."""
    real = variant.real
    half, one = real(0.5), real(1.0)
    read, write, part_of = memory.build(real).read, memory.build(real).write, memory.build(real).part_of
    use, split = variant.use(lanes, plate_grid), lanes.split(variant)
    Plate, Window, Box = use.plate_grid.Plate, use.plate_grid.Window, use.plate_grid.Box

    @wp.struct
    class Fields:
        """Scratch of all slots, or of one: exposure [s], exposure gained in the step [s], and room for the filter.

        A slot has `nodes` of each. The window of a layer has planes of cells_y × cells_z of them, from number `first`
        on; shape [layers]. `channel` has other planes of the same windows, `channel_nodes` in a slot: how deep each
        node lies in the channels of earlier hits [m], negative outside.
        """

        exposure: wp.array(dtype=real)
        gain: wp.array(dtype=real)
        filtered: wp.array(dtype=real)
        nodes: wp.int32
        first: wp.array(dtype=wp.int32)
        cells_y: wp.array(dtype=wp.int32)
        cells_z: wp.array(dtype=wp.int32)
        channel: wp.array(dtype=real)
        channel_nodes: wp.int32

    # Native, because a CPU reads two neighbours at once in half the time.
    @wp.func_native("""
    assert(index >= 0 && index + 1 < field.shape[0]);
    const auto* from = field.data + index;
    using Real = decltype(0 * z);
    #if !defined(__CUDA_ARCH__)
    if constexpr (sizeof(Real) == 4) {
        unsigned long long both;
        memcpy(&both, from, sizeof(both));
        const float first = __builtin_bit_cast(float, (unsigned)both);
        return first + z * (__builtin_bit_cast(float, (unsigned)(both >> 32)) - first);
    }
    #endif
    return from[0] + z * (from[1] - from[0]);
    """)
    def across(field: wp.array(dtype=real), index: wp.int32, z: real) -> real:
        """Linear interpolation between the node `index` and the next one."""
        ...

    @wp.func
    def gather(field: wp.array(dtype=real), stride: wp.int32, index: wp.int32, y: real, z: real):
        """Bilinear interpolation between the four nodes from `index` on."""
        low, high = across(field, index, z), across(field, index + stride, z)
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

    def by_rows(loop: str) -> str:
        """Native code that does a loop over j < count in some rows of a field, `stride` apart, from node `start` on.
        Whole rows are one loop."""
        return split(
            "if (count == stride) { count *= rows; rows = 1; }\n"
            "for (int row = 0; row < rows; ++row) {" + loop + "start += stride; }"
        )

    # Native, because a compiler vectorises these loops only if the pointers do not alias.
    @wp.func_native(
        by_rows("""
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
        rows: wp.int32,
        count: wp.int32,
        stride: wp.int32,
        step: wp.int32,
        middle: real,
        side: real,
    ):
        """target[j] = middle × source[j] + side × (source[j − step] + source[j + step]) in a strip."""
        ...

    @wp.func_native(
        by_rows("""
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
        rows: wp.int32,
        count: wp.int32,
        stride: wp.int32,
        step: wp.int32,
        side: real,
    ):
        """target[j] += side × (source[j − step] + source[j + step]) in a strip."""
        ...

    @wp.func_native(
        by_rows("""
    assert(start >= 0 && start + count <= source.shape[0]);
    auto* __restrict__ into = target.data + start;
    const auto* __restrict__ from = source.data + start;
    for (int j = 0; j < count; ++j) into[j] += factor * from[j];
    """)
    )
    def add_scaled(
        target: wp.array(dtype=real),
        source: wp.array(dtype=real),
        start: wp.int32,
        rows: wp.int32,
        count: wp.int32,
        stride: wp.int32,
        factor: real,
    ):
        """target[j] += factor × source[j] in a strip; target and source are different arrays."""
        ...

    @wp.func_native(
        by_rows("""
    assert(start >= 0 && start + count <= source.shape[0]);
    auto* __restrict__ into = target.data + start;
    auto* __restrict__ from = source.data + start;
    for (int j = 0; j < count; ++j) { into[j] += factor * from[j]; from[j] = 0; }
    """)
    )
    def take_scaled(
        target: wp.array(dtype=real),
        source: wp.array(dtype=real),
        start: wp.int32,
        rows: wp.int32,
        count: wp.int32,
        stride: wp.int32,
        factor: real,
    ):
        """As `add_scaled`; then source[j] = 0."""
        ...

    @wp.func_native(
        by_rows("""
    auto* __restrict__ into = target.data + start;
    for (int j = 0; j < count; ++j) into[j] = 0;
    """)
    )
    def clear_strip(target: wp.array(dtype=real), start: wp.int32, rows: wp.int32, count: wp.int32, stride: wp.int32):
        """target[j] = 0 in a strip."""
        ...

    @wp.func
    def clear(target: wp.array(dtype=real), start: wp.int32, count: wp.int32):
        """target[start + j] = 0 for j < count."""
        clear_strip(target, start, 1, count, count)

    @wp.func
    def own_fields(fields: Fields, slot: wp.int32):
        """The fields of one slot."""
        own = fields
        if wp.static(variant.degrades):
            own.exposure = part_of(fields.exposure, slot * fields.nodes, fields.nodes)
            own.gain = part_of(fields.gain, slot * fields.nodes, fields.nodes)
            own.filtered = part_of(fields.filtered, slot * fields.nodes, fields.nodes)
        if wp.static(variant.burst):
            own.channel = part_of(fields.channel, slot * fields.channel_nodes, fields.channel_nodes)
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

    # Native, because a CPU copies whole rows.
    @wp.func_native("""
    assert(start >= 0 && start + planes * cells_y * cells_z <= field.shape[0]);
    for (int plane = 0; plane < planes; ++plane) {
        auto* const first = field.data + start + plane * cells_y * cells_z;
        for (int n = 0; n < cells_y; ++n) {
            const int row = rows >= 0 ? n : cells_y - 1 - n;  // in an order that overwrites nothing that is still read
            auto* const into = first + row * cells_z;
            const auto* const from = into + rows * cells_z + columns;
            const bool known = row + rows >= 0 && row + rows < cells_y;
            for (int m = 0; m < cells_z; ++m) {
                const int column = columns >= 0 ? m : cells_z - 1 - m;
                const bool kept = known && column + columns >= 0 && column + columns < cells_z;
                into[column] = kept ? from[column] : 0;
            }
        }
    }
    """)
    def slide_nodes(
        field: wp.array(dtype=real),
        start: wp.int32,
        planes: wp.int32,
        cells_y: wp.int32,
        cells_z: wp.int32,
        rows: wp.int32,
        columns: wp.int32,
    ):
        """The nodes of a window that has slid over its plate by some rows and columns; new ones are 0."""
        ...

    @wp.struct
    class Strip:
        """Nodes of one plane of a window: `rows` rows of `count` nodes, `stride` apart, from node `start` on."""

        start: wp.int32
        rows: wp.int32
        count: wp.int32
        stride: wp.int32

    @wp.func
    def strip_of(plate: Plate, window: Window, box: Box):
        """The nodes of a box and those that the filter reaches from there. Whole rows where that is not much more, for
        all of them are then one loop."""
        first = box.z_low - plate.reach
        columns = box.z_high - box.z_low + 1 + 2 * plate.reach
        columns = wp.static(LANES) * ((columns + wp.static(LANES - 1)) // wp.static(LANES))
        whole = wp.static(variant.window > 0) or 4 * columns > 3 * window.cells_z
        first = wp.where(whole, 0, wp.min(first, window.cells_z - columns))
        columns = wp.where(whole, window.cells_z, columns)
        strip = Strip()
        strip.start = window.first + (box.y_low - plate.reach) * window.cells_z + first
        strip.rows = box.y_high - box.y_low + 1 + 2 * plate.reach
        strip.count = columns
        strip.stride = window.cells_z
        return strip

    @wp.func
    def filter_(
        target: wp.array(dtype=real),
        source: wp.array(dtype=real),
        plate: Plate,
        start: wp.int32,
        rows: wp.int32,
        strip: Strip,
        step: wp.int32,
    ):
        """target = the tent's taps along one direction, `step` apart, applied to source in rows of a strip."""
        count, stride = strip.count, strip.stride
        filter_near(target, source, start, rows, count, stride, step, plate.taps[0], plate.taps[1])
        for k in range(2, plate.reach + 1):
            filter_far(target, source, start, rows, count, stride, k * step, plate.taps[k])

    @wp.func
    def filter_plane(plate: Plate, fields: Fields, strip: Strip, start: wp.int32):
        """Filter the gained exposure of a strip of the plane that begins `start` nodes later, one direction after the
        other."""
        above = plate.reach * strip.stride
        start += strip.start
        filter_(fields.filtered, fields.gain, plate, start - above, strip.rows + 2 * plate.reach, strip, 1)
        if wp.static(variant.window > 0):
            use.lanes.barrier()  # the other direction reads what other lanes filter, and overwrites what they read
        filter_(fields.gain, fields.filtered, plate, start, strip.rows, strip, strip.stride)

    in_vectors = """
        int j = 0;
    #if !defined(__CUDA_ARCH__)
        typedef Real Vector __attribute__((vector_size(LANES * sizeof(Real))));
        typedef Real Pair __attribute__((vector_size(2 * LANES * sizeof(Real))));  // one waits while the other adds
        for (; j + 2 * LANES <= count; j += 2 * LANES) sum(Pair{}, gained + j, into + j, kept + j);
        for (; j + LANES <= count; j += LANES) sum(Vector{}, gained + j, into + j, kept + j);
    #endif
        for (; j < count; ++j) sum((Real)0, gained + j, into + j, kept + j);
    """
    by_lanes = split("for (int j = 0; j < count; ++j) sum((Real)0, gained + j, into + j, kept + j);")

    # Σ over |i − plane| < reach, and half of the planes at ± reach: the trapezoidal rule over twice the depth. From one
    # plane to the next two planes come in by halves, and two go. The sums are those of a kernel with ends that three
    # linear interpolations blur (of what is scattered, of the trapezoidal rule, and of what is gathered), each with the
    # variance 1/6 of a spacing squared. What a quarter of the second difference takes off makes up for that: the error
    # is of fourth order. All planes of a few nodes at a time stay in registers.
    @wp.func_native(
        """
    const int first = low - reach - 2 > 0 ? low - reach - 2 : 0;
    const int last = high + reach + 2 < planes ? high + reach + 2 : planes - 1;
    assert(start + first * nodes >= 0 && start + (rows - 1) * stride + last * nodes + count <= exposure.shape[0]);
    if (count == stride) { count *= rows; rows = 1; }
    using Real = decltype(0 * gain.data[0]);
    const auto sum = [=](auto none, const Real* gained, Real* into, Real* kept) {
        using Some = decltype(none);
        const auto load = [](const Real* from) { Some x; memcpy(&x, from, sizeof(x)); return x; };
        const auto add = [=](Some& total, int from, Real share) {
            if (from >= low && from <= high) total += share * load(gained + from * nodes);
        };
        Some before = none, here = none;
        for (int plane = first; plane <= last; ++plane) {
            Some next = here;
            if (plane == first)
                for (int from = low; from < first + reach && from <= high; ++from) add(next, from, 1);
            add(next, plane + reach, 0.5f);
            if (plane > first) {
                add(next, plane + reach - 1, 0.5f);
                add(next, plane - reach, -0.5f);
                add(next, plane - reach - 1, -0.5f);
            }
            if (plane > first + 1) {
                const int at = (plane - 1) * nodes;
                const Some part = (Real)0.75f * here - (Real)0.125f * (before + next);
                const Some whole = load(into + at) + part;
                memcpy(kept + at, &part, sizeof(part));
                memcpy(into + at, &whole, sizeof(whole));
            }
            before = here;
            here = next;
        }
    };
    for (int row = 0; row < rows; ++row, start += stride) {
        const auto* gained = gain.data + start;
        auto *into = exposure.data + start, *kept = later.data + start;
        COLUMNS
    }
    """.replace("COLUMNS", by_lanes if variant.window else in_vectors).replace("LANES", str(LANES))
    )
    def add_half_of_planes(
        exposure: wp.array(dtype=real),
        later: wp.array(dtype=real),
        gain: wp.array(dtype=real),
        start: wp.int32,
        rows: wp.int32,
        count: wp.int32,
        stride: wp.int32,
        nodes: wp.int32,
        planes: wp.int32,
        low: wp.int32,
        high: wp.int32,
        reach: wp.int32,
    ):
        """Add half of what a gain spreads over the planes up to `reach` away, of `nodes` each, in a strip of each, and
        keep it in `later`. Only the planes from `low` to `high` have gained."""
        ...

    @wp.func
    def spread_in_one(plate: Plate, fields: Fields, strip: Strip):
        """`spread` for the whole thickness at once."""
        filter_plane(plate, fields, strip, 0)
        add_scaled(fields.exposure, fields.gain, strip.start, strip.rows, strip.count, strip.stride, half)

    @wp.func
    def spread_through(plate: Plate, fields: Fields, window: Window, box: Box, strip: Strip):
        """`spread` over several planes."""
        for plane in range(box.plane_low, box.plane_high + 1):
            filter_plane(plate, fields, strip, plane * window.nodes)
        if wp.static(variant.window > 0):
            use.lanes.barrier()  # what other lanes read of the filtered is overwritten
        add_half_of_planes(
            fields.exposure,
            fields.filtered,
            fields.gain,
            strip.start,
            strip.rows,
            strip.count,
            strip.stride,
            window.nodes,
            window.planes,
            box.plane_low,
            box.plane_high,
            plate.plane_reach,
        )

    @wp.func
    def settle_through(plate: Plate, fields: Fields, window: Window, box: Box, strip: Strip):
        """`settle` over several planes."""
        first = wp.max(box.plane_low - plate.plane_reach - 1, 1)
        last = wp.min(box.plane_high + plate.plane_reach + 1, window.planes - 2)
        for plane in range(first, last + 1):
            start = strip.start + plane * window.nodes
            add_scaled(fields.exposure, fields.filtered, start, strip.rows, strip.count, strip.stride, one)
        for plane in range(box.plane_low, box.plane_high + 1):
            start = strip.start + plane * window.nodes
            clear_strip(fields.gain, start, strip.rows, strip.count, strip.stride)

    @wp.func
    def spread(plate: Plate, fields: Fields, window: Window, box: Box):
        """Spread the gained exposure by the tent K of the law and over the degradation depth, and add half of it to the
        exposure. The sum is the exposure at mid-step.

        Values that wrap from one row to the next are zero, because the box keeps the filter's reach away from the
        window's edge.
        """
        strip = strip_of(plate, window, box)
        if wp.static(variant.deep):
            if window.planes > 1:
                spread_through(plate, fields, window, box, strip)
            else:
                spread_in_one(plate, fields, strip)
        else:
            spread_in_one(plate, fields, strip)

    @wp.func
    def settle(plate: Plate, fields: Fields, window: Window, box: Box):
        """Add the other half of the gained exposure and clear it for the next step."""
        strip = strip_of(plate, window, box)
        if wp.static(variant.deep):
            if window.planes > 1:
                settle_through(plate, fields, window, box, strip)
            else:
                take_scaled(fields.exposure, fields.gain, strip.start, strip.rows, strip.count, strip.stride, half)
        else:
            take_scaled(fields.exposure, fields.gain, strip.start, strip.rows, strip.count, strip.stride, half)

    return SimpleNamespace(**locals())
