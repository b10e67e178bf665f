"""The load of one step in the block layout: the lanes of a block share out the patches (kernels/lanes.py).

Lane k takes every 32nd patch, from the k-th on, of one list: the patches of all rings that may close in.

The passes, the law and the filter are those of the simple layout (kernels/contact.py, kernels/exposure.py). Different
are the place of the window, and how exposure is added to it: as whole numbers, because their sum does not depend on the
order of the lanes. So an outcome has the same bits in every run. The front window, that of the plate or of the laminate
that it begins, is in the block's shared memory. The windows of layers behind it are in global memory: a core arrives
turned, so they are some 130 nodes wide, and shared memory would not hold them. Nor would it hold several planes: where
any layer is deep, all windows are in global memory.

Where the barriers stand, and what would go wrong without each of them (E is the exposure, G the exposure gained):

1. After the deposits: a lane converts nodes of G that all lanes add to.
2. After the conversion: the filter reads nodes of G that other lanes have converted.
3. Between the filter's directions, in `exposure.spread`: the second one reads what other lanes have filtered, and
   overwrites G, which they read in the first one. Likewise before what spreads over planes overwrites the filtered.
4. Before the second pass: a patch reads nodes of E that other lanes have raised to mid-step.
5. After the second pass: `settle` raises nodes of E that other lanes read as they are at mid-step.
6. After `settle`: the next step adds to nodes of G that other lanes clear.
7. After the window is cleared (`open_window`), as after 6.

All lanes write what a slot knows of the layers (`Stack`, `Passage`) and of earlier hits (`Earlier`, `Channels`), and
they write the same. So a lane reads what itself has written, and a barrier stands only before a write, for lanes that
still read what it replaces:

8. Before a window opens (kernels/layers.py): other lanes find out whether it is open.
9. Before a layer's footprint is kept, there: other lanes read the last one, and whether the core was near the layer.
10. Before a core leaves a layer (kernels/passage.py): other lanes read whether it has left, and whether it has touched.
11. Before the box of a channel widens (kernels/channel.py): other lanes read it, and the last section that was drawn on
    the plane has to be there, as this one may be the share of other lanes.
12. Before a section is kept, there: other lanes compare it with the next one.
13. After each step of `recall` (kernels/earlier.py): the next one, or the march, reads what other lanes have written.

Butterflies stand between the passes and 5, between the steps, and between what 9, 11 and 12 separate. They make lanes
wait, but order no memory: hence these barriers. The shots of a burst are launches of their own. Touches need no
barrier: a patch belongs to the same lane in every loop. Nor does `settle` need one before it for G: it goes over the
same nodes, in the same lanes, as the second direction of the filter. All conditions around barriers hold for all lanes
alike, since they follow from sums over the lanes, from the state, or from what all lanes write alike.
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
    """Device functions of a step's load in the block layout for one variant, in float32."""
    real = variant.real
    zero, half = real(0.0), real(0.5)
    use = variant.use(
        contact, core_surface, damping, exposure, fixed_point, footprint, interaction, lanes, plate_grid, rigid_body
    )
    Surface, Pose, Plate = use.core_surface.Surface, use.core_surface.Pose, use.plate_grid.Plate
    Window = use.plate_grid.Window
    Law, Load, Slopes = use.interaction.Law, use.rigid_body.Load, use.damping.Slopes
    Footprint = use.footprint.Footprint
    Fields, Touches = use.exposure.Fields, use.contact.Touches
    read, part_of, read_index = memory.build(real).read, memory.build(real).part_of, memory.build(wp.int32).read

    @wp.func
    def in_front(fields: Fields):
        """The fields of a slot that has layers, with exposure and gain of the front window in shared memory."""
        own = fields
        if wp.static(variant.degrades):
            own.exposure = use.lanes.own_exposure(fields.exposure, 0)
            own.gain = use.lanes.own_gain(fields.gain, 0)
        return own

    @wp.func
    def own_fields(fields: Fields, slot: wp.int32):
        """The fields of a block alone: those of its slot, and of a single plate in shared memory."""
        own = fields
        if wp.static(variant.layered or variant.deep):
            own = use.exposure.own_fields(fields, slot)
        else:
            if wp.static(variant.degrades):
                own.exposure = use.lanes.own_exposure(fields.exposure, slot * fields.nodes)
                own.gain = use.lanes.own_gain(fields.gain, slot * fields.nodes)
                own.filtered = part_of(fields.filtered, slot * fields.nodes, fields.nodes)
            if wp.static(variant.burst):
                own.channel = part_of(fields.channel, slot * fields.channel_nodes, fields.channel_nodes)
        return own

    @wp.func
    def fields_of(fields: Fields, first: wp.int32):
        """The fields of a window that begins at a node of its slot; the front window is the first."""
        own = fields
        if wp.static(variant.layered and not variant.deep):
            if first == 0:
                own = in_front(fields)
        return own

    @wp.func
    def open_window(
        plate: Plate, thickness: real, fields: Fields, layer: wp.int32, hit_y: wp.float64, hit_z: wp.float64
    ):
        """The window of a layer about a hit, on an untouched plate; `fields` are the block's own."""
        window = use.exposure.open_window(plate, thickness, fields_of(fields, fields.first[layer]), layer, hit_y, hit_z)
        if wp.static(variant.degrades):
            use.lanes.barrier()
        return window

    @wp.func
    def expose(
        fields: Fields, window: Window, touches: Touches, base: wp.int32, begin: wp.int32, end: wp.int32, units: real
    ):
        """Add the exposure of this lane's patches, of those with begin ≤ j < end, to the plate."""
        j = begin + use.lanes.lane()
        while j < end:
            gain = read(touches.gain, base + j)
            if gain > zero:
                cell = read_index(touches.cell, base + j)
                y, z = read(touches.y, base + j), read(touches.z, base + j)
                if wp.static(variant.deep):
                    ahead = read(touches.x, base + j) * gain
                    if ahead > zero:
                        next = cell + window.nodes
                        use.fixed_point.scatter(fields.gain, window.cells_z, next, y, z, ahead * units)
                    gain -= ahead
                use.fixed_point.scatter(fields.gain, window.cells_z, cell, y, z, gain * units)
            j += use.lanes.count()

    @wp.func
    def total_slopes(slopes: Slopes):
        """Sum over the lanes."""
        total = Slopes()
        total.aa = use.lanes.total(slopes.aa)
        total.ar = use.lanes.total_pair(slopes.ar)
        total.rr = use.lanes.total_triple(slopes.rr)
        total.al = use.lanes.total_pair(slopes.al)
        total.rl = use.lanes.total_triple(slopes.rl)
        total.ll = use.lanes.total_triple(slopes.ll)
        return total

    @wp.func
    def load_in(
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
        """`load_on` where the fields of the window are known to be in shared or in global memory."""
        load = Load()
        box = found.box
        begin, end = found.first_closing * surface.around, (found.last_closing + 1) * surface.around
        base = use.core_surface.patches_before(surface, slot) - begin
        use.contact.find_touches(surface, plate, law, fields, window, touches, pose, base, begin, end, dt)
        if wp.static(variant.burst):
            if window.pierced:
                use.contact.spare(fields, window, touches, base + begin, end - begin)
        load.touching = use.lanes.any_of(use.contact.meet(plate, touches, base + begin, end - begin) > zero)
        if load.touching:
            if wp.static(variant.degrades):
                if use.contact.weakens(window):
                    coarsest = zero
                    for index in range(found.first_closing, found.last_closing + 1):
                        coarsest = wp.max(coarsest, read(surface.area, index))
                    units = use.fixed_point.units(law, window, coarsest, wp.length(pose.velocity), dt)
                    box = use.contact.gained_box(touches, found.box, base + begin, end - begin)
                    if box.y_high > box.y_low:
                        expose(fields, window, touches, base, begin, end, units)
                        use.lanes.barrier()
                        use.fixed_point.measure(fields.gain, window, box, units)
                        use.lanes.barrier()
                        use.exposure.spread(plate, fields, window, box)
                        use.lanes.barrier()
            sums = use.contact.summed(
                surface, law, fields, window, touches, pose, base, found.first_closing, found.last_closing
            )
            load.force = use.lanes.total_triple(sums.force)
            load.moment = use.lanes.total_triple(sums.moment)
            slopes = total_slopes(sums.slopes)
            load.damped = slopes.aa + slopes.rr[0] + slopes.rr[2] > zero
            load.damping_vv = half * use.damping.damping_vv(slopes)
            load.damping_vw = half * use.damping.damping_vw(slopes)
            load.damping_ww = half * use.damping.damping_ww(slopes)
            if wp.static(variant.degrades):
                if use.contact.weakens(window):
                    if box.y_high > box.y_low:
                        use.lanes.barrier()
                        use.exposure.settle(plate, fields, window, box)
                        use.lanes.barrier()
        return load

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
        if wp.static(variant.layered and not variant.deep):  # two calls, so that none goes through generic addresses
            if window.first > 0:
                return load_in(surface, plate, law, fields, window, touches, slot, found, pose, dt)
            return load_in(surface, plate, law, in_front(fields), window, touches, slot, found, pose, dt)
        return load_in(surface, plate, law, fields, window, touches, slot, found, pose, dt)

    return SimpleNamespace(**locals())
