"""One step's load on a core: the consistent law (MODEL.md §4), exposure taken at mid-step.

Two passes over the patches in the slab: the first finds what touches and tells the plate, the second reads the
weakened plate and sums the load. Their inner loops run over the patches of a ring without a branch, so that a CPU
computes a vector of them at a time.
"""

from functools import cache
from types import SimpleNamespace

import warp as wp

from . import core_surface, interaction, memory, plate_grid, rigid_body
from .variant import Variant


@cache
def build(variant: Variant) -> SimpleNamespace:
    """Device functions of a step's load for one variant."""
    real, vec3, mat33 = variant.real, variant.vec3, variant.mat33
    zero, half, one = real(0.0), real(0.5), real(1.0)
    surfaces, grid, laws, motion = (part.build(variant) for part in (core_surface, plate_grid, interaction, rigid_body))
    Surface, Pose, Ring, Patch = surfaces.Surface, surfaces.Pose, surfaces.Ring, surfaces.Patch
    Plate, Fields, Window, Box = grid.Plate, grid.Fields, grid.Window, grid.Box
    Law, Load = laws.Law, motion.Load
    ring_at, patch_at = surfaces.ring_at, surfaces.patch_at
    reals, integers = memory.build(real), memory.build(wp.int32)
    read, write, read_index, write_index = reals.read, reals.write, integers.read, integers.write
    tiny = real(1.0e-30)
    far = wp.constant(2**20)  # nodes away: beyond any window

    @wp.struct
    class Footprint:
        """What a step can touch: the first and last ring that can be in the slab (none: last < first), whether all
        rings are beyond its rear face (`through`) or before its front face (`back`), and the nodes around those in the
        slab; `inside` tells whether the window holds them."""

        first_ring: wp.int32
        last_ring: wp.int32
        through: wp.bool
        back: wp.bool
        inside: wp.bool
        box: Box

    @wp.struct
    class Sums:
        """Over a ring: force [N] and moment [N m] along the body axes; the tractions' derivative by the closing speed
        [N s/m], weighted by 1, cos, sin, cos² and cos sin of the azimuth."""

        force: vec3
        moment: vec3
        slopes: real
        slopes_c: real
        slopes_s: real
        slopes_cc: real
        slopes_cs: real

    @wp.struct
    class Touches:
        """What the first pass finds, for every patch of every slot: area [m²] of material that it immerses, exposure
        per node [s] that it is about to give, cells of the tile and of the grid with the place in them; the area of
        every ring's patches together; and, where the core bends, what the second pass sums over each ring."""

        area: wp.array(dtype=real)
        gain: wp.array(dtype=real)
        tile: wp.array(dtype=wp.int32)
        tile_y: wp.array(dtype=real)
        tile_z: wp.array(dtype=real)
        cell: wp.array(dtype=wp.int32)
        y: wp.array(dtype=real)
        z: wp.array(dtype=real)
        ring_area: wp.array(dtype=real)
        sums: wp.array(dtype=Sums)

    @wp.struct
    class Grip:
        """How a patch touches: the share of it in contact; the normal (axial, outwards, around) of that share and
        its closing speed [m/s]; and the range of closing speeds over which contact sets in [m/s]."""

        share: real
        axial: real
        outward: real
        around: real
        closing: real
        width: real

    @wp.func
    def node_below(window: Window, place: real):
        """Nodes from the hit to the last one before a place along one direction."""
        return wp.int32(wp.floor(place * window.per_cell))

    @wp.func
    def footprint_of(surface: Surface, plate: Plate, fields: Fields, window: Window, pose: Pose, dt: real):
        """The footprint in mid-step; patches act at their centres, so a ring covers centre ± radius."""
        broadside = surfaces.broadside(pose)
        across_y = wp.sqrt(wp.max(zero, one - pose.axis[1] * pose.axis[1]))
        across_z = wp.sqrt(wp.max(zero, one - pose.axis[2] * pose.axis[2]))
        advance = half * dt * wp.abs(wp.dot(pose.velocity, vec3(pose.axis[0], pose.right[0], pose.up[0])))
        turning = half * dt * wp.length(pose.omega)
        # Integers, because a CPU takes the least of a vector of them, but not of numbers that may be NaN.
        first_ring, last_ring, not_through, not_back = int(surface.rings), int(-1), int(0), int(0)
        y_low, y_high, z_low, z_high = int(far), int(-far), int(far), int(-far)
        index = int(0)
        while index < surface.rings:
            ring = ring_at(surface, pose, index)
            reach = surfaces.reach_along_x(ring, pose, broadside, advance, turning)
            foremost, rearmost = ring.centre[0] + reach, ring.centre[0] - reach
            within = foremost > zero and rearmost < plate.thickness
            first_ring = wp.min(first_ring, wp.where(within, index, surface.rings))
            last_ring = wp.max(last_ring, wp.where(within, index, -1))
            not_through += wp.where(rearmost > plate.thickness, 0, 1)
            not_back += wp.where(foremost < zero, 0, 1)
            wide_y, wide_z = ring.radius * across_y, ring.radius * across_z
            y_low = wp.min(y_low, wp.where(within, node_below(window, ring.centre[1] - wide_y), far))
            z_low = wp.min(z_low, wp.where(within, node_below(window, ring.centre[2] - wide_z), far))
            y_high = wp.max(y_high, wp.where(within, node_below(window, ring.centre[1] + wide_y), -far))
            z_high = wp.max(z_high, wp.where(within, node_below(window, ring.centre[2] + wide_z), -far))
            index += 1
        found = Footprint()
        found.first_ring = first_ring
        found.last_ring = last_ring
        found.through = not_through == 0
        found.back = not_back == 0
        found.inside = True
        if last_ring >= 0:
            # One node of slack: rounding of a patch on the ring's outermost point must stay inside.
            home_y, home_z = fields.cells_y // 2, fields.cells_z // 2
            found.box.y_low = home_y + y_low - 1
            found.box.y_high = home_y + y_high + 2
            found.box.z_low = home_z + z_low - 1
            found.box.z_high = home_z + z_high + 2
            # The filter's second pass looks at rows twice its reach away, and at the next in any case.
            rows = wp.max(2 * plate.reach, 1)
            found.inside = (
                found.box.y_low >= rows
                and found.box.z_low >= plate.reach
                and found.box.y_high < fields.cells_y - rows
                and found.box.z_high < fields.cells_z - plate.reach
            )
        return found

    @wp.func
    def grip_of(law: Law, pose: Pose, ring: Ring, patch: Patch):
        """Contact of a curved patch: normal and closing speed vary linearly over it, and only the part that closes in
        touches. Without this, contact along a shank would come and go by whole patches."""
        meridian = ring.turn_axial * patch.velocity_axial + ring.turn_radial * patch.velocity_outward
        sideways = ring.sector * ring.normal_radial
        around = sideways * patch.velocity_around
        variation = wp.sqrt(meridian * meridian + around * around)
        # From the patch's centre to that of the part in contact, in halves of the patch: 0 if all of it touches.
        per_speed = one / (variation + tiny)
        beyond = wp.clamp(half - half * patch.closing * per_speed, zero, one)
        shift = beyond * per_speed
        grip = Grip()
        grip.width = laws.onset_width(law, variation)
        grip.share = laws.contact_fraction(law, patch.closing, variation, pose.speed)
        grip.axial = ring.normal_axial + shift * meridian * ring.turn_axial
        grip.outward = ring.normal_radial + shift * meridian * ring.turn_radial
        grip.around = shift * around * sideways
        grip.closing = patch.closing + shift * variation * variation
        return grip

    @wp.func
    def normal_along_x(pose: Pose, patch: Patch, grip: Grip):
        return grip.axial * pose.axis[0] + grip.outward * patch.outward_x + grip.around * patch.around_x

    @wp.func
    def open_window(plate: Plate, fields: Fields, slot: wp.int32, hit_y: wp.float64, hit_z: wp.float64):
        """A slot's window about a hit, on a plate that nothing has touched."""
        window = grid.window_at(plate, fields, slot, hit_y, hit_z)
        if wp.static(variant.degrades):
            grid.blank(fields, window)
        return window

    @wp.func
    def find_touches(
        surface: Surface,
        plate: Plate,
        law: Law,
        fields: Fields,
        window: Window,
        touches: Touches,
        pose: Pose,
        ring: Ring,
        first: wp.int32,
        dt: real,
    ):
        """Fill in the patches of a ring, from index `first` on, as if the plate had no holes."""
        per_node = dt * window.per_cell * window.per_cell
        j = int(0)
        while j < surface.around:
            patch = patch_at(pose, ring, read(surface.cosine, ring.first + j), read(surface.sine, ring.first + j))
            grip = grip_of(law, pose, ring, patch)
            area = surfaces.immersed_area(pose, ring, patch, plate.thickness, dt)
            area = wp.where(grip.share > zero, area, zero)
            if wp.static(variant.rimmed):
                area *= grid.on_plate(plate, window, patch.y, patch.z)
            cell = grid.cell_at(fields, window, patch.y, patch.z)
            write(touches.area, first + j, area)
            write(touches.gain, first + j, per_node * grip.share * area * wp.abs(normal_along_x(pose, patch, grip)))
            tile = grid.tile_at(plate, window, patch.y, patch.z)
            write_index(touches.tile, first + j, tile.index)
            write(touches.tile_y, first + j, tile.y)
            write(touches.tile_z, first + j, tile.z)
            write_index(touches.cell, first + j, cell.index)
            write(touches.y, first + j, cell.y)
            write(touches.z, first + j, cell.z)
            j += 1

    @wp.func
    def meet_plate(surface: Surface, plate: Plate, fields: Fields, touches: Touches, first: wp.int32):
        """Leave of a ring's touches what meets material, and give the plate its exposure; the area left [m²]."""
        total = zero
        j = int(first)
        while j < first + surface.around:
            area = read(touches.area, j)
            if area > zero:
                tile, tile_y, tile_z = read_index(touches.tile, j), read(touches.tile_y, j), read(touches.tile_z, j)
                material = grid.gather(plate.tile, plate.tile_z + 1, tile, tile_y, tile_z)
                write(touches.area, j, material * area)
                total += material * area
                if wp.static(variant.degrades):
                    gain = material * read(touches.gain, j)
                    if gain > zero:
                        cell, y, z = read_index(touches.cell, j), read(touches.y, j), read(touches.z, j)
                        grid.scatter(fields.gain, fields.cells_z, cell, y, z, gain)
            j += 1
        return total

    @wp.func
    def sum_ring(surface: Surface, law: Law, fields: Fields, touches: Touches, pose: Pose, ring: Ring, first: wp.int32):
        """Sum tractions and their slopes over a ring's touches."""
        axial, right, up, around = real(0.0), real(0.0), real(0.0), real(0.0)
        axial_c, axial_s = real(0.0), real(0.0)
        slopes, slopes_c, slopes_s, slopes_cc, slopes_cs = real(0.0), real(0.0), real(0.0), real(0.0), real(0.0)
        j = int(0)
        while j < surface.around:
            cosine, sine = read(surface.cosine, ring.first + j), read(surface.sine, ring.first + j)
            patch = patch_at(pose, ring, cosine, sine)
            grip = grip_of(law, pose, ring, patch)
            area = read(touches.area, first + j)
            if wp.static(variant.degrades):
                cell = read_index(touches.cell, first + j)
                y, z = read(touches.y, first + j), read(touches.z, first + j)
                area *= laws.remaining(law, grid.gather(fields.exposure, fields.cells_z, cell, y, z))
            static_slope = wp.where(grip.share < one, laws.normal_stress(law, grip.closing) / grip.width, zero)
            slope = area * static_slope
            if wp.static(variant.rate_dependent):
                slope += area * grip.share * laws.stress_slope(law, grip.closing)
            # Traction = stress × (−n + η t), t against the sliding velocity.
            f_axial, f_outward, f_around = -grip.axial, -grip.outward, -grip.around
            if wp.static(variant.rubs):
                s_axial = patch.velocity_axial - grip.closing * grip.axial
                s_outward = patch.velocity_outward - grip.closing * grip.outward
                s_around = patch.velocity_around - grip.closing * grip.around
                sliding = wp.sqrt(s_axial * s_axial + s_outward * s_outward + s_around * s_around)
                rubbing = laws.friction_per_speed(law, sliding, pose.speed)
                f_axial -= rubbing * s_axial
                f_outward -= rubbing * s_outward
                f_around -= rubbing * s_around
            force = area * grip.share * laws.normal_stress(law, grip.closing)
            axial += force * f_axial
            axial_c += force * f_axial * cosine
            axial_s += force * f_axial * sine
            right += force * (f_outward * cosine - f_around * sine)
            up += force * (f_outward * sine + f_around * cosine)
            around += force * f_around
            slopes += slope
            slopes_c += slope * cosine
            slopes_s += slope * sine
            slopes_cc += slope * cosine * cosine
            slopes_cs += slope * cosine * sine
            j += 1
        sums = Sums()
        sums.force = vec3(axial, right, up)
        sums.moment = vec3(
            ring.radius * around,
            ring.radius * axial_s - ring.station * up,
            ring.station * right - ring.radius * axial_c,
        )
        sums.slopes = slopes
        sums.slopes_c = slopes_c
        sums.slopes_s = slopes_s
        sums.slopes_cc = slopes_cc
        sums.slopes_cs = slopes_cs
        return sums

    @wp.func
    def damping_vv(ring: Ring, s: Sums):
        """Σ slope n nᵀ, n = (axial, radial cos, radial sin)."""
        a, r = ring.normal_axial, ring.normal_radial
        aa, ar, rr = a * a * s.slopes, a * r, r * r
        return mat33(
            aa, ar * s.slopes_c, ar * s.slopes_s,
            ar * s.slopes_c, rr * s.slopes_cc, rr * s.slopes_cs,
            ar * s.slopes_s, rr * s.slopes_cs, rr * (s.slopes - s.slopes_cc),
        )  # fmt: skip

    @wp.func
    def damping_vw(ring: Ring, s: Sums):
        """Σ slope n (arm × n)ᵀ, arm × n = lever (0, −sin, cos)."""
        lever = ring.station * ring.normal_radial - ring.radius * ring.normal_axial
        a, r = lever * ring.normal_axial, lever * ring.normal_radial
        return mat33(
            zero, -a * s.slopes_s, a * s.slopes_c,
            zero, -r * s.slopes_cs, r * s.slopes_cc,
            zero, -r * (s.slopes - s.slopes_cc), r * s.slopes_cs,
        )  # fmt: skip

    @wp.func
    def damping_ww(ring: Ring, s: Sums):
        """Σ slope (arm × n)(arm × n)ᵀ."""
        lever = ring.station * ring.normal_radial - ring.radius * ring.normal_axial
        square = lever * lever
        return mat33(
            zero, zero, zero,
            zero, square * (s.slopes - s.slopes_cc), -square * s.slopes_cs,
            zero, -square * s.slopes_cs, square * s.slopes_cc,
        )  # fmt: skip

    @wp.func
    def load_on(
        surface: Surface,
        plate: Plate,
        law: Law,
        fields: Fields,
        window: Window,
        touches: Touches,
        slot: wp.int32,
        found: Footprint,
        pose: Pose,
        dt: real,
    ):
        """The load over one step; the plate's exposure moves on by the step.

        Half of the slope of the traction is the load's damping: the step is the trapezoid rule, second order where
        the stress depends on the rate, and stable where a wall rests on the steep ramp of the contact.
        """
        base = slot * surface.rings * surface.around
        load = Load()
        for index in range(found.first_ring, found.last_ring + 1):
            ring = ring_at(surface, pose, index)
            first = base + index * surface.around
            area = zero
            if surfaces.closes(pose, ring):
                find_touches(surface, plate, law, fields, window, touches, pose, ring, first, dt)
                area = meet_plate(surface, plate, fields, touches, first)
            touches.ring_area[slot * surface.rings + index] = area
            load.touching = load.touching or area > zero
        if load.touching:
            if wp.static(variant.degrades):
                grid.spread(plate, fields, window, found.box)
            for index in range(found.first_ring, found.last_ring + 1):
                if touches.ring_area[slot * surface.rings + index] > zero:
                    ring = ring_at(surface, pose, index)
                    sums = sum_ring(surface, law, fields, touches, pose, ring, base + index * surface.around)
                    if wp.static(variant.bends):
                        touches.sums[slot * surface.rings + index] = sums
                    load.force += sums.force
                    load.moment += sums.moment
                    if sums.slopes > zero:
                        load.damped = True
                        load.damping_vv += half * damping_vv(ring, sums)
                        load.damping_vw += half * damping_vw(ring, sums)
                        load.damping_ww += half * damping_ww(ring, sums)
            if wp.static(variant.degrades):
                grid.settle(plate, fields, window, found.box)
        return load

    return SimpleNamespace(
        Footprint=Footprint,
        Touches=Touches,
        Sums=Sums,
        Grip=Grip,
        damping_vv=damping_vv,
        damping_vw=damping_vw,
        damping_ww=damping_ww,
        open_window=open_window,
        footprint_of=footprint_of,
        grip_of=grip_of,
        load_on=load_on,
    )
