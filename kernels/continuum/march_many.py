"""The march of many hits at once: a thread for each node and each element of every hit, and six launches a step.

Sums over a hit have a fixed order, which no other hit changes: first PARTS partial sums, each over every PARTS-th node,
then the sum of these. So a hit has the same bits in every launch, whichever hits are beside it. The order differs from
that of the march of one hit (march_one.py), so the last digits of the two differ.
"""

from functools import cache
from types import SimpleNamespace

import warp as wp

from .. import memory
from ..status import RUNNING
from ..variant import Variant
from . import bending, fields, hexahedra, march_one
from .fields import PARTS, PIECE


@cache
def build(variant: Variant) -> SimpleNamespace:
    """The kernels of a step for one variant, in their order."""
    struct, real = fields.build(variant), variant.real
    read = memory.build(real).read
    march, deform_element, bends = march_one.build(variant), hexahedra.build(variant).deform, bending.build(variant)
    Load = wp.types.vector(6, wp.float64)
    zero, half = wp.float64(0.0), wp.float64(0.5)
    running, parts, piece = wp.constant(RUNNING), wp.constant(PARTS), wp.constant(PIECE)

    @wp.func
    def member(pieces: wp.array(dtype=wp.int32), place: wp.int32):
        """The element, or the node, at a place among those of all pieces, and its sheet."""
        first = 2 * (place // piece)
        return pieces[first] + place % piece, pieces[first + 1]

    @wp.func
    def places(pieces: wp.array(dtype=wp.int32)):
        """Number of places."""
        return piece * (pieces.shape[0] // 2)

    def press(hits: wp.array(dtype=struct.Hit), loads: wp.array2d(dtype=Load)):
        """Press every node that is near on the core, and sum force [N] and moment [N m] of each part; notes the time at
        each sheet that touches, and the impulses that bend the core. Threads [hits, PARTS]."""
        number, part = wp.tid()
        flight = hits[number].flights[0]
        if flight.status != running:
            return
        core, mesh, pieces = hits[number].core, hits[number].mesh, hits[number].node_pieces
        load, kick = Load(), half * (flight.before + flight.step)
        for place in range(part, places(pieces), parts):
            node, layer = member(pieces, place)
            if mesh.awake[layer] != 0 and read(mesh.near, node) > real(0.0):
                force, away = march.press(mesh, mesh.sheets[layer], core, flight.state, node, flight.step)
                moment = wp.cross(away, force)
                load -= Load(force[0], force[1], force[2], moment[0], moment[1], moment[2])
                if wp.dot(force, force) > zero:
                    mesh.touched[layer] = flight.time
                    if core.impulses.shape[1] > 0:
                        axis, own = march.body.axis_of(flight.state.attitude), part % core.impulses.shape[0]
                        bends.add_impulse(core, own, axis, away, -kick * force)
        loads[number, part] = load

    def push(
        hits: wp.array(dtype=struct.Hit),
        loads: wp.array2d(dtype=Load),
        cylinders: wp.array(dtype=struct.Cylinder),
    ):
        """Kick each core and let it drift; its cylinder. Threads [hits]."""
        number = wp.tid()
        flight = hits[number].flights[0]
        if flight.status != running:
            return
        core, touched = hits[number].core, hits[number].mesh.touched
        load, touching = Load(), wp.bool(False)
        for part in range(parts):
            load += loads[number, part]
        for layer in range(touched.shape[0]):
            touching = touching or touched[layer] == flight.time
        force, moment = wp.vec3d(load[0], load[1], load[2]), wp.vec3d(load[3], load[4], load[5])
        flight = march.pushed(core, flight, force, moment, touching)
        cylinders[number] = march.cylinder_about(core, flight.state)
        hits[number].flights[0] = flight

    def move(hits: wp.array(dtype=struct.Hit), cylinders: wp.array(dtype=struct.Cylinder)):
        """Kick the nodes and let them drift. Threads [hits, most nodes of a hit]."""
        number, place = wp.tid()
        flight, pieces = hits[number].flights[0], hits[number].node_pieces
        if flight.status != running or place >= places(pieces):
            return
        mesh = hits[number].mesh
        node, layer = member(pieces, place)
        if mesh.awake[layer] != 0:
            mesh.kick = real(half * (flight.before + flight.step))
            mesh.cylinder = cylinders[number]
            march.move(mesh, mesh.sheets[layer], node, real(flight.step))

    def deform(hits: wp.array(dtype=struct.Hit)):
        """Take the elements over the step. Those that have failed, and places where none is, have no force any more, so
        they are left alone. Threads [hits, most elements of a hit]."""
        number, place = wp.tid()
        flight, pieces = hits[number].flights[0], hits[number].pieces
        if flight.status != running or place >= places(pieces):
            return
        mesh = hits[number].mesh
        element, layer = member(pieces, place)
        if mesh.awake[layer] != 0 and read(mesh.alive, element) > real(0.0):
            deform_element(mesh, mesh.sheets[layer], element, real(flight.step))

    def cross(hits: wp.array(dtype=struct.Hit), crossings: wp.array2d(dtype=real)):
        """The shortest time that a wave takes across an element of each part [s]; 1 s if there is none. Threads
        [hits, PARTS]."""
        number, part = wp.tid()
        flight = hits[number].flights[0]
        if flight.status != running:
            return
        mesh, pieces, shortest = hits[number].mesh, hits[number].pieces, real(1.0)
        for place in range(part, places(pieces), parts):
            element, layer = member(pieces, place)
            if mesh.awake[layer] != 0:
                shortest = wp.min(shortest, read(mesh.crossing, element))
        crossings[number, part] = shortest

    def step(hits: wp.array(dtype=struct.Hit), crossings: wp.array2d(dtype=real)):
        """End the step of each hit. Threads [hits]."""
        number = wp.tid()
        flight = hits[number].flights[0]
        if flight.status != running:
            return
        shortest = real(1.0)
        for part in range(parts):
            shortest = wp.min(shortest, crossings[number, part])
        hits[number].flights[0] = march.stepped(
            hits[number].core, hits[number].limits, hits[number].mesh, flight, wp.float64(shortest), hits[number].left
        )

    def look(hits: wp.array(dtype=struct.Hit), seen: wp.array2d(dtype=wp.int32)):
        """The status of each hit, and whether its core is near a node at the outer edge of a mesh, where `seen` is 0
        before. Threads [hits, PARTS]."""
        number, part = wp.tid()
        mesh, pieces = hits[number].mesh, hits[number].node_pieces
        if part == 0:
            seen[number, 0] = hits[number].flights[0].status
        for place in range(part, places(pieces), parts):
            node, _ = member(pieces, place)
            beyond = read(mesh.impedance, mesh.size + node) + read(mesh.impedance, 2 * mesh.size + node)
            if read(mesh.near, node) > real(0.0) and beyond > real(0.0):
                seen[number, 1] = 1

    kernels = SimpleNamespace(
        **{function.__name__: variant.kernel(function) for function in (press, push, move, deform, cross, step, look)}
    )
    return SimpleNamespace(**locals())
