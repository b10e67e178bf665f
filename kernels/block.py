"""The load of one step in the block layout: the lanes of a block share out the patches (kernels/lanes.py).

Lane k takes every 32nd patch, from the k-th on, of one list: the patches of all rings that may close in.

The passes, the law and the filter are those of the simple layout (kernels/contact.py, kernels/exposure.py). Different
are the place of the window, in the block's shared memory, and how exposure is added to it: as whole numbers, because
their sum does not depend on the order of the lanes. So an outcome has the same bits in every run.

Where the barriers stand, and what would go wrong without each of them (E is the exposure, G the exposure gained):

1. After the deposits: a lane converts nodes of G that all lanes add to.
2. After the conversion: the filter reads nodes of G that other lanes have converted.
3. Between the filter's directions, in `exposure.spread`: the second one reads what other lanes have filtered, and
   overwrites G, which they read in the first one.
4. Before the second pass: a patch reads nodes of E that other lanes have raised to mid-step.
5. After the second pass: `settle` raises nodes of E that other lanes read as they are at mid-step.
6. After `settle`: the next step adds to nodes of G that other lanes clear.
7. After the window is cleared (`open_window`), as after 6.

Butterflies stand between the passes and 5, and between the steps. They make lanes wait, but order no memory: hence 5, 6
and 7. Touches need no barrier: a patch belongs to the same lane in every loop. Nor does `settle` need one before it for
G: it goes over the same nodes, in the same lanes, as the second direction of the filter. All conditions around barriers
hold for all lanes alike, since they follow from sums over the lanes or from the state.
"""

from functools import cache
from types import SimpleNamespace

import warp as wp

from . import (
    contact,
    core_surface,
    damping,
    exposure,
    fixed_point,
    footprint,
    interaction,
    lanes,
    memory,
    plate_grid,
    rigid_body,
)
from .variant import Variant


@cache
def build(variant: Variant) -> SimpleNamespace:
    """Device functions of a step's load in the block layout for one variant: a single plate, float32."""
    real = variant.real
    zero, half = real(0.0), real(0.5)
    surfaces, grid, laws, motion = (part.build(variant) for part in (core_surface, plate_grid, interaction, rigid_body))
    memories, resistances, touching, block = (part.build(variant) for part in (exposure, damping, contact, lanes))
    whole = fixed_point.build(variant)
    Surface, Pose, Plate, Window = surfaces.Surface, surfaces.Pose, grid.Plate, grid.Window
    Law, Load, Slopes, Footprint = laws.Law, motion.Load, resistances.Slopes, footprint.build(variant).Footprint
    Fields, Touches = memories.Fields, touching.Touches
    reals, integers = memory.build(real), memory.build(wp.int32)
    read, read_index = reals.read, integers.read

    @wp.func
    def own_fields(fields: Fields, slot: wp.int32):
        """The fields of a block alone: exposure and gain in shared memory, the filter's room in that of its slot."""
        nodes = fields.cells_y * fields.cells_z
        own = fields
        if wp.static(variant.degrades):
            own.exposure = block.own_exposure(fields.exposure, slot, nodes)
            own.gain = block.own_gain(fields.gain, slot, nodes)
            own.filtered = block.own_room(fields.filtered, slot, nodes)
        return own

    @wp.func
    def open_window(
        plate: Plate, thickness: real, fields: Fields, slot: wp.int32, hit_y: wp.float64, hit_z: wp.float64
    ):
        """A block's window about a hit, on an untouched plate; `fields` are the block's own."""
        window = touching.open_window(plate, thickness, fields, 0, hit_y, hit_z)
        if wp.static(variant.degrades):
            block.barrier()
        return window

    @wp.func
    def expose(fields: Fields, touches: Touches, base: wp.int32, begin: wp.int32, end: wp.int32, units: real):
        """Add the exposure of this lane's patches, of those with begin ≤ j < end, to the plate."""
        j = begin + block.lane()
        while j < end:
            gain = read(touches.gain, base + j)
            if gain > zero:
                cell = read_index(touches.cell, base + j)
                y, z = read(touches.y, base + j), read(touches.z, base + j)
                whole.scatter(fields.gain, fields.cells_z, cell, y, z, gain * units)
            j += block.count()

    @wp.func
    def total_slopes(slopes: Slopes):
        """Sum over the lanes."""
        total = Slopes()
        total.aa = block.total(slopes.aa)
        total.ar = block.total_pair(slopes.ar)
        total.rr = block.total_triple(slopes.rr)
        total.al = block.total_pair(slopes.al)
        total.rl = block.total_triple(slopes.rl)
        total.ll = block.total_triple(slopes.ll)
        return total

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
        """As in the simple layout (kernels/contact.py), by all lanes of a block."""
        load = Load()
        begin, end = found.first_closing * surface.around, (found.last_closing + 1) * surface.around
        base = slot * surface.rings * surface.around - begin
        touching.find_touches(surface, plate, law, fields, window, touches, pose, base, begin, end, dt)
        load.touching = block.any_of(touching.meet(plate, touches, base + begin, end - begin) > zero)
        if load.touching:
            if wp.static(variant.degrades):
                coarsest = zero
                for index in range(found.first_closing, found.last_closing + 1):
                    coarsest = wp.max(coarsest, read(surface.area, index))
                units = whole.units(law, window, coarsest, wp.length(pose.velocity), dt)
                expose(fields, touches, base, begin, end, units)
                block.barrier()
                whole.measure(fields.gain, window, found.box, units)
                block.barrier()
                memories.spread(plate, fields, window, found.box)
                block.barrier()
            sums = touching.sum_patches(surface, law, fields, window, touches, pose, base, begin, end)
            load.force = block.total_triple(sums.force)
            load.moment = block.total_triple(sums.moment)
            slopes = total_slopes(sums.slopes)
            load.damped = slopes.aa + slopes.rr[0] + slopes.rr[2] > zero
            load.damping_vv = half * resistances.damping_vv(slopes)
            load.damping_vw = half * resistances.damping_vw(slopes)
            load.damping_ww = half * resistances.damping_ww(slopes)
            if wp.static(variant.degrades):
                block.barrier()
                memories.settle(plate, fields, window, found.box)
                block.barrier()
        return load

    return SimpleNamespace(
        Fields=Fields, own_fields=own_fields, open_window=open_window, load_on=load_on, lane=block.lane
    )
