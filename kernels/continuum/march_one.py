"""The march of one hit: a thread takes all nodes and elements through the stages of a step (stages.py), step by step,
until the core has passed, turned back or rests.
"""

from functools import cache
from typing import Any

import warp as wp

from ..status import RUNNING
from ..variant import Variant
from . import contact, fields, stages
from .fields import CORE, Core, Flight, Limits, over_runs

move_all, deform_all = over_runs(stages.move), over_runs(stages.deform)


@wp.func
def sort_all(mesh: Any):
    """Enter the faces into the grid, and choose those that nodes may touch."""
    for body in range(mesh.bodies.shape[0]):
        contact.bound(mesh, body)
    for run in range(mesh.runs.shape[0] // 3):
        block = mesh.blocks[mesh.runs[3 * run + 2]]
        element, last = wp.int32(mesh.runs[3 * run]), wp.int32(mesh.runs[3 * run + 1])
        while element < last and mesh.awake[block.body] != 0:
            contact.expose(mesh, block, element)
            element += 1
    contact.enter(mesh, 0, 1)
    for run in range(mesh.node_runs.shape[0] // 3):
        block = mesh.blocks[mesh.node_runs[3 * run + 2]]
        node, last = wp.int32(mesh.node_runs[3 * run]), wp.int32(mesh.node_runs[3 * run + 1])
        while node < last and mesh.awake[block.body] != 0:
            contact.choose(mesh, block, node)
            node += 1


@wp.func
def touch_all(mesh: Any, flight: Flight):
    """The pushes of faces on all nodes, and their reactions."""
    count = wp.int32(0)
    for run in range(mesh.node_runs.shape[0] // 3):
        block = mesh.blocks[mesh.node_runs[3 * run + 2]]
        node, last = wp.int32(mesh.node_runs[3 * run]), wp.int32(mesh.node_runs[3 * run + 1])
        while node < last and mesh.awake[block.body] != 0:
            if mesh.contacts.near[node] > 0:
                count = contact.take(mesh, contact.touch(mesh, block, flight, node), count, 0, 1)
            node += 1
    mesh.contacts.pushing[0] = count
    contact.react(mesh, 0, 1)


@wp.func
def press_all(core: Core, mesh: Any, flight: Flight):
    """Load of all nodes on the core, in their order."""
    load, count = stages.Load(), wp.where(core.deforms == 0, mesh.node_runs.shape[0] // 3, 0)
    for run in range(count):
        node, last = wp.int32(mesh.node_runs[3 * run]), wp.int32(mesh.node_runs[3 * run + 1])
        block = mesh.blocks[mesh.node_runs[3 * run + 2]]
        while node < last and mesh.awake[block.body] != 0:
            if stages.is_near(mesh, node):
                own = stages.press(mesh, block, core, flight, node, 0)
                load.force -= own.force
                load.moment -= own.moment
            node += 1
    return load


@wp.func
def gather_all(mesh: Any, flight: Flight):
    """Sums over the nodes of the core, in their order."""
    motion = stages.Motion()
    for run in range(mesh.node_runs.shape[0] // 3):
        node, last = wp.int32(mesh.node_runs[3 * run]), wp.int32(mesh.node_runs[3 * run + 1])
        block = mesh.blocks[mesh.node_runs[3 * run + 2]]
        while node < last and mesh.bodies[block.body].layer == CORE:
            motion = stages.gather(mesh, block, flight, node, motion)
            node += 1
    return motion


@wp.func
def cross_all(mesh: Any):
    """The shortest time that a wave takes across an element of the bodies that are awake [s]; 1 s if there is none.
    Four minima side by side, as a run has a multiple of four elements."""
    second = type(mesh.kick)(1.0)
    first, third, fourth = type(second)(1.0), type(second)(1.0), type(second)(1.0)
    for run in range(mesh.runs.shape[0] // 3):
        element, last = wp.int32(mesh.runs[3 * run]), wp.int32(mesh.runs[3 * run + 1])
        own = mesh.blocks[mesh.runs[3 * run + 2]].body
        while element < last and mesh.awake[own] != 0:
            first = stages.cross(mesh, element, first)
            second = stages.cross(mesh, element + 1, second)
            third = stages.cross(mesh, element + 2, third)
            fourth = stages.cross(mesh, element + 3, fourth)
            element += 4
    return wp.float64(wp.min(wp.min(first, second), wp.min(third, fourth)))


def advance(
    core: Core,
    limits: Limits,
    steps: wp.int32,
    mesh: Any,
    flights: wp.array(dtype=Flight),
    left: wp.array2d(dtype=wp.float64),
):
    """March one hit by some steps.

    Model: core, limits. Data in and out: mesh, flights, left.
    """
    flight = flights[0]
    for _ in range(steps):
        if flight.status != RUNNING:
            break
        dt = type(mesh.kick)(flight.step)
        mesh.kick = type(dt)(stages.kick_time(flight))
        load = press_all(core, mesh, flight)
        if mesh.contacts.counts.shape[0] > 0:
            if contact.is_due(mesh, flight):
                sort_all(mesh)
                flight.sorted = flight.time
            touch_all(mesh, flight)
        flight = stages.push(core, mesh, flight, load)
        mesh.cylinder = stages.cylinder_about(mesh, core, flight.state)
        move_all(mesh, mesh.node_runs, dt)
        if core.deforms != 0:
            flight.state = stages.state_of(core, flight, gather_all(mesh, flight))
        deform_all(mesh, mesh.runs, dt)
        flight = stages.step(core, limits, mesh, flight, cross_all(mesh), left)
    flights[0] = flight


@cache
def build(variant: Variant) -> wp.Kernel:
    """The kernel `advance` for one precision."""
    return variant.kernel(advance, mesh=fields.build(variant).Mesh)
