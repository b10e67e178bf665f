"""The march of a core through the target, from the first touch of the front face to the end of contact."""

from functools import cache
from types import SimpleNamespace

import warp as wp

from . import (
    bending,
    block,
    contact,
    core_surface,
    damping,
    earlier,
    footprint,
    interaction,
    layers,
    nodal,
    plate_grid,
    rigid_body,
    shots,
    trace,
)
from .lanes import BLOCKS, LANES
from .status import Status
from .variant import Variant


@cache
def build(variant: Variant) -> SimpleNamespace:
    """The march kernel and the structs it takes, for one variant."""
    real, vec3 = variant.real, variant.vec3
    zero, half = real(0.0), real(0.5)
    steadied = real(8.0)  # onsets: as far as a step carries a core beyond the ramp
    still = real(1.0e-4)  # of the impact energy: a core at 1 % of its impact velocity has come to rest
    spent = real(2.5e-3)  # likewise: at 5 % it does not come back through a layer that it has left
    most = real(1.01)  # of the impact energy: no law adds to it, and rounding errors add less in many thousand steps
    use = variant.use(
        bending, contact, core_surface, damping, earlier, footprint, interaction, layers, plate_grid, rigid_body, shots
    )
    record = trace.build(variant).record
    scheme = (nodal if variant.nodal else block if variant.window else contact).build(variant)
    Surface, Pose, Plate = use.core_surface.Surface, use.core_surface.Pose, use.plate_grid.Plate
    Law = use.interaction.Law
    Body, State, Load = use.rigid_body.Body, use.rigid_body.State, use.rigid_body.Load
    Change = use.rigid_body.Change
    Fields, Footprint, Touches = scheme.Fields, use.footprint.Footprint, use.contact.Touches
    Sections, Bending = use.bending.Sections, use.bending.Bending
    Shots, Pace, own = use.shots.Shots, use.shots.Pace, use.shots.own
    Layers, Stack, Passage = use.layers.Layers, use.layers.Stack, use.layers.Passage
    Reached = use.layers.Reached
    Earlier = use.earlier.Earlier
    PERFORATED, ARRESTED, RICOCHETED = (
        wp.constant(int(s)) for s in (Status.PERFORATED, Status.ARRESTED, Status.RICOCHETED)
    )
    MISSED, UNFINISHED, LEFT_WINDOW = (
        wp.constant(int(s)) for s in (Status.MISSED, Status.UNFINISHED, Status.LEFT_WINDOW)
    )
    NOT_FINITE, GAINED_ENERGY = (wp.constant(int(s)) for s in (Status.NOT_FINITE, Status.GAINED_ENERGY))
    RUNNING = wp.constant(-1)

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
    def reach_of(surface: Surface, thickness: real, state: State):
        """Largest distance from the hit [m], in the plane of the plate, of any part of a core that touches nothing."""
        axis = use.rigid_body.axis_of(state.attitude)
        slope = vec3(zero, state.velocity[1], state.velocity[2]) / state.velocity[0]
        lean = axis - axis[0] * slope  # of the axis against the line of flight
        steep = wp.length(slope)
        return (
            surface.max_radius * (real(1.0) + steep)
            + surface.bounding_radius * wp.length(vec3(zero, lean[1], lean[2]))
            + thickness * steep
        )

    @wp.func
    def ended(
        surface: Surface,
        body: Body,
        state: State,
        pose: Pose,
        found: Footprint,
        touched: wp.bool,
        behind: wp.bool,
        initial_energy: real,
        thickness: real,
    ):
        """The final status of a core, or RUNNING.

        A core outside the slab cannot come back if it moves away faster than its rotation moves any part of it. A core
        that turns back `behind` a layer, and is spent, rests there.
        """
        status = RUNNING
        energy = use.rigid_body.kinetic_energy(body, pose.axis, state.velocity, state.angular_momentum)
        along = wp.dot(state.angular_momentum, pose.axis)
        about_axis = half * along * along / body.inertia_axial
        turning = surface.bounding_radius * wp.length(wp.cross(pose.omega, pose.axis))
        leaving = wp.abs(state.velocity[0])
        beyond = wp.max(state.position[0] - thickness, -state.position[0])
        rest = wp.where(behind and state.velocity[0] < zero, spent, still)
        gone = leaving > turning or beyond > surface.bounding_radius
        if not wp.isfinite(energy):
            status = NOT_FINITE
        elif energy > most * initial_energy:
            status = GAINED_ENERGY
        elif found.through and state.velocity[0] > zero and gone:
            status = wp.where(touched, PERFORATED, MISSED)
        elif found.back and state.velocity[0] < zero and gone:
            status = wp.where(touched, RICOCHETED, MISSED)
        elif touched and energy - about_axis < rest * initial_energy:
            status = ARRESTED
        elif not found.inside:
            status = LEFT_WINDOW
        return status

    def march(
        # inputs
        first: wp.int32,
        slots: wp.int32,
        order: wp.array(dtype=wp.int32),
        surface: Surface,
        sections: Sections,
        plate: Plate,
        law: Law,
        shots: Shots,
        pace: Pace,
        target: Layers,
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

        Shots at one plate are numbered in a row, and are computed one after another in one slot.
        """
        shot = order[first + wp.tid()]
        body = use.shots.body_of(shots, shot)
        law = use.shots.law_of(law, shots, shot)
        pace = use.shots.pace_of(pace, shots, shot)
        speed = own(shots.velocity, shot)
        dt = use.shots.step_of(pace, speed, own(shots.obliquity, shot))
        max_steps = wp.int32(wp.ceil(pace.longest_way / (speed * wp.float64(dt))))
        slot = wp.tid() % slots
        thickness = real(own(shots.thickness, shot))
        if wp.static(variant.burst):
            use.earlier.begin(earlier, slot, shot)
        if wp.static(variant.layered):
            use.layers.begin(target, stack, passage, slot, shot)
            reached = Reached()
            straight = use.shots.line_of_flight(shots, shot)
            flight = vec3(real(straight[0]), real(straight[1]), real(straight[2]))
            # A core that slides between two layers never ends: it has gone farther than one that goes straight through.
            farthest = real(pace.longest_way) + wp.length(vec3(zero, flight[1], flight[2])) / flight[0] * thickness
        else:
            hit_y, hit_z = own(shots.hit_y, shot), own(shots.hit_z, shot)
            if wp.static(variant.window > 0):
                fields = scheme.own_fields(fields, slot)
            window = scheme.open_window(plate, thickness, fields, slot, hit_y, hit_z)
            if wp.static(variant.burst):
                use.earlier.recall(earlier, fields, plate, window, slot, 0, shot, hit_y, hit_z)
        state = use.shots.launch_state(surface, body, shots, shot)
        axis = use.rigid_body.axis_of(state.attitude)
        initial_energy = use.rigid_body.kinetic_energy(body, axis, state.velocity, state.angular_momentum)
        # Positions are those of mid-step from here on: kicks at mid-step, exact drifts between them.
        state = use.rigid_body.drift(body, state, half * dt)
        status = int(RUNNING)
        if wp.static(not variant.layered):
            if use.plate_grid.clearance(plate, window) > reach_of(surface, thickness, state):
                status = int(MISSED)
        touched = bool(False)
        if wp.static(variant.bends):
            worst = Bending()
            worst.strength = own(shots.strength, shot)
        contact_steps = int(0)
        skipped = real(0.0)  # time between layers that no step counts
        last = Change()
        before_last = Change()
        step = int(0)
        behind = bool(False)  # the plate
        while status == RUNNING and step < max_steps:
            omega = use.rigid_body.angular_velocity(
                body, use.rigid_body.axis_of(state.attitude), state.angular_momentum
            )
            pose = use.core_surface.pose_of(surface, state.position, state.attitude, state.velocity, omega)
            # The closing speeds are those at mid-step, if this step changes the velocities as much as the last one did.
            pose.velocity += half * last.velocity
            pose.omega += half * last.omega
            if wp.static(variant.layered):
                found, reached = use.layers.reach(
                    surface,
                    body,
                    target,
                    fields,
                    stack,
                    earlier,
                    passage,
                    shots,
                    slot,
                    shot,
                    state,
                    pose,
                    reached,
                    last,
                    (real(step) + half) * dt + skipped,
                    flight,
                    dt,
                )
                behind = use.layers.is_behind(passage, shot)
            else:
                found = use.footprint.footprint_of(surface, plate, window, pose, dt)
            status = ended(surface, body, state, pose, found, touched, behind, initial_energy, thickness)
            if status == RUNNING:
                if wp.static(variant.layered):
                    law.onset_jump = use.layers.jump_of(target, stack, slot, shot, reached)
                law.onset = use.interaction.onset_speed(law, dt, wp.length(pose.velocity), real(speed))
                law.steadied = wp.where(use.rigid_body.swings(body, before_last, last), steadied * law.onset, zero)
                before_last = last
                load = Load()
                before = state
                free = real(0.0)
                if found.last_ring >= 0:
                    if wp.static(variant.layered):
                        load = use.layers.load_on(
                            surface, target, law, fields, stack, touches, passage, slot, shot, reached, pose, dt
                        )
                    else:
                        load = scheme.load_on(surface, plate, law, fields, window, touches, slot, found, pose, dt)
                if load.touching:
                    touched = True
                    contact_steps += 1
                    # The damping counts from the speeds at the start of the step.
                    load.force += load.damping_vv * last.velocity + load.damping_vw * last.omega
                    load.moment += wp.transpose(load.damping_vw) * last.velocity + load.damping_ww * last.omega
                    if wp.static(variant.bends):
                        middle = (real(step) + half) * dt + skipped
                        worst = use.bending.bent(
                            worst, surface, sections, body, touches, slot, found, pose, state, load, last, dt, middle
                        )
                    state = use.rigid_body.kick(body, state, load, dt)
                    last = use.rigid_body.change_between(body, before, state)
                else:
                    last = Change()
                if pace.rows > 0:
                    force, moment = use.rigid_body.mean_load(body, before, load, dt)
                    now = (real(step) + half) * dt + skipped
                    record(trace, shot * pace.rows + step, now, state, force, moment)
                if wp.static(variant.layered):
                    if found.last_ring < 0:
                        free = use.layers.free_time(surface, target, shot, state, pose, reached, dt)
                        skipped += free
                        if wp.length(vec3(zero, state.position[1], state.position[2])) > farthest:
                            max_steps = step
                state = use.rigid_body.drift(body, state, dt + free)
                step += 1
        if pace.rows > 0:
            record(trace, shot * pace.rows + step, (real(step) + half) * dt + skipped, state, vec3(), vec3())
        if status == RUNNING:
            status = UNFINISHED
            if wp.static(variant.layered):
                if touched and use.layers.is_between(target, shot, reached, state.position[0]):
                    status = ARRESTED
        if wp.static(variant.layered):
            use.layers.conclude(target, passage, shot, status, reached)
        if wp.static(variant.burst):
            if wp.static(variant.layered):
                use.layers.keep(target, fields, stack, earlier, slot, shot)
            else:
                use.earlier.keep(earlier, fields, window, slot, shot)
        axis = use.rigid_body.axis_of(state.attitude)
        if wp.static(variant.window > 0):
            if scheme.lane() > 0:  # all lanes know the outcome
                return
        outcomes.status[shot] = status
        outcomes.steps[shot] = step
        outcomes.contact_duration[shot] = real(contact_steps) * dt
        energy_loss = zero
        if touched:
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

    return SimpleNamespace(
        kernel=variant.kernel(march, (LANES, BLOCKS) if variant.window else None),
        Surface=Surface,
        Sections=Sections,
        Bending=Bending,
        Plate=Plate,
        Fields=Fields,
        Touches=Touches,
        Sums=use.damping.Sums,
        Law=Law,
        Shots=Shots,
        Outcomes=Outcomes,
        Pace=Pace,
        Layers=Layers,
        Stack=Stack,
        Passage=Passage,
        Earlier=Earlier,
    )
