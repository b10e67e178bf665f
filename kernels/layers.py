"""A target of several layers: which of them a step can touch, the load of all of them, and how the core left each.

A layer sees the core in a frame of its own: its front at x = 0, its window's home at y = z = 0. So the load of one
layer is the load of one plate, and loads of layers add. The interface is that of kernels/one_plate.py.

Long because all of them read the same layers of the same slot.
"""

from functools import cache
from types import ModuleType, SimpleNamespace

import warp as wp

from . import (
    core_surface,
    earlier,
    footprint,
    interaction,
    lanes,
    passage,
    plate_grid,
    rigid_body,
    shots,
    sliding,
    target,
)
from .status import RUNNING, Status
from .variant import Variant


@cache
def build(variant: Variant, scheme: ModuleType) -> SimpleNamespace:
    """Device functions of the layers for one variant, whose loads a scheme computes."""
    real, vec3 = variant.real, variant.vec3
    zero, half, one, tiny = real(0.0), real(0.5), real(1.0), real(1.0e-9)
    far = 1.0e9  # [m]
    use = variant.use(
        core_surface, earlier, footprint, interaction, lanes, passage, plate_grid, rigid_body, shots, sliding
    )
    plates, loads = target.build(variant, scheme), scheme.build(variant)
    Surface, Pose, Window = use.core_surface.Surface, use.core_surface.Pose, use.plate_grid.Window
    Body, State = use.rigid_body.Body, use.rigid_body.State
    Load, Change = use.rigid_body.Load, use.rigid_body.Change
    Law, Footprint, Shots = use.interaction.Law, use.footprint.Footprint, use.shots.Shots
    Target, Fields, Touches = plates.Target, loads.Fields, loads.Touches
    slides = variant.degrades and not variant.burst and variant.window == 0
    Earlier, Passage, faces_of, own_of = use.earlier.Earlier, use.passage.Passage, plates.faces_of, plates.own_of

    @wp.struct
    class Stack:
        """Scratch of all slots, shape [slots × layers]: what a step can touch of each layer, the layer's window, the
        place of the window's home relative to the hit [m], whether the window is open, whether the core was near the
        layer in the last step, and the nodes that the window has held, from its home (`known`). `own_cells` are the
        nodes in each direction of the first window that a shot has by itself, shape [layers, 1] or [layers, shots]:
        what becomes of it must not depend on how wide the windows of those are that are computed with it."""

        found: wp.array(dtype=Footprint)
        window: wp.array(dtype=Window)
        home: wp.array(dtype=vec3)
        open: wp.array(dtype=wp.bool)
        near: wp.array(dtype=wp.bool)
        known: wp.array(dtype=use.plate_grid.Box)
        own_cells: wp.array2d(dtype=wp.int32)

    @wp.struct
    class Reached:
        """What a step can touch: of all layers together (`found`), and which layers; `first` > `last` if there is none.

        `rearmost` and `foremost` are the ends of the core along x, and `deepest` is the largest x that it has reached
        so far [m]. `clearance` is a lower bound of its distance from the material of layers that it passes through a
        hole or beside [m]. `behind` says whether it has left the plate through its rear face. `barrier` is the work
        that a core takes straight through the layers before it, if they were solid [J]. `flight` is the unit vector
        along the line of fire; a core that gets farther away from the hit across the line than `farthest` [m] never
        ends.
        """

        found: Footprint
        first: wp.int32
        last: wp.int32
        rearmost: real
        foremost: real
        deepest: real
        clearance: real
        behind: wp.bool
        barrier: real
        flight: vec3
        farthest: real

    @wp.func
    def first_step(target: Target, shot: wp.int32, shortest: real):
        """Length of the first step [s]: that of the plate."""
        return own_of(target.stretch, 0, shot) * shortest

    @wp.func
    def next_step(
        surface: Surface,
        target: Target,
        shot: wp.int32,
        pose: Pose,
        reached: Reached,
        last: Change,
        dt: real,
        free: real,
        shortest: real,
    ):
        """Length of the step after the present one and a `free` time [s]: that of the layer that needs the shortest, of
        those that the core can be in until then. It is not so long that it takes more than a share of the speed, if it
        takes as much of it per time as the present one."""
        longest = one
        for k in range(target.count):
            longest = wp.max(longest, own_of(target.stretch, k, shot))
        margin = (half * dt + free + longest * shortest) * pose.speed
        low, high = reached.rearmost - margin, reached.foremost + margin
        stretch = longest
        for k in range(target.count):
            front, rear = faces_of(target, k, shot)
            if high > front and low < rear:
                stretch = wp.min(stretch, own_of(target.stretch, k, shot))
        taken = wp.length(last.velocity) + surface.bounding_radius * wp.length(last.omega)
        allowed = target.slowing * wp.length(pose.velocity) * dt / (taken + tiny)
        return wp.max(shortest, wp.min(stretch * shortest, allowed))

    @wp.func
    def begin(
        surface: Surface,
        target: Target,
        fields: Fields,
        stack: Stack,
        earlier: Earlier,
        passage: Passage,
        shots: Shots,
        slot: wp.int32,
        shot: wp.int32,
        state: State,
    ):
        """No layer is reached yet."""
        plates.begin(earlier, slot, shot)
        for k in range(target.count):
            stack.open[slot * target.count + k] = False
            stack.near[slot * target.count + k] = False
        use.passage.begin(passage, shot, target.count)
        reached = Reached()
        straight = use.shots.line_of_flight(shots, shot)
        reached.flight = vec3(real(straight[0]), real(straight[1]), real(straight[2]))
        # A core that slides between two layers never ends: it has gone farther than one that goes straight through.
        steep = wp.length(vec3(zero, reached.flight[1], reached.flight[2])) / reached.flight[0]
        longest_way = real(use.shots.own(shots.longest_way, shot))
        reached.farthest = longest_way + steep * real(plates.depth_of(target, shot))
        return reached, RUNNING

    @wp.func
    def in_layer(target: Target, stack: Stack, slot: wp.int32, layer: wp.int32, shot: wp.int32, pose: Pose):
        """The pose in the frame of a layer."""
        seen = pose
        front = real(own_of(target.front, layer, shot))
        seen.position = pose.position - stack.home[slot * target.count + layer] - vec3(front, zero, zero)
        return seen

    @wp.func
    def slide(
        target: Target,
        stack: Stack,
        fields: Fields,
        slot: wp.int32,
        layer: wp.int32,
        touch: Footprint,
    ):
        """Have the window of a layer and its laminate follow a core that leaves it, if what it leaves behind is not
        needed any more: nodes come back as if nothing had been there, so none may that were held before. Nor may
        another layer of the laminate have been found in the window in this step."""
        base, first = slot * target.count, target.laminate[layer]
        old, known, box = stack.window[base + layer], stack.known[base + layer], touch.box
        rows = (box.y_low + box.y_high) // 2 - old.cells_y // 2
        columns = (box.z_low + box.z_high) // 2 - old.cells_z // 2
        new = use.sliding.slid(old, rows, columns)
        before, after = use.sliding.extent_of(old), use.sliding.extent_of(new)
        possible = use.sliding.is_ahead(before, after, known)
        possible = possible and use.footprint.holds(
            plates.plate_of(target, layer), new, use.sliding.moved(box, rows, columns)
        )
        for k in range(first, layer):
            possible = possible and not (stack.near[base + k] and stack.found[base + k].last_ring >= 0)
        if possible:
            loads.slide_nodes(fields.exposure, old.first, old.planes, old.cells_y, old.cells_z, rows, columns)
            for k in range(first, target.count):
                if target.laminate[k] == first:
                    stack.window[base + k] = use.sliding.slid(stack.window[base + k], rows, columns)
                    stack.known[base + k] = use.sliding.around(known, after)
        return possible

    @wp.func
    def open_layer(
        target: Target,
        stack: Stack,
        earlier: Earlier,
        fields: Fields,
        shots: Shots,
        slot: wp.int32,
        layer: wp.int32,
        shot: wp.int32,
        pose: Pose,
        ahead: vec3,
    ):
        """Open the windows of a layer and its laminate where the core will reach it, at first that of the plate about
        the hit."""
        home = vec3()
        if layer > 0 or stack.open[slot * target.count + layer]:
            home = vec3(zero, pose.position[1] + ahead[1], pose.position[2] + ahead[2])
        use.lanes.barrier()
        for k in range(target.laminate[layer], target.count):
            if target.laminate[k] == target.laminate[layer]:
                here = slot * target.count + k
                stack.window[here] = plates.open_window(target, fields, earlier, shots, slot, k, shot, home)
                stack.home[here] = home
                stack.open[here] = True
                stack.known[here] = use.sliding.extent_of(stack.window[here])

    @wp.func
    def was_near(target: Target, stack: Stack, slot: wp.int32, layer: wp.int32):
        """Whether the core was near a layer, or another one of its laminate, in the last step."""
        near = bool(False)
        for k in range(target.laminate[layer], target.count):
            near = near or (target.laminate[k] == target.laminate[layer] and stack.near[slot * target.count + k])
        return near

    @wp.func
    def touch_of(
        surface: Surface,
        target: Target,
        fields: Fields,
        stack: Stack,
        earlier: Earlier,
        shots: Shots,
        slot: wp.int32,
        layer: wp.int32,
        shot: wp.int32,
        state: State,
        pose: Pose,
        dt: real,
    ):
        """What a step can touch of a layer that the core is near, and a lower bound of the core's distance from its
        material [m]. A window opens when the core comes near, and again where it comes back elsewhere."""
        here, plate = slot * target.count + layer, plates.plate_of(target, layer)
        if not stack.open[here]:
            front, _ = faces_of(target, layer, shot)
            ahead = real((front - pose.position[0]) / wp.max(state.velocity[0], one)) * state.velocity
            ahead = wp.min(one, surface.bounding_radius / (wp.length(ahead) + tiny)) * ahead
            open_layer(target, stack, earlier, fields, shots, slot, layer, shot, pose, ahead)
        seen = in_layer(target, stack, slot, layer, shot, pose)
        touch = use.footprint.footprint_of(surface, plate, stack.window[here], seen, dt)
        if (
            touch.last_ring >= 0
            and not was_near(target, stack, slot, layer)
            and use.footprint.is_beside(stack.window[here], touch, own_of(stack.own_cells, layer, shot))
        ):
            open_layer(target, stack, earlier, fields, shots, slot, layer, shot, pose, vec3())
            seen = in_layer(target, stack, slot, layer, shot, pose)
            touch = use.footprint.footprint_of(surface, plate, stack.window[here], seen, dt)
        window = stack.window[here]
        beside = use.footprint.clearance_at(plate, window, seen.position[1], seen.position[2])
        if touch.last_ring >= 0 and use.footprint.is_clear(plate, window, touch):
            touch.last_ring = -1
            touch.inside = True
        if wp.static(slides):
            if target.slide and target.weakens[layer] and not touch.inside:
                if slide(target, stack, fields, slot, layer, touch):
                    touch = use.footprint.footprint_of(surface, plate, stack.window[here], seen, dt)
        return touch, wp.max(zero, beside - surface.bounding_radius)

    @wp.func
    def reach(
        surface: Surface,
        body: Body,
        target: Target,
        fields: Fields,
        stack: Stack,
        earlier: Earlier,
        passage: Passage,
        shots: Shots,
        slot: wp.int32,
        shot: wp.int32,
        state: State,
        pose: Pose,
        before: Reached,
        last: Change,
        time: real,
        dt: real,
    ):
        """Find what a step can touch of every layer, and record the layers that the core has left. `last` is the change
        of its velocities in the last step."""
        reached = before
        rearmost, foremost = use.core_surface.ends_of(surface, pose)
        reached.rearmost = rearmost
        reached.foremost = foremost
        reached.deepest = wp.max(before.deepest, foremost)
        reached.clearance = real(far)
        reached.barrier = zero
        reached.first = target.count
        reached.last = -1
        margin = half * dt * pose.speed
        low, high = rearmost - margin, foremost + margin
        found = Footprint()
        found.last_ring = -1
        found.inside = True
        found.back = high < zero
        for k in range(target.count):
            here = slot * target.count + k
            front, rear = faces_of(target, k, shot)
            found.through = low > rear  # in the end, that of the last layer
            near = high > front and low < rear
            if low > rear:
                section = real(wp.pi) * surface.max_radius * surface.max_radius
                reached.barrier += own_of(target.a0, k, shot) * (rear - front) * section
            if near:
                touch, clearance = touch_of(
                    surface, target, fields, stack, earlier, shots, slot, k, shot, state, pose, dt
                )
                reached.clearance = wp.min(reached.clearance, clearance)
                if touch.last_ring >= 0:
                    reached.first = wp.min(reached.first, k)
                    reached.last = k
                    found.last_ring = surface.rings - 1
                    found.inside = found.inside and (
                        touch.inside or not (target.weakens[k] or wp.static(variant.burst))
                    )
                use.lanes.barrier()
                stack.found[here] = touch
            elif low > rear and not use.passage.has_left(passage, shot, k):
                since = (rearmost - rear) / wp.max(state.velocity[0], one)
                speed = wp.length(state.velocity)
                if before.first != k or before.last != k:  # other layers slow the core down while it leaves this one
                    speed = wp.length(pose.velocity - (since / dt) * last.velocity)
                use.passage.leave(passage, body, shot, k, state, speed, since, time, reached.flight)
                use.passage.fly_on(passage, body, target.standoffs, target.ahead, shot, k, state, rear, reached.flight)
            stack.near[here] = near
        reached.found = found
        reached.behind = use.passage.has_left(passage, shot, 0)
        return reached

    @wp.func
    def law_at(target: Target, law: Law, stack: Stack, slot: wp.int32, shot: wp.int32, reached: Reached):
        """The law with the onset of what a step can touch: the layers add theirs."""
        jump, most = real(0.0), real(0.0)
        for k in range(reached.first, reached.last + 1):
            if stack.found[slot * target.count + k].last_ring >= 0:
                jump += own_of(target.onset_jump, k, shot)
                most = wp.max(most, own_of(target.most_jump, k, shot))
        found = law
        found.onset_jump = wp.min(jump, most)
        return found

    @wp.func
    def load_on(
        surface: Surface,
        target: Target,
        common: Law,
        fields: Fields,
        stack: Stack,
        touches: Touches,
        passage: Passage,
        slot: wp.int32,
        shot: wp.int32,
        reached: Reached,
        pose: Pose,
        dt: real,
    ):
        """The load of all layers over one step."""
        load = Load()
        if wp.static(variant.bends):
            loads.clear_sums(surface, touches, slot)
        for k in range(reached.first, reached.last + 1):
            here = slot * target.count + k
            if stack.found[here].last_ring >= 0:
                part = loads.load_on(
                    surface,
                    plates.plate_of(target, k),
                    plates.law_of(target, common, k, shot),
                    fields,
                    stack.window[here],
                    touches,
                    slot,
                    stack.found[here],
                    in_layer(target, stack, slot, k, shot, pose),
                    dt,
                )
                if part.touching:
                    load.touching = True
                    use.passage.enter(passage, shot, k)
                load.damped = load.damped or part.damped
                load.force += part.force
                load.moment += part.moment
                load.damping_vv += part.damping_vv
                load.damping_vw += part.damping_vw
                load.damping_ww += part.damping_ww
        return load

    @wp.func
    def follow(
        surface: Surface,
        target: Target,
        stack: Stack,
        earlier: Earlier,
        slot: wp.int32,
        shot: wp.int32,
        reached: Reached,
        pose: Pose,
    ):
        """Take note, for later shots, of where the core is in the layers that a step can touch."""
        for k in range(reached.first, reached.last + 1):
            here = slot * target.count + k
            if stack.found[here].last_ring >= 0:
                seen = in_layer(target, stack, slot, k, shot, pose)
                plates.follow(surface, earlier, stack.window[here], slot, k, shot, seen)

    @wp.func
    def free_time(
        surface: Surface, target: Target, shot: wp.int32, state: State, pose: Pose, reached: Reached, dt: real
    ):
        """Time [s] that a core between layers can go on after a step before it may touch one, and whether it is lost
        between them. No part of it moves along x faster than its centre of mass and its turn together. It never passes
        more than its own size."""
        ahead, behind = real(far), real(far)
        for k in range(target.count):
            front, rear = faces_of(target, k, shot)
            if reached.foremost < front:
                ahead = wp.min(ahead, front - reached.foremost)
            if reached.rearmost > rear:
                behind = wp.min(behind, reached.rearmost - rear)
        turning = surface.bounding_radius * wp.length(wp.cross(pose.omega, vec3(one, zero, zero)))
        forwards, backwards = turning + state.velocity[0], turning - state.velocity[0]
        across = turning + wp.length(vec3(zero, state.velocity[1], state.velocity[2]))
        time = surface.bounding_radius / wp.max(wp.length(state.velocity), one)
        time = wp.min(time, reached.clearance / wp.max(across, tiny))
        if forwards > zero:
            time = wp.min(time, ahead / forwards)
        if backwards > zero:
            time = wp.min(time, behind / backwards)
        lost = wp.length(vec3(zero, state.position[1], state.position[2])) > reached.farthest
        return wp.max(zero, time - half * dt), lost

    @wp.func
    def given_up(target: Target, shot: wp.int32, reached: Reached, state: State, touched: wp.bool):
        """The status of a core that has not ended: it rests if it has touched, the whole of it is in the target, and
        its centre of mass is in none of the layers."""
        x, between = state.position[0], touched and reached.rearmost > zero
        for k in range(target.count):
            front, rear = faces_of(target, k, shot)
            between = between and (x < front or x > rear)
            if k == target.count - 1:
                between = between and reached.foremost < rear
        return wp.where(between, Status.ARRESTED, Status.UNFINISHED)

    @wp.func
    def conclude(
        surface: Surface,
        target: Target,
        fields: Fields,
        stack: Stack,
        earlier: Earlier,
        passage: Passage,
        slot: wp.int32,
        shot: wp.int32,
        status: wp.int32,
        reached: Reached,
    ):
        """Say how the core ended in the layers that it did not leave through their rear faces. Keep what later shots at
        this target need of those that it reached, each in its last window there."""
        for k in range(target.count):
            here = slot * target.count + k
            front, rear = faces_of(target, k, shot)
            inside = reached.foremost > front and reached.rearmost < rear
            use.passage.conclude(passage, shot, k, status, inside, reached.deepest - front)
            if stack.open[here] and target.laminate[k] == k:
                plates.keep(fields, earlier, stack.window[here], slot, shot)
            if stack.open[here] and use.passage.has_left(passage, shot, k):
                plates.leave_channel(surface, earlier, stack.window[here], slot, k, shot)

    return SimpleNamespace(**locals())
