"""Stages of a step, each written once for one node, one element or one hit: press, push, move, gather, deform, cross,
step.

Contact is a penalty along the normal of the core, a surface of revolution. Nodes move by the forces of the elements
about them, in a fixed order. Beyond the outer edge is the material of Lysmer and Kuhlemeyer (J Eng Mech Div ASCE 95
(1969) 859): it resists a velocity by ρ c per area, so that waves that arrive upright leave.

How threads go over nodes and elements, and in which order they sum, is in the march of one hit (march_one.py) and in
that of many (march_many.py). `Any` is the precision of the elements, or a struct of it (fields.py).
"""

from typing import Any

import warp as wp

from .. import constants, rigid_body
from ..memory import read, write
from ..status import RUNNING, WAITING, Status
from . import bending, choices, hexahedra
from .fields import CORE, RIGID, Core, Flight, Limits, put_vector, rigid, vector_at

body = rigid_body.build(RIGID)

ENDS = 32
"""Of its tabulated radii, every such one counts for where the core ends along x."""
ZERO, HALF, ONE = wp.float64(0.0), wp.float64(0.5), wp.float64(1.0)
DAMPING, SLIP = wp.float64(2.0 * choices.DAMPING.value), wp.float64(choices.SLIP.value)
ON_AXIS, OUTSIDE = wp.float64(choices.ON_AXIS.value), wp.float64(choices.OUTSIDE.value)
COURANT, GROWTH = wp.float64(choices.COURANT.value), wp.float64(choices.GROWTH.value)
FREE_WAY, FREE_TIME = wp.float64(choices.FREE_WAY.value), wp.float64(choices.FREE_TIME.value)
BITS_WAY = wp.float64(2.0 * choices.FREE_WAY.value)
"""Behind the target, where a core of elements is free, as bits of its tip may still touch the target."""
REST_SHARE, RETURN_SHARE = wp.float64(constants.REST_ENERGY.value), wp.float64(constants.RETURN_ENERGY.value)
UNBOUNDED = wp.float64(choices.UNBOUNDED.value)


@wp.func
def kick_time(flight: Flight):
    """Time between the velocities of this step and the last one [s]."""
    return HALF * (flight.before + flight.step)


# --- Press: the core on a node ---


@wp.struct
class Load:
    """A force [N] and its moment about the centre of mass [N m]."""

    force: wp.vec3d
    moment: wp.vec3d


@wp.struct
class Touch:
    """How deep a point lies in the core [m], and the outward normal of the nearest surface."""

    depth: wp.float64
    normal: wp.vec3d


@wp.func
def touch_at(core: Core, axis: wp.vec3d, away: wp.vec3d):
    """The touch of a point at a place relative to the centre of mass; a depth of 0 or less is no touch."""
    along = wp.dot(away, axis)
    station = core.centre_of_mass - along
    touch = Touch()
    if station > ZERO and station < core.length:
        outwards = away - along * axis
        distance = wp.length(outwards)
        pieces = core.radii.shape[0] - 1
        place = station / core.length * wp.float64(pieces)
        piece = wp.min(wp.int32(place), pieces - 1)
        near, far = read(core.radii, piece), read(core.radii, piece + 1)
        radius = near + (place - wp.float64(piece)) * (far - near)
        slope = (far - near) * wp.float64(pieces) / core.length
        upright = ONE / wp.sqrt(ONE + slope * slope)
        touch.depth = (radius - distance) * upright
        touch.normal = upright * (outwards / wp.max(distance, ON_AXIS) + slope * axis)
        if station < touch.depth:
            touch.depth = station
            touch.normal = axis
        if core.length - station < touch.depth:
            touch.depth = core.length - station
            touch.normal = -axis
    return touch


@wp.func
def live_about(mesh: Any, block: Any, node: wp.int32):
    """Number of the elements about a node that are alive."""
    total = type(mesh.kick)(0.0)
    for plane in range(2):
        for row in range(2):
            element = node - plane * block.plane_before - row * block.row
            total += read(mesh.alive, element) + read(mesh.alive, element - 1)
    return total


