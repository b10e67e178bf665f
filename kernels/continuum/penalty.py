"""Contact: every node against the surface of revolution of the core, by a penalty along the surface's normal."""

from functools import cache
from types import SimpleNamespace

import warp as wp

from .. import memory, rigid_body, structs
from ..variant import Variant
from . import choices, fields, nodes

ENDS = 32
"""Of its tabulated radii, every such one counts for where the core ends along x."""


@cache
def build(variant: Variant) -> SimpleNamespace:
    """Device functions of the contact for one variant."""
    struct, real, rigid = fields.build(variant), variant.real, structs.build(fields.RIGID)
    access, exact = memory.build(real), memory.build(wp.float64)
    read, write = access.read, access.write
    move, use = rigid_body.build(fields.RIGID), nodes.build(variant)
    zero, one, half = wp.float64(0.0), wp.float64(1.0), wp.float64(0.5)
    damping, slow, tiny = (
        wp.float64(value) for value in (2.0 * choices.DAMPING.value, choices.SLOW.value, choices.ON_AXIS.value)
    )
    outside = wp.float64(choices.OUTSIDE.value)

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
        size = mesh.size
        y, z = size + node, 2 * size + node
        place = wp.vec3d(
            wp.float64(read(mesh.position, node)),
            wp.float64(read(mesh.position, y)),
            wp.float64(read(mesh.position, z)),
        )
        away, axis = place - state.position, move.axis_of(state.attitude)
        touch = touch_of(core, axis, away)
        force = wp.vec3d()
        lightness = wp.float64(read(mesh.inverse_mass, node))
        if touch.depth > zero and use.is_held(mesh, sheet, node):
            velocity = wp.vec3d(
                wp.float64(read(mesh.velocity, node)),
                wp.float64(read(mesh.velocity, y)),
                wp.float64(read(mesh.velocity, z)),
            )
            omega = move.angular_velocity(core.body, axis, state.angular_momentum)
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
            write(mesh.contact, node, real(force[0]))
            write(mesh.contact, y, real(force[1]))
            write(mesh.contact, z, real(force[2]))
        return force, away

    @wp.func
    def load_on(mesh: struct.Mesh, core: struct.Core, state: rigid.State, time: wp.float64, dt: wp.float64):
        """Force of all nodes on the core [N], and its moment about the centre of mass [N m], in the plate frame and in
        the order of the nodes; notes the time at each sheet that touches."""
        load = rigid.Load()
        for run in range(mesh.node_runs.shape[0] // 3):
            node, last = wp.int32(mesh.node_runs[3 * run]), wp.int32(mesh.node_runs[3 * run + 1])
            layer = mesh.node_runs[3 * run + 2]
            sheet = mesh.sheets[layer]
            while node < last and mesh.awake[layer] != 0:
                if read(mesh.near, node) > real(0.0):
                    force, away = press(mesh, sheet, core, state, node, dt)
                    load.force -= force
                    load.moment -= wp.cross(away, force)
                    if wp.dot(force, force) > zero:
                        load.touching = True
                        mesh.touched[layer] = time
                node += 1
        return load

    @wp.func
    def ends_of(core: struct.Core, state: rigid.State):
        """The rearmost and the foremost x of the core [m]."""
        axis = move.axis_of(state.attitude)
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

    return SimpleNamespace(**locals())
