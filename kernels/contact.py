"""One step's load on a core: the consistent law (MODEL.md §4), exposure taken at mid-step.

Two passes over the patches in the slab: the first tells the plate what touches it, the second reads the
weakened plate and sums the load. Both see the same pose, so a patch touches in one as in the other.
"""

from functools import cache
from types import SimpleNamespace

import warp as wp

from . import core_surface, interaction, plate_grid, rigid_body
from .variant import Variant


@cache
def build(variant: Variant) -> SimpleNamespace:
    """Device functions of a step's load for one variant."""
    real = variant.real
    zero, half, one = real(0.0), real(0.5), real(1.0)
    surfaces, grid, laws, motion = (part.build(variant) for part in (core_surface, plate_grid, interaction, rigid_body))
    Surface, Pose, Patch = surfaces.Surface, surfaces.Pose, surfaces.Patch
    Plate, Fields, Window, Box = grid.Plate, grid.Fields, grid.Window, grid.Box
    Law, Load = laws.Law, motion.Load
    ring_at, patch_at = surfaces.ring_at, surfaces.patch_at

    @wp.struct
    class Footprint:
        """What a step can touch: the first and last ring that can be in the slab (none: last < first), the span
        of the core along x [m], and the cells under those rings; `inside` tells whether the window holds them."""

        first_ring: wp.int32
        last_ring: wp.int32
        inside: wp.bool
        rear: real
        front: real
        box: Box

    @wp.func
    def footprint_of(surface: Surface, plate: Plate, fields: Fields, window: Window, pose: Pose, dt: real):
        """The footprint in mid-step; patches act at their centres, so a ring covers centre ± radius."""
        found = Footprint()
        found.inside = True
        found.first_ring = surface.rings
        found.last_ring = -1
        home_y = fields.cells_y // 2
        home_z = fields.cells_z // 2
        found.box.y_low = fields.cells_y
        found.box.z_low = fields.cells_z
        found.box.y_high = -1
        found.box.z_high = -1
        found.rear = real(wp.inf)
        found.front = -real(wp.inf)
        across_y = wp.sqrt(wp.max(zero, one - pose.axis[1] * pose.axis[1]))
        across_z = wp.sqrt(wp.max(zero, one - pose.axis[2] * pose.axis[2]))
        for index in range(surface.rings):
            ring = ring_at(surface, pose, index, dt)
            reach = surfaces.reach_along_x(surface, ring, pose, dt)
            found.rear = wp.min(found.rear, ring.centre[0] - reach)
            found.front = wp.max(found.front, ring.centre[0] + reach)
            if ring.centre[0] + reach > zero and ring.centre[0] - reach < plate.thickness:
                found.first_ring = wp.min(found.first_ring, index)
                found.last_ring = index
                y = (ring.centre[1] - window.y0) * window.per_y
                z = (ring.centre[2] - window.z0) * window.per_z
                spread_y = ring.radius * across_y * window.per_y
                spread_z = ring.radius * across_z * window.per_z
                found.box.y_low = wp.min(found.box.y_low, home_y + wp.int32(wp.floor(y - spread_y)))
                found.box.z_low = wp.min(found.box.z_low, home_z + wp.int32(wp.floor(z - spread_z)))
                found.box.y_high = wp.max(found.box.y_high, home_y + wp.int32(wp.floor(y + spread_y)) + 1)
                found.box.z_high = wp.max(found.box.z_high, home_z + wp.int32(wp.floor(z + spread_z)) + 1)
        # One cell of slack: rounding of a patch on the ring's outermost point must stay inside.
        margin_y = plate.reach_y + 1
        margin_z = plate.reach_z + 1
        if found.last_ring >= 0:
            found.inside = (
                found.box.y_low >= margin_y
                and found.box.z_low >= margin_z
                and found.box.y_high < fields.cells_y - margin_y
                and found.box.z_high < fields.cells_z - margin_z
            )
            found.box.y_low -= 1
            found.box.z_low -= 1
            found.box.y_high += 1
            found.box.z_high += 1
        return found

    @wp.func
    def cell_under(fields: Fields, window: Window, pose: Pose, patch: Patch):
        return grid.cell_at(fields, window, pose.position[1] + patch.arm[1], pose.position[2] + patch.arm[2])

    @wp.func
    def expose(
        surface: Surface,
        plate: Plate,
        law: Law,
        fields: Fields,
        window: Window,
        found: Footprint,
        pose: Pose,
        dt: real,
    ):
        """First pass: exposure gained per cell [s], ∫ρ dt before the tent is spread over it."""
        per_cell = dt * window.per_y * window.per_z
        for index in range(found.first_ring, found.last_ring + 1):
            ring = ring_at(surface, pose, index, dt)
            for j in range(surface.around):
                patch = patch_at(surface, pose, ring, j)
                share = laws.contact_fraction(law, patch.closing, pose.speed)
                if share > zero:
                    immersed = surfaces.immersed_area(pose, ring, patch, plate.thickness, dt)
                    if immersed > zero:
                        cell = cell_under(fields, window, pose, patch)
                        projected = share * immersed * wp.abs(patch.normal[0])
                        material = grid.gather(fields.material, fields.cells_z, cell)
                        grid.scatter(fields.gain, fields.cells_z, cell, per_cell * projected * material)

    @wp.func
    def force_of(law: Law, pose: Pose, patch: Patch, share: real, area: real):
        """Force [N] on a patch that touches `area` [m²] of undamaged material, `share` of it in contact."""
        stress = laws.normal_stress(law, patch.closing)
        direction = laws.traction_direction(law, patch.normal, patch.velocity, patch.closing, pose.speed)
        return (area * share * stress) * direction

    @wp.func
    def damping_of(law: Law, patch: Patch, share: real, area: real):
        """Half of how fast a patch's normal force grows with its closing speed [N s/m].

        Half of it makes the step the trapezoid rule: second order where the stress depends on the rate, and
        stable where a wall rests on the steep ramp of the contact.
        """
        slope = zero
        if share < one:
            slope += laws.normal_stress(law, patch.closing) / law.onset
        if wp.static(variant.rate_dependent):
            slope += share * laws.stress_slope(law, patch.closing)
        return half * area * slope

    @wp.func
    def total_load(
        surface: Surface,
        plate: Plate,
        law: Law,
        fields: Fields,
        window: Window,
        found: Footprint,
        pose: Pose,
        dt: real,
    ):
        """Second pass: the load [N, N m] of all patches on the plate as it is at mid-step."""
        load = Load()
        for index in range(found.first_ring, found.last_ring + 1):
            ring = ring_at(surface, pose, index, dt)
            for j in range(surface.around):
                patch = patch_at(surface, pose, ring, j)
                share = laws.contact_fraction(law, patch.closing, pose.speed)
                if share > zero:
                    immersed = surfaces.immersed_area(pose, ring, patch, plate.thickness, dt)
                    if immersed > zero:
                        cell = cell_under(fields, window, pose, patch)
                        area = immersed * grid.gather(fields.material, fields.cells_z, cell)
                        load.touching = load.touching or area > zero
                        if wp.static(variant.degrades):
                            area *= laws.remaining(law, grid.gather(fields.exposure, fields.cells_z, cell))
                        force = force_of(law, pose, patch, share, area)
                        load.force += force
                        load.moment += wp.cross(patch.arm, force)
                        damping = damping_of(law, patch, share, area)
                        if damping > zero:
                            turning = wp.cross(patch.arm, patch.normal)
                            load.damping_vv += damping * wp.outer(patch.normal, patch.normal)
                            load.damping_vw += damping * wp.outer(patch.normal, turning)
                            load.damping_ww += damping * wp.outer(turning, turning)
                            load.damped = True
        return load

    @wp.func
    def load_on(
        surface: Surface,
        plate: Plate,
        law: Law,
        fields: Fields,
        window: Window,
        found: Footprint,
        pose: Pose,
        dt: real,
    ):
        """The load over one step; the plate's exposure moves on by the step."""
        if wp.static(variant.degrades):
            expose(surface, plate, law, fields, window, found, pose, dt)
            grid.spread(plate, fields, window, found.box)
        load = total_load(surface, plate, law, fields, window, found, pose, dt)
        if wp.static(variant.degrades):
            grid.settle(plate, fields, window, found.box)
        return load

    return SimpleNamespace(Footprint=Footprint, footprint_of=footprint_of, load_on=load_on)