@wp.func
def contact_force(mesh: Any, block: Any, core: Core, flight: Flight, node: wp.int32, away: wp.vec3d):
    """Force of the core on a node at a place relative to the centre of mass [N].

    Model: core, block.
    Data in: mesh.velocity, mesh.alive, flight.state, flight.step.
    Data out: mesh.contact, if there is a touch.
    """
    state, dt = flight.state, flight.step
    axis = body.axis_of(state.attitude)
    touch = touch_at(core, axis, away)
    force = wp.vec3d()
    lightness = wp.float64(read(mesh.inverse_mass, node))
    is_held = live_about(mesh, block, node) > type(mesh.kick)(0.0)
    pushes = is_held or (block.debris == 1 and lightness > ZERO)
    if touch.depth > ZERO and pushes:
        velocity = wp.vec3d(vector_at(mesh.velocity, mesh.size, node))
        omega = body.angular_velocity(core.body, axis, state.angular_momentum)
        sliding = velocity - state.velocity - wp.cross(omega, away)
        leaving = wp.dot(sliding, touch.normal)
        stiffness = wp.float64(block.stiffness)
        damped = ZERO
        if lightness > ZERO:
            stiffness = wp.min(stiffness, ONE / (lightness * dt * dt))  # a stiffer spring would be unstable
            damped = DAMPING * wp.sqrt(stiffness / lightness) * leaving
        pressure = wp.max(stiffness * touch.depth - damped, ZERO)
        sliding -= leaving * touch.normal
        rub = core.friction * pressure / wp.max(wp.length(sliding), SLIP)
        force = pressure * touch.normal - rub * sliding
        put_vector(mesh.contact, mesh.size, node, type(mesh.cylinder.centre)(force))
    return force


@wp.func
def is_near(mesh: Any, node: wp.int32):
    """Whether the core may touch a node."""
    return read(mesh.near, node) > type(mesh.kick)(0.0)


@wp.func
def press(mesh: Any, block: Any, core: Core, flight: Flight, node: wp.int32, part: wp.int32):
    """Load of the core on a near node of a block; `part` is that of the sums to which the node belongs.

    Model: core, block.
    Data in: mesh.position, mesh.velocity, mesh.alive, flight.
    Data out: mesh.contact, mesh.touched, core.impulses, which bend the core.
    """
    away = wp.vec3d(vector_at(mesh.position, mesh.size, node)) - flight.state.position
    load = Load()
    load.force = contact_force(mesh, block, core, flight, node, away)
    load.moment = wp.cross(away, load.force)
    if wp.dot(load.force, load.force) > ZERO:
        if mesh.bodies[block.body].layer >= 0:
            mesh.touched[block.body] = flight.time
        if core.impulses.shape[1] > 0:
            axis, own = body.axis_of(flight.state.attitude), part % core.impulses.shape[0]
            bending.add_impulse(core, own, axis, away, -kick_time(flight) * load.force)
    return load


# --- Push: the core ---


@wp.func
def push(core: Core, mesh: Any, flight: Flight, load: Load):
    """A flight whose core the load of all nodes has kicked and that has drifted over the step. A core of elements has
    no load; its state then follows from its nodes (`state_of`).

    Model: core.
    Data in: flight, mesh.touched, load.
    Data out: flight.state, flight.first_touch, flight.last_touch.
    """
    kick = kick_time(flight)
    for number in range(mesh.touched.shape[0]):
        if mesh.touched[number] == flight.time:
            if mesh.bodies[number].layer >= 0:
                flight.last_touch = flight.time
            if flight.first_touch < ZERO:
                flight.first_touch = flight.time
    kicked = rigid.State()
    kicked.position = flight.state.position
    kicked.attitude = flight.state.attitude
    kicked.velocity = flight.state.velocity + (kick / core.body.mass) * load.force
    kicked.angular_momentum = flight.state.angular_momentum + kick * load.moment
    flight.state = body.drift(core.body, kicked, flight.step)
    return flight


@wp.func
def cylinder_about(mesh: Any, core: Core, state: rigid.State):
    """The cylinder about a core, in the precision of a mesh."""
    axis = body.axis_of(state.attitude)
    middle = state.position + (core.centre_of_mass - HALF * core.length) * axis
    cylinder = mesh.cylinder
    cylinder.centre = type(cylinder.centre)(middle)
    cylinder.axis = type(cylinder.axis)(axis)
    cylinder.half_length = type(mesh.kick)(HALF * core.length)
    cylinder.square = type(mesh.kick)(core.largest * core.largest)
    return cylinder


# --- Move: a node ---


@wp.func
def corner_force(mesh: Any, element: wp.int32, corner: wp.int32):
    """Force of an element on one of its corners [N]."""
    return vector_at(mesh.force, mesh.size, 3 * corner * mesh.size + element)


@wp.func
def internal_force(mesh: Any, block: Any, node: wp.int32):
    """Force of the eight elements about a node [N]."""
    across, beyond = node - block.row, node - block.plane_before
    force = corner_force(mesh, node, 0) + corner_force(mesh, node - 1, 1)
    force += corner_force(mesh, across, 2) + corner_force(mesh, across - 1, 3)
    force += corner_force(mesh, beyond, 4) + corner_force(mesh, beyond - 1, 5)
    beyond -= block.row
    force += corner_force(mesh, beyond, 6) + corner_force(mesh, beyond - 1, 7)
    return force


