"""The load of one step in the block layout: the lanes of a block share out the patches (kernels/lanes.py).

Lane k takes every 32nd patch, from the k-th on, of one list: the patches of all rings that may close in.

The passes, the law and the filter are those of the simple layout (kernels/contact.py, kernels/exposure.py). Two things
differ: where a window lies, and that exposure is added to it as whole numbers, because their sum does not depend on the
order of the lanes. So an outcome has the same bits in every run. The front window, of the plate, is
in the block's shared memory. The windows of layers behind it are in global memory: a core arrives turned, so they are
some 130 nodes wide, and shared memory would not hold them.

The barriers, and the error that each of them prevents (E is the exposure, G the exposure gained):

1. After the deposits: a lane converts nodes of G that all lanes add to.
2. After the conversion: the filter reads nodes of G that other lanes have converted.
3. Between the filter's directions, in `exposure.spread`: the second direction reads what other lanes have filtered, and
   overwrites G, which they read in the first one.
4. Before the second pass: a patch reads nodes of E that other lanes have raised to mid-step.
5. After the second pass: `settle` raises nodes of E that other lanes read as they are at mid-step.
6. After `settle`: the next step adds to nodes of G that other lanes clear.
7. After the window is cleared (`open_window`), as after 6.

All lanes write the slot's state of the layers (`Stack`, `Passage`), and all write the same values. A lane therefore
reads its own writes, and barriers stand only before a write, for lanes that still read the old value:

8. Before a window opens (kernels/layers.py): other lanes check whether it is open.
9. Before a layer's footprint is kept, there: other lanes read the last one, and whether the core was near the layer.
10. Before a core leaves a layer (kernels/layers.py): other lanes read whether it has left, and whether it has touched.

Butterflies stand between the passes and 5, between the steps, and between the places that 9 separates. They make lanes
wait, but order no memory: hence these barriers. Touches need no barrier: a patch belongs to the same lane in every
loop. `settle` needs none before it for G: it goes over the same nodes, in the same lanes, as the second direction of
the filter. All conditions around barriers hold for all lanes alike, because they follow from sums over the lanes, from
the state, or from values that all lanes write alike.
"""

from functools import cache
from types import SimpleNamespace

import warp as wp

from . import contact, core_surface, exposure, lanes, structs
from .memory import part_of, read
from .variant import Variant


@cache
def build(variant: Variant) -> SimpleNamespace:
    """Device functions of a step's load in the block layout for one variant, in float32."""
    struct, real = structs.build(variant), variant.real
    zero = real(0.0)
    use = variant.use(contact, core_surface, exposure, lanes)

    @wp.func
    def in_front(fields: struct.Fields):
        """The fields of a slot that has layers, with exposure and gain of the front window in shared memory."""
        front = fields
        if wp.static(variant.degrades):
            front.exposure = use.lanes.shared_exposure(fields.exposure, 0)
            front.gain = use.lanes.shared_gain(fields.gain, 0)
        return front

    @wp.func
    def fields_of_slot(fields: struct.Fields, slot: wp.int32):
        """The fields of one block: those of its slot, and of a single plate in shared memory."""
        part = fields
        if wp.static(variant.layered):
            part = use.exposure.fields_of_slot(fields, slot)
        else:
            if wp.static(variant.degrades):
                part.exposure = use.lanes.shared_exposure(fields.exposure, slot * fields.nodes)
                part.gain = use.lanes.shared_gain(fields.gain, slot * fields.nodes)
                part.filtered = part_of(fields.filtered, slot * fields.nodes, fields.nodes)
        return part

    @wp.func
    def fields_of_window(fields: struct.Fields, first: wp.int32):
        """The fields of a window that begins at node `first` of its slot; the front window is the first."""
        part = fields
        if wp.static(variant.layered):
            if first == 0:
                part = in_front(fields)
        return part

    @wp.func
    def open_window(plate: struct.Plate, thickness: real, fields: struct.Fields, layer: wp.int32, hit: wp.vec2d):
        """The window of a layer about a hit, on an untouched plate; `fields` are those of the block."""
        part = fields_of_window(fields, fields.first[layer])
        window = use.exposure.open_window(plate, thickness, part, layer, hit)
        if wp.static(variant.degrades):
            use.lanes.barrier()
        return window

    @wp.func
    def expose(
        touches: struct.Touches,
        fields: struct.Fields,
        window: struct.Window,
        base: wp.int32,
        begin: wp.int32,
        end: wp.int32,
        units: real,
    ):
        """Add the exposure of this lane's patches among begin ≤ j < end to the plate."""
        j = begin + use.lanes.lane()
        while j < end:
            gain = read(touches.gain, base + j)
            if gain > zero:
                cell = read(touches.cell, base + j)
                y, z = read(touches.y, base + j), read(touches.z, base + j)
                use.exposure.scatter_units(fields.gain, window.cells_z, cell, y, z, gain * units)
            j += use.lanes.count()

    @wp.func
    def total_of(sums: struct.Sums):
        """Sum over the lanes."""
        total = struct.Sums()
        total.force = use.lanes.total_triple(sums.force)
        total.moment = use.lanes.total_triple(sums.moment)
        total.aa = use.lanes.total(sums.aa)
        total.ar = use.lanes.total_pair(sums.ar)
        total.rr = use.lanes.total_triple(sums.rr)
        total.al = use.lanes.total_pair(sums.al)
        total.rl = use.lanes.total_triple(sums.rl)
        total.ll = use.lanes.total_triple(sums.ll)
        return total

    @wp.func
    def load_in(context: struct.Context, slab: struct.Slab, fields: struct.Fields):
        """`load_on` where the fields of the window are known to be in shared or in global memory."""
        surface, touches = context.surface, context.touches
        plate, law, window, footprint = slab.plate, slab.law, slab.window, slab.footprint
        load = struct.Load()
        first, last = footprint.first_closing, footprint.last_closing
        begin, end = first * surface.around, (last + 1) * surface.around
        base = use.core_surface.patches_before(surface, context.slot) - begin
        use.contact.find_touches(context, slab, base, begin, end)
        if use.lanes.any_of(use.contact.meet(plate, touches, base + begin, end - begin) > zero):
            if wp.static(variant.degrades):
                if use.contact.weakens(window):
                    coarsest = zero
                    for index in range(first, last + 1):
                        coarsest = wp.max(coarsest, use.core_surface.ring_at(surface, slab.pose, index).area)
                    units = use.exposure.units(law, window, coarsest, wp.length(slab.pose.velocity), slab.dt)
                    expose(touches, fields, window, base, begin, end, units)
                    use.lanes.barrier()
                    use.exposure.measure(fields.gain, window, footprint.box, units)
                    use.lanes.barrier()
                    use.exposure.spread(plate, fields, window, footprint.box)
                    use.lanes.barrier()
            sums = use.contact.summed(context, slab, fields, base, first, last)
            load = use.contact.load_of(total_of(sums))
            if wp.static(variant.degrades):
                if use.contact.weakens(window):
                    use.lanes.barrier()
                    use.exposure.settle(plate, fields, window, footprint.box)
                    use.lanes.barrier()
        return load

    @wp.func
    def load_on(context: struct.Context, slab: struct.Slab):
        """The load of one step by all lanes of a block."""
        if wp.static(variant.layered):  # two calls, so that none goes through generic addresses
            if slab.window.first == 0:
                return load_in(context, slab, in_front(context.fields))
        return load_in(context, slab, context.fields)

    return SimpleNamespace(**locals())
