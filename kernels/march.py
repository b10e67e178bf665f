"""The march of a core through the plate, from the first touch of the front face to the end of contact."""

from functools import cache
from types import SimpleNamespace

import warp as wp

from . import bending, contact, core_surface, interaction, nodal, plate_grid, rigid_body
from .status import Status
from .variant import Variant

TRACE_COLUMNS = 20
"""Numbers per traced step: time, position, attitude (x, y, z, w), velocity, angular momentum, mean force and moment.
A last row, without load, is the state in which contact ended."""


@cache
def build(variant: Variant) -> SimpleNamespace:
    """The march kernel and the structs it takes, for one variant."""
    real, vec3, quat = variant.real, variant.vec3, variant.quat
    zero, half = real(0.0), real(0.5)
    tiny = wp.float64(1.0e-9)
    still = real(1.0e-4)  # of the impact energy: a core at 1 % of its impact velocity has come to rest
    surfaces, grid, laws, motion = (part.build(variant) for part in (core_surface, plate_grid, interaction, rigid_body))
    contacts, bends = contact.build(variant), bending.build(variant)
    scheme = nodal.build(variant) if variant.nodal else contacts
    Surface, Pose, Plate, Fields, Law = surfaces.Surface, surfaces.Pose, grid.Plate, grid.Fields, laws.Law
    Body, State, Load, Change = motion.Body, motion.State, motion.Load, motion.Change
    Footprint, Touches = contacts.Footprint, contacts.Touches
    Sections, Bending = bends.Sections, bends.Bending
    PERFORATED, ARRESTED, RICOCHETED = (
        wp.constant(int(s)) for s in (Status.PERFORATED, Status.ARRESTED, Status.RICOCHETED)
    )
    MISSED, UNFINISHED, LEFT_WINDOW, NOT_FINITE = (
        wp.constant(int(s)) for s in (Status.MISSED, Status.UNFINISHED, Status.LEFT_WINDOW, Status.NOT_FINITE)
    )
    RUNNING = wp.constant(-1)

    @wp.struct
    class Shots:
        """What hits where: float64 arrays of shape [shots]; metres, m/s, radians, rad/s (MODEL.md §1)."""

        hit_y: wp.array(dtype=wp.float64)
        hit_z: wp.array(dtype=wp.float64)
        velocity: wp.array(dtype=wp.float64)
        obliquity: wp.array(dtype=wp.float64)
        azimuth: wp.array(dtype=wp.float64)
        pitch: wp.array(dtype=wp.float64)
        yaw: wp.array(dtype=wp.float64)
        spin: wp.array(dtype=wp.float64)

    @wp.struct
    class Own:
        """What every shot has in the place of the scene's, where it scatters: arrays of shape [shots]; the names are
        those of Plate, Body, Law and Pace."""

        thickness: wp.array(dtype=real)
        mass: wp.array(dtype=real)
        inertia_axial: wp.array(dtype=real)
        inertia_transverse: wp.array(dtype=real)
        a0: wp.array(dtype=real)
        a1: wp.array(dtype=real)
        friction: wp.array(dtype=real)
        decay_rate: wp.array(dtype=real)
        onset_jump: wp.array(dtype=real)
        way: wp.array(dtype=wp.float64)
        longest_time: wp.array(dtype=wp.float64)
        longest_step: wp.array(dtype=wp.float64)
        longest_way: wp.array(dtype=wp.float64)

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

    @wp.struct
    class Pace:
        """The time step [s], or if that is 0 the way per step [m] at impact velocity, of which `way_along` at most may
        lie in the plane of the plate and which takes `longest_time` [s] at most, if a quarter of the way is enough for
        both; the most that any step may take; and the way [m], at impact velocity, after which a shot that has not
        ended is given up. `rows` of the trace belong to each shot; none if it is 0: not a build of its own, so that a
        shot computes the same bits with a trace and without."""

        time_step: wp.float64
        way: wp.float64
        way_along: wp.float64
        longest_time: wp.float64
        longest_step: wp.float64
        longest_way: wp.float64
        rows: wp.int32

    @wp.func
    def line_of_flight(obliquity: wp.float64, azimuth: wp.float64):
        sine = wp.sin(obliquity)
        return wp.vec3d(wp.cos(obliquity), sine * wp.cos(azimuth), sine * wp.sin(azimuth))

    @wp.func
    def attitude_of(axis: wp.vec3d):
        """The shortest turn that takes the plate normal to the axis (axis_x > 0)."""
        return wp.normalize(wp.quatd(wp.float64(0.0), -axis[2], axis[1], wp.float64(1.0) + axis[0]))

    @wp.func
    def own_body(scene: Body, own: Own, shot: wp.int32):
        body = scene
        body.mass = own.mass[shot]
        body.inertia_axial = own.inertia_axial[shot]
        body.inertia_transverse = own.inertia_transverse[shot]
        return body

    @wp.func
    def own_law(scene: Law, own: Own, shot: wp.int32):
        law = scene
        law.a0 = own.a0[shot]
        law.a1 = own.a1[shot]
        law.friction = own.friction[shot]
        law.decay_rate = own.decay_rate[shot]
        law.onset_jump = own.onset_jump[shot]
        return law

    @wp.func
    def own_pace(scene: Pace, own: Own, shot: wp.int32):
        pace = scene
        pace.way = own.way[shot]
        pace.longest_time = own.longest_time[shot]
        pace.longest_step = own.longest_step[shot]
        pace.longest_way = own.longest_way[shot]
        return pace

    @wp.func
    def step_of(pace: Pace, speed: wp.float64, obliquity: wp.float64):
        """Time step of a shot [s]."""
        way = pace.time_step * speed
        if way == wp.float64(0.0):
            bound = wp.min(pace.way_along / wp.max(wp.sin(obliquity), tiny), pace.longest_time * speed)
            way = wp.clamp(bound, wp.float64(0.25) * pace.way, pace.way)
        return real(wp.min(way, pace.longest_step) / speed)

    @wp.func
    def reach_of(surface: Surface, plate: Plate, state: State):
        """How far from the hit [m], in the plane of the plate, any part of a core that touches nothing can get."""
        axis = motion.axis_of(state.attitude)
        slope = vec3(zero, state.velocity[1], state.velocity[2]) / state.velocity[0]
        lean = axis - axis[0] * slope  # of the axis against the line of flight
        steep = wp.length(slope)
        return (
            surface.max_radius * (real(1.0) + steep)
            + surface.bounding_radius * wp.length(vec3(zero, lean[1], lean[2]))
            + plate.thickness * steep
        )

    @wp.func
    def foremost(surface: Surface, pose: Pose):
        """How far the core reaches ahead of its centre of mass along x [m]."""
        front = -surface.bounding_radius
        for index in range(surface.rings):
            ring = surfaces.ring_at(surface, pose, index)
            broadside = surfaces.broadside(pose)
            middle = ring.station * pose.axis[0] + ring.radius * broadside
            front = wp.max(front, middle + wp.abs(ring.half_axial * pose.axis[0] + ring.half_radial * broadside))
        return front

    @wp.func
    def launch_state(surface: Surface, body: Body, shots: Shots, shot: wp.int32):
        """State with the foremost point at the front face, the centre of mass on the line through the hit."""
        flight = line_of_flight(shots.obliquity[shot], shots.azimuth[shot])
        yaw = wp.atan2(flight[1], flight[0]) + shots.yaw[shot]
        pitch = wp.atan2(flight[2], flight[0]) + shots.pitch[shot]
        axis = wp.normalize(wp.vec3d(wp.float64(1.0), wp.tan(yaw), wp.tan(pitch)))
        turn = attitude_of(axis)
        speed = shots.velocity[shot]
        direction = vec3(real(flight[0]), real(flight[1]), real(flight[2]))
        state = State()
        state.attitude = quat(real(turn[0]), real(turn[1]), real(turn[2]), real(turn[3]))
        state.velocity = real(speed) * direction
        state.angular_momentum = (body.inertia_axial * real(shots.spin[shot])) * motion.axis_of(state.attitude)
        pose = surfaces.pose_of(surface, vec3(), state.attitude, state.velocity, vec3())
        state.position = (-foremost(surface, pose) / direction[0]) * direction
        return state

    @wp.func
    def ended(
        surface: Surface,
        body: Body,
        state: State,
        pose: Pose,
        found: Footprint,
        touched: wp.bool,
        initial_energy: real,
        thickness: real,
    ):
        """The status a core has reached, or RUNNING.

        A core clear of the slab is gone once it moves away faster than its own rotation can bring any part of it back.
        """
        status = RUNNING
        energy = motion.kinetic_energy(body, pose.axis, state.velocity, state.angular_momentum)
        along = wp.dot(state.angular_momentum, pose.axis)
        about_axis = half * along * along / body.inertia_axial
        turning = surface.bounding_radius * wp.length(wp.cross(pose.omega, pose.axis))
        leaving = wp.abs(state.velocity[0])
        beyond = wp.max(state.position[0] - thickness, -state.position[0])
        gone = leaving > turning or beyond > surface.bounding_radius
        if not wp.isfinite(energy):
            status = NOT_FINITE
        elif found.through and state.velocity[0] > zero and gone:
            status = wp.where(touched, PERFORATED, MISSED)
        elif found.back and state.velocity[0] < zero and gone:
            status = wp.where(touched, RICOCHETED, MISSED)
        elif touched and energy - about_axis < still * initial_energy:
            status = ARRESTED
        elif not found.inside:
            status = LEFT_WINDOW
        return status

    @wp.func
    def write_vec3(trace: wp.array2d(dtype=real), row: wp.int32, column: wp.int32, value: vec3):
        for k in range(3):
            trace[row, column + k] = value[k]

    @wp.func
    def record(trace: wp.array2d(dtype=real), row: wp.int32, time: real, state: State, force: vec3, moment: vec3):
        """One traced step, in the order of TRACE_COLUMNS: the state after its kick, and the load that made it."""
        trace[row, 0] = time
        write_vec3(trace, row, 1, state.position)
        for k in range(4):
            trace[row, 4 + k] = state.attitude[k]
        write_vec3(trace, row, 8, state.velocity)
        write_vec3(trace, row, 11, state.angular_momentum)
        write_vec3(trace, row, 14, force)
        write_vec3(trace, row, 17, moment)

    def march(
        # inputs
        first: wp.int32,
        slots: wp.int32,
        order: wp.array(dtype=wp.int32),
        surface: Surface,
        body: Body,
        sections: Sections,
        plate: Plate,
        law: Law,
        shots: Shots,
        own: Own,
        pace: Pace,
        # scratch
        fields: Fields,
        touches: Touches,
        # outputs
        outcomes: Outcomes,
        bending: wp.array(dtype=Bending),
        trace: wp.array2d(dtype=real),
    ):
        """March one shot per thread: thread k computes shot order[first + k] in slot k mod slots."""
        shot = order[first + wp.tid()]
        if wp.static(variant.scattered):
            plate.thickness = own.thickness[shot]
            body = own_body(body, own, shot)
            law = own_law(law, own, shot)
            pace = own_pace(pace, own, shot)
        speed = shots.velocity[shot]
        dt = step_of(pace, speed, shots.obliquity[shot])
        max_steps = wp.int32(wp.ceil(pace.longest_way / (speed * wp.float64(dt))))
        slot = wp.tid() % slots
        window = scheme.open_window(plate, fields, slot, shots.hit_y[shot], shots.hit_z[shot])
        state = launch_state(surface, body, shots, shot)
        axis = motion.axis_of(state.attitude)
        initial_energy = motion.kinetic_energy(body, axis, state.velocity, state.angular_momentum)
        # Positions are those of mid-step from here on: kicks at mid-step, exact drifts between them.
        state = motion.drift(body, state, half * dt)
        status = int(RUNNING)
        if grid.clearance(plate, window) > reach_of(surface, plate, state):
            status = int(MISSED)
        touched = bool(False)
        if wp.static(variant.bends):
            worst = Bending()
        contact_steps = int(0)
        last = Change()
        step = int(0)
        while status == RUNNING and step < max_steps:
            omega = motion.angular_velocity(body, motion.axis_of(state.attitude), state.angular_momentum)
            pose = surfaces.pose_of(surface, state.position, state.attitude, state.velocity, omega)
            # What closes in is what mid-step will see, if the step changes what the last one did.
            pose.velocity += half * last.velocity
            pose.omega += half * last.omega
            found = contacts.footprint_of(surface, plate, fields, window, pose, dt)
            status = ended(surface, body, state, pose, found, touched, initial_energy, plate.thickness)
            if status == RUNNING:
                law.onset = laws.onset_speed(law, dt, wp.length(state.velocity), real(speed))
                load = Load()
                before = state
                if found.last_ring >= 0:
                    load = scheme.load_on(surface, plate, law, fields, window, touches, slot, found, pose, dt)
                if load.touching:
                    touched = True
                    contact_steps += 1
                    # Back to the speeds at the start of the step, which the damping counts from.
                    load.force += load.damping_vv * last.velocity + load.damping_vw * last.omega
                    load.moment += wp.transpose(load.damping_vw) * last.velocity + load.damping_ww * last.omega
                    if wp.static(variant.bends):
                        worst = bends.bent(
                            worst, surface, sections, body, touches, slot, found, pose, state, load, last, dt
                        )
                    state = motion.kick(body, state, load, dt)
                    last = motion.change_between(body, before, state)
                else:
                    last = Change()
                if pace.rows > 0:
                    force, moment = motion.mean_load(body, before, load, dt)
                    record(trace, shot * pace.rows + step, (real(step) + half) * dt, state, force, moment)
                state = motion.drift(body, state, dt)
                step += 1
        if pace.rows > 0:
            record(trace, shot * pace.rows + step, (real(step) + half) * dt, state, vec3(), vec3())
        if status == RUNNING:
            status = UNFINISHED
        axis = motion.axis_of(state.attitude)
        outcomes.status[shot] = status
        outcomes.steps[shot] = step
        outcomes.contact_duration[shot] = real(contact_steps) * dt
        energy_loss = zero
        if touched:
            energy_loss = initial_energy - motion.kinetic_energy(body, axis, state.velocity, state.angular_momentum)
        outcomes.energy_loss[shot] = energy_loss
        if wp.static(variant.bends):
            bending[shot] = worst
        outcomes.position[shot] = state.position
        outcomes.axis[shot] = axis
        outcomes.velocity[shot] = state.velocity
        outcomes.angular_momentum[shot] = state.angular_momentum

    return SimpleNamespace(
        kernel=variant.kernel(march),
        line_of_flight=line_of_flight,
        own_body=own_body,
        Surface=Surface,
        Body=Body,
        Sections=Sections,
        Bending=Bending,
        Plate=Plate,
        Fields=Fields,
        Touches=Touches,
        Sums=contacts.Sums,
        Law=Law,
        Shots=Shots,
        Own=Own,
        Outcomes=Outcomes,
        Pace=Pace,
    )