@wp.func
def move(mesh: Any, block: Any, node: wp.int32, dt: Any):
    """Kick a node over the time between two velocities, drift it over a step, and see whether the core is near.

    Model: block, mesh.inverse_mass, mesh.impedance.
    Data in: mesh.force, mesh.contact, mesh.kick, mesh.cylinder.
    Data out: mesh.velocity, mesh.position, mesh.contact_work, mesh.radiated, mesh.near; mesh.contact, which is 0 again.
    """
    nil, semi, unit = type(dt)(0.0), type(dt)(0.5), type(dt)(1.0)
    size = mesh.size
    touch, before = vector_at(mesh.contact, size, node), vector_at(mesh.velocity, size, node)
    force = internal_force(mesh, block, node) + touch
    lightness = mesh.kick * read(mesh.inverse_mass, node)
    beyond = vector_at(mesh.impedance, size, node)
    velocity = wp.cw_div(before + lightness * force, wp.vector(unit, unit, unit) + lightness * beyond)
    position = vector_at(mesh.position, size, node) + dt * velocity
    pressed = semi * mesh.kick * wp.dot(touch, before + velocity)
    radiated = semi * mesh.kick * wp.dot(wp.cw_mul(beyond, velocity), before + velocity)
    away = position - mesh.cylinder.centre
    along = wp.dot(away, mesh.cylinder.axis)
    off = wp.max(wp.abs(along) - mesh.cylinder.half_length, wp.dot(away, away) - along * along - mesh.cylinder.square)
    put_vector(mesh.velocity, size, node, velocity)
    put_vector(mesh.position, size, node, position)
    write(mesh.contact_work, node, read(mesh.contact_work, node) + pressed)
    write(mesh.radiated, node, read(mesh.radiated, node) + radiated)
    put_vector(mesh.contact, size, node, wp.vector(nil, nil, nil))
    write(mesh.near, node, wp.where(off < nil, unit, nil))


# --- Gather: a core of elements ---


@wp.struct
class Motion:
    """Sums over nodes of a core: mass [kg]; about its place before, the first [kg m] and second moments [kg m²];
    momentum [N s] and its moment [N m s]."""

    mass: wp.float64
    first: wp.vec3d
    second: wp.mat33d
    momentum: wp.vec3d
    turning: wp.vec3d


@wp.func
def leading_about(mesh: Any, block: Any, node: wp.int32):
    """Number of the live elements about a node of the leading fragment of a core."""
    total = type(mesh.kick)(0.0)
    for plane in range(2):
        for row in range(2):
            element = node - plane * block.plane_before - row * block.row
            total += read(mesh.alive, element) * read(mesh.leading, element)
            total += read(mesh.alive, element - 1) * read(mesh.leading, element - 1)
    return total


@wp.func
def gather(mesh: Any, block: Any, flight: Flight, node: wp.int32, motion: Motion):
    """The sums with one more node, if an element of the leading fragment of a core holds it.

    Data in: mesh.position, mesh.velocity, flight.state.
    """
    is_held = mesh.bodies[block.body].layer == CORE and leading_about(mesh, block, node) > type(mesh.kick)(0.0)
    if is_held:
        mass = ONE / wp.float64(read(mesh.inverse_mass, node))
        velocity = wp.vec3d(vector_at(mesh.velocity, mesh.size, node))
        away = wp.vec3d(vector_at(mesh.position, mesh.size, node)) - flight.state.position
        motion.mass += mass
        motion.first += mass * away
        motion.second += mass * wp.outer(away, away)
        motion.momentum += mass * velocity
        motion.turning += mass * wp.cross(away, velocity)
    return motion


@wp.func
def joined(one: Motion, other: Motion):
    """The sums of two groups of nodes."""
    one.mass += other.mass
    one.first += other.first
    one.second += other.second
    one.momentum += other.momentum
    one.turning += other.turning
    return one


@wp.func
def state_of(core: Core, flight: Flight, motion: Motion):
    """The state of the rigid body that moves as some nodes of a core: its axis is that of the least moment of inertia,
    and it turns at the rate of their momentum over their inertia."""
    own, state, off = core.body, rigid.State(), motion.first / motion.mass
    state.position = flight.state.position + off
    state.velocity = motion.momentum / motion.mass
    second = motion.second - motion.mass * wp.outer(off, off)
    before = body.axis_of(flight.state.attitude)
    axis = wp.normalize(second * before)
    for _ in range(4):  # each leaves a thirtieth of the error or less
        axis = wp.normalize(second * axis)
    inertia = wp.trace(second) * wp.identity(n=3, dtype=wp.float64) - second
    omega = wp.inverse(inertia) * (motion.turning - wp.cross(off, motion.momentum))
    state.angular_momentum = body.angular_momentum(own, axis, omega)
    about = wp.cross(before, axis)
    turn = wp.quatd(about[0], about[1], about[2], ONE + wp.dot(before, axis))
    state.attitude = wp.normalize(wp.normalize(turn) * flight.state.attitude)
    return state


