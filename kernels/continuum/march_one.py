"""The march of one hit: contact, core, nodes and elements, step by step, until the core has passed, turned back or
rests."""

from functools import cache
from types import SimpleNamespace

import warp as wp

from .. import constants, memory, rigid_body, structs
from ..status import RUNNING, WAITING, Status
from ..variant import Variant
from . import choices, fields, hexahedra, nodes, penalty


@cache
def build(variant: Variant) -> SimpleNamespace:
    """The kernel that marches hits for one variant."""
    struct, real, rigid = fields.build(variant), variant.real, structs.build(fields.RIGID)
    read = memory.build(real).read
    move, elements = rigid_body.build(fields.RIGID), hexahedra.build(variant)
    mesh_nodes, contact = nodes.build(variant), penalty.build(variant)
    vec3 = wp.types.vector(3, real)
    zero, half, one = wp.float64(0.0), wp.float64(0.5), wp.float64(1.0)
    courant, growth, behind, quiet, unbounded = (
        wp.float64(constant.value)
        for constant in (choices.COURANT, choices.GROWTH, choices.BEHIND, choices.QUIET, choices.UNBOUNDED)
    )
    still, spent = wp.float64(constants.STILL.value), wp.float64(constants.SPENT.value)
    running, waiting = wp.constant(RUNNING), wp.constant(WAITING)

    @wp.func
    def status_of(core: struct.Core, limits: struct.Limits, flight: struct.Flight):
        """How a hit has ended; RUNNING if it has not, WAITING if its next layer needs a mesh."""
        state = flight.state
        rearmost, foremost = contact.ends_of(core, state)
        energy = move.kinetic_energy(core.body, move.axis_of(state.attitude), state.velocity, state.angular_momentum)
        untouched = flight.first_touch < zero
        free = untouched or flight.time - flight.last_touch > quiet
        swings = state.velocity[0] <= zero and energy < spent * limits.impact_energy  # on, in its hole
        status = running
        if not (energy < unbounded * limits.impact_energy):  # what is no number, too
            status = Status.NOT_FINITE
        elif rearmost > limits.rear and untouched:
            status = Status.MISSED
        elif rearmost > limits.rear + behind and free:
            status = Status.PERFORATED
        elif foremost < -behind and state.velocity[0] < zero and free:
            status = wp.where(untouched, Status.MISSED, Status.RICOCHETED)
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
        axis = move.axis_of(state.attitude)
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
        flight.state = move.drift(core.body, kicked, flight.step)
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
        rearmost, foremost = contact.ends_of(core, flight.state)
        axis = move.axis_of(flight.state.attitude)
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
        return flight

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
            load = contact.load_on(mesh, core, flight.state, flight.time, dt)
            flight = pushed(core, flight, load.force, load.moment, load.touching)
            mesh.cylinder = cylinder_about(core, flight.state)
            mesh_nodes.move_all(mesh, mesh.node_runs, real(dt))
            elements.deform_all(mesh, mesh.runs, real(dt))
            flight = stepped(core, limits, mesh, flight, shortest_crossing(mesh), left)
        flights[0] = flight

    kernel = variant.kernel(advance)
    return SimpleNamespace(**locals())
