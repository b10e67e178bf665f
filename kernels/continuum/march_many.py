"""The march of many hits at once: a thread for each node and each element of every hit, and a launch for each stage of
a step (stages.py), in the order of KERNELS.

Sums over a hit have a fixed order, which no other hit changes: first PARTS partial sums, each over every PARTS-th node,
then the sum of these. So a hit has the same bits in every launch, whichever hits are beside it. The order differs from
that of the march of one hit (march_one.py), so the last digits of the two differ.
"""

from functools import cache
from typing import Any

import warp as wp

from ..memory import read
from ..status import RUNNING
from ..variant import Variant
from . import contact, fields, stages
from .fields import PARTS, PIECE
from .stages import Load, Motion


@wp.func
def member(pieces: wp.array(dtype=wp.int32), place: wp.int32):
    """The element, or the node, at a place among those of all pieces, and its block."""
    first = 2 * (place // PIECE)
    return pieces[first] + place % PIECE, pieces[first + 1]


@wp.func
def places(pieces: wp.array(dtype=wp.int32)):
    """Number of places."""
    return PIECE * (pieces.shape[0] // 2)


def press(hits: wp.array(dtype=Any), loads: wp.array2d(dtype=Load)):
    """Press every node that is near on the core, and sum the loads of each part. Threads [hits, PARTS].

    Data in and out: hits. Data out: loads.
    """
    number, part = wp.tid()
    flight = hits[number].flights[0]
    if flight.status != RUNNING:
        return
    core, mesh, pieces = hits[number].core, hits[number].mesh, hits[number].node_pieces
    load, count = Load(), wp.where(core.deforms == 0, places(pieces), 0)
    for place in range(part, count, PARTS):
        node, place_of_block = member(pieces, place)
        block = mesh.blocks[place_of_block]
        if mesh.awake[block.body] != 0 and stages.is_near(mesh, node):
            own = stages.press(mesh, block, core, flight, node, part)
            load.force -= own.force
            load.moment -= own.moment
    loads[number, part] = load


@wp.func
def touches(hit: Any):
    """Whether bodies of a hit that goes on may touch."""
    return hit.flights[0].status == RUNNING and hit.mesh.contacts.counts.shape[0] > 0


@wp.func
def sorts(hit: Any):
    """Whether faces of a hit enter its grid anew."""
    return touches(hit) and contact.is_due(hit.mesh, hit.flights[0])


def bound(hits: wp.array(dtype=Any)):
    """Boxes about bodies, where faces enter the grid anew. Threads [hits, most bodies of a hit].

    Data in and out: hits.
    """
    number, body = wp.tid()
    if sorts(hits[number]) and body < hits[number].mesh.bodies.shape[0]:
        contact.bound(hits[number].mesh, body)


def expose(hits: wp.array(dtype=Any)):
    """Sides of elements that are faces, where these enter the grid anew. Threads [hits, most elements of a hit].

    Data in and out: hits.
    """
    number, place = wp.tid()
    mesh, pieces = hits[number].mesh, hits[number].pieces
    if sorts(hits[number]) and place < places(pieces):
        element, place_of_block = member(pieces, place)
        block = mesh.blocks[place_of_block]
        if mesh.awake[block.body] != 0:
            contact.expose(mesh, block, element)


def enter(hits: wp.array(dtype=Any)):
    """Faces in the cells of the grid, where they enter it anew. Threads [hits, PARTS].

    Data in and out: hits.
    """
    number, part = wp.tid()
    if sorts(hits[number]):
        contact.enter(hits[number].mesh, part, PARTS)


def choose(hits: wp.array(dtype=Any)):
    """Faces that nodes may touch, where they have entered the grid anew. Threads [hits, most nodes of a hit].

    Data in and out: hits.
    """
    number, place = wp.tid()
    mesh, pieces = hits[number].mesh, hits[number].node_pieces
    if sorts(hits[number]) and place < places(pieces):
        node, place_of_block = member(pieces, place)
        block = mesh.blocks[place_of_block]
        if mesh.awake[block.body] != 0:
            contact.choose(mesh, block, node)


def touch(hits: wp.array(dtype=Any)):
    """Pushes of faces on the nodes of each part. Threads [hits, PARTS].

    Data in and out: hits.
    """
    number, part = wp.tid()
    if not touches(hits[number]):
        return
    flight, mesh, pieces, count = hits[number].flights[0], hits[number].mesh, hits[number].node_pieces, wp.int32(0)
    for place in range(part, places(pieces), PARTS):
        node, place_of_block = member(pieces, place)
        block = mesh.blocks[place_of_block]
        if mesh.awake[block.body] != 0 and mesh.contacts.near[node] > 0:
            count = contact.take(mesh, contact.touch(mesh, block, flight, node), count, part, PARTS)
    mesh.contacts.pushing[part] = count


def react(hits: wp.array(dtype=Any)):
    """Forces and reactions of all pushes on the nodes of each part. Threads [hits, PARTS].

    Data in and out: hits.
    """
    number, part = wp.tid()
    if touches(hits[number]):
        contact.react(hits[number].mesh, part, PARTS)


def push(hits: wp.array(dtype=Any), loads: wp.array2d(dtype=Load), cylinders: wp.array(dtype=Any)):
    """Kick each core and let it drift; its cylinder. Threads [hits].

    Data in: loads. Data in and out: hits. Data out: cylinders.
    """
    number = wp.tid()
    flight = hits[number].flights[0]
    if flight.status != RUNNING:
        return
    core, mesh, load = hits[number].core, hits[number].mesh, Load()
    for part in range(PARTS):
        load.force += loads[number, part].force
        load.moment += loads[number, part].moment
    if sorts(hits[number]):
        flight.sorted = flight.time
    flight = stages.push(core, mesh, flight, load)
    cylinders[number] = stages.cylinder_about(mesh, core, flight.state)
    hits[number].flights[0] = flight


def move(hits: wp.array(dtype=Any), cylinders: wp.array(dtype=Any)):
    """Kick the nodes and let them drift. Threads [hits, most nodes of a hit].

    Data in: cylinders. Data in and out: hits.
    """
    number, place = wp.tid()
    flight, pieces = hits[number].flights[0], hits[number].node_pieces
    if flight.status != RUNNING or place >= places(pieces):
        return
    mesh = hits[number].mesh
    node, place_of_block = member(pieces, place)
    block = mesh.blocks[place_of_block]
    if mesh.awake[block.body] != 0:
        dt = type(mesh.kick)(flight.step)
        mesh.kick = type(dt)(stages.kick_time(flight))
        mesh.cylinder = cylinders[number]
        stages.move(mesh, block, node, dt)


def gather(hits: wp.array(dtype=Any), motions: wp.array2d(dtype=Motion)):
    """Sums over the nodes of each part that belong to a core of elements. Threads [hits, PARTS].

    Data in: hits. Data out: motions.
    """
    number, part = wp.tid()
    flight = hits[number].flights[0]
    if flight.status != RUNNING or hits[number].core.deforms == 0:
        return
    mesh, pieces, motion = hits[number].mesh, hits[number].node_pieces, Motion()
    for place in range(part, places(pieces), PARTS):
        node, place_of_block = member(pieces, place)
        motion = stages.gather(mesh, mesh.blocks[place_of_block], flight, node, motion)
    motions[number, part] = motion


def deform(hits: wp.array(dtype=Any)):
    """Take the elements over the step. Those that have failed, and places where none is, have no force any more, so
    they are left alone. Threads [hits, most elements of a hit].

    Data in and out: hits.
    """
    number, place = wp.tid()
    flight, pieces = hits[number].flights[0], hits[number].pieces
    if flight.status != RUNNING or place >= places(pieces):
        return
    mesh = hits[number].mesh
    element, place_of_block = member(pieces, place)
    block = mesh.blocks[place_of_block]
    dt = type(mesh.kick)(flight.step)
    if mesh.awake[block.body] != 0 and read(mesh.alive, element) > type(dt)(0.0):
        stages.deform(mesh, block, element, dt)


def cross(hits: wp.array(dtype=Any), crossings: wp.array2d(dtype=wp.float64)):
    """The shortest time that a wave takes across an element of each part [s]; 1 s if there is none. Threads
    [hits, PARTS].

    Data in: hits. Data out: crossings.
    """
    number, part = wp.tid()
    flight = hits[number].flights[0]
    if flight.status != RUNNING:
        return
    mesh, pieces = hits[number].mesh, hits[number].pieces
    shortest = type(mesh.kick)(1.0)
    for place in range(part, places(pieces), PARTS):
        element, place_of_block = member(pieces, place)
        if mesh.awake[mesh.blocks[place_of_block].body] != 0:
            shortest = stages.cross(mesh, element, shortest)
    crossings[number, part] = wp.float64(shortest)


def step(hits: wp.array(dtype=Any), motions: wp.array2d(dtype=Motion), crossings: wp.array2d(dtype=wp.float64)):
    """End the step of each hit. Threads [hits].

    Data in: motions, crossings. Data in and out: hits.
    """
    number = wp.tid()
    flight = hits[number].flights[0]
    if flight.status != RUNNING:
        return
    shortest = wp.float64(1.0)
    for part in range(PARTS):
        shortest = wp.min(shortest, crossings[number, part])
    core, limits, mesh, left = hits[number].core, hits[number].limits, hits[number].mesh, hits[number].left
    if core.deforms != 0:
        motion = motions[number, 0]
        for part in range(1, PARTS):
            motion = stages.joined(motion, motions[number, part])
        flight.state = stages.state_of(core, flight, motion)
    hits[number].flights[0] = stages.step(core, limits, mesh, flight, shortest, left)


def look(hits: wp.array(dtype=Any), seen: wp.array2d(dtype=wp.int32)):
    """The status of each hit, and whether its core is near a node at the outer edge of a mesh, where `seen` is 0
    before. Threads [hits, PARTS].

    Data in: hits. Data out: seen.
    """
    number, part = wp.tid()
    mesh, pieces = hits[number].mesh, hits[number].node_pieces
    if part == 0:
        seen[number, 0] = hits[number].flights[0].status
    for place in range(part, places(pieces), PARTS):
        node, _ = member(pieces, place)
        beyond = read(mesh.impedance, mesh.size + node) + read(mesh.impedance, 2 * mesh.size + node)
        if stages.is_near(mesh, node) and beyond > type(beyond)(0.0):
            seen[number, 1] = 1


KERNELS = (press, bound, expose, enter, choose, touch, react, push, move, gather, deform, cross, step, look)
"""The stages of a step in their order, and what the host looks at between steps."""


@cache
def build(variant: Variant) -> dict[str, wp.Kernel]:
    """The kernels for one precision, by name."""
    struct = fields.build(variant)
    types = {"hits": wp.array(dtype=struct.Hit), "cylinders": wp.array(dtype=struct.Cylinder)}
    return {kernel.__name__: variant.kernel(kernel, **types) for kernel in KERNELS}
