"""A target of several layers: which of them a step can touch, the load of all of them, and how the core left each.

A layer sees the core in a frame of its own: its front at x = 0, its window's home at y = z = 0. So the load of one
layer is the load of one plate (contact.load_on), and loads of layers add.

Long because all of them read the same layers of the same slot.
"""

from functools import cache
from types import SimpleNamespace

import warp as wp

from . import contact, core_surface, earlier, exposure, footprint, interaction, passage, plate_grid, rigid_body, shots
from .variant import Variant


@cache
def build(variant: Variant) -> SimpleNamespace:
    """Device functions of the layers for one variant."""
    real, vec3 = variant.real, variant.vec3
    zero, half, one, tiny = real(0.0), real(0.5), real(1.0), real(1.0e-9)
    far = 1.0e9  # [m]
    use = variant.use(
        contact, core_surface, earlier, exposure, footprint, interaction, passage, plate_grid, rigid_body, shots
    )
    Surface, Pose, Plate = use.core_surface.Surface, use.core_surface.Pose, use.plate_grid.Plate
    Window, Law = use.plate_grid.Window, use.interaction.Law
    Body, State, Load = use.rigid_body.Body, use.rigid_body.State, use.rigid_body.Load
    Change = use.rigid_body.Change
    Fields, Footprint, Touches = use.contact.Fields, use.footprint.Footprint, use.contact.Touches
    Shots = use.shots.Shots
    own, Passage, Earlier = use.shots.own, use.passage.Passage, use.earlier.Earlier

    @wp.struct
    class Layers:
        """The layers of the target, front to back; arrays of shape [layers].

        `front` is the front face behind that of the target [m]; `offset_y` and `offset_z` are the place of the layer's
        origin in the plane of the plate [m]. These, `thickness` [m] and the members of Law have one value for all shots
        or one per shot: shape [layers, 1] or [layers, shots]. Those layers that a step can touch add their
        `onset_jump`, up to `most_jump`, as if they were one plate. `weakens` says whether the layer keeps a field, in a
        window of cells_y × cells_z nodes from number `first` of its slot's `nodes` on. `standoffs` are distances behind
        the rear face of every layer [m], which the point `ahead` of the centre of mass passes [m].
        """

        count: wp.int32
        plates: wp.array(dtype=Plate)
        weakens: wp.array(dtype=wp.bool)
        by_path: wp.array(dtype=wp.bool)
        a2: wp.array(dtype=real)
        first: wp.array(dtype=wp.int32)
        cells_y: wp.array(dtype=wp.int32)
        cells_z: wp.array(dtype=wp.int32)
        nodes: wp.int32
        standoffs: wp.array(dtype=real)
        ahead: real
        front: wp.array2d(dtype=wp.float64)
        thickness: wp.array2d(dtype=wp.float64)
        offset_y: wp.array2d(dtype=wp.float64)
        offset_z: wp.array2d(dtype=wp.float64)
        a0: wp.array2d(dtype=real)
        a1: wp.array2d(dtype=real)
        friction: wp.array2d(dtype=real)
        decay_rate: wp.array2d(dtype=real)
        onset_jump: wp.array2d(dtype=real)
        most_jump: wp.array2d(dtype=real)

    @wp.struct
    class Stack:
        """Scratch of all slots, shape [slots × layers]: what a step can touch of each layer, the layer's window, the
        place of the window's home relative to the hit [m], whether the window is open, and whether the core was near
        the layer in the last step."""

        found: wp.array(dtype=Footprint)
        window: wp.array(dtype=Window)
        home: wp.array(dtype=vec3)
        open: wp.array(dtype=wp.bool)
        near: wp.array(dtype=wp.bool)

    @wp.struct
    class Reached:
        """Layers that a step can touch, and the ends of the core along x [m]. `first` > `last` if there is none.
        `deepest` is the largest x that the core has reached so far; `clearance` is a lower bound of its distance from
        the material of layers that it passes through a hole or beside [m]."""

        first: wp.int32
        last: wp.int32
        rearmost: real
        foremost: real
        deepest: real
        clearance: real

    @wp.func
    def own_of(values: wp.array2d(dtype=wp.float64), layer: wp.int32, shot: wp.int32):
        """The value of one layer and shot."""
        return real(values[layer, shot % values.shape[1]])

    @wp.func
    def law_of(layers: Layers, common: Law, layer: wp.int32, shot: wp.int32):
        """The law of a layer; the onset of contact is that of the target."""
        law = common
        law.by_path = layers.by_path[layer]
        law.a2 = layers.a2[layer]
        law.a0 = layers.a0[layer, shot % layers.a0.shape[1]]
        law.a1 = layers.a1[layer, shot % layers.a1.shape[1]]
        law.friction = layers.friction[layer, shot % layers.friction.shape[1]]
        law.decay_rate = layers.decay_rate[layer, shot % layers.decay_rate.shape[1]]
        return law

    @wp.func
    def begin(layers: Layers, stack: Stack, passage: Passage, slot: wp.int32, shot: wp.int32):
        """No layer is reached yet."""
        for k in range(layers.count):
            stack.open[slot * layers.count + k] = False
            stack.near[slot * layers.count + k] = False
        use.passage.begin(passage, shot, layers.count)

    @wp.func
    def in_layer(layers: Layers, stack: Stack, slot: wp.int32, layer: wp.int32, shot: wp.int32, pose: Pose):
        """The pose in the frame of a layer."""
        seen = pose
        front = own_of(layers.front, layer, shot)
        seen.position = pose.position - stack.home[slot * layers.count + layer] - vec3(front, zero, zero)
        return seen

    @wp.func
    def fields_of(layers: Layers, common: Fields, layer: wp.int32):
        """The fields, with the width of a layer's window."""
        fields = common
        fields.cells_y = layers.cells_y[layer]
        fields.cells_z = layers.cells_z[layer]
        return fields

    @wp.func
    def open_layer(
        layers: Layers,
        stack: Stack,
        past: Earlier,
        common: Fields,
        shots: Shots,
        slot: wp.int32,
        layer: wp.int32,
        shot: wp.int32,
        pose: Pose,
        ahead: vec3,
    ):
        """Open the window of a layer where the core will reach it, at first that of the plate about the hit."""
        here, home = slot * layers.count + layer, vec3()
        if layer > 0 or stack.open[here]:
            home = vec3(zero, pose.position[1] + ahead[1], pose.position[2] + ahead[2])
        fields = fields_of(layers, common, layer)
        y = own(shots.hit_y, shot) + wp.float64(home[1]) - layers.offset_y[layer, shot % layers.offset_y.shape[1]]
        z = own(shots.hit_z, shot) + wp.float64(home[2]) - layers.offset_z[layer, shot % layers.offset_z.shape[1]]
        thickness = own_of(layers.thickness, layer, shot)
        window = use.plate_grid.window_at(layers.plates[layer], thickness, fields.cells_y, fields.cells_z, 0, y, z)
        first = slot * layers.nodes + layers.first[layer]
        window.first += first
        window.home += first
        window.weakens = layers.weakens[layer]
        if wp.static(variant.degrades):
            if window.weakens:
                use.exposure.blank(fields, window)
                if wp.static(variant.burst):
                    use.earlier.recall(past, fields, layers.plates[layer], window, slot, layer, shot, y, z)
        stack.window[here] = window
        stack.home[here] = home
        stack.open[here] = True

    @wp.func
    def reach(
        surface: Surface,
        body: Body,
        layers: Layers,
        fields: Fields,
        stack: Stack,
        past: Earlier,
        passage: Passage,
        shots: Shots,
        slot: wp.int32,
        shot: wp.int32,
        state: State,
        pose: Pose,
        before: Reached,
        last: Change,
        time: real,
        flight: vec3,
        dt: real,
    ):
        """Find what a step can touch of every layer; open the windows of layers that are reached for the first time,
        and record the layers that the core has left. `last` is the change of its velocities in the last step."""
        reached = Reached()
        rearmost, foremost = use.core_surface.ends_of(surface, pose)
        reached.rearmost = rearmost
        reached.foremost = foremost
        reached.deepest = wp.max(before.deepest, foremost)
        reached.clearance = real(far)
        reached.first = layers.count
        reached.last = -1
        margin = half * dt * pose.speed
        low, high = rearmost - margin, foremost + margin
        found = Footprint()
        found.last_ring = -1
        found.inside = True
        found.back = high < zero
        for k in range(layers.count):
            here = slot * layers.count + k
            front = own_of(layers.front, k, shot)
            rear = front + own_of(layers.thickness, k, shot)
            found.through = low > rear  # in the end, that of the last layer
            near = bool(False)
            if high > front and low < rear:
                if not stack.open[here]:
                    ahead = real((front - pose.position[0]) / wp.max(state.velocity[0], one)) * state.velocity
                    ahead = wp.min(one, surface.bounding_radius / (wp.length(ahead) + tiny)) * ahead
                    open_layer(layers, stack, past, fields, shots, slot, k, shot, pose, ahead)
                plate = layers.plates[k]
                seen = in_layer(layers, stack, slot, k, shot, pose)
                touch = use.footprint.footprint_of(surface, plate, stack.window[here], seen, dt)
                if not touch.inside and not stack.near[here] and use.footprint.is_beside(stack.window[here], touch):
                    open_layer(layers, stack, past, fields, shots, slot, k, shot, pose, vec3())
                    seen = in_layer(layers, stack, slot, k, shot, pose)
                    touch = use.footprint.footprint_of(surface, plate, stack.window[here], seen, dt)
                window = stack.window[here]
                beside = use.footprint.clearance_at(plate, window, seen.position[1], seen.position[2])
                reached.clearance = wp.min(reached.clearance, wp.max(zero, beside - surface.bounding_radius))
                if touch.last_ring >= 0 and use.footprint.is_clear(plate, window, touch):
                    touch.last_ring = -1
                    touch.inside = True
                if touch.last_ring >= 0:
                    reached.first = wp.min(reached.first, k)
                    reached.last = k
                    found.last_ring = surface.rings - 1
                    found.inside = found.inside and (touch.inside or not layers.weakens[k])
                stack.found[here] = touch
                near = True
            elif low > rear and not use.passage.has_left(passage, shot, k):
                since = (rearmost - rear) / wp.max(state.velocity[0], one)
                speed = wp.length(state.velocity)
                if before.first != k or before.last != k:  # other layers slow the core down while it leaves this one
                    speed = wp.length(pose.velocity - (since / dt) * last.velocity)
                use.passage.leave(passage, body, shot, k, state, speed, since, time, flight)
                use.passage.fly_on(passage, body, layers.standoffs, layers.ahead, shot, k, state, rear, flight)
            stack.near[here] = near
        return found, reached

    @wp.func
    def jump_of(layers: Layers, stack: Stack, slot: wp.int32, shot: wp.int32, reached: Reached):
        """Onset speed of contact per time step [m/s²] of the layers that a step can touch."""
        jump, most = real(0.0), real(0.0)
        for k in range(reached.first, reached.last + 1):
            if stack.found[slot * layers.count + k].last_ring >= 0:
                jump += layers.onset_jump[k, shot % layers.onset_jump.shape[1]]
                most = wp.max(most, layers.most_jump[k, shot % layers.most_jump.shape[1]])
        return wp.min(jump, most)

    @wp.func
    def load_on(
        surface: Surface,
        layers: Layers,
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
            use.contact.clear_sums(surface, touches, slot)
        for k in range(reached.first, reached.last + 1):
            here = slot * layers.count + k
            if stack.found[here].last_ring >= 0:
                part = use.contact.load_on(
                    surface,
                    layers.plates[k],
                    law_of(layers, common, k, shot),
                    fields_of(layers, fields, k),
                    stack.window[here],
                    touches,
                    slot,
                    stack.found[here],
                    in_layer(layers, stack, slot, k, shot, pose),
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
    def free_time(
        surface: Surface, layers: Layers, shot: wp.int32, state: State, pose: Pose, reached: Reached, dt: real
    ):
        """Time [s] that a core between layers can go on after a step before it may touch one: no part of it moves along
        x faster than its centre of mass and its turn together. It never passes more than its own size."""
        ahead, behind = real(far), real(far)
        for k in range(layers.count):
            front = own_of(layers.front, k, shot)
            rear = front + own_of(layers.thickness, k, shot)
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
        return wp.max(zero, time - half * dt)

    @wp.func
    def is_behind(passage: Passage, shot: wp.int32):
        """Whether the core has left the plate through its rear face."""
        return use.passage.has_left(passage, shot, 0)

    @wp.func
    def is_between(layers: Layers, shot: wp.int32, reached: Reached, x: real):
        """Whether the whole core is in the target, and its centre of mass, at x [m], in none of the layers."""
        between = reached.rearmost > zero
        for k in range(layers.count):
            front = own_of(layers.front, k, shot)
            rear = front + own_of(layers.thickness, k, shot)
            between = between and (x < front or x > rear)
            if k == layers.count - 1:
                between = between and reached.foremost < rear
        return between

    @wp.func
    def conclude(layers: Layers, passage: Passage, shot: wp.int32, status: wp.int32, reached: Reached):
        """Say how the core ended in the layers that it did not leave through their rear faces."""
        for k in range(layers.count):
            front = own_of(layers.front, k, shot)
            rear = front + own_of(layers.thickness, k, shot)
            inside = reached.foremost > front and reached.rearmost < rear
            use.passage.conclude(passage, shot, k, status, inside, reached.deepest - front)

    @wp.func
    def keep(layers: Layers, common: Fields, stack: Stack, past: Earlier, slot: wp.int32, shot: wp.int32):
        """Keep what a shot of a burst has added to the layers that it reached, each in its last window there."""
        for k in range(layers.count):
            here = slot * layers.count + k
            if stack.open[here] and layers.weakens[k]:
                use.earlier.keep(past, common, stack.window[here], slot, shot)

    return SimpleNamespace(
        Layers=Layers,
        Stack=Stack,
        Passage=Passage,
        Reached=Reached,
        begin=begin,
        reach=reach,
        jump_of=jump_of,
        load_on=load_on,
        free_time=free_time,
        is_behind=is_behind,
        is_between=is_between,
        conclude=conclude,
        keep=keep,
    )
