"""The march of a core through the target, from the first touch of the front face to the end of contact."""

from functools import cache
from types import SimpleNamespace

import warp as wp

from . import (
    bending,
    constants,
    core_surface,
    interaction,
    lanes,
    layers,
    one_plate,
    rigid_body,
    structs,
    target,
    trace,
)
from .lanes import BLOCKS, LANES
from .status import RUNNING, Status
from .variant import Variant


@cache
def build(variant: Variant) -> SimpleNamespace:
    """The march kernel of one variant."""
    struct, real, vec3 = structs.build(variant), variant.real, variant.vec3
    zero, half = real(0.0), real(0.5)
    at_rest, spent = real(constants.REST_ENERGY.value), real(constants.RETURN_ENERGY.value)
    weak, barrier_share = real(constants.STRAY_ENERGY.value), real(constants.BARRIER_SHARE.value)
    gained, steadied = real(constants.MOST_ENERGY.value), real(constants.DAMPED_ONSETS.value)
    use = variant.use(bending, core_surface, interaction, lanes, rigid_body, target, trace)
    scheme = target.scheme_of(variant)
    kind = (layers if variant.layered else one_plate).build(variant)
    shot_value = use.target.shot_value

    @wp.func
    def status_of(
        context: struct.Context,
        reach: struct.Reach,
        state: struct.State,
        pose: struct.Pose,
        touched: wp.bool,
    ):
        """The final status of a core, or RUNNING.

        A core outside the target cannot come back if it moves away faster than its rotation moves any part of it. A
        core that turns back behind a layer with too little energy rests there. Between layers, the energy of its motion
        along them does not count (docs/model.md §8).
        """
        body, surface, footprint = context.body, context.surface, reach.footprint
        status = RUNNING
        energy = use.rigid_body.kinetic_energy(body, pose.axis, state.velocity, state.angular_momentum)
        along = wp.dot(state.angular_momentum, pose.axis)
        about_axis = half * along * along / body.inertia_axial
        turning = surface.bounding_radius * wp.length(wp.cross(pose.omega, pose.axis))
        leaving = wp.abs(state.velocity[0])
        beyond = wp.max(state.position[0] - context.depth, -state.position[0])
        back = reach.behind and state.velocity[0] < zero
        rests = energy - about_axis < wp.where(back, spent, at_rest) * context.impact_energy
        along_layers = half * body.mass * wp.length_sq(vec3(zero, state.velocity[1], state.velocity[2]))
        crossing = energy - about_axis - along_layers
        held = crossing < wp.min(weak * context.impact_energy, barrier_share * reach.barrier)
        stays = back and footprint.last_ring < 0 and held
        gone = leaving > turning or beyond > surface.bounding_radius
        if not wp.isfinite(energy):
            status = Status.NOT_FINITE
        elif energy > gained * context.impact_energy:
            status = Status.GAINED_ENERGY
        elif footprint.through and state.velocity[0] > zero and gone:
            status = wp.where(touched, Status.PERFORATED, Status.UNTOUCHED)
        elif footprint.back and state.velocity[0] < zero and gone:
            status = wp.where(touched, Status.RICOCHETED, Status.UNTOUCHED)
        elif touched and (rests or stays):
            status = Status.ARRESTED
        elif not footprint.inside:
            status = Status.LEFT_WINDOW
        return status

    @wp.func
    def context_of(
        inputs: struct.Inputs, scratch: struct.Scratch, passage: struct.Passage, slot: wp.int32, shot: wp.int32
    ):
        """The context of a shot in a slot: its core and target, and the fields of the slot."""
        context, shots = struct.Context(), inputs.shots
        context.shot = shot
        context.slot = slot
        context.surface = inputs.surface
        context.sections = inputs.sections
        context.target = inputs.target
        context.body = use.target.body_of(shots, shot)
        context.law = use.target.law_of(context.target, inputs.law, 0, shot)
        context.law.onset_share = shot_value(shots.onset_share, shot)
        context.depth = real(use.target.depth_of(context.target, shot))
        context.shots = shots
        context.fields = scheme.fields_of_slot(scratch.fields, slot)
        context.touches = scratch.touches
        context.stack = scratch.stack
        context.passage = passage
        return context

    def march(
        first: wp.int32,
        slots: wp.int32,
        order: wp.array(dtype=wp.int32),
        inputs: struct.Inputs,
        scratch: struct.Scratch,
        results: struct.Results,
    ):
        """March one shot per thread, or per block of threads: number k computes shot order[first + k] in slot k mod
        slots.

        A step finds what the core can touch at mid-step, loads the core, kicks it there, and drifts it to the middle of
        the next step (kernels/trace.py). Velocities therefore change at mid-steps only, where positions are known: the
        method is of second order, and exact where nothing touches. A load depends on the velocities at mid-step, half
        of whose change is still to come. This half is predicted from the last step.

        The trace has no build of its own, so a shot computes the same bits with and without it.
        """
        shot = order[first + wp.tid()]
        slot = wp.tid() % slots
        context = context_of(inputs, scratch, results.passage, slot, shot)
        surface, body, shots = context.surface, context.body, context.shots
        speed = shot_value(shots.velocity, shot)
        shortest = real(shot_value(shots.time_step, shot))
        max_steps = wp.int32(wp.ceil(shot_value(shots.longest_way, shot) / (speed * wp.float64(shortest))))
        state = use.target.launch_state(surface, body, shots, shot)
        if inputs.starts.shape[0] > 0:
            state = inputs.starts[shot]
        axis = use.rigid_body.axis_of(state.attitude)
        context.impact_energy = use.rigid_body.kinetic_energy(body, axis, state.velocity, state.angular_momentum)
        clock = use.trace.started(shortest, kind.first_step(context, shortest))
        state = use.rigid_body.drift(body, state, half * clock.step)  # to the first mid-step
        reach, status = kind.begin(context, state)
        touched, lost = bool(False), bool(False)
        if wp.static(variant.bends):
            worst = struct.Bending()
            worst.strength = shot_value(shots.strength, shot)
        last, before_last = struct.Change(), struct.Change()
        while status == RUNNING and clock.steps < max_steps and not lost:
            now, dt = use.trace.now(clock), clock.step
            omega = use.rigid_body.angular_velocity(
                body, use.rigid_body.axis_of(state.attitude), state.angular_momentum
            )
            pose = use.core_surface.pose_of(surface, state.position, state.attitude, state.velocity, omega)
            # These are the closing speeds at mid-step if this step changes the velocities as the last one did.
            pose.velocity += half * last.velocity
            pose.omega += half * last.omega
            reach = kind.find_reach(context, reach, state, pose, last, dt)
            status = status_of(context, reach, state, pose, touched)
            if status == RUNNING:
                law = kind.law_at(context, context.law, reach)
                law.onset = use.interaction.onset_speed(law, dt, wp.length(pose.velocity), real(speed))
                if wp.static(variant.free_surface):
                    law.per_speed = use.interaction.per_speed(wp.length(pose.velocity), real(speed))
                law.steadied = wp.where(use.rigid_body.swings(body, before_last, last), steadied * law.onset, zero)
                before_last = last
                load = struct.Load()
                before = state
                free = real(0.0)
                if reach.footprint.last_ring >= 0:
                    load = kind.load_on(context, law, reach, pose, dt)
                else:
                    free, lost = kind.free_time(context, reach, state, pose, dt)
                if load.touching:
                    touched = True
                    clock = use.trace.in_contact(clock)
                    # The damping counts from the speeds at the start of the step.
                    load.force += load.damping_vv * last.velocity + load.damping_vw * last.omega
                    load.moment += wp.transpose(load.damping_vw) * last.velocity + load.damping_ww * last.omega
                    if wp.static(variant.bends):
                        worst = use.bending.bent(worst, context, reach.footprint, pose, state, load, last, clock)
                    state = use.rigid_body.kick(body, state, load, dt)
                    last = use.rigid_body.change_between(body, before, state)
                else:
                    last = struct.Change()
                if inputs.rows > 0:
                    force, moment = use.rigid_body.mean_load(body, before, load, dt)
                    row = shot * inputs.rows + clock.steps
                    use.trace.record(results.trace, row, now, dt, state, force, moment)
                following = kind.next_step(context, reach, pose, last, clock, free)
                state = use.rigid_body.drift(body, state, use.trace.drift_time(clock, following) + free)
                clock = use.trace.advanced(clock, following, free)
                last = use.rigid_body.in_step(last, following / dt)
        if inputs.rows > 0:
            row = shot * inputs.rows + clock.steps
            use.trace.record(results.trace, row, use.trace.now(clock), clock.step, state, vec3(), vec3())
        status = kind.conclude(context, reach, state, status, touched)
        axis = use.rigid_body.axis_of(state.attitude)
        if use.lanes.lane() > 0:  # all lanes of a block know the outcome
            return
        energy_loss = zero
        if status == Status.ARRESTED:
            energy_loss = context.impact_energy
        elif touched:
            energy_loss = context.impact_energy - use.rigid_body.kinetic_energy(
                body, axis, state.velocity, state.angular_momentum
            )
        if wp.static(variant.bends):
            results.bending[shot] = worst
        outcomes = results.outcomes
        outcomes.status[shot] = status
        outcomes.steps[shot] = clock.steps
        outcomes.contact_duration[shot] = use.trace.contact_duration(clock)
        outcomes.energy_loss[shot] = energy_loss
        outcomes.position[shot] = state.position
        outcomes.axis[shot] = axis
        outcomes.velocity[shot] = state.velocity
        outcomes.angular_momentum[shot] = state.angular_momentum

    kernel = variant.kernel(march, (LANES, BLOCKS) if variant.window else None)
    return SimpleNamespace(**vars(struct), kernel=kernel, status_of=status_of)
