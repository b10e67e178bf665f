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
    real, vec2, vec3, mat33 = variant.real, variant.vec2, variant.vec3, variant.mat33
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
    class Slopes:
        """Σ slope × products of the normal's components along the axis (a) and outwards (r) and of its lever (l) about
        the centre of mass; with the azimuth's cos and sin for each r or l: (cos, sin), or (cos², cos sin, sin²)."""

        aa: real
        ar: vec2
        rr: vec3
        al: vec2
        rl: vec3
        ll: vec3

    @wp.struct
    class Touches:
        """What the first pass finds, for every patch of every slot: the area [m²] with which it presses on material,
        the derivative of that area by its closing speed [m s], the `shift` of its grip, exposure per node [s] that it
        is about to give, cells of the tile and of the grid, and the place in the latter; the area of every ring's
        patches together; and, where the core bends, what the second pass sums over each ring."""

        area: wp.array(dtype=real)
        slope: wp.array(dtype=real)
        shift: wp.array(dtype=real)
        gain: wp.array(dtype=real)
        tile: wp.array(dtype=wp.int32)
        cell: wp.array(dtype=wp.int32)
        y: wp.array(dtype=real)
        z: wp.array(dtype=real)
        ring_area: wp.array(dtype=real)
        sums: wp.array(dtype=Sums)

    @wp.struct
    class Grip:
        """How a patch touches: the share of it in contact, its derivative by the closing speed [s/m], and how far the
        middle of that share is from the patch's own, in halves of the patch and per variation of the closing speed
        over it [s/m]."""

        share: real
        slope: real
        shift: real

    @wp.struct
    class Face:
        """The part of a patch in contact: its normal (axial, outwards, around) and its closing speed [m/s]."""

        axial: real
        outward: real
        around: real
        closing: real

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
            # The filter's first pass takes rows twice its reach away, and looks a little beyond them.
            rows = 2 * plate.reach + 1
            found.inside = (
                found.box.y_low >= rows
                and found.box.z_low >= plate.reach
                and found.box.y_high < fields.cells_y - rows
                and found.box.z_high < fields.cells_z - plate.reach
            )
        return found

    @wp.func
    def variations(ring: Ring, patch: Patch):
        """Half of what the closing speed varies by over a patch, along the meridian and around [m/s]."""
        meridian = ring.turn_axial * patch.velocity_axial + ring.turn_radial * patch.velocity_outward
        return meridian, ring.sector * ring.normal_radial * patch.velocity_around

    @wp.func
    def grip_of(law: Law, pose: Pose, ring: Ring, patch: Patch):
        """Contact of a curved patch: normal and closing speed vary linearly over it, and only the part that closes in
        touches. Without this, contact along a shank would come and go by whole patches."""
        meridian, around = variations(ring, patch)
        variation = wp.sqrt(meridian * meridian + around * around)
        per_variation = one / (variation + tiny)
        rate = laws.onset_rate(law, per_variation)
        grip = Grip()
        grip.share = laws.contact_fraction(patch.closing, variation, rate, pose.speed)
        grip.slope = wp.where(grip.share < one, rate, zero)
        # 0 if all of it touches.
        grip.shift = wp.clamp(half - half * patch.closing * per_variation, zero, one) * per_variation
        return grip

    @wp.func
    def face_of(ring: Ring, patch: Patch, shift: real):
        """The part of a patch in contact, from its grip's shift."""
        meridian, around = variations(ring, patch)
        face = Face()
        face.axial = ring.normal_axial + shift * meridian * ring.turn_axial
        face.outward = ring.normal_radial + shift * meridian * ring.turn_radial
        face.around = shift * around * ring.sector * ring.normal_radial
        face.closing = patch.closing + shift * (meridian * meridian + around * around)
        return face

    @wp.func
    def normal_along_x(pose: Pose, patch: Patch, face: Face):
        return face.axial * pose.axis[0] + face.outward * patch.outward_x + face.around * patch.around_x

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
        """Fill in the patches of a ring, from index `first` on; the area [m²] with which they press on material."""
        per_node = dt * window.per_cell * window.per_cell
        j = int(0)
        while j < surface.around:
            patch = patch_at(pose, ring, read(surface.cosine, ring.first + j), read(surface.sine, ring.first + j))
            grip = grip_of(law, pose, ring, patch)
            face = face_of(ring, patch, grip.shift)
            immersed = surfaces.immersed_area(pose, ring, patch, plate.thickness, dt)
            if wp.static(variant.rimmed):
                immersed *= grid.on_plate(plate, window, patch.y, patch.z)
            area = grip.share * immersed
            write(touches.area, first + j, area)
            write(touches.slope, first + j, wp.where(grip.share > zero, grip.slope * immersed, zero))
            write(touches.shift, first + j, grip.shift)
            write(touches.gain, first + j, per_node * area * wp.abs(normal_along_x(pose, patch, face)))
            write_index(touches.tile, first + j, grid.tile_at(plate, window, patch.y, patch.z))
            cell = grid.cell_at(fields, window, patch.y, patch.z)
            write_index(touches.cell, first + j, cell.index)
            write(touches.y, first + j, cell.y)
            write(touches.z, first + j, cell.z)
            j += 1
        return grid.meet(touches.area, touches.slope, touches.gain, touches.tile, plate.tile, first, surface.around)

    @wp.func
    def expose(surface: Surface, fields: Fields, touches: Touches, first: wp.int32):
        """Give the plate the exposure of a ring's touches, from its four quarters in turn: neighbours share nodes, and
        one would wait for the other. What does not touch gives nothing, which costs less than to leave it out."""
        quarter = surface.around // 4
        j = int(first)
        while j < first + quarter:
            for k in range(4):
                i = j + k * quarter
                cell, y, z = read_index(touches.cell, i), read(touches.y, i), read(touches.z, i)
                grid.scatter(fields.gain, fields.cells_z, cell, y, z, read(touches.gain, i))
            j += 1

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
            face = face_of(ring, patch, read(touches.shift, first + j))
            left = one
            if wp.static(variant.degrades):
                cell = read_index(touches.cell, first + j)
                y, z = read(touches.y, first + j), read(touches.z, first + j)
                left = laws.remaining(law, grid.gather(fields.exposure, fields.cells_z, cell, y, z))
            area = left * read(touches.area, first + j)
            stress = laws.normal_stress(law, face.closing)
            slope = left * read(touches.slope, first + j) * stress
            if wp.static(variant.rate_dependent):
                slope += area * laws.stress_slope(law, face.closing)
            # Traction = stress × (−n + η t), t against the sliding velocity.
            f_axial, f_outward, f_around = -face.axial, -face.outward, -face.around
            if wp.static(variant.rubs):
                s_axial = patch.velocity_axial - face.closing * face.axial
                s_outward = patch.velocity_outward - face.closing * face.outward
                s_around = patch.velocity_around - face.closing * face.around
                sliding = wp.sqrt(s_axial * s_axial + s_outward * s_outward + s_around * s_around)
                rubbing = laws.friction_per_speed(law, sliding, pose.speed)
                f_axial -= rubbing * s_axial
                f_outward -= rubbing * s_outward
                f_around -= rubbing * s_around
            force = area * stress
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
    def slopes_of(ring: Ring, s: Sums):
        """Of a ring; its normals are n = (a, r cos, r sin) and arm × n = l (0, −sin, cos)."""
        a, r = ring.normal_axial, ring.normal_radial
        lever = ring.station * r - ring.radius * a
        once, twice = vec2(s.slopes_c, s.slopes_s), vec3(s.slopes_cc, s.slopes_cs, s.slopes - s.slopes_cc)
        slopes = Slopes()
        slopes.aa = a * a * s.slopes
        slopes.ar = a * r * once
        slopes.rr = r * r * twice
        slopes.al = a * lever * once
        slopes.rl = r * lever * twice
        slopes.ll = lever * lever * twice
        return slopes

    @wp.func
    def damping_vv(s: Slopes):
        """Σ slope n nᵀ."""
        return mat33(
            s.aa, s.ar[0], s.ar[1],
            s.ar[0], s.rr[0], s.rr[1],
            s.ar[1], s.rr[1], s.rr[2],
        )  # fmt: skip

    @wp.func
    def damping_vw(s: Slopes):
        """Σ slope n (arm × n)ᵀ."""
        return mat33(
            zero, -s.al[1], s.al[0],
            zero, -s.rl[1], s.rl[0],
            zero, -s.rl[2], s.rl[1],
        )  # fmt: skip

    @wp.func
    def damping_ww(s: Slopes):
        """Σ slope (arm × n)(arm × n)ᵀ."""
        return mat33(
            zero, zero, zero,
            zero, s.ll[2], -s.ll[1],
            zero, -s.ll[1], s.ll[0],
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
                area = find_touches(surface, plate, law, fields, window, touches, pose, ring, first, dt)
            touches.ring_area[slot * surface.rings + index] = area
            load.touching = load.touching or area > zero
        if load.touching:
            if wp.static(variant.degrades):
                # After all rings are found: what was just stored by vectors cannot be read one by one at once.
                for index in range(found.first_ring, found.last_ring + 1):
                    if touches.ring_area[slot * surface.rings + index] > zero:
                        expose(surface, fields, touches, base + index * surface.around)
                grid.spread(plate, fields, window, found.box)
            slopes = Slopes()
            for index in range(found.first_ring, found.last_ring + 1):
                if touches.ring_area[slot * surface.rings + index] > zero:
                    ring = ring_at(surface, pose, index)
                    sums = sum_ring(surface, law, fields, touches, pose, ring, base + index * surface.around)
                    if wp.static(variant.bends):
                        touches.sums[slot * surface.rings + index] = sums
                    load.force += sums.force
                    load.moment += sums.moment
                    load.damped = load.damped or sums.slopes > zero
                    here = slopes_of(ring, sums)
                    slopes.aa += here.aa
                    slopes.ar += here.ar
                    slopes.rr += here.rr
                    slopes.al += here.al
                    slopes.rl += here.rl
                    slopes.ll += here.ll
            load.damping_vv = half * damping_vv(slopes)
            load.damping_vw = half * damping_vw(slopes)
            load.damping_ww = half * damping_ww(slopes)
            if wp.static(variant.degrades):
                grid.settle(plate, fields, window, found.box)
        return load

    return SimpleNamespace(
        Footprint=Footprint,
        Touches=Touches,
        Sums=Sums,
        Grip=Grip,
        Face=Face,
        slopes_of=slopes_of,
        damping_vv=damping_vv,
        damping_vw=damping_vw,
        damping_ww=damping_ww,
        open_window=open_window,
        footprint_of=footprint_of,
        grip_of=grip_of,
        face_of=face_of,
        load_on=load_on,
    )
