"""The load of one step on a core: the consistent law (docs/model.md §4), with the exposure at mid-step.

A step makes two passes over the patches in the slab. The first pass finds the patches that touch and adds their
exposure to the plate. The second pass reads the weakened plate and sums the load. Each pass is one loop over the
patches of all rings without a branch, so a CPU computes several patches at once.
"""

from functools import cache
from types import SimpleNamespace
from typing import Any

import warp as wp

from . import constants, core_surface, exposure, free_edges, interaction, lanes, plate_grid, structs
from .memory import read, write
from .variant import Variant


@cache
def build(variant: Variant) -> SimpleNamespace:
    """Device functions of a step's load for one variant."""
    struct = structs.build(variant)
    real, reals, vec2, vec3, mat33 = variant.real, variant.reals, variant.vec2, variant.vec3, variant.mat33
    zero, half, one = real(0.0), real(0.5), real(1.0)
    use = variant.use(core_surface, exposure, free_edges, interaction, lanes, plate_grid)
    far = constants.FAR_NODES.value
    ring_of, patch_at = use.core_surface.ring_of, use.core_surface.patch_at

    @wp.func
    def damping_vv(s: struct.Sums):
        """Σ slope n nᵀ."""
        return mat33(
            s.aa, s.ar[0], s.ar[1],
            s.ar[0], s.rr[0], s.rr[1],
            s.ar[1], s.rr[1], s.rr[2],
        )  # fmt: skip

    @wp.func
    def damping_vw(s: struct.Sums):
        """Σ slope n (arm × n)ᵀ."""
        return mat33(
            zero, -s.al[1], s.al[0],
            zero, -s.rl[1], s.rl[0],
            zero, -s.rl[2], s.rl[1],
        )  # fmt: skip

    @wp.func
    def damping_ww(s: struct.Sums):
        """Σ slope (arm × n)(arm × n)ᵀ."""
        return mat33(
            zero, zero, zero,
            zero, s.ll[2], -s.ll[1],
            zero, -s.ll[1], s.ll[0],
        )  # fmt: skip

    @wp.func
    def joined(a: struct.Sums, b: struct.Sums):
        """Sums over two sets of patches."""
        a.force += b.force
        a.moment += b.moment
        a.aa += b.aa
        a.ar += b.ar
        a.rr += b.rr
        a.al += b.al
        a.rl += b.rl
        a.ll += b.ll
        return a

    @wp.func
    def find_touches(context: struct.Context, slab: struct.Slab, base: wp.int32, begin: wp.int32, end: wp.int32):
        """Fill in the touches of the patches begin ≤ j < end, from index `base` + begin on, as if there were material
        everywhere."""
        surface, touches = context.surface, context.touches
        plate, law, window, pose, dt = slab.plate, slab.law, slab.window, slab.pose, slab.dt
        per_node = use.interaction.exposure_in(law, dt, wp.length(pose.velocity)) * window.per_cell * window.per_cell
        # A ring outside the slab, between rings in it, may be outside the window, too. It touches nothing.
        last_cell = window.first + (window.cells_y - 1) * window.cells_z - 2
        j = begin + use.lanes.lane()
        while j < end:
            ring = ring_of(surface, pose, j)
            patch = patch_at(pose, ring, read(surface.cosine, j), read(surface.sine, j))
            grip = use.interaction.grip_of(law, pose, ring, patch)
            face = use.interaction.face_of(ring, patch, grip.shift)
            immersed = use.core_surface.immersed_area(pose, ring, patch, window.thickness, dt)
            if wp.static(variant.rimmed):
                immersed *= use.plate_grid.on_plate(plate, window, patch.y, patch.z)
            area = grip.share * immersed
            write(touches.area, base + j, area)
            slope = use.interaction.steady_slope(law, grip.share, grip.slope, face.closing)
            write(touches.slope, base + j, slope * immersed)
            write(touches.shift, base + j, grip.shift)
            write(touches.gain, base + j, per_node * area * wp.abs(use.interaction.normal_along_x(pose, patch, face)))
            write(touches.tile, base + j, use.plate_grid.tile_at(plate, window, patch.y, patch.z))
            cell = use.plate_grid.cell_at(window, patch.y, patch.z)
            write(touches.cell, base + j, wp.clamp(cell.index, window.first, last_cell))
            write(touches.y, base + j, cell.y)
            write(touches.z, base + j, cell.z)
            j += use.lanes.count()
        if wp.static(variant.free_surface):
            use.free_edges.restrict(context, slab, base, begin, end)

    @wp.func
    def meet(plate: struct.Plate, touches: struct.Touches, first: wp.int32, count: wp.int32):
        """Restrict touches to material, from index `first` on; return the area that presses on it [m²]."""
        if wp.static(variant.free_surface):
            area = use.free_edges.sum_of(touches.area, first, count)
        else:
            area = use.plate_grid.meet(
                touches.area, touches.slope, touches.gain, touches.tile, plate.tile, first, count
            )
        return area

    @wp.func
    def expose(context: struct.Context, window: struct.Window, first: wp.int32):
        """Add the exposure of a ring's patches to the plate, one patch of each quarter in turn, because neighbours
        share nodes and a CPU would have to wait between them. A patch that does not touch adds zero, which is faster
        than a branch."""
        fields, touches, quarter = context.fields, context.touches, context.surface.around // 4
        j = int(first)
        while j < first + quarter:
            for k in range(4):
                i = j + k * quarter
                cell, y, z = read(touches.cell, i), read(touches.y, i), read(touches.z, i)
                gain = read(touches.gain, i)
                use.exposure.scatter(fields.gain, window.cells_z, cell, y, z, gain)
            j += 1

    def summing(weakened: bool) -> Any:
        """The second pass, without a branch, for a layer that weakens or for one that does not."""

        @wp.func(name="sum_weakened" if weakened else "sum_sound")
        def sum_patches(
            context: struct.Context,
            slab: struct.Slab,
            fields: struct.Fields,
            base: wp.int32,
            begin: wp.int32,
            end: wp.int32,
        ):
            """Sum tractions and their slopes over the touches of the patches begin ≤ j < end."""
            surface, touches = context.surface, context.touches
            law, window, pose = slab.law, slab.window, slab.pose
            axial, right, up = real(0.0), real(0.0), real(0.0)
            roll, pitch, yaw = real(0.0), real(0.0), real(0.0)
            aa, ac, as_ = real(0.0), real(0.0), real(0.0)
            cc, cs, ss = real(0.0), real(0.0), real(0.0)
            lc, ls = real(0.0), real(0.0)
            lcc, lcs, lss = real(0.0), real(0.0), real(0.0)
            llcc, llcs, llss = real(0.0), real(0.0), real(0.0)
            j = begin + use.lanes.lane()
            while j < end:
                ring = ring_of(surface, pose, j)
                cosine, sine = read(surface.cosine, j), read(surface.sine, j)
                patch = patch_at(pose, ring, cosine, sine)
                face = use.interaction.face_of(ring, patch, read(touches.shift, base + j))
                left = one
                if wp.static(weakened):
                    cell = read(touches.cell, base + j)
                    y, z = read(touches.y, base + j), read(touches.z, base + j)
                    exposed = use.exposure.gather(fields.exposure, window.cells_z, cell, y, z)
                    left = use.interaction.remaining(law, exposed)
                area = left * read(touches.area, base + j)
                stress = use.interaction.normal_stress(law, face.closing, ring.radius)
                slope = left * read(touches.slope, base + j) * stress
                if wp.static(variant.rate_dependent or variant.free_surface):
                    slope += area * use.interaction.stress_slope(law, face.closing)
                # Traction = stress × (−n + η t), t against the sliding velocity.
                f_axial, f_outward, f_around = -face.axial, -face.outward, -face.around
                if wp.static(variant.rubs):
                    s_axial = patch.velocity_axial - face.closing * face.axial
                    s_outward = patch.velocity_outward - face.closing * face.outward
                    s_around = patch.velocity_around - face.closing * face.around
                    sliding = wp.sqrt(s_axial * s_axial + s_outward * s_outward + s_around * s_around)
                    rubbing = use.interaction.friction_per_speed(law, sliding, pose.speed)
                    f_axial -= rubbing * s_axial
                    f_outward -= rubbing * s_outward
                    f_around -= rubbing * s_around
                force = area * stress
                p_right = f_outward * cosine - f_around * sine
                p_up = f_outward * sine + f_around * cosine
                axial += force * f_axial
                right += force * p_right
                up += force * p_up
                roll += force * face.radius * f_around
                pitch += force * (face.radius * f_axial * sine - face.station * p_up)
                yaw += force * (face.station * p_right - face.radius * f_axial * cosine)
                # Normals are n = (a, r cos, r sin), and arm × n = l (0, −sin, cos).
                lever = ring.station * ring.normal_radial - ring.radius * ring.normal_axial
                a, turn = slope * ring.normal_axial, slope * lever
                nc, ns = ring.normal_radial * cosine, ring.normal_radial * sine
                kc, ks = lever * cosine, lever * sine
                aa += a * ring.normal_axial
                ac += a * nc
                as_ += a * ns
                cc += slope * nc * nc
                cs += slope * nc * ns
                ss += slope * ns * ns
                lc += a * kc
                ls += a * ks
                lcc += turn * nc * cosine
                lcs += turn * nc * sine
                lss += turn * ns * sine
                llcc += turn * kc * cosine
                llcs += turn * kc * sine
                llss += turn * ks * sine
                j += use.lanes.count()
            sums = struct.Sums()
            sums.force = vec3(axial, right, up)
            sums.moment = vec3(roll, pitch, yaw)
            sums.aa = aa
            sums.ar = vec2(ac, as_)
            sums.rr = vec3(cc, cs, ss)
            sums.al = vec2(lc, ls)
            sums.rl = vec3(lcc, lcs, lss)
            sums.ll = vec3(llcc, llcs, llss)
            return sums

        return sum_patches

    sum_patches, sum_sound = summing(variant.degrades), summing(False)
    mixed = variant.layered and variant.degrades  # layers that weaken beside layers that do not

    @wp.func
    def weakens(window: struct.Window):
        """Whether a plate, or this layer of a target, weakens."""
        kept = wp.static(variant.degrades)
        if wp.static(mixed):
            kept = window.weakens
        return kept

    @wp.func
    def clear_sums(context: struct.Context):
        """Begin the sums of all layers at zero."""
        touches, first = context.touches, use.core_surface.rings_before(context.surface, context.slot)
        for index in range(first, first + context.surface.rings):
            touches.total_area[index] = zero
            touches.sums[index] = struct.Sums()

    @wp.func
    def keep_sums(touches: struct.Touches, index: wp.int32, sums: struct.Sums):
        """Add a ring's sums of the second pass to those of all layers."""
        touches.total_area[index] = touches.total_area[index] + touches.ring_area[index]
        touches.sums[index] = joined(touches.sums[index], sums)

    @wp.func
    def summed(
        context: struct.Context,
        slab: struct.Slab,
        fields: struct.Fields,
        base: wp.int32,
        first: wp.int32,
        last: wp.int32,
    ):
        """The second pass over the rings from `first` to `last`, in a layer of either kind."""
        begin, end = first * context.surface.around, (last + 1) * context.surface.around
        if wp.static(mixed):
            if not slab.window.weakens:
                return sum_sound(context, slab, fields, base, begin, end)
        return sum_patches(context, slab, fields, base, begin, end)

    @wp.func
    def load_of(sums: struct.Sums):
        """The load of the touching patches. Its damping is half of the slope of the traction. So the step is of second
        order where the stress depends on the rate, and stable where a wall lies on the steep ramp of the contact."""
        load = struct.Load()
        load.touching = True
        load.force = sums.force
        load.moment = sums.moment
        load.damped = sums.aa + sums.rr[0] + sums.rr[2] > zero
        load.damping_vv = half * damping_vv(sums)
        load.damping_vw = half * damping_vw(sums)
        load.damping_ww = half * damping_ww(sums)
        return load

    @wp.func
    def load_on(context: struct.Context, slab: struct.Slab):
        """The load of one step by one thread."""
        surface, fields, touches = context.surface, context.fields, context.touches
        plate, window, footprint = slab.plate, slab.window, slab.footprint
        load = struct.Load()
        begin, end = footprint.first_closing * surface.around, (footprint.last_closing + 1) * surface.around
        base = (
            use.core_surface.patches_before(surface, context.slot) - begin
        )  # the touches of a step then stay in the fastest cache
        rings = use.core_surface.rings_before(surface, context.slot)
        find_touches(context, slab, base, begin, end)
        first, last = int(surface.rings), int(-1)  # of the rings that touch
        for index in range(footprint.first_ring, footprint.last_ring + 1):
            area = zero
            if index >= footprint.first_closing and index <= footprint.last_closing:
                area = meet(plate, touches, base + index * surface.around, surface.around)
            touches.ring_area[rings + index] = area
            if area > zero:
                first, last = wp.min(first, index), index
        if last >= 0:
            if wp.static(variant.degrades):
                if weakens(window):
                    # After all rings are found: a CPU has to wait before it reads single values that it has just stored
                    # as vectors.
                    for index in range(first, last + 1):
                        if touches.ring_area[rings + index] > zero:
                            expose(context, window, base + index * surface.around)
                    use.exposure.spread(plate, fields, window, footprint.box)
            sums = struct.Sums()
            if wp.static(variant.bends):
                for index in range(first, last + 1):
                    if touches.ring_area[rings + index] > zero:
                        part = summed(context, slab, fields, base, index, index)
                        keep_sums(touches, rings + index, part)
                        sums = joined(sums, part)
            else:
                sums = summed(context, slab, fields, base, first, last)
            load = load_of(sums)
            if wp.static(variant.degrades):
                if weakens(window):
                    use.exposure.settle(plate, fields, window, footprint.box)
        return load

    fields_of_slot, open_window = use.exposure.fields_of_slot, use.exposure.open_window
    return SimpleNamespace(**locals())
