"""The march of a core through the target, from the first touch of the front face to the end of contact."""

from functools import cache
from types import SimpleNamespace

import warp as wp

from . import (
    bending,
    block,
    channel,
    contact,
    core_surface,
    damping,
    earlier,
    footprint,
    interaction,
    lanes,
    layers,
    nodal,
    one_plate,
    passage,
    plate_grid,
    rigid_body,
    shots,
    target,
    trace,
)
from .lanes import BLOCKS, LANES
from .status import RUNNING, Status
from .variant import Variant


@cache
def build(variant: Variant) -> SimpleNamespace:
    """The march kernel and the structs it takes, for one variant."""
    real, vec3 = variant.real, variant.vec3
    zero, half = real(0.0), real(0.5)
    steadied = real(8.0)  # onsets: as far as a step carries a core beyond the ramp
    still = real(1.0e-4)  # of the impact energy: a core at 1 % of its impact velocity has come to rest
    spent = real(2.5e-3)  # likewise: at 5 % it does not come back through a layer that it has left
    weak = real(2.25e-2)  # likewise: nor does one that flies back at 15 %, however fast it goes along the layers,
    tenth = real(0.1)  # if that is no more than this share of what solid layers would take
    most = real(1.01)  # of the impact energy: no law adds to it, and rounding errors add less in many thousand steps
    use = variant.use(
        bending,
        channel,
        core_surface,
        damping,
        earlier,
        footprint,
        interaction,
        lanes,
        passage,
        plate_grid,
        rigid_body,
        shots,
        trace,
    )
    scheme = nodal if variant.nodal else block if variant.window else contact
    loads, plates = scheme.build(variant), target.build(variant, scheme)
    reaches = (layers if variant.layered else one_plate).build(variant, scheme)
    Surface, Pose, Law = use.core_surface.Surface, use.core_surface.Pose, use.interaction.Law
    Body, State = use.rigid_body.Body, use.rigid_body.State
    Load, Change = use.rigid_body.Load, use.rigid_body.Change
    Fields, Footprint, Touches = loads.Fields, use.footprint.Footprint, loads.Touches
    Sections, Bending = use.bending.Sections, use.bending.Bending
    Shots, own = use.shots.Shots, use.shots.own
    Target, Stack, Passage, Earlier = plates.Target, reaches.Stack, use.passage.Passage, use.earlier.Earlier
    Channels, Section, Box = use.channel.Channels, use.channel.Section, use.plate_grid.Box

    @wp.struct
    class Outcomes:
        """How each shot's contact ended: arrays of shape [shots]; position relative to the hit point."""

        status: wp.array(dtype=wp.int32)
        steps: wp.array(dtype=wp.int32)
        contact_duration: wp.array(dtype=real)
        energy_loss: wp.array(dtype=real)
        position: wp.array(dtype=vec3)
        axis: wp.array(dtype=vec3)
        velocity: wp.array(dtype=vec3)
        angular_momentum: wp.array(dtype=vec3)

    @wp.func
    def ended(
        surface: Surface,
        body: Body,
        state: State,
        pose: Pose,
        found: Footprint,
        touched: wp.bool,
        behind: wp.bool,
        barrier: real,
        initial_energy: real,
        depth: real,
    ):
        """The final status of a core, or RUNNING.

        A core outside the target, which is `depth` [m] deep, cannot come back if it moves away faster than its rotation
        moves any part of it. A core that turns back `behind` a layer, and is spent, rests there; between
        layers, what it has along them does not count, and they are a `barrier` to it [J].
        """
        status = RUNNING
        energy = use.rigid_body.kinetic_energy(body, pose.axis, state.velocity, state.angular_momentum)
        along = wp.dot(state.angular_momentum, pose.axis)
        about_axis = half * along * along / body.inertia_axial
        turning = surface.bounding_radius * wp.length(wp.cross(pose.omega, pose.axis))
        leaving = wp.abs(state.velocity[0])
        beyond = wp.max(state.position[0] - depth, -state.position[0])
        back = behind and state.velocity[0] < zero
        rests = energy - about_axis < wp.where(back, spent, still) * initial_energy
        along_layers = half * body.mass * wp.length_sq(vec3(zero, state.velocity[1], state.velocity[2]))
        crossing = energy - about_axis - along_layers
        stays = back and found.last_ring < 0 and crossing < wp.min(weak * initial_energy, tenth * barrier)
        gone = leaving > turning or beyond > surface.bounding_radius
        if not wp.isfinite(energy):
            status = Status.NOT_FINITE
        elif energy > most * initial_energy:
            status = Status.GAINED_ENERGY
        elif found.through and state.velocity[0] > zero and gone:
            status = wp.where(touched, Status.PERFORATED, Status.MISSED)
        elif found.back and state.velocity[0] < zero and gone:
            status = wp.where(touched, Status.RICOCHETED, Status.MISSED)
        elif touched and (rests or stays):
            status = Status.ARRESTED
        elif not found.inside:
            status = Status.LEFT_WINDOW
        return status

    def march(
        # inputs
        first: wp.int32,
        slots: wp.int32,
        order: wp.array(dtype=wp.int32),
        surface: Surface,
        sections: Sections,
        surfaces: wp.array(dtype=Surface),
        all_sections: wp.array(dtype=Sections),
        target: Target,
        law: Law,
        shots: Shots,
        rows: wp.int32,
        # scratch
        fields: Fields,
        touches: Touches,
        stack: Stack,
        earlier: Earlier,
        # outputs
        outcomes: Outcomes,
        passage: Passage,
        bending: wp.array(dtype=Bending),
        trace: wp.array2d(dtype=real),
    ):
        """March one shot per thread, or per block of threads: number k computes shot order[first + k] in slot k mod
        slots.

        Shots at one plate are numbered in a row, and are computed one after another in one slot. All shots have one
        surface, by value as one plate is (kernels/target.py), or each has one of the table. Each shot has `rows` rows
        of the trace; 0 means no trace. The trace has no build of its own, so a shot computes the same bits with and
        without it.
        """
        shot = order[first + wp.tid()]
        slot = wp.tid() % slots
        body = use.shots.body_of(shots, shot)
        if wp.static(variant.tabled):
            surface = surfaces[own(shots.surface, shot)]
            sections = all_sections[own(shots.surface, shot)]
            target = plates.of_shot(target, shots, shot)
        law = plates.law_of(target, law, 0, shot)
        law.onset_share = own(shots.onset_share, shot)
        speed = own(shots.velocity, shot)
        shortest = real(own(shots.time_step, shot))
        max_steps = wp.int32(wp.ceil(own(shots.longest_way, shot) / (speed * wp.float64(shortest))))
        depth = real(plates.depth_of(target, shot))
        fields = loads.own_fields(fields, slot)
        state = use.shots.launch_state(surface, body, shots, shot)
        axis = use.rigid_body.axis_of(state.attitude)
        initial_energy = use.rigid_body.kinetic_energy(body, axis, state.velocity, state.angular_momentum)
        dt = reaches.first_step(target, shot, shortest)
        # Positions are those of mid-step from here on: kicks at mid-step, exact drifts between them.
        state = use.rigid_body.drift(body, state, half * dt)
        reached, status = reaches.begin(surface, target, fields, stack, earlier, passage, shots, slot, shot, state)
        touched, lost = bool(False), bool(False)
        if wp.static(variant.bends):
            worst = Bending()
            worst.strength = own(shots.strength, shot)
        contact_steps = int(0)
        skipped = half * (dt - shortest)  # time that no shortest step counts
        longer = real(0.0)  # what steps in contact are longer than the shortest, together
        last = Change()
        before_last = Change()
        step = int(0)
        while status == RUNNING and step < max_steps and not lost:
            now = (real(step) + half) * shortest + skipped
            omega = use.rigid_body.angular_velocity(
                body, use.rigid_body.axis_of(state.attitude), state.angular_momentum
            )
            pose = use.core_surface.pose_of(surface, state.position, state.attitude, state.velocity, omega)
            # The closing speeds are those at mid-step, if this step changes the velocities as much as the last one did.
            pose.velocity += half * last.velocity
            pose.omega += half * last.omega
            reached = reaches.reach(
                surface, body, target, fields, stack, earlier, passage, shots, slot, shot, state, pose, reached, last,
                now, dt,
            )  # fmt: skip
            found = reached.found
            status = ended(
                surface, body, state, pose, found, touched, reached.behind, reached.barrier, initial_energy, depth
            )
            if status == RUNNING:
                law = reaches.law_at(target, law, stack, slot, shot, reached)
                law.onset = use.interaction.onset_speed(law, dt, wp.length(pose.velocity), real(speed))
                law.steadied = wp.where(use.rigid_body.swings(body, before_last, last), steadied * law.onset, zero)
                before_last = last
                load = Load()
                before = state
                free = real(0.0)
                if found.last_ring >= 0:
                    load = reaches.load_on(
                        surface, target, law, fields, stack, touches, passage, slot, shot, reached, pose, dt
                    )
                    reaches.follow(surface, target, stack, earlier, slot, shot, reached, pose)
                else:
                    free, lost = reaches.free_time(surface, target, shot, state, pose, reached, dt)
                if load.touching:
                    touched = True
                    contact_steps += 1
                    longer += dt - shortest
                    # The damping counts from the speeds at the start of the step.
                    load.force += load.damping_vv * last.velocity + load.damping_vw * last.omega
                    load.moment += wp.transpose(load.damping_vw) * last.velocity + load.damping_ww * last.omega
                    if wp.static(variant.bends):
                        worst = use.bending.bent(
                            worst, surface, sections, body, touches, slot, found, pose, state, load, last, dt, now
                        )
                    state = use.rigid_body.kick(body, state, load, dt)
                    last = use.rigid_body.change_between(body, before, state)
                else:
                    last = Change()
                if rows > 0:
                    force, moment = use.rigid_body.mean_load(body, before, load, dt)
                    use.trace.record(trace, shot * rows + step, now, dt, state, force, moment)
                following = reaches.next_step(surface, target, shot, pose, reached, last, dt, free, shortest)
                between = half * (dt + following)  # from mid-step to mid-step
                state = use.rigid_body.drift(body, state, between + free)
                skipped += between - shortest + free
                last = use.rigid_body.in_step(last, following / dt)
                dt = following
                step += 1
        if rows > 0:
            now = (real(step) + half) * shortest + skipped
            use.trace.record(trace, shot * rows + step, now, dt, state, vec3(), vec3())
        if status == RUNNING:
            status = reaches.given_up(target, shot, reached, state, touched)
        reaches.conclude(surface, target, fields, stack, earlier, passage, slot, shot, status, reached)
        axis = use.rigid_body.axis_of(state.attitude)
        if wp.static(variant.window > 0):
            if use.lanes.lane() > 0:  # all lanes know the outcome
                return
        outcomes.status[shot] = status
        outcomes.steps[shot] = step
        outcomes.contact_duration[shot] = real(contact_steps) * shortest + longer
        energy_loss = zero
        if status == Status.ARRESTED:
            energy_loss = initial_energy
        elif touched:
            energy_loss = initial_energy - use.rigid_body.kinetic_energy(
                body, axis, state.velocity, state.angular_momentum
            )
        outcomes.energy_loss[shot] = energy_loss
        if wp.static(variant.bends):
            bending[shot] = worst
        outcomes.position[shot] = state.position
        outcomes.axis[shot] = axis
        outcomes.velocity[shot] = state.velocity
        outcomes.angular_momentum[shot] = state.angular_momentum

    kernel = variant.kernel(march, (LANES, BLOCKS) if variant.window else None)
    Plate = use.plate_grid.Plate
    Sums = use.damping.Sums
    depth_of = plates.depth_of
    return SimpleNamespace(**locals())
