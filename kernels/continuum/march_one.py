"""The march of one hit: contact, core, nodes and elements, step by step, until the core has passed, turned back or
rests.

Contact is a penalty along the normal of the core, a surface of revolution. Nodes move by the forces of the elements
about them, in a fixed order. Beyond the outer edge is the material of Lysmer and Kuhlemeyer (J Eng Mech Div ASCE 95
(1969) 859): it resists a velocity by ρ c per area, so that waves that arrive upright leave.
"""

from functools import cache
from types import SimpleNamespace

import warp as wp

from .. import constants, memory, rigid_body, structs
from ..status import RUNNING, WAITING, Status
from ..variant import Variant
from . import bending, choices, fields, hexahedra
from .fields import over_runs

ENDS = 32
"""Of its tabulated radii, every such one counts for where the core ends along x."""


@cache
def build(variant: Variant) -> SimpleNamespace:
    """The kernel that marches hits for one variant."""
    struct, real, rigid = fields.build(variant), variant.real, structs.build(fields.RIGID)
    access, exact = fields.access(real), memory.build(wp.float64)
    read, write, vector_at, put_vector = access.read, access.write, access.vector_at, access.put_vector
    body, elements, bends = rigid_body.build(fields.RIGID), hexahedra.build(variant), bending.build(variant)
    vec3 = wp.types.vector(3, real)
    zero, half, one = wp.float64(0.0), wp.float64(0.5), wp.float64(1.0)
    nil, semi, unit = real(0.0), real(0.5), real(1.0)
    damping, slow, tiny, outside = (
        wp.float64(value)
        for value in (
            2.0 * choices.DAMPING.value,
            choices.SLIP.value,
            choices.ON_AXIS.value,
            choices.OUTSIDE.value,
        )
    )
    courant, growth, behind, quiet, unbounded = (
        wp.float64(constant.value)
        for constant in (choices.COURANT, choices.GROWTH, choices.FREE_WAY, choices.FREE_TIME, choices.UNBOUNDED)
    )
    still, spent = wp.float64(constants.REST_ENERGY.value), wp.float64(constants.RETURN_ENERGY.value)
    running, waiting = wp.constant(RUNNING), wp.constant(WAITING)

    @wp.func
    def corner_force(mesh: struct.Mesh, element: wp.int32, corner: wp.int32):
        """Force of an element on one of its corners [N]."""
        return vector_at(mesh.force, mesh.size, 3 * corner * mesh.size + element)

    @wp.func
    def internal_force(mesh: struct.Mesh, sheet: struct.Sheet, node: wp.int32):
        """Force of the eight elements about a node [N]."""
        across, beyond = node - sheet.row, node - sheet.plane
        force = corner_force(mesh, node, 0) + corner_force(mesh, node - 1, 1)
        force += corner_force(mesh, across, 2) + corner_force(mesh, across - 1, 3)
        force += corner_force(mesh, beyond, 4) + corner_force(mesh, beyond - 1, 5)
        beyond -= sheet.row
        force += corner_force(mesh, beyond, 6) + corner_force(mesh, beyond - 1, 7)
        return force

    @wp.func
    def is_held(mesh: struct.Mesh, sheet: struct.Sheet, node: wp.int32):
        """Whether any element about a node is alive."""
        total = nil
        for plane in range(2):
            for row in range(2):
                element = node - plane * sheet.plane - row * sheet.row
                total += read(mesh.alive, element) + read(mesh.alive, element - 1)
        return total > nil

    @wp.func
    def move(mesh: struct.Mesh, sheet: struct.Sheet, node: wp.int32, dt: real):
        """Kick a node over the time between two velocities, drift it over a step, and see whether the core is near."""
        size = mesh.size
        touch, before = vector_at(mesh.contact, size, node), vector_at(mesh.velocity, size, node)
        force = internal_force(mesh, sheet, node) + touch
        lightness = mesh.kick * read(mesh.inverse_mass, node)
        beyond = vector_at(mesh.impedance, size, node)
        velocity = wp.cw_div(before + lightness * force, vec3(unit, unit, unit) + lightness * beyond)
        position = vector_at(mesh.position, size, node) + dt * velocity
        pressed = semi * mesh.kick * wp.dot(touch, before + velocity)
        radiated = semi * mesh.kick * wp.dot(wp.cw_mul(beyond, velocity), before + velocity)
        away = position - mesh.cylinder.centre
        along = wp.dot(away, mesh.cylinder.axis)
        off = wp.max(
            wp.abs(along) - mesh.cylinder.half_length, wp.dot(away, away) - along * along - mesh.cylinder.square
        )
        put_vector(mesh.velocity, size, node, velocity)
        put_vector(mesh.position, size, node, position)
        write(mesh.contact_work, node, read(mesh.contact_work, node) + pressed)
        write(mesh.radiated, node, read(mesh.radiated, node) + radiated)
        put_vector(mesh.contact, size, node, vec3())
        write(mesh.near, node, wp.where(off < nil, unit, nil))

    move_all = over_runs(struct, real, move)

    @wp.struct
    class Touch:
        """How deep a point lies in the core [m], and the outward normal of the nearest surface."""

        depth: wp.float64
        normal: wp.vec3d

    @wp.func
    def touch_of(core: struct.Core, axis: wp.vec3d, away: wp.vec3d):
        """The touch of a point at a place relative to the centre of mass; a depth of 0 or less is no touch."""
        along = wp.dot(away, axis)
        station = core.centre_of_mass - along
        touch = Touch()
        if station > zero and station < core.length:
            outwards = away - along * axis
            distance = wp.length(outwards)
            pieces = core.radii.shape[0] - 1
            place = station / core.length * wp.float64(pieces)
            piece = wp.min(wp.int32(place), pieces - 1)
            near, far = exact.read(core.radii, piece), exact.read(core.radii, piece + 1)
            radius = near + (place - wp.float64(piece)) * (far - near)
            slope = (far - near) * wp.float64(pieces) / core.length
            upright = one / wp.sqrt(one + slope * slope)
            touch.depth = (radius - distance) * upright
            touch.normal = upright * (outwards / wp.max(distance, tiny) + slope * axis)
            if station < touch.depth:
                touch.depth = station
                touch.normal = axis
            if core.length - station < touch.depth:
                touch.depth = core.length - station
                touch.normal = -axis
        return touch

    @wp.func
    def press(
        mesh: struct.Mesh, sheet: struct.Sheet, core: struct.Core, state: rigid.State, node: wp.int32, dt: wp.float64
    ):
        """Force of the core on a node [N], and its place relative to the centre of mass [m]; writes the force."""
        away = wp.vec3d(vector_at(mesh.position, mesh.size, node)) - state.position
        axis = body.axis_of(state.attitude)
        touch = touch_of(core, axis, away)
        force = wp.vec3d()
        lightness = wp.float64(read(mesh.inverse_mass, node))
        if touch.depth > zero and is_held(mesh, sheet, node):
            velocity = wp.vec3d(vector_at(mesh.velocity, mesh.size, node))
            omega = body.angular_velocity(core.body, axis, state.angular_momentum)
            sliding = velocity - state.velocity - wp.cross(omega, away)
            leaving = wp.dot(sliding, touch.normal)
            stiffness = wp.float64(sheet.stiffness)
            damped = zero
            if lightness > zero:
                stiffness = wp.min(stiffness, one / (lightness * dt * dt))  # a stiffer spring would be unstable
                damped = damping * wp.sqrt(stiffness / lightness) * leaving
            pressure = wp.max(stiffness * touch.depth - damped, zero)
            sliding -= leaving * touch.normal
            rub = core.friction * pressure / wp.max(wp.length(sliding), slow)
            force = pressure * touch.normal - rub * sliding
            put_vector(mesh.contact, mesh.size, node, vec3(force))
        return force, away

    @wp.func
    def load_on(mesh: struct.Mesh, core: struct.Core, flight: struct.Flight):
        """Force of all nodes on the core [N], and its moment about the centre of mass [N m], in the plate frame and in
        the order of the nodes; notes the time at each sheet that touches, and the impulses that bend the core."""
        state, dt, kick = flight.state, flight.step, half * (flight.before + flight.step)
        load = rigid.Load()
        for run in range(mesh.node_runs.shape[0] // 3):
            node, last = wp.int32(mesh.node_runs[3 * run]), wp.int32(mesh.node_runs[3 * run + 1])
            layer = mesh.node_runs[3 * run + 2]
            sheet = mesh.sheets[layer]
            while node < last and mesh.awake[layer] != 0:
                if read(mesh.near, node) > nil:
                    force, away = press(mesh, sheet, core, state, node, dt)
                    load.force -= force
                    load.moment -= wp.cross(away, force)
                    if wp.dot(force, force) > zero:
                        load.touching = True
                        mesh.touched[layer] = flight.time
                        if core.impulses.shape[1] > 0:
                            bends.add_impulse(core, 0, body.axis_of(state.attitude), away, -kick * force)
                node += 1
        return load

    @wp.func
    def ends_of(core: struct.Core, state: rigid.State):
        """The rearmost and the foremost x of the core [m]."""
        axis = body.axis_of(state.attitude)
        wide = wp.sqrt(wp.max(zero, one - axis[0] * axis[0]))
        rearmost, foremost = wp.float64(outside), wp.float64(-outside)
        pieces = core.radii.shape[0] - 1
        for k in range(0, pieces + 1, ENDS):
            station = core.length * wp.float64(k) / wp.float64(pieces)
            centre = state.position[0] + (core.centre_of_mass - station) * axis[0]
            reach = wide * exact.read(core.radii, k)
            rearmost = wp.min(rearmost, centre - reach)
            foremost = wp.max(foremost, centre + reach)
        return rearmost, foremost

    @wp.func
    def status_of(core: struct.Core, limits: struct.Limits, flight: struct.Flight):
        """How a hit has ended; RUNNING if it has not, WAITING if its next layer needs a mesh."""
        state = flight.state
        rearmost, foremost = ends_of(core, state)
        energy = body.kinetic_energy(core.body, body.axis_of(state.attitude), state.velocity, state.angular_momentum)
        untouched = flight.first_touch < zero
        free = untouched or flight.time - flight.last_touch > quiet
        swings = state.velocity[0] <= zero and energy < spent * limits.impact_energy  # on, in its hole
        status = running
        if not (energy < unbounded * limits.impact_energy):  # what is no number, too
            status = Status.NOT_FINITE
        elif rearmost > limits.rear and untouched:
            status = Status.UNTOUCHED
        elif rearmost > limits.rear + behind and free:
            status = Status.PERFORATED
        elif foremost < -behind and state.velocity[0] < zero and free:
            status = wp.where(untouched, Status.UNTOUCHED, Status.RICOCHETED)
        elif swings or energy < still * limits.impact_energy:
            status = Status.ARRESTED
        elif flight.time > limits.longest:
            status = Status.UNFINISHED
        elif foremost > limits.unmeshed - behind:
            status = waiting
        return status

    @wp.func
    def shortest_crossing(mesh: struct.Mesh):
        """The shortest time that a wave takes across an element of the sheets that are awake [s]; 1 s if there is
        none."""
        first, second, third, fourth = real(1.0), real(1.0), real(1.0), real(1.0)
        for run in range(mesh.runs.shape[0] // 3):
            element, last = wp.int32(mesh.runs[3 * run]), wp.int32(mesh.runs[3 * run + 1])
            while element < last and mesh.awake[mesh.runs[3 * run + 2]] != 0:
                first = wp.min(first, read(mesh.crossing, element))
                second = wp.min(second, read(mesh.crossing, element + 1))
                third = wp.min(third, read(mesh.crossing, element + 2))
                fourth = wp.min(fourth, read(mesh.crossing, element + 3))
                element += 4
        return wp.float64(wp.min(wp.min(first, second), wp.min(third, fourth)))

    @wp.func
    def cylinder_about(core: struct.Core, state: rigid.State):
        """The cylinder about a core."""
        axis = body.axis_of(state.attitude)
        middle = state.position + (core.centre_of_mass - half * core.length) * axis
        cylinder = struct.Cylinder()
        cylinder.centre = vec3(real(middle[0]), real(middle[1]), real(middle[2]))
        cylinder.axis = vec3(real(axis[0]), real(axis[1]), real(axis[2]))
        cylinder.half_length = real(half * core.length)
        cylinder.square = real(core.largest * core.largest)
        return cylinder

    @wp.func
    def pushed(core: struct.Core, flight: struct.Flight, force: wp.vec3d, moment: wp.vec3d, touching: wp.bool):
        """A flight whose core a load has kicked [N, N m] and that has drifted over the step."""
        kick = half * (flight.before + flight.step)
        if touching:
            flight.last_touch = flight.time
            if flight.first_touch < zero:
                flight.first_touch = flight.time
        kicked = rigid.State()
        kicked.position = flight.state.position
        kicked.attitude = flight.state.attitude
        kicked.velocity = flight.state.velocity + (kick / core.body.mass) * force
        kicked.angular_momentum = flight.state.angular_momentum + kick * moment
        flight.state = body.drift(core.body, kicked, flight.step)
        return flight

    @wp.func
    def stepped(
        core: struct.Core,
        limits: struct.Limits,
        mesh: struct.Mesh,
        flight: struct.Flight,
        crossing: wp.float64,
        left: wp.array2d(dtype=wp.float64),
    ):
        """A flight at the end of a step: its clock, its next step by the shortest crossing, and its status. Notes which
        layers are marched next, and how the core left the layers behind it (see `advance`)."""
        dt = flight.step
        flight.time += dt
        flight.steps += 1
        flight.before = dt
        flight.step = wp.where(crossing < one, wp.min(courant * crossing, growth * dt), dt)
        rearmost, foremost = ends_of(core, flight.state)
        axis = body.axis_of(flight.state.attitude)
        for layer in range(mesh.sheets.shape[0]):
            sheet = mesh.sheets[layer]
            passed = rearmost > sheet.rear + behind and flight.time - mesh.touched[layer] > quiet
            mesh.awake[layer] = wp.where(foremost > sheet.front - behind and not passed, 1, 0)
            if rearmost > sheet.rear and wp.isnan(left[layer, 6]):
                for k in range(3):
                    left[layer, k] = flight.state.velocity[k]
                    left[layer, 3 + k] = axis[k]
                left[layer, 6] = flight.time
        flight.status = status_of(core, limits, flight)
        return bends.bent_in_time(core, flight)

    def advance(
        # inputs
        core: struct.Core,
        limits: struct.Limits,
        steps: wp.int32,
        mesh: struct.Mesh,
        # outputs
        flights: wp.array(dtype=struct.Flight),
        left: wp.array2d(dtype=wp.float64),
    ):
        """March one hit by some steps. A layer is marched while the core is within reach of it: before, it is at rest;
        afterwards it stays as the core left it. In a gap the steps keep their length.

        `left` is the state with which the core left each layer, shape [layers, 7]: velocity, axis, and time; NaN
        before.
        """
        flight = flights[0]
        for _ in range(steps):
            if flight.status != running:
                break
            dt = flight.step
            mesh.kick = real(half * (flight.before + dt))
            load = load_on(mesh, core, flight)
            flight = pushed(core, flight, load.force, load.moment, load.touching)
            mesh.cylinder = cylinder_about(core, flight.state)
            move_all(mesh, mesh.node_runs, real(dt))
            elements.deform_all(mesh, mesh.runs, real(dt))
            flight = stepped(core, limits, mesh, flight, shortest_crossing(mesh), left)
        flights[0] = flight

    kernel = variant.kernel(advance)
    return SimpleNamespace(**locals())
