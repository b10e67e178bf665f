"""The channels of cores that went through a layer: later hits find no material there (docs/model.md §8).

A channel is all that was inside the core at some time. Nodes on planes through the thickness hold how deep they lie in
it; between them the depth is interpolated, so the wall of a channel is sharp within a part of a cell, at any angle.
A section of the core that lies in the next one, or in the last one drawn, adds nothing, so few sections are drawn.

Long because functions in native code take every length and place by itself.
"""

from functools import cache
from types import SimpleNamespace

import warp as wp

from . import core_surface, exposure, lanes, memory, plate_grid
from .variant import Variant


@cache
def build(variant: Variant) -> SimpleNamespace:
    """Device functions of the channels for one variant."""
    real, vec3 = variant.real, variant.vec3
    zero, one = real(0.0), real(1.0)
    outside = real(-1.0)  # [m]: no channel is near
    steepest = real(0.5)  # least cosine of a core's angle with the normal for which its sections are compared
    spared = real(0.1)  # cells: what a section adds beyond the last one by no more is not drawn
    wall = real(20.0)  # the share of material goes from 0 to 1 over a cell divided by this
    use, split = variant.use(core_surface, exposure, lanes, plate_grid), lanes.split(variant)
    read, write = memory.build(real).read, memory.build(real).write
    Surface, Pose, Fields = use.core_surface.Surface, use.core_surface.Pose, use.exposure.Fields
    Window, Box = use.plate_grid.Window, use.plate_grid.Box

    @wp.struct
    class Section:
        """A core at a plane: its axis, and where this crosses the plane, with what radius [m]; the radius is 0 if it
        does not."""

        axis: vec3
        y: real
        z: real
        radius: real

    @wp.struct
    class Channels:
        """Scratch of all slots: the channels of the shots at a slot's plate.

        `inside` has the `nodes` of all layers of every shot, how deep each lies in its channel [m], negative outside;
        shape [slots × count × nodes]. `box` has all of them that a channel may hold, and `through` says whether the
        shot has left the layer through its rear face; shape [slots × count × layers]. `sections` are those of the shot
        under way that are not drawn yet, shape [slots × planes]. `first` and `first_plane` are the first node and plane
        of every layer, and `apart` is the largest distance of its planes [m]; shape [layers].
        """

        count: wp.int32
        nodes: wp.int32
        planes: wp.int32
        inside: wp.array(dtype=real)
        box: wp.array(dtype=Box)
        sections: wp.array(dtype=Section)
        through: wp.array(dtype=wp.bool)
        first: wp.array(dtype=wp.int32)
        first_plane: wp.array(dtype=wp.int32)
        apart: wp.array(dtype=wp.float64)

    # Native, because a compiler vectorises these loops only if the pointers do not alias.
    @wp.func_native(
        split("""
    assert(start >= 0 && start + count <= field.shape[0]);
    auto* __restrict__ into = field.data + start;
    for (int j = 0; j < count; ++j) into[j] = value;
    """)
    )
    def fill(field: wp.array(dtype=real), start: wp.int32, count: wp.int32, value: real):
        """field[start + j] = value for j < count."""
        ...

    @wp.func_native(
        split("""
    const auto least = [](int a, int b) { return a < b ? a : b; };
    const auto most = [](int a, int b) { return a > b ? a : b; };
    const int row_low = most(most(0, -row), box.y_low - 1 - row);
    const int low = most(most(0, -column), box.z_low - 1 - column);
    const int row_high = least(row < 0 ? rows : rows - 1 - row, box.y_high + 1 - row);
    const int high = least(column < 0 ? columns : columns - 1 - column, box.z_high + 1 - column);
    const auto far_far = y * z, far_near = y - far_far, near_far = z - far_far, near_near = 1 - y - near_far;
    assert(target >= 0 && target + rows * columns <= field.shape[0]);
    assert(source >= 0 && source + rows * columns <= inside.shape[0]);
    for (int i = row_low; i < row_high; ++i) {
        auto* __restrict__ into = field.data + target + i * columns;
        const auto* __restrict__ near = inside.data + source + (i + row) * columns + column;
        const auto* __restrict__ far = near + columns;
        for (int j = low; j < high; ++j) {
            const auto found = near_near * near[j] + near_far * near[j + 1] + far_near * far[j] + far_far * far[j + 1];
            into[j] = found > into[j] ? found : into[j];
        }
    }
    """)
    )
    def join_shifted(
        field: wp.array(dtype=real),
        target: wp.int32,
        inside: wp.array(dtype=real),
        source: wp.int32,
        rows: wp.int32,
        columns: wp.int32,
        box: Box,
        row: wp.int32,
        column: wp.int32,
        y: real,
        z: real,
    ):
        """Join the channel of a window from index `source` on to those from `target` on, where the first is shifted as
        in `earlier.add_shifted`. It holds no node outside a box."""
        ...

    # (r² − d²) / 2r in the place of the distance r − d: the same at the wall, and without a root.
    @wp.func_native(
        split("""
    using Real = decltype(0 * y);
    assert(start >= 0 && (rows <= 0 || columns <= 0 || start + (rows - 1) * stride + columns <= field.shape[0]));
    const Real per = -(Real)0.5 / radius, most = (Real)0.5 * (radius - cell * cell * per);
    const Real straight = per * (1 - turn_z * turn_z);
    const auto join = [=](Real* __restrict__ into, Real constant, Real linear) {
        for (int j = 0; j < columns; ++j) {
            const Real w = z + j * cell;
            const Real found = constant + w * (linear + straight * w);
            into[j] = found > into[j] ? found : into[j];
        }
    };
    for (int i = 0; i < rows; ++i) {
        const Real v = y + i * cell;
        const Real level = most + per * v * v * (1 - turn_y * turn_y);
        join(field.data + start + i * stride, level, -2 * per * v * turn_y * turn_z);
    }
    """)
    )
    def cut(
        field: wp.array(dtype=real),
        start: wp.int32,
        rows: wp.int32,
        columns: wp.int32,
        stride: wp.int32,
        cell: real,
        y: real,
        z: real,
        radius: real,
        turn_y: real,
        turn_z: real,
    ):
        """Join the ellipse in which a plane cuts a cylinder of some radius [m] to a channel, at nodes a `cell` apart
        [m], of which the first is at (y, z) from the cylinder's axis [m]. The axis has the components (turn_y, turn_z)
        in the plane."""
        ...

    @wp.func
    def radius_at(surface: Surface, station: real):
        """Radius of the core at a station [m]; 0 before its nose and behind its base."""
        radius = zero
        place, last = (station - surface.base) * surface.per_station, surface.profile.shape[0] - 2
        if place >= zero and place < real(last + 1):
            low = wp.min(wp.int32(place), last)
            before = read(surface.profile, low)
            radius = before + (place - real(low)) * (read(surface.profile, low + 1) - before)
        return radius

    @wp.func
    def plane_at(window: Window, plane: wp.int32):
        """Depth of a plane behind the front face [m]."""
        return real(plane) / window.per_channel_plane

    @wp.func
    def box_about(window: Window, y: real, z: real, reach: real):
        """The nodes of a window about a place, as far as some reach [m]."""
        home_y, home_z = window.home_y, window.home_z
        box = Box()
        box.y_low = wp.max(0, home_y - 1 + wp.int32(wp.floor((y - reach) * window.per_cell)))
        box.z_low = wp.max(0, home_z - 1 + wp.int32(wp.floor((z - reach) * window.per_cell)))
        box.y_high = wp.min(window.cells_y - 1, home_y + 1 + wp.int32(wp.ceil((y + reach) * window.per_cell)))
        box.z_high = wp.min(window.cells_z - 1, home_z + 1 + wp.int32(wp.ceil((z + reach) * window.per_cell)))
        return box

    @wp.func
    def widen(channels: Channels, mine: wp.int32, box: Box):
        """A channel may hold the nodes of a box, too."""
        whole = channels.box[mine]
        whole.y_low = wp.min(whole.y_low, box.y_low)
        whole.z_low = wp.min(whole.z_low, box.z_low)
        whole.y_high = wp.max(whole.y_high, box.y_high)
        whole.z_high = wp.max(whole.z_high, box.z_high)
        use.lanes.barrier()
        channels.box[mine] = whole

    @wp.func
    def draw(channels: Channels, surface: Surface, window: Window, mine: wp.int32, start: wp.int32, core: Section):
        """Join a section of a core to the channel on a plane, from node `start` on: at its own nodes, and around them
        as far as it moves to the next plane."""
        steep = wp.abs(core.axis[0])
        slope = wp.sqrt(wp.max(zero, one - steep * steep)) / steep
        reach = surface.max_radius * wp.sqrt(one + slope * slope) + slope / window.per_channel_plane
        box, cell = box_about(window, core.y, core.z, reach), one / window.per_cell
        widen(channels, mine, box)
        cut(
            channels.inside,
            start + box.y_low * window.cells_z + box.z_low,
            box.y_high - box.y_low + 1,
            box.z_high - box.z_low + 1,
            window.cells_z,
            cell,
            real(box.y_low - window.home_y) * cell - core.y,
            real(box.z_low - window.home_z) * cell - core.z,
            core.radius,
            core.axis[1],
            core.axis[2],
        )

    @wp.func
    def draw_steep(
        channels: Channels, surface: Surface, window: Window, mine: wp.int32, start: wp.int32, x: real, pose: Pose
    ):
        """The same of a core that lies across the plane at a depth x, node by node."""
        box = box_about(window, pose.position[1], pose.position[2], surface.bounding_radius)
        widen(channels, mine, box)
        for i in range(box.y_low, box.y_high + 1):
            for j in range(box.z_low, box.z_high + 1):
                y, z = real(i - window.home_y), real(j - window.home_z)
                arm = vec3(x, y / window.per_cell, z / window.per_cell) - pose.position
                station = wp.dot(arm, pose.axis)
                radius, node = radius_at(surface, station), start + i * window.cells_z + j
                if radius > zero and use.lanes.has(j):
                    inside = radius - wp.sqrt(wp.max(zero, wp.dot(arm, arm) - station * station))
                    write(channels.inside, node, wp.max(inside, read(channels.inside, node)))

    @wp.func
    def section_of(surface: Surface, pose: Pose, x: real):
        """The core at a plane."""
        found = Section()
        station = (x - pose.position[0]) / pose.axis[0]
        found.axis = pose.axis
        found.radius = radius_at(surface, station)
        found.y = pose.position[1] + station * pose.axis[1]
        found.z = pose.position[2] + station * pose.axis[2]
        return found

    @wp.func
    def holds(outer: Section, inner: Section, slack: real):
        """Whether a section holds another one, up to some slack [m]. Both are ellipses, alike where the axes are."""
        spare = outer.radius + slack - inner.radius
        held = bool(False)
        if spare >= zero:
            y, z = outer.y - inner.y, outer.z - inner.z
            turned, steep = wp.length(outer.axis - inner.axis), wp.abs(outer.axis[0])
            change = turned * (wp.sqrt(wp.max(zero, one - steep * steep)) / (steep * steep) + turned)
            spare -= inner.radius * change
            held = spare >= zero and y * y + z * z <= spare * spare
        return held

    @wp.func
    def follow(
        channels: Channels,
        surface: Surface,
        window: Window,
        slot: wp.int32,
        layer: wp.int32,
        shot: wp.int32,
        mine: wp.int32,
        pose: Pose,
    ):
        """Take note of where the core of a shot is in a layer, number `mine` of all. No later shot follows the last."""
        order = shot % channels.count
        if order + 1 == channels.count:
            return
        start = (slot * channels.count + order) * channels.nodes + channels.first[layer]
        first = slot * channels.planes + channels.first_plane[layer]
        slack = spared / window.per_cell
        for plane in range(window.channel_planes):
            x, node = plane_at(window, plane), start + plane * window.nodes
            if wp.abs(pose.axis[0]) <= steepest:
                draw_steep(channels, surface, window, mine, node, x, pose)
            else:
                core = section_of(surface, pose, x)
                if core.radius > zero:
                    before = channels.sections[first + plane]
                    if not holds(before, core, slack):
                        if before.radius > zero and not holds(core, before, zero):
                            draw(channels, surface, window, mine, node, before)
                        use.lanes.barrier()
                        channels.sections[first + plane] = core

    @wp.func
    def conclude(
        channels: Channels,
        surface: Surface,
        window: Window,
        slot: wp.int32,
        layer: wp.int32,
        shot: wp.int32,
        mine: wp.int32,
    ):
        """Leave the channel of a shot, whose core went through, to later ones."""
        order = shot % channels.count
        if order + 1 < channels.count:
            start = (slot * channels.count + order) * channels.nodes + channels.first[layer]
            first = slot * channels.planes + channels.first_plane[layer]
            for plane in range(window.channel_planes):
                before = channels.sections[first + plane]
                if before.radius > zero:
                    draw(channels, surface, window, mine, start + plane * window.nodes, before)
            channels.through[mine] = True

    @wp.func
    def open_window(window: Window, channels: Channels, thickness: wp.float64, layer: wp.int32):
        """The planes of a layer in a window."""
        opened = window
        planes = 1 + wp.int32(wp.ceil(thickness / channels.apart[layer]))
        opened.channel = channels.first[layer]
        opened.channel_planes = planes
        opened.per_channel_plane = real(wp.float64(planes - 1) / thickness)
        return opened

    @wp.func
    def clear(fields: Fields, window: Window):
        """A window knows of no channels."""
        fill(fields.channel, window.channel, window.channel_planes * window.nodes, outside)

    @wp.func
    def begin(channels: Channels, window: Window, slot: wp.int32, layer: wp.int32, shot: wp.int32, mine: wp.int32):
        """A shot has made no channel yet in its window."""
        order = shot % channels.count
        if order + 1 < channels.count:
            start = (slot * channels.count + order) * channels.nodes + channels.first[layer]
            fill(channels.inside, start, window.channel_planes * window.nodes, outside)
            nothing = Box()
            nothing.y_low = window.cells_y
            nothing.z_low = window.cells_z
            channels.box[mine] = nothing
            first = slot * channels.planes + channels.first_plane[layer]
            for plane in range(window.channel_planes):
                channels.sections[first + plane] = Section()

    @wp.func
    def join(
        channels: Channels,
        fields: Fields,
        window: Window,
        slot: wp.int32,
        layer: wp.int32,
        before: wp.int32,
        other: wp.int32,
        row: wp.int32,
        column: wp.int32,
        y: real,
        z: real,
    ):
        """Join the channel of an earlier shot, number `other` of all, to what a window knows of channels."""
        start = (slot * channels.count + before) * channels.nodes + channels.first[layer]
        for plane in range(window.channel_planes):
            ahead = plane * window.nodes
            join_shifted(
                fields.channel,
                window.channel + ahead,
                channels.inside,
                start + ahead,
                window.cells_y,
                window.cells_z,
                channels.box[other],
                row,
                column,
                y,
                z,
            )

    @wp.func
    def place_of(window: Window, x: real, index: wp.int32):
        """Where a depth x [m] lies in a cell of the window: the first node of its channel there, and how far it is on
        the way to the next plane, 0 to 1."""
        depth = wp.clamp(x, zero, window.thickness) * window.per_channel_plane
        plane = wp.min(wp.floor(depth), real(window.channel_planes - 2))
        return window.channel + (index - window.first) + wp.int32(plane) * window.nodes, depth - plane

    # Native, because a compiler reads several nodes at once only if the pointers do not alias.
    @wp.func_native(
        split("""
    using Real = decltype(0 * per_wall);
    assert(start >= 0 && start + count <= area.shape[0]);
    const auto spare = [=](Real* __restrict__ area, Real* __restrict__ slope, Real* __restrict__ gain,
                           const int* __restrict__ at, const Real* __restrict__ x, const Real* __restrict__ y,
                           const Real* __restrict__ z, const Real* __restrict__ field, int size) {
        for (int j = 0; j < count; ++j) {
            assert(at[j] >= 0 && at[j] + nodes + stride + 1 < size);
            const auto across = [=](const Real* from) {
    #if !defined(__CUDA_ARCH__)
                if constexpr (sizeof(Real) == 4) {  // a CPU reads two neighbours at once in half the time
                    unsigned long long both;
                    memcpy(&both, from, sizeof(both));
                    const float first = __builtin_bit_cast(float, (unsigned)both);
                    return first + z[j] * (__builtin_bit_cast(float, (unsigned)(both >> 32)) - first);
                }
    #endif
                return from[0] + z[j] * (from[1] - from[0]);
            };
            const Real* from = field + at[j];
            const Real a = across(from), b = across(from + nodes);
            const Real c = across(from + stride), d = across(from + nodes + stride);
            const Real low = a + x[j] * (b - a), high = c + x[j] * (d - c);
            const Real outside = -per_wall * (low + y[j] * (high - low));
            const Real share = outside < 0 ? (Real)0 : (outside > 1 ? (Real)1 : outside);
            area[j] *= share;
            slope[j] *= share;
            gain[j] *= share;
        }
    };
    spare(area.data + start, slope.data + start, gain.data + start, at.data + start, x.data + start, y.data + start,
          z.data + start, field.data, field.shape[0]);
    """)
    )
    def spare_channels(
        area: wp.array(dtype=real),
        slope: wp.array(dtype=real),
        gain: wp.array(dtype=real),
        at: wp.array(dtype=wp.int32),
        x: wp.array(dtype=real),
        y: wp.array(dtype=real),
        z: wp.array(dtype=real),
        start: wp.int32,
        count: wp.int32,
        field: wp.array(dtype=real),
        nodes: wp.int32,
        stride: wp.int32,
        per_wall: real,
    ):
        """Multiply three lists, from `start` on, by the share of material that earlier cores have left at places of the
        channel: between the nodes from `at` on, on this plane and the next, `nodes` later."""
        ...

    @wp.func
    def per_wall(window: Window):
        """What the share of material gains per depth outside a channel [1/m]."""
        return wall * window.per_cell

    return SimpleNamespace(**locals())
