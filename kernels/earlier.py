"""Earlier hits on the same plate: what each of them added to the exposure, the channel that it left, and what a later
one finds of both (docs/model.md §8).

Every shot of a burst keeps its own window about its own hit. A later one reads the windows of the earlier ones
bilinearly at its own nodes. So windows that do not overlap change no bit, and those about one point add exactly.
"""

from functools import cache
from types import SimpleNamespace

import warp as wp

from . import channel, core_surface, exposure, lanes, plate_grid
from .variant import Variant


@cache
def build(variant: Variant) -> SimpleNamespace:
    """Device functions of earlier hits for one variant."""
    real = variant.real
    use, split = variant.use(channel, core_surface, exposure, lanes, plate_grid), lanes.split(variant)
    Fields, Plate, Window = use.exposure.Fields, use.plate_grid.Plate, use.plate_grid.Window
    Surface, Pose, Channels = use.core_surface.Surface, use.core_surface.Pose, use.channel.Channels

    @wp.struct
    class Earlier:
        """Scratch of all slots: the windows of the `count` shots at a slot's plate, and their places.

        `exposure` has the `nodes` of all layers of every shot, shape [slots × count × nodes]: while a shot is under
        way what it found, then what it added [s]. `y` and `z` are the centres of the windows in the frames of their
        layers [m], `open` says whether a shot has opened its window; shape [slots × count × layers].
        """

        count: wp.int32
        nodes: wp.int32
        layers: wp.int32
        exposure: wp.array(dtype=real)
        y: wp.array(dtype=wp.float64)
        z: wp.array(dtype=wp.float64)
        open: wp.array(dtype=wp.bool)
        channels: Channels

    # Native, because a compiler vectorises these loops only if the pointers do not alias.
    @wp.func_native(
        split("""
    const int row_low = row > 0 ? 0 : -row, row_high = row < 0 ? rows : rows - 1 - row;
    const int low = column > 0 ? 0 : -column, high = column < 0 ? columns : columns - 1 - column;
    const auto far_far = y * z, far_near = y - far_far, near_far = z - far_far, near_near = 1 - y - near_far;
    assert(target >= 0 && target + rows * columns <= field.shape[0]);
    assert(source >= 0 && source + rows * columns <= field.shape[0]);
    for (int i = row_low; i < row_high; ++i) {
        auto* __restrict__ into = field.data + target + i * columns;
        const auto* __restrict__ near = field.data + source + (i + row) * columns + column;
        const auto* __restrict__ far = near + columns;
        for (int j = low; j < high; ++j)
            into[j] += near_near * near[j] + near_far * near[j + 1] + far_near * far[j] + far_far * far[j + 1];
    }
    """)
    )
    def add_shifted(
        field: wp.array(dtype=real),
        target: wp.int32,
        source: wp.int32,
        rows: wp.int32,
        columns: wp.int32,
        row: wp.int32,
        column: wp.int32,
        y: real,
        z: real,
    ):
        """Add the window from index `source` on to that from `target` on. Node (i, j) of the target lies behind node
        (i + row, j + column) of the source by the shares y and z of a cell. The outermost nodes of a window hold
        nothing."""
        ...

    @wp.func_native(
        split("""
    assert(start >= 0 && start + count <= target.shape[0] && first >= 0 && first + count <= source.shape[0]);
    auto* __restrict__ into = target.data + start;
    const auto* __restrict__ from = source.data + first;
    for (int j = 0; j < count; ++j) into[j] = from[j];
    """)
    )
    def copy(
        target: wp.array(dtype=real), start: wp.int32, source: wp.array(dtype=real), first: wp.int32, count: wp.int32
    ):
        """target[start + j] = source[first + j] for j < count."""
        ...

    @wp.func_native(
        split("""
    assert(start >= 0 && start + count <= target.shape[0] && first >= 0 && first + count <= source.shape[0]);
    auto* __restrict__ into = target.data + start;
    const auto* __restrict__ from = source.data + first;
    for (int j = 0; j < count; ++j) into[j] = from[j] - into[j];
    """)
    )
    def subtract_from(
        target: wp.array(dtype=real), start: wp.int32, source: wp.array(dtype=real), first: wp.int32, count: wp.int32
    ):
        """target[start + j] = source[first + j] − target[start + j] for j < count."""
        ...

    @wp.func
    def row_of(earlier: Earlier, window: Window, slot: wp.int32, order: wp.int32):
        """Index of the first node of a shot's window among those of its slot."""
        return (slot * earlier.count + order) * earlier.nodes + window.first

    @wp.func
    def begin(earlier: Earlier, slot: wp.int32, shot: wp.int32):
        """This shot has opened no window yet."""
        first = (slot * earlier.count + shot % earlier.count) * earlier.layers
        for layer in range(earlier.layers):
            earlier.open[first + layer] = False
            earlier.channels.through[first + layer] = False

    @wp.func
    def recall(
        earlier: Earlier,
        fields: Fields,
        plate: Plate,
        window: Window,
        slot: wp.int32,
        layer: wp.int32,
        shot: wp.int32,
        y: wp.float64,
        z: wp.float64,
    ):
        """Fill a shot's blank window about (y, z) [m] with what the earlier shots have left of this layer; whether a
        core went through it."""
        order, pierced = shot % earlier.count, bool(False)
        row = row_of(earlier, window, slot, order)
        nodes = window.planes * window.nodes
        mine = (slot * earlier.count + order) * earlier.layers + layer
        use.channel.begin(earlier.channels, window, slot, layer, shot, mine)
        if window.weakens:
            use.exposure.clear(earlier.exposure, row, nodes)
            use.lanes.barrier()
        for before in range(order):
            other = (slot * earlier.count + before) * earlier.layers + layer
            if earlier.open[other]:
                across = (y - earlier.y[other]) / wp.float64(plate.spacing)
                along = (z - earlier.z[other]) / wp.float64(plate.spacing)
                near_y = wp.abs(across) < wp.float64(window.cells_y)
                near_z = wp.abs(along) < wp.float64(window.cells_z)
                if near_y and near_z:
                    rows, columns = wp.floor(across), wp.floor(along)
                    far_y, far_z = real(across - rows), real(along - columns)
                    if window.weakens:
                        for plane in range(window.planes):
                            add_shifted(
                                earlier.exposure,
                                row + plane * window.nodes,
                                row_of(earlier, window, slot, before) + plane * window.nodes,
                                window.cells_y,
                                window.cells_z,
                                wp.int32(rows),
                                wp.int32(columns),
                                far_y,
                                far_z,
                            )
                        use.lanes.barrier()
                    if earlier.channels.through[other]:
                        if not pierced:
                            use.channel.clear(fields, window)
                            use.lanes.barrier()
                        pierced = True
                        use.channel.join(
                            earlier.channels,
                            fields,
                            window,
                            slot,
                            layer,
                            before,
                            other,
                            wp.int32(rows),
                            wp.int32(columns),
                            far_y,
                            far_z,
                        )
                        use.lanes.barrier()
        if window.weakens:
            copy(fields.exposure, window.first, earlier.exposure, row, nodes)
        use.lanes.barrier()
        earlier.y[mine] = y
        earlier.z[mine] = z
        earlier.open[mine] = True
        return pierced

    @wp.func
    def keep(earlier: Earlier, fields: Fields, window: Window, slot: wp.int32, shot: wp.int32):
        """Keep what a shot has added to a layer: what there is in the end less what it found, which is exact to the
        rounding of the sum, and never negative."""
        row = row_of(earlier, window, slot, shot % earlier.count)
        nodes = window.planes * window.nodes
        subtract_from(earlier.exposure, row, fields.exposure, window.first, nodes)

    @wp.func
    def follow(
        earlier: Earlier, surface: Surface, window: Window, slot: wp.int32, layer: wp.int32, shot: wp.int32, pose: Pose
    ):
        """Take note of where the core of a shot is in a layer."""
        mine = (slot * earlier.count + shot % earlier.count) * earlier.layers + layer
        use.channel.follow(earlier.channels, surface, window, slot, layer, shot, mine, pose)

    @wp.func
    def leave_channel(
        earlier: Earlier,
        surface: Surface,
        window: Window,
        slot: wp.int32,
        layer: wp.int32,
        shot: wp.int32,
    ):
        """Keep the channel of a core that went through a layer."""
        mine = (slot * earlier.count + shot % earlier.count) * earlier.layers + layer
        use.channel.conclude(earlier.channels, surface, window, slot, layer, shot, mine)

    return SimpleNamespace(**locals())
