"""How much of a patch presses on a plate with holes: the material ahead of it, along its normal (docs/model.md §4.9).

A table has the length of this material, the cover, at the nodes of a period, in directions in the plane of the plate
and for radii of the core. A length is negative where its node, or a neighbour, has no material: there the tile decides
how much of a patch is on material.
"""

from functools import cache
from types import SimpleNamespace

import warp as wp

from . import constants, core_surface, interaction, lanes, structs
from .memory import read, write
from .variant import Variant


@cache
def build(variant: Variant) -> SimpleNamespace:
    """Device functions of the cover for one variant."""
    struct = structs.build(variant)
    real, reals = variant.real, variant.reals
    zero, half, one, two = real(0.0), real(0.5), real(1.0), real(2.0)
    three = one + two
    use = variant.use(core_surface, lanes)
    least, tiny = real(constants.LEAST_RADIAL.value), real(constants.TINY.value)

    @wp.func
    def direction_of(plate: struct.Plate, pose: struct.Pose, ring: struct.Ring, cosine: real, sine: real):
        """Place of a patch's normal among the directions of the table, from along z on towards y: an eighth of a turn
        is as many cells along one side as along the other. A normal across the plate has the direction outwards."""
        outwards = wp.max(ring.normal_radial, least)
        y = outwards * (cosine * pose.right[1] + sine * pose.up[1]) + ring.normal_axial * pose.axis[1]
        z = outwards * (cosine * pose.right[2] + sine * pose.up[2]) + ring.normal_axial * pose.axis[2]
        y *= plate.cover_per_y
        z *= plate.cover_per_z
        steep = wp.abs(y) > wp.abs(z)
        large, small = wp.where(steep, y, z), wp.where(steep, z, y)
        ratio = small / wp.where(wp.abs(large) < tiny, tiny, large)
        quarter = wp.where(
            steep, wp.where(y > zero, one, three) - half * ratio, wp.where(z > zero, zero, two) + half * ratio
        )
        return quarter * real(plate.directions // 4)

    @wp.func
    def node_before(place: real, count: wp.int32):
        """The node before a place in nodes of a period, and the share of the way to the next one."""
        within = place - real(count) * wp.floor(place / real(count))
        node = wp.min(wp.int32(within), count - 1)
        return node, within - real(node)

    @wp.func
    def class_of(plate: struct.Plate, surface: struct.Surface, ring: struct.Ring):
        """The class of a ring's radius in the table."""
        share = ring.radius / surface.max_radius
        return wp.min(wp.int32(share * real(plate.radii)), plate.radii - 1)

    @wp.func
    def find_covers(context: struct.Context, slab: struct.Slab, base: wp.int32, begin: wp.int32, end: wp.int32):
        """Fill in where the patches begin ≤ j < end, from index `base` + begin on, are in the table. A loop of its own:
        a compiler vectorises none that writes more lists than `contact.find_touches` does."""
        surface, touches, plate, window, pose = context.surface, context.touches, slab.plate, slab.window, slab.pose
        j = begin + use.lanes.lane()
        while j < end:
            ring = use.core_surface.ring_of(surface, pose, j)
            cosine, sine = read(surface.cosine, j), read(surface.sine, j)
            patch = use.core_surface.patch_at(pose, ring, cosine, sine)
            across = (real(window.row) + window.tile_y + patch.y * window.per_row) * plate.cover_per_row
            along = (real(window.column) + window.tile_z + patch.z * window.per_column) * plate.cover_per_column
            row, y = node_before(across, plate.cover_y)
            column, z = node_before(along, plate.cover_z)
            turn, part = node_before(direction_of(plate, pose, ring, cosine, sine), plate.directions)
            layer = class_of(plate, surface, ring) * (plate.directions + 1) + turn
            write(touches.cover, base + j, (layer * (plate.cover_y + 1) + row) * (plate.cover_z + 1) + column)
            write(touches.cover_y, base + j, y)
            write(touches.cover_z, base + j, z)
            write(touches.cover_turn, base + j, part)
            write(touches.cover_decay, base + j, -slab.law.cover / ring.radius)
            j += use.lanes.count()

    # Native, because a compiler reads several cells at once only if the pointers do not alias.
    @wp.func_native(
        lanes.share(variant)
        + interaction.EXPONENTIAL
        + """
    assert(start >= 0 && start + count <= area.shape[0]);
    const auto scale = [=](auto* __restrict__ area, auto* __restrict__ slope, auto* __restrict__ gain,
                           const int* __restrict__ at, const auto* __restrict__ tile, const int* __restrict__ first,
                           const auto* __restrict__ y, const auto* __restrict__ z, const auto* __restrict__ turn,
                           const auto* __restrict__ decay, const auto* __restrict__ cover, int cells, int nodes) {
        for (int j = lane; j < count; j += lanes) {
            assert(at[j] >= 0 && at[j] < cells);
            assert(first[j] >= 0 && first[j] + direction + row + 1 < nodes);
            decltype(0 * area[0]) length = 0, pushed = 0;
            const auto add = [&](int k, auto weight) {
                const auto one = cover[first[j] + k], next = cover[first[j] + k + 1], far = weight * z[j];
                length += (weight - far) * (one < 0 ? -one : one) + far * (next < 0 ? -next : next);
                pushed += (one > 0 ? weight - far : 0) + (next > 0 ? far : 0);
            };
            const auto both = y[j] * turn[j];
            add(0, 1 - y[j] - turn[j] + both);
            add(row, y[j] - both);
            add(direction, turn[j] - both);
            add(direction + row, both);
            const auto material = tile[at[j]];
            const auto share = (material + (1 - material) * pushed) * (1 - exponential(decay[j] * length));
            area[j] *= share;
            slope[j] *= share;
            gain[j] *= share;
        }
    };
    scale(area.data + start, slope.data + start, gain.data + start, at.data + start, tile.data, first.data + start,
          y.data + start, z.data + start, turn.data + start, decay.data + start, cover.data, tile.shape[0],
          cover.shape[0]);
    """
    )
    def weigh(
        area: reals,
        slope: reals,
        gain: reals,
        at: wp.array(dtype=wp.int32),
        tile: reals,
        first: wp.array(dtype=wp.int32),
        y: reals,
        z: reals,
        turn: reals,
        decay: reals,
        cover: reals,
        row: wp.int32,
        direction: wp.int32,
        start: wp.int32,
        count: wp.int32,
    ):
        """Multiply three lists, from `start` on, by the share that presses; the next row and the next direction are
        `row` and `direction` numbers on."""
        ...

    @wp.func
    def restrict(context: struct.Context, slab: struct.Slab, base: wp.int32, begin: wp.int32, end: wp.int32):
        """Restrict the touches of the patches begin ≤ j < end, from index `base` + begin on, to what presses."""
        touches, plate = context.touches, slab.plate
        find_covers(context, slab, base, begin, end)
        row = plate.cover_z + 1
        weigh(
            touches.area,
            touches.slope,
            touches.gain,
            touches.tile,
            plate.tile,
            touches.cover,
            touches.cover_y,
            touches.cover_z,
            touches.cover_turn,
            touches.cover_decay,
            plate.cover,
            row,
            (plate.cover_y + 1) * row,
            base + begin,
            end - begin,
        )

    # Native, as `weigh` is.
    @wp.func_native(
        lanes.share(variant)
        + """
    assert(start >= 0 && start + count <= area.shape[0]);
    const auto* __restrict__ from = area.data + start;
    decltype(0 * from[0]) total = 0;
    for (int j = lane; j < count; j += lanes) total += from[j];
    return total;
    """
    )
    def sum_of(area: reals, start: wp.int32, count: wp.int32) -> real:
        """Sum of a list, from `start` on."""
        ...

    return SimpleNamespace(**locals())
