"""A target of several layers: the layers that a step can touch, their load, and how the core left each of them.

A layer sees the core in a frame of its own: its front at x = 0, its window's home at y = z = 0. The load of one layer
is therefore the load of one plate, and the loads of layers add. one_plate.py has the same functions for one plate.
"""

from functools import cache
from types import SimpleNamespace

import warp as wp

from . import (
    constants,
    contact,
    core_surface,
    exposure,
    footprint,
    lanes,
    rigid_body,
    structs,
    target,
)
from .status import ENTERED, RUNNING, Status
from .variant import Variant


@cache
def build(variant: Variant) -> SimpleNamespace:
    """Device functions of several layers for one variant."""
    struct, real, vec3 = structs.build(variant), variant.real, variant.vec3
    zero, half, one = real(0.0), real(0.5), real(1.0)
    small, slowest = real(constants.SMALL.value), real(constants.SLOWEST.value)
    far = constants.FAR_AWAY.value
    use, scheme = (
        variant.use(contact, core_surface, exposure, footprint, lanes, rigid_body, target),
        target.scheme_of(variant),
    )
    entered = wp.constant(ENTERED)
    faces_of, layer_value, plate_of = use.target.faces_of, use.target.layer_value, use.target.plate_of
    slides = variant.degrades and variant.window == 0

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

    @wp.func
    def begin_passage(passage: struct.Passage, shot: wp.int32, layers: wp.int32):
        """Record that the core has reached no layer yet."""
        for k in range(layers):
            passage.status[shot, k] = Status.NOT_REACHED
            passage.velocity[shot, k] = real(wp.nan)
            passage.tilt[shot, k] = real(wp.nan)
        passage.stopped_in[shot] = -1
        passage.depth[shot] = real(wp.nan)

    @wp.func
    def enter_layer(passage: struct.Passage, shot: wp.int32, layer: wp.int32):
        """Record that the core touches a layer."""
        if passage.status[shot, layer] == Status.NOT_REACHED:
            passage.status[shot, layer] = entered

    @wp.func
    def has_left(passage: struct.Passage, shot: wp.int32, layer: wp.int32):
        """Whether the core has already left a layer through its rear face."""
        return passage.status[shot, layer] == Status.PERFORATED or passage.status[shot, layer] == Status.UNTOUCHED

    @wp.func
    def leave_layer(
        context: struct.Context, layer: wp.int32, state: struct.State, speed: real, since: real, flight: vec3
    ):
        """Record how a core left a layer at a speed [m/s], `since` [s] ago."""
        passage, shot = context.passage, context.shot
        axis = use.rigid_body.axis_of(state.attitude)
        axis = use.rigid_body.turned(context.body, axis, state.angular_momentum, -since)
        touched = passage.status[shot, layer] == entered
        use.lanes.barrier()
        passage.status[shot, layer] = wp.where(touched, Status.PERFORATED, Status.UNTOUCHED)
        passage.velocity[shot, layer] = speed
        passage.tilt[shot, layer] = use.rigid_body.angle_between(axis, flight)

    @wp.func
    def conclude_layer(
        passage: struct.Passage, shot: wp.int32, layer: wp.int32, status: wp.int32, inside: wp.bool, depth: real
    ):
        """Record how the core ended in a layer that it did not leave through the rear face. It rests there if it is
        `inside`; `depth` is the largest distance of its points behind the front face [m]."""
        if passage.status[shot, layer] == entered:
            stays = status == Status.ARRESTED and inside
            other = wp.where(status >= Status.UNFINISHED, status, Status.RICOCHETED)
            passage.status[shot, layer] = wp.where(stays, Status.ARRESTED, other)
            if stays:
                passage.stopped_in[shot] = layer
                passage.depth[shot] = depth

    @wp.func
    def first_step(context: struct.Context, shortest: real):
        """Length of the first step [s], which is that of the plate."""
        return layer_value(context.target.stretch, 0, context.shot) * shortest

    @wp.func
    def next_step(
        context: struct.Context,
        reach: struct.Reach,
        pose: struct.Pose,
        last: struct.Change,
        clock: struct.Clock,
        free: real,
    ):
        """Length of the next step [s], after the present one and a `free` time [s]. It is the shortest of those for the
        layers in which the core can then be. It is also so short that it takes at most a share of the speed, if it
        slows down the core as the present step does."""
        target, shot, dt = context.target, context.shot, clock.step
        longest = one
        for k in range(target.count):
            longest = wp.max(longest, layer_value(target.stretch, k, shot))
        margin = (half * dt + free + longest * clock.shortest) * pose.speed
        low, high = reach.rearmost - margin, reach.foremost + margin
        stretch = longest
        for k in range(target.count):
            front, rear = faces_of(target, k, shot)
            if high > front and low < rear:
                stretch = wp.min(stretch, layer_value(target.stretch, k, shot))
        taken = wp.length(last.velocity) + context.surface.bounding_radius * wp.length(last.omega)
        allowed = target.slowing * wp.length(pose.velocity) * dt / (taken + small)
        return wp.max(clock.shortest, wp.min(stretch * clock.shortest, allowed))

    @wp.func
    def begin(context: struct.Context, state: struct.State):
        """The Reach before the first step: no layer is reached."""
        target, stack, shot = context.target, context.stack, context.shot
        for k in range(target.count):
            stack.open[context.slot * target.count + k] = False
            stack.near[context.slot * target.count + k] = False
        begin_passage(context.passage, shot, target.count)
        reach = struct.Reach()
        straight = use.target.line_of_flight(context.shots, shot)
        reach.flight = vec3(real(straight[0]), real(straight[1]), real(straight[2]))
        # A core that slides between two layers never ends: it goes farther than one that goes straight through.
        steep = wp.length(vec3(zero, reach.flight[1], reach.flight[2])) / reach.flight[0]
        longest_way = real(use.target.shot_value(context.shots.longest_way, shot))
        reach.farthest = longest_way + steep * real(use.target.depth_of(target, shot))
        return reach, RUNNING

    @wp.func
    def in_layer(context: struct.Context, layer: wp.int32, pose: struct.Pose):
        """The pose in the frame of a layer."""
        target = context.target
        seen = pose
        front = real(layer_value(target.front, layer, context.shot))
        home = context.stack.home[context.slot * target.count + layer]
        seen.position = pose.position - home - vec3(front, zero, zero)
        return seen

    @wp.func
    def slide(context: struct.Context, layer: wp.int32, touch: struct.Footprint):
        """Have the window of a layer follow a core that leaves it; returns whether it could.

        Nodes that leave the window lose their memory. Therefore it must not take in nodes that it has held before.
        """
        stack, fields = context.stack, context.fields
        here, box = context.slot * context.target.count + layer, touch.box
        old, known = stack.window[here], stack.known[here]
        rows = (box.y_low + box.y_high) // 2 - old.cells_y // 2
        columns = (box.z_low + box.z_high) // 2 - old.cells_z // 2
        new = slid(old, rows, columns)
        before, after = extent_of(old), extent_of(new)
        plate = plate_of(context.target, layer)
        possible = is_ahead(before, after, known)
        possible = possible and use.footprint.holds(plate, new, moved(box, rows, columns))
        if possible:
            use.exposure.slide_nodes(fields.exposure, old.first, old.cells_y, old.cells_z, rows, columns)
            stack.window[here] = new
            stack.known[here] = around(known, after)
        return possible

    @wp.func
    def open_layer(context: struct.Context, layer: wp.int32, pose: struct.Pose, ahead: vec3):
        """Open the window of a layer where the core will reach the layer; at first that of the plate about the hit."""
        stack, here = context.stack, context.slot * context.target.count + layer
        home = vec3()
        if layer > 0 or stack.open[here]:
            home = vec3(zero, pose.position[1] + ahead[1], pose.position[2] + ahead[2])
        use.lanes.barrier()
        stack.window[here] = use.target.open_window(context, layer, home)
        stack.home[here] = home
        stack.open[here] = True
        stack.known[here] = extent_of(stack.window[here])

    @wp.func
    def touch_of(context: struct.Context, layer: wp.int32, state: struct.State, pose: struct.Pose, dt: real):
        """The footprint of a step on a layer that the core is near, and a lower bound of the core's distance from the
        material of the layer [m]. A window opens when the core comes near, and opens anew where the core comes back
        elsewhere."""
        surface, target, stack = context.surface, context.target, context.stack
        here, plate = context.slot * target.count + layer, plate_of(target, layer)
        if not stack.open[here]:
            front, _ = faces_of(target, layer, context.shot)
            ahead = real((front - pose.position[0]) / wp.max(state.velocity[0], slowest)) * state.velocity
            ahead = wp.min(one, surface.bounding_radius / (wp.length(ahead) + small)) * ahead
            open_layer(context, layer, pose, ahead)
        seen = in_layer(context, layer, pose)
        touch = use.footprint.footprint_of(surface, plate, stack.window[here], seen, dt)
        cells = layer_value(stack.first_cells, layer, context.shot)
        returns = touch.last_ring >= 0 and not stack.near[here]
        if returns and use.footprint.is_elsewhere(stack.window[here], touch, cells):
            open_layer(context, layer, pose, vec3())
            seen = in_layer(context, layer, pose)
            touch = use.footprint.footprint_of(surface, plate, stack.window[here], seen, dt)
        window = stack.window[here]
        distance = use.footprint.clearance_at(plate, window, seen.position[1], seen.position[2])
        if touch.last_ring >= 0 and use.footprint.is_clear(plate, window, touch, use.footprint.pushes(surface)):
            touch.last_ring = -1
            touch.inside = True
        if wp.static(slides):
            if target.slide and target.weakens[layer] and not touch.inside:
                if slide(context, layer, touch):
                    touch = use.footprint.footprint_of(surface, plate, stack.window[here], seen, dt)
        return touch, wp.max(zero, distance - surface.bounding_radius - use.footprint.pushes(surface))

    @wp.func
    def find_reach(
        context: struct.Context,
        before: struct.Reach,
        state: struct.State,
        pose: struct.Pose,
        last: struct.Change,
        dt: real,
    ):
        """The Reach of a step in every layer. Layers that the core has left are recorded; `last` is the change of its
        velocities in the last step."""
        surface, target, stack, shot = context.surface, context.target, context.stack, context.shot
        reach = before
        rearmost, foremost = use.core_surface.ends_of(surface, pose)
        reach.rearmost = rearmost
        reach.foremost = foremost
        reach.deepest = wp.max(before.deepest, foremost)
        reach.clearance = real(far)
        reach.barrier = zero
        reach.first = target.count
        reach.last = -1
        margin = half * dt * pose.speed
        low, high = rearmost - margin, foremost + margin
        footprint = struct.Footprint()
        footprint.last_ring = -1
        footprint.inside = True
        footprint.back = high < zero
        for k in range(target.count):
            here = context.slot * target.count + k
            front, rear = faces_of(target, k, shot)
            footprint.through = low > rear  # after the loop, it holds for the last layer
            near = high > front and low < rear
            if low > rear:
                section = real(wp.pi) * surface.max_radius * surface.max_radius
                reach.barrier += layer_value(target.a0, k, shot) * (rear - front) * section
            if near:
                touch, clearance = touch_of(context, k, state, pose, dt)
                reach.clearance = wp.min(reach.clearance, clearance)
                if touch.last_ring >= 0:
                    reach.first = wp.min(reach.first, k)
                    reach.last = k
                    footprint.last_ring = surface.rings - 1
                    held = touch.inside or not target.weakens[k]
                    footprint.inside = footprint.inside and held
                use.lanes.barrier()
                stack.footprint[here] = touch
            elif low > rear and not has_left(context.passage, shot, k):
                since = (rearmost - rear) / wp.max(state.velocity[0], slowest)
                speed = wp.length(state.velocity)
                if before.first != k or before.last != k:  # other layers slow the core down while it leaves this one
                    speed = wp.length(pose.velocity - (since / dt) * last.velocity)
                leave_layer(context, k, state, speed, since, reach.flight)
            stack.near[here] = near
        reach.footprint = footprint
        reach.behind = has_left(context.passage, shot, 0)
        return reach

    @wp.func
    def law_at(context: struct.Context, law: struct.Law, reach: struct.Reach):
        """The law with the onset of contact for all layers that a step can touch, the sum of theirs."""
        target, jump, most = context.target, real(0.0), real(0.0)
        for k in range(reach.first, reach.last + 1):
            if context.stack.footprint[context.slot * target.count + k].last_ring >= 0:
                jump += layer_value(target.onset_jump, k, context.shot)
                most = wp.max(most, layer_value(target.most_jump, k, context.shot))
        wider = law
        wider.onset_jump = wp.min(jump, most)
        return wider

    @wp.func
    def load_on(context: struct.Context, law: struct.Law, reach: struct.Reach, pose: struct.Pose, dt: real):
        """The load of all layers over one step."""
        target, stack, shot = context.target, context.stack, context.shot
        load = struct.Load()
        if wp.static(variant.bends):
            use.contact.clear_sums(context)
        for k in range(reach.first, reach.last + 1):
            here = context.slot * target.count + k
            if stack.footprint[here].last_ring >= 0:
                slab = struct.Slab()
                slab.plate = plate_of(target, k)
                slab.law = use.target.law_of(target, law, k, shot)
                slab.window = stack.window[here]
                slab.footprint = stack.footprint[here]
                slab.pose = in_layer(context, k, pose)
                slab.dt = dt
                part = scheme.load_on(context, slab)
                if part.touching:
                    load.touching = True
                    enter_layer(context.passage, shot, k)
                load.damped = load.damped or part.damped
                load.force += part.force
                load.moment += part.moment
                load.damping_vv += part.damping_vv
                load.damping_vw += part.damping_vw
                load.damping_ww += part.damping_ww
        return load

    @wp.func
    def free_time(context: struct.Context, reach: struct.Reach, state: struct.State, pose: struct.Pose, dt: real):
        """Time [s] that a core between layers can go on after a step before it may touch one, and whether it is lost
        between them. No part of the core moves along x faster than its centre of mass and its turn together. The core
        never passes more than its own size."""
        surface, target = context.surface, context.target
        ahead, behind = real(far), real(far)
        for k in range(target.count):
            front, rear = faces_of(target, k, context.shot)
            if reach.foremost < front:
                ahead = wp.min(ahead, front - reach.foremost)
            if reach.rearmost > rear:
                behind = wp.min(behind, reach.rearmost - rear)
        turning = surface.bounding_radius * wp.length(wp.cross(pose.omega, vec3(one, zero, zero)))
        forwards, backwards = turning + state.velocity[0], turning - state.velocity[0]
        across = turning + wp.length(vec3(zero, state.velocity[1], state.velocity[2]))
        time = surface.bounding_radius / wp.max(wp.length(state.velocity), slowest)
        time = wp.min(time, reach.clearance / wp.max(across, small))
        if forwards > zero:
            time = wp.min(time, ahead / forwards)
        if backwards > zero:
            time = wp.min(time, behind / backwards)
        lost = wp.length(vec3(zero, state.position[1], state.position[2])) > reach.farthest
        return wp.max(zero, time - half * dt), lost

    @wp.func
    def conclude(context: struct.Context, reach: struct.Reach, state: struct.State, status: wp.int32, touched: wp.bool):
        """The final status. Records how the core ended in the layers that it did not leave through their rear faces.

        A core that has not ended rests if it has touched, all of it is in the target, and its centre of mass is in no
        layer.
        """
        target, shot, x, final = context.target, context.shot, state.position[0], status
        between = touched and reach.rearmost > zero
        for k in range(target.count):
            front, rear = faces_of(target, k, shot)
            between = between and (x < front or x > rear) and (k < target.count - 1 or reach.foremost < rear)
        if status == RUNNING:
            final = wp.where(between, Status.ARRESTED, Status.UNFINISHED)
        for k in range(target.count):
            front, rear = faces_of(target, k, shot)
            inside = reach.foremost > front and reach.rearmost < rear
            conclude_layer(context.passage, shot, k, final, inside, reach.deepest - front)
        return final

    return SimpleNamespace(**locals())
