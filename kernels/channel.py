"""The channels of cores that went through a layer. Later hits find no material there (docs/model.md §8).

A channel is all that was inside the core at some time. Nodes on planes through the thickness hold their depth inside
the channel. Between nodes the depth is interpolated, so the wall of a channel is sharp within a part of a cell, at any
angle. A section of the core that lies in the next one, or in the last one drawn, adds nothing, so few sections are
drawn. Long because functions in native code take every length and place by itself.
"""

from functools import cache
from types import SimpleNamespace
from typing import Any

import warp as wp

from . import constants, exposure, lanes, memory, sliding, structs
from .variant import Variant


@cache
def build(variant: Variant) -> SimpleNamespace:
    """Device functions of the channels for one variant."""
    struct, real, reals, vec3 = structs.build(variant), variant.real, variant.reals, variant.vec3
    zero, one = real(0.0), real(1.0)
    outside, wall = real(constants.NO_CHANNEL.value), real(constants.WALL.value)
    steepest, spared = real(constants.STEEPEST.value), real(constants.SPARED.value)
    use, share = variant.use(exposure, lanes, sliding), lanes.share(variant)
    read, write = memory.build(real).read, memory.build(real).write

    def shifted(combined: str) -> Any:
        """A function that combines the value `held` by each node of a window with the `value` of another window
        there."""

        # Native, because a compiler vectorises these loops only if the pointers do not alias.
        @wp.func_native(
            share
            + f"const auto combine = [](auto held, auto value) {{ return {combined}; }};"
            + """
        const auto least = [](int a, int b) { return a < b ? a : b; };
        const auto most = [](int a, int b) { return a > b ? a : b; };
        const int row_low = most(most(0, -row), box.y_low - 1 - row);
        const int low = most(most(0, -column), box.z_low - 1 - column) + lane;
        const int row_high = least(row < 0 ? rows : rows - 1 - row, box.y_high + 1 - row);
        const int high = least(column < 0 ? columns : columns - 1 - column, box.z_high + 1 - column);
        const auto far_far = y * z, far_near = y - far_far, near_far = z - far_far, near_near = 1 - y - near_far;
        assert(start >= 0 && start + rows * columns <= target.shape[0]);
        assert(first >= 0 && first + rows * columns <= source.shape[0]);
        for (int i = row_low; i < row_high; ++i) {
            auto* __restrict__ into = target.data + start + i * columns;
            const auto* __restrict__ near = source.data + first + (i + row) * columns + column;
            const auto* __restrict__ far = near + columns;
            for (int j = low; j < high; j += lanes)
                into[j] = combine(into[j], near_near * near[j] + near_far * near[j + 1]
                                  + far_near * far[j] + far_far * far[j + 1]);
        }
        """
        )
        def combine(
            target: reals,
            start: wp.int32,
            source: reals,
            first: wp.int32,
            rows: wp.int32,
            columns: wp.int32,
            box: struct.Box,
            row: wp.int32,
            column: wp.int32,
            y: real,
            z: real,
        ):
            """The window has rows × columns nodes from index `start` on, the other one from `first` on. Node (i, j) of
            the window lies behind node (i + row, j + column) of the other one by the fractions y and z of a cell. The
            other window holds nothing outside a box, and nothing on its outermost nodes."""
            ...

        return combine

    add_shifted, join_shifted = shifted("held + value"), shifted("value > held ? value : held")

    # (r² − d²) / 2r replaces the distance r − d: it is equal at the wall, and needs no root.
    @wp.func_native(
        share
        + """
    using Real = decltype(0 * y);
    assert(start >= 0 && (rows <= 0 || columns <= 0 || start + (rows - 1) * stride + columns <= field.shape[0]));
    const Real per = -(Real)0.5 / radius, most = (Real)0.5 * (radius - cell * cell * per);
    const Real straight = per * (1 - turn_z * turn_z);
    const auto join = [=](Real* __restrict__ into, Real constant, Real linear) {
        for (int j = lane; j < columns; j += lanes) {
            const Real w = z + j * cell;
            const Real depth = constant + w * (linear + straight * w);
            into[j] = depth > into[j] ? depth : into[j];
        }
    };
    for (int i = 0; i < rows; ++i) {
        const Real v = y + i * cell;
        const Real level = most + per * v * v * (1 - turn_y * turn_y);
        join(field.data + start + i * stride, level, -2 * per * v * turn_y * turn_z);
    }
    """
    )
    def cut(
        field: reals,
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
        """Join to a channel the ellipse in which a plane cuts a cylinder of a radius [m]. Nodes are a `cell` apart [m];
        the first is at (y, z) from the cylinder's axis [m]. The axis has the components (turn_y, turn_z) in the
        plane."""
        ...

    @wp.func
    def radius_at(surface: struct.Surface, station: real):
        """Radius of the core at a station [m]; 0 before its nose and behind its base."""
        radius = zero
        place, last = (station - surface.base) * surface.per_station, surface.profile.shape[0] - 2
        if place >= zero and place < real(last + 1):
            low = wp.min(wp.int32(place), last)
            before = read(surface.profile, low)
            radius = before + (place - real(low)) * (read(surface.profile, low + 1) - before)
        return radius

    @wp.func
    def depth_of_plane(window: struct.Window, plane: wp.int32):
        """Depth of a plane behind the front face [m]."""
        return real(plane) / window.per_channel_plane

    @wp.func
    def box_about(window: struct.Window, y: real, z: real, reach: real):
        """The nodes of a window within a reach [m] of a place."""
        home_y, home_z = window.home_y, window.home_z
        box = struct.Box()
        box.y_low = wp.max(0, home_y - 1 + wp.int32(wp.floor((y - reach) * window.per_cell)))
        box.z_low = wp.max(0, home_z - 1 + wp.int32(wp.floor((z - reach) * window.per_cell)))
        box.y_high = wp.min(window.cells_y - 1, home_y + 1 + wp.int32(wp.ceil((y + reach) * window.per_cell)))
        box.z_high = wp.min(window.cells_z - 1, home_z + 1 + wp.int32(wp.ceil((z + reach) * window.per_cell)))
        return box

    @wp.func
    def widen(earlier: struct.Earlier, index: wp.int32, box: struct.Box):
        """Extend the box of nodes that a channel may hold."""
        whole = use.sliding.around(earlier.box[index], box)
        use.lanes.barrier()
        earlier.box[index] = whole

    @wp.func
    def draw(
        earlier: struct.Earlier,
        surface: struct.Surface,
        window: struct.Window,
        place: struct.Place,
        plane: wp.int32,
        core: struct.Section,
    ):
        """Join a section of a core to the channel on a plane, at its own nodes and at the nodes that it sweeps on its
        way to the next plane."""
        steep = wp.abs(core.axis[0])
        slope = wp.sqrt(wp.max(zero, one - steep * steep)) / steep
        reach = surface.max_radius * wp.sqrt(one + slope * slope) + slope / window.per_channel_plane
        box, cell = box_about(window, core.y, core.z, reach), one / window.per_cell
        widen(earlier, place.index, box)
        cut(
            earlier.inside,
            place.channel + plane * window.nodes + box.y_low * window.cells_z + box.z_low,
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
        earlier: struct.Earlier,
        surface: struct.Surface,
        window: struct.Window,
        place: struct.Place,
        plane: wp.int32,
        pose: struct.Pose,
    ):
        """Join a core that lies across a plane to the channel there, node by node."""
        box = box_about(window, pose.position[1], pose.position[2], surface.bounding_radius)
        widen(earlier, place.index, box)
        x, start = depth_of_plane(window, plane), place.channel + plane * window.nodes
        for i in range(box.y_low, box.y_high + 1):
            for j in range(box.z_low, box.z_high + 1):
                y, z = real(i - window.home_y), real(j - window.home_z)
                arm = vec3(x, y / window.per_cell, z / window.per_cell) - pose.position
                station = wp.dot(arm, pose.axis)
                radius, node = radius_at(surface, station), start + i * window.cells_z + j
                if radius > zero and use.lanes.has(j):
                    inside = radius - wp.sqrt(wp.max(zero, wp.dot(arm, arm) - station * station))
                    write(earlier.inside, node, wp.max(inside, read(earlier.inside, node)))

    @wp.func
    def section_of(surface: struct.Surface, pose: struct.Pose, x: real):
        """The section of the core at the plane at a depth x [m]."""
        section = struct.Section()
        station = (x - pose.position[0]) / pose.axis[0]
        section.axis = pose.axis
        section.radius = radius_at(surface, station)
        section.y = pose.position[1] + station * pose.axis[1]
        section.z = pose.position[2] + station * pose.axis[2]
        return section

    @wp.func
    def holds(outer: struct.Section, inner: struct.Section, slack: real):
        """Whether a section contains another one, up to a slack [m]. Both are ellipses, of equal shape where the axes
        are equal."""
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
        earlier: struct.Earlier,
        surface: struct.Surface,
        window: struct.Window,
        place: struct.Place,
        pose: struct.Pose,
    ):
        """Keep the place of a shot's core in a layer, unless no later shot follows. A section is drawn only when the
        next one does not contain it."""
        if place.last:
            return
        slack = spared / window.per_cell
        for plane in range(window.channel_planes):
            if wp.abs(pose.axis[0]) <= steepest:
                draw_steep(earlier, surface, window, place, plane, pose)
            else:
                core = section_of(surface, pose, depth_of_plane(window, plane))
                if core.radius > zero:
                    before = earlier.sections[place.section + plane]
                    if not holds(before, core, slack):
                        if before.radius > zero and not holds(core, before, zero):
                            draw(earlier, surface, window, place, plane, before)
                        use.lanes.barrier()
                        earlier.sections[place.section + plane] = core

    @wp.func
    def conclude(earlier: struct.Earlier, surface: struct.Surface, window: struct.Window, place: struct.Place):
        """Leave to later shots the channel of a shot whose core went through."""
        if not place.last:
            for plane in range(window.channel_planes):
                before = earlier.sections[place.section + plane]
                if before.radius > zero:
                    draw(earlier, surface, window, place, plane, before)
            earlier.through[place.index] = True

    @wp.func
    def open_window(earlier: struct.Earlier, window: struct.Window, thickness: wp.float64, layer: wp.int32):
        """A window with the planes of the channels through its layer."""
        opened = window
        planes = 1 + wp.int32(wp.ceil(thickness / earlier.apart[layer]))
        opened.channel = earlier.first[layer]
        opened.channel_planes = planes
        opened.per_channel_plane = real(wp.float64(planes - 1) / thickness)
        return opened

    @wp.func
    def clear(fields: struct.Fields, window: struct.Window):
        """Clear the channels in a window."""
        use.exposure.fill(fields.channel, window.channel, window.channel_planes * window.nodes, outside)

    @wp.func
    def begin(earlier: struct.Earlier, window: struct.Window, place: struct.Place):
        """Begin the channel of a shot in its window, empty."""
        if not place.last:
            use.exposure.fill(earlier.inside, place.channel, window.channel_planes * window.nodes, outside)
            nothing = struct.Box()
            nothing.y_low = window.cells_y
            nothing.z_low = window.cells_z
            earlier.box[place.index] = nothing
            for plane in range(window.channel_planes):
                earlier.sections[place.section + plane] = struct.Section()

    @wp.func
    def join(
        earlier: struct.Earlier,
        fields: struct.Fields,
        window: struct.Window,
        other: struct.Place,
        row: wp.int32,
        column: wp.int32,
        y: real,
        z: real,
    ):
        """Join the channel of an earlier shot to the channels in a window, shifted as in `shifted`."""
        for plane in range(window.channel_planes):
            ahead = plane * window.nodes
            join_shifted(
                fields.channel,
                window.channel + ahead,
                earlier.inside,
                other.channel + ahead,
                window.cells_y,
                window.cells_z,
                earlier.box[other.index],
                row,
                column,
                y,
                z,
            )

    @wp.func
    def node_at(window: struct.Window, x: real, index: wp.int32):
        """The first node of a cell's channel on the plane before a depth x [m], and the fraction of the way to the next
        plane, 0 to 1."""
        depth = wp.clamp(x, zero, window.thickness) * window.per_channel_plane
        plane = wp.min(wp.floor(depth), real(window.channel_planes - 2))
        return window.channel + (index - window.first) + wp.int32(plane) * window.nodes, depth - plane

    # Native, because a compiler reads several nodes at once only if the pointers do not alias.
    @wp.func_native(
        share
        + memory.ACROSS
        + """
    using Real = decltype(0 * per_wall);
    assert(start >= 0 && start + count <= area.shape[0]);
    const auto spare = [=](Real* __restrict__ area, Real* __restrict__ slope, Real* __restrict__ gain,
                           const int* __restrict__ at, const Real* __restrict__ x, const Real* __restrict__ y,
                           const Real* __restrict__ z, const Real* __restrict__ field, int size) {
        for (int j = lane; j < count; j += lanes) {
            assert(at[j] >= 0 && at[j] + nodes + stride + 1 < size);
            const Real* from = field + at[j];
            const Real a = across(from, z[j]), b = across(from + nodes, z[j]);
            const Real c = across(from + stride, z[j]), d = across(from + nodes + stride, z[j]);
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
    """
    )
    def spare_channels(
        area: reals,
        slope: reals,
        gain: reals,
        at: wp.array(dtype=wp.int32),
        x: reals,
        y: reals,
        z: reals,
        start: wp.int32,
        count: wp.int32,
        field: reals,
        nodes: wp.int32,
        stride: wp.int32,
        per_wall: real,
    ):
        """Multiply three lists, from `start` on, by the share of material that earlier cores have left. The places lie
        in the cells at nodes `at`, between this plane and the next, `nodes` later. The share rises from 0 to 1 with the
        depth outside a channel, by `per_wall` [1/m]."""
        ...

    @wp.func
    def spare(fields: struct.Fields, window: struct.Window, touches: struct.Touches, first: wp.int32, count: wp.int32):
        """Restrict touches, from index `first` on, to the material that the channels of earlier hits leave."""
        spare_channels(
            touches.area,
            touches.slope,
            touches.gain,
            touches.place,
            touches.ahead,
            touches.y,
            touches.z,
            first,
            count,
            fields.channel,
            window.nodes,
            window.cells_z,
            wall * window.per_cell,
        )

    return SimpleNamespace(**locals())