# --- Deform and cross: an element ---


@wp.func
def deform(mesh: Any, block: Any, element: wp.int32, dt: Any):
    """Take an element over a step (hexahedra.py).

    Model: block, mesh.volume, mesh.length.
    Data in: mesh.position, mesh.velocity.
    Data out: mesh.force, mesh.crossing, and the state of the element: stress, strain, damage, heat, works, alive.
    """
    hexahedra.deform(mesh, block, element, dt)


@wp.func
def cross(mesh: Any, element: wp.int32, shortest: Any):
    """The shorter one of a time and that of a wave across an element [s]."""
    return wp.min(shortest, read(mesh.crossing, element))


# --- Step: the clock ---


@wp.func
def ends_along_x(core: Core, state: rigid.State):
    """The rearmost and the foremost x of the core [m]."""
    axis = body.axis_of(state.attitude)
    wide = wp.sqrt(wp.max(ZERO, ONE - axis[0] * axis[0]))
    rearmost, foremost = wp.float64(OUTSIDE), wp.float64(-OUTSIDE)
    pieces = core.radii.shape[0] - 1
    for k in range(0, pieces + 1, ENDS):
        station = core.length * wp.float64(k) / wp.float64(pieces)
        centre = state.position[0] + (core.centre_of_mass - station) * axis[0]
        reach = wide * read(core.radii, k)
        rearmost = wp.min(rearmost, centre - reach)
        foremost = wp.max(foremost, centre + reach)
    return rearmost, foremost


@wp.func
def find_status(core: Core, limits: Limits, flight: Flight):
    """How a hit has ended; RUNNING if it has not, WAITING if its next layer needs a mesh."""
    state = flight.state
    rearmost, foremost = ends_along_x(core, state)
    energy = body.kinetic_energy(core.body, body.axis_of(state.attitude), state.velocity, state.angular_momentum)
    untouched = flight.first_touch < ZERO
    free = untouched or flight.time - flight.last_touch > FREE_TIME
    swings = state.velocity[0] <= ZERO and energy < RETURN_SHARE * limits.impact_energy  # on, in its hole
    status = wp.int32(RUNNING)
    if not (energy < UNBOUNDED * limits.impact_energy):  # what is no number, too
        status = Status.NOT_FINITE
    elif rearmost > limits.rear and untouched:
        status = Status.UNTOUCHED
    elif rearmost > limits.rear + FREE_WAY and (free or (core.deforms != 0 and rearmost > limits.rear + BITS_WAY)):
        status = Status.PERFORATED
    elif foremost < -FREE_WAY and state.velocity[0] < ZERO and free:
        status = wp.where(untouched, Status.UNTOUCHED, Status.RICOCHETED)
    elif swings or energy < REST_SHARE * limits.impact_energy:
        status = Status.ARRESTED
    elif flight.time > limits.longest:
        status = Status.UNFINISHED
    elif foremost > limits.unmeshed - FREE_WAY:
        status = WAITING
    return status


@wp.func
def step(
    core: Core,
    limits: Limits,
    mesh: Any,
    flight: Flight,
    crossing: wp.float64,
    left: wp.array2d(dtype=wp.float64),
):
    """A flight at the end of a step: its clock, its next step by the shortest crossing [s], its status, its bending.

    A layer is marched while the core is within reach of it: before, it is at rest; afterwards it stays as the core left
    it. In a gap the steps keep their length.

    Model: core, limits, mesh.bodies.
    Data in: flight, mesh.touched, crossing.
    Data out: flight; mesh.awake; left, the state with which the core left each layer (fields.py).
    """
    dt = flight.step
    flight.time += dt
    flight.steps += 1
    flight.before = dt
    flight.step = wp.where(crossing < ONE, wp.min(COURANT * crossing, GROWTH * dt), dt)
    rearmost, foremost = ends_along_x(core, flight.state)
    axis = body.axis_of(flight.state.attitude)
    for number in range(mesh.bodies.shape[0]):
        own = mesh.bodies[number]
        passed = rearmost > own.sleeps + FREE_WAY and flight.time - mesh.touched[number] > FREE_TIME
        mesh.awake[number] = wp.where(foremost > own.wakes - FREE_WAY and not passed, 1, 0)
        if own.layer >= 0 and rearmost > own.rear and wp.isnan(left[own.layer, 6]):
            for k in range(3):
                left[own.layer, k] = flight.state.velocity[k]
                left[own.layer, 3 + k] = axis[k]
            left[own.layer, 6] = flight.time
    flight.status = find_status(core, limits, flight)
    return bending.bent_in_time(core, flight)
