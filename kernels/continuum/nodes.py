"""Motion of the nodes: the forces of the elements about each, in a fixed order, of the core, and of the material beyond
the outer edge; kick and drift.

The edge is that of Lysmer and Kuhlemeyer (J Eng Mech Div ASCE 95 (1969) 859): it resists a velocity by ρ c per area, so
that waves that arrive upright leave.
"""

from functools import cache
from types import SimpleNamespace

import warp as wp

from .. import memory
from ..variant import Variant
from . import fields
from .fields import over_runs


@cache
def build(variant: Variant) -> SimpleNamespace:
    """Device functions of the nodes for one variant."""
    struct, real = fields.build(variant), variant.real
    access = memory.build(real)
    read, write = access.read, access.write
    vec3 = wp.types.vector(3, real)
    zero, half, one = real(0.0), real(0.5), real(1.0)

    @wp.func
    def corner_force(mesh: struct.Mesh, element: wp.int32, corner: wp.int32):
        """Force of an element on one of its corners [N]."""
        first = 3 * corner * mesh.size + element
        return vec3(
            read(mesh.force, first), read(mesh.force, first + mesh.size), read(mesh.force, first + 2 * mesh.size)
        )

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
        total = real(0.0)
        for plane in range(2):
            for row in range(2):
                element = node - plane * sheet.plane - row * sheet.row
                total += read(mesh.alive, element) + read(mesh.alive, element - 1)
        return total > zero

    @wp.func
    def move(mesh: struct.Mesh, sheet: struct.Sheet, node: wp.int32, dt: real):
        """Kick a node over the time between two velocities, drift it over a step, and see whether the core is near."""
        y, z = mesh.size + node, 2 * mesh.size + node
        touch = vec3(read(mesh.contact, node), read(mesh.contact, y), read(mesh.contact, z))
        before = vec3(read(mesh.velocity, node), read(mesh.velocity, y), read(mesh.velocity, z))
        force = internal_force(mesh, sheet, node) + touch
        lightness = mesh.kick * read(mesh.inverse_mass, node)
        beyond = vec3(read(mesh.impedance, node), read(mesh.impedance, y), read(mesh.impedance, z))
        velocity = wp.cw_div(before + lightness * force, vec3(one, one, one) + lightness * beyond)
        position = vec3(read(mesh.position, node), read(mesh.position, y), read(mesh.position, z)) + dt * velocity
        pressed = half * mesh.kick * wp.dot(touch, before + velocity)
        radiated = half * mesh.kick * wp.dot(wp.cw_mul(beyond, velocity), before + velocity)
        away = position - mesh.cylinder.centre
        along = wp.dot(away, mesh.cylinder.axis)
        outside = wp.max(
            wp.abs(along) - mesh.cylinder.half_length, wp.dot(away, away) - along * along - mesh.cylinder.square
        )
        write(mesh.velocity, node, velocity[0])
        write(mesh.velocity, y, velocity[1])
        write(mesh.velocity, z, velocity[2])
        write(mesh.position, node, position[0])
        write(mesh.position, y, position[1])
        write(mesh.position, z, position[2])
        write(mesh.contact_work, node, read(mesh.contact_work, node) + pressed)
        write(mesh.radiated, node, read(mesh.radiated, node) + radiated)
        write(mesh.contact, node, zero)
        write(mesh.contact, y, zero)
        write(mesh.contact, z, zero)
        write(mesh.near, node, wp.where(outside < zero, one, zero))

    move_all = over_runs(struct, real, move)
    return SimpleNamespace(**locals())
