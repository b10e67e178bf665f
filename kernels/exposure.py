"""The exposure T [s] that each node of a window remembers, and how a contact spreads it (docs/model.md §4): over the
degradation length in the plane of the plate, by the tent filter, and over the degradation depth through its thickness.

A window has one plane of nodes for the whole thickness, or several where a plate is thicker than the depth. Where the
thickness differs from shot to shot, a window of several planes serves both: a shot at a plate that is no thicker than
the depth uses the first plane.

Long because all spreading goes over the same strips of a window.
"""

from functools import cache
from types import SimpleNamespace

import warp as wp

from . import constants, lanes, memory, plate_grid, structs
from .variant import Variant


@cache
def build(variant: Variant) -> SimpleNamespace:
    """Device functions of the exposure for one variant."""
    struct, real, reals = structs.build(variant), variant.real, variant.reals
    zero, half, one = real(0.0), real(0.5), real(1.0)
    vector = constants.VECTOR.value
    part_of = memory.build(real).part_of
    use, share = variant.use(lanes, plate_grid), lanes.share(variant)

    @wp.func_native(
        memory.ACROSS
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

    @wp.func_native(
        by_rows("""
    auto* __restrict__ into = target.data + start;
    for (int j = lane; j < count; j += lanes) into[j] = 0;
    """)
    )
    def clear_strip(target: reals, strip: struct.Strip):
        """target[j] = 0 in a strip."""
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
            fill(fields.exposure, window.first, window.planes * window.nodes, zero)
            fill(fields.gain, window.first, window.planes * window.nodes, zero)
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
        field: reals,
        start: wp.int32,
        planes: wp.int32,
        cells_y: wp.int32,
        cells_z: wp.int32,
        rows: wp.int32,
        columns: wp.int32,
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
    def nodes_later(strip: struct.Strip, nodes: wp.int32):
        """The strip that begins this number of nodes later, such as that of another plane."""
        later = strip
        later.start += nodes
        return later

    @wp.func
    def filter_(target: reals, source: reals, plate: struct.Plate, strip: struct.Strip, step: wp.int32):
        """Apply the tent's taps along one direction, `step` apart, to `source` in a strip, and put the result in
        `target`."""
        filter_near(target, source, strip, step, plate.taps[0], plate.taps[1])
        for k in range(2, plate.reach + 1):
            filter_far(target, source, strip, k * step, plate.taps[k])

    @wp.func
    def filter_plane(plate: struct.Plate, fields: struct.Fields, strip: struct.Strip):
        """Filter the gained exposure in a strip of a plane, one direction after the other."""
        wider = nodes_later(strip, -plate.reach * strip.stride)
        wider.rows += 2 * plate.reach
        filter_(fields.filtered, fields.gain, plate, wider, 1)
        use.lanes.barrier()  # the other direction reads what other lanes filter, and overwrites what they read
        filter_(fields.gain, fields.filtered, plate, strip, strip.stride)

    if variant.window:
        columns = "for (int j = lane; j < count; j += lanes) sum((Real)0, gained + j, into + j, kept + j);"
    else:
        columns = f"""
        int j = 0;
    #if !defined(__CUDA_ARCH__)
        typedef Real Vector __attribute__((vector_size({vector} * sizeof(Real))));
        typedef Real Pair __attribute__((vector_size(2 * {vector} * sizeof(Real))));  // one waits while the other adds
        for (; j + 2 * {vector} <= count; j += 2 * {vector}) sum(Pair{{}}, gained + j, into + j, kept + j);
        for (; j + {vector} <= count; j += {vector}) sum(Vector{{}}, gained + j, into + j, kept + j);
    #endif
        for (; j < count; ++j) sum((Real)0, gained + j, into + j, kept + j);
    """

    # Σ over |i − plane| < reach, and half of the planes at ± reach: the trapezoidal rule over twice the depth. From one
    # plane to the next two planes come in by halves, and two go. The sums are those of a kernel whose ends are blurred
    # by
    # three linear interpolations (scattering, the trapezoidal rule, gathering), each with the variance 1/6 of a spacing
    # squared. Subtracting a quarter of the second difference makes up for that: the error is of fourth order. All
    # planes
    # of a few nodes at a time stay in registers.
    @wp.func_native(
        share
        + """
    const int first = low - reach - 2 > 0 ? low - reach - 2 : 0;
    const int last = high + reach + 2 < planes ? high + reach + 2 : planes - 1;
    int start = strip.start, rows = strip.rows, count = strip.count;
    assert(start + first * nodes >= 0 && start + (rows - 1) * strip.stride + last * nodes + count <= exposure.shape[0]);
    if (count == strip.stride) { count *= rows; rows = 1; }
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
    for (int row = 0; row < rows; ++row, start += strip.stride) {
        const auto* gained = gain.data + start;
        auto *into = exposure.data + start, *kept = later.data + start;
    """
        + columns
        + "}"
    )
    def add_half_of_planes(
        exposure: reals,
        later: reals,
        gain: reals,
        strip: struct.Strip,
        nodes: wp.int32,
        planes: wp.int32,
        low: wp.int32,
        high: wp.int32,
        reach: wp.int32,
    ):
        """Add half of what a gain spreads over the planes up to `reach` away, of `nodes` each, in a strip of each, and
        keep this half in `later`. Only the planes from `low` to `high` have a gain."""
        ...

    @wp.func
    def spread(plate: struct.Plate, fields: struct.Fields, window: struct.Window, box: struct.Box):
        """Spread the gained exposure by the tent K of the law and over the degradation depth, and add half of it to the
        exposure. The sum is the exposure at mid-step.

        Values that wrap from one row to the next are zero, because the box keeps the filter's reach away from the
        window's edge.
        """
        strip, through = strip_of(plate, window, box), wp.static(variant.deep) and window.planes > 1
        if through:
            for plane in range(box.plane_low, box.plane_high + 1):
                filter_plane(plate, fields, nodes_later(strip, plane * window.nodes))
            use.lanes.barrier()  # the next loop overwrites filtered values that other lanes read
            add_half_of_planes(
                fields.exposure,
                fields.filtered,
                fields.gain,
                strip,
                window.nodes,
                window.planes,
                box.plane_low,
                box.plane_high,
                plate.plane_reach,
            )
        else:
            filter_plane(plate, fields, strip)
            add_scaled(fields.exposure, fields.gain, strip, half)

    @wp.func
    def settle(plate: struct.Plate, fields: struct.Fields, window: struct.Window, box: struct.Box):
        """Add the other half of the gained exposure and clear it for the next step."""
        strip, through = strip_of(plate, window, box), wp.static(variant.deep) and window.planes > 1
        if through:
            first = wp.max(box.plane_low - plate.plane_reach - 1, 1)
            last = wp.min(box.plane_high + plate.plane_reach + 1, window.planes - 2)
            for plane in range(first, last + 1):
                add_scaled(fields.exposure, fields.filtered, nodes_later(strip, plane * window.nodes), one)
            for plane in range(box.plane_low, box.plane_high + 1):
                clear_strip(fields.gain, nodes_later(strip, plane * window.nodes))
        else:
            take_scaled(fields.exposure, fields.gain, strip, half)

    return SimpleNamespace(**locals())
