"""Earlier hits on the same plate: the exposure that each of them added, and the channel that it left, for later hits
(docs/model.md §8).

Every shot of a burst keeps its own window about its own hit. A later shot reads the windows of the earlier ones
bilinearly at its own nodes. Windows that do not overlap therefore change no bit, and windows about one point add
exactly.
"""

from functools import cache
from types import SimpleNamespace
from typing import Any

import warp as wp

from . import channel, exposure, lanes, structs
from .variant import Variant


@cache
def build(variant: Variant) -> SimpleNamespace:
    """Device functions of earlier hits for one variant."""
    struct, real, reals = structs.build(variant), variant.real, variant.reals
    use, share = variant.use(channel, exposure, lanes), lanes.share(variant)

    def filled_with(value: str) -> Any:
        """A function that sets target[start + j] = `value` for j < count. In `value`, from[j] is source[first + j] and
        into[j] is target[start + j]."""

        # Native, because a compiler vectorises this loop only if the pointers do not alias.
        @wp.func_native(
            f"""{share}
        assert(start >= 0 && start + count <= target.shape[0] && first >= 0 && first + count <= source.shape[0]);
        auto* __restrict__ into = target.data + start;
        const auto* __restrict__ from = source.data + first;
        for (int j = lane; j < count; j += lanes) into[j] = {value};
        """
        )
        def fill(
            target: reals,
            start: wp.int32,
            source: reals,
            first: wp.int32,
            count: wp.int32,
        ): ...

        return fill

    copy, subtract_from = filled_with("from[j]"), filled_with("from[j] - into[j]")

    @wp.func
    def place_of(earlier: struct.Earlier, slot: wp.int32, shot: wp.int32, layer: wp.int32):
        """The place where a slot keeps what a shot leaves in a layer; the order of a shot at its target also does for
        `shot`."""
        place = struct.Place()
        place.order = shot % earlier.count
        place.last = place.order + 1 == earlier.count
        row = slot * earlier.count + place.order
        place.index = row * earlier.layers + layer
        place.window = row * earlier.nodes
        place.channel = row * earlier.channel_nodes + earlier.first[layer]
        place.section = slot * earlier.planes + earlier.first_plane[layer]
        return place

    @wp.func
    def begin(earlier: struct.Earlier, slot: wp.int32, shot: wp.int32):
        """Record that this shot has opened no window yet."""
        first = (slot * earlier.count + shot % earlier.count) * earlier.layers
        for layer in range(earlier.layers):
            earlier.open[first + layer] = False
            earlier.through[first + layer] = False

    @wp.func
    def recall(
        earlier: struct.Earlier,
        fields: struct.Fields,
        plate: struct.Plate,
        window: struct.Window,
        slot: wp.int32,
        shot: wp.int32,
        layer: wp.int32,
        hit: wp.vec2d,
    ):
        """Fill a shot's blank window about a hit [m] with the exposure and the channels of the earlier shots in this
        layer; returns whether a core went through it."""
        place, pierced = place_of(earlier, slot, shot, layer), bool(False)
        row, nodes = place.window + window.first, window.planes * window.nodes
        whole = struct.Box()
        whole.y_high = window.cells_y - 1
        whole.z_high = window.cells_z - 1
        use.channel.begin(earlier, window, place)
        if window.weakens:
            use.exposure.fill(earlier.exposure, row, nodes, real(0.0))
            use.lanes.barrier()
        for order in range(place.order):
            other = place_of(earlier, slot, order, layer)
            if earlier.open[other.index]:
                apart = (hit - earlier.hit[other.index]) / wp.float64(plate.spacing)
                across, along = apart[0], apart[1]
                near_y = wp.abs(across) < wp.float64(window.cells_y)
                near_z = wp.abs(along) < wp.float64(window.cells_z)
                if near_y and near_z:
                    rows, columns = wp.floor(across), wp.floor(along)
                    far_y, far_z = real(across - rows), real(along - columns)
                    if window.weakens:
                        for plane in range(window.planes):
                            use.channel.add_shifted(
                                earlier.exposure,
                                row + plane * window.nodes,
                                earlier.exposure,
                                other.window + window.first + plane * window.nodes,
                                window.cells_y,
                                window.cells_z,
                                whole,
                                wp.int32(rows),
                                wp.int32(columns),
                                far_y,
                                far_z,
                            )
                        use.lanes.barrier()
                    if earlier.through[other.index]:
                        if not pierced:
                            use.channel.clear(fields, window)
                            use.lanes.barrier()
                        pierced = True
                        use.channel.join(
                            earlier, fields, window, other, wp.int32(rows), wp.int32(columns), far_y, far_z
                        )
                        use.lanes.barrier()
        if window.weakens:
            copy(fields.exposure, window.first, earlier.exposure, row, nodes)
        use.lanes.barrier()
        earlier.hit[place.index] = hit
        earlier.open[place.index] = True
        return pierced

    @wp.func
    def keep(earlier: struct.Earlier, fields: struct.Fields, window: struct.Window, slot: wp.int32, shot: wp.int32):
        """Keep the exposure that a shot has added to a layer: that at its end minus that before it. This is exact to
        the rounding of the sum, and never negative."""
        row = (slot * earlier.count + shot % earlier.count) * earlier.nodes + window.first
        nodes = window.planes * window.nodes
        subtract_from(earlier.exposure, row, fields.exposure, window.first, nodes)

    return SimpleNamespace(**locals())
