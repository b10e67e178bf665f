"""The target: its layers, front to back, of which the plate is number 0; and how the window of a layer opens."""

from functools import cache
from types import ModuleType, SimpleNamespace
from typing import Any

import warp as wp

from . import channel, core_surface, earlier, interaction, plate_grid, shots
from .variant import Variant


@cache
def build(variant: Variant, scheme: ModuleType) -> SimpleNamespace:
    """Device functions of the target for one variant, whose windows a scheme opens."""
    real, vec3 = variant.real, variant.vec3
    one = real(1.0)
    use = variant.use(channel, core_surface, earlier, interaction, plate_grid, shots)
    Plate, Window, Law = use.plate_grid.Plate, use.plate_grid.Window, use.interaction.Law
    Shots, Earlier, own = use.shots.Shots, use.earlier.Earlier, use.shots.own
    Surface, Pose = use.core_surface.Surface, use.core_surface.Pose
    Fields, open_blank = scheme.build(variant).Fields, scheme.build(variant).open_window
    fields_of = getattr(scheme.build(variant), "fields_of", None)  # where a window may be in shared memory

    # One plate comes by value, because CUDA does not know where a pointer leads that lies in memory.
    Plates = wp.array(dtype=Plate) if variant.layered or variant.tabled else Plate

    @wp.struct
    class Target:
        """The layers of the target, front to back; arrays of shape [layers]. A table of `plates` has those of several
        targets, one after the other, of which a shot has those from number `first` on.

        `front` is the front face behind that of the target [m]; `offset_y` and `offset_z` are the place of the layer's
        origin in the plane of the plate [m]. These, `thickness` [m] and the members of Law have one value for all shots
        or one per shot: shape [layers, 1] or [layers, shots]. Those layers that a step can touch add their
        `onset_jump`, up to `most_jump`, as if they were one plate. `weakens` says whether the layer keeps a field.
        Layers that touch each other and remember alike are one laminate: a contact in one weakens the others, and they
        share a field. `laminate` is the number of the first of them. `deep` is 1 where the laminate is thicker than the
        depth over which it weakens together, else 0.
        `stretch` is how many times longer a step may be than the shortest, where a core touches nothing but the layer,
        and `slowing` is the share of its speed that a longer step may take. Windows that `slide` follow a core that
        leaves them, where there are several layers.
        `standoffs` are distances behind the rear face of every layer [m], which the point `ahead` of the centre of mass
        passes [m].
        """

        count: wp.int32
        plates: Plates
        first: wp.int32
        weakens: wp.array(dtype=wp.bool)
        laminate: wp.array(dtype=wp.int32)
        by_path: wp.array(dtype=wp.bool)
        standoffs: wp.array(dtype=real)
        ahead: real
        slowing: real
        slide: wp.bool
        front: wp.array2d(dtype=wp.float64)
        thickness: wp.array2d(dtype=wp.float64)
        deep: wp.array2d(dtype=wp.float64)
        offset_y: wp.array2d(dtype=wp.float64)
        offset_z: wp.array2d(dtype=wp.float64)
        a0: wp.array2d(dtype=real)
        a1: wp.array2d(dtype=real)
        a2: wp.array2d(dtype=real)
        friction: wp.array2d(dtype=real)
        degradation: wp.array2d(dtype=real)
        decay_rate: wp.array2d(dtype=real)
        onset_jump: wp.array2d(dtype=real)
        most_jump: wp.array2d(dtype=real)
        stretch: wp.array2d(dtype=real)

    @wp.func
    def own_of(values: wp.array2d(dtype=Any), layer: wp.int32, shot: wp.int32):
        """The value of one layer and shot."""
        return values[layer, wp.min(shot, values.shape[1] - 1)]

    @wp.func
    def of_shot(target: Target, shots: Shots, shot: wp.int32):
        """The target with the plates of a shot."""
        found = target
        found.first = own(shots.plates, shot) * target.count
        return found

    @wp.func
    def plate_of(target: Target, layer: wp.int32):
        """The pattern of a layer."""
        if wp.static(variant.tabled):
            plate = target.plates[target.first + layer]
        elif wp.static(variant.layered):
            plate = target.plates[layer]
        else:
            plate = target.plates
        return plate

    @wp.func
    def law_of(target: Target, common: Law, layer: wp.int32, shot: wp.int32):
        """The law of a layer; the onset of contact in a step is common to all."""
        law = common
        law.by_path = target.by_path[layer]
        law.a0 = own_of(target.a0, layer, shot)
        law.a1 = own_of(target.a1, layer, shot)
        law.a2 = own_of(target.a2, layer, shot)
        law.friction = own_of(target.friction, layer, shot)
        law.degradation = own_of(target.degradation, layer, shot)
        law.decay_rate = own_of(target.decay_rate, layer, shot)
        law.onset_jump = own_of(target.onset_jump, layer, shot)
        return law

    @wp.func
    def faces_of(target: Target, layer: wp.int32, shot: wp.int32):
        """Front and rear face of a layer behind the front of the target [m]."""
        front = real(own_of(target.front, layer, shot))
        return front, front + real(own_of(target.thickness, layer, shot))

    @wp.func
    def depth_of(target: Target, shot: wp.int32):
        """The rear face of the target behind its front [m], in float64."""
        last = target.count - 1
        return own_of(target.front, last, shot) + own_of(target.thickness, last, shot)

    @wp.func
    def begin(earlier: Earlier, slot: wp.int32, shot: wp.int32):
        """This shot has opened no window yet."""
        if wp.static(variant.burst):
            use.earlier.begin(earlier, slot, shot)

    @wp.func
    def open_window(
        target: Target,
        fields: Fields,
        earlier: Earlier,
        shots: Shots,
        slot: wp.int32,
        layer: wp.int32,
        shot: wp.int32,
        home: vec3,
    ):
        """A layer's window about a place relative to the hit [m], with what earlier shots have left there."""
        y = own(shots.hit_y, shot) + wp.float64(home[1]) - own_of(target.offset_y, layer, shot)
        z = own(shots.hit_z, shot) + wp.float64(home[2]) - own_of(target.offset_z, layer, shot)
        plate = plate_of(target, layer)
        window = open_blank(plate, real(own_of(target.thickness, layer, shot)), fields, layer, y, z)
        window.weakens = target.weakens[layer]
        if wp.static(variant.deep):
            if own_of(target.deep, layer, shot) > wp.float64(0.0):
                within = own_of(target.front, layer, shot) - own_of(target.front, target.laminate[layer], shot)
                window.behind = real(within) + one / plate.per_plane  # a plane to spare
            else:  # it weakens as a whole: all is remembered on the first plane
                window.planes = 1
                window.per_plane = real(0.0)
        if wp.static(variant.burst):
            if wp.static(variant.window > 0):
                fields = fields_of(fields, window.first)
            thickness = own_of(target.thickness, layer, shot)
            window = use.channel.open_window(window, earlier.channels, thickness, layer)
            window.pierced = use.earlier.recall(earlier, fields, plate, window, slot, layer, shot, y, z)
        return window

    @wp.func
    def keep(fields: Fields, earlier: Earlier, window: Window, slot: wp.int32, shot: wp.int32):
        """Keep for later shots what this one has added to a layer in its window there."""
        if wp.static(variant.burst):
            if window.weakens:
                if wp.static(variant.window > 0):
                    fields = fields_of(fields, window.first)
                use.earlier.keep(earlier, fields, window, slot, shot)

    @wp.func
    def follow(
        surface: Surface, earlier: Earlier, window: Window, slot: wp.int32, layer: wp.int32, shot: wp.int32, pose: Pose
    ):
        """Take note, for later shots, of where the core is in a layer."""
        if wp.static(variant.burst):
            use.earlier.follow(earlier, surface, window, slot, layer, shot, pose)

    @wp.func
    def leave_channel(
        surface: Surface, earlier: Earlier, window: Window, slot: wp.int32, layer: wp.int32, shot: wp.int32
    ):
        """Keep for later shots where this one went through a layer."""
        if wp.static(variant.burst):
            use.earlier.leave_channel(earlier, surface, window, slot, layer, shot)

    return SimpleNamespace(**locals())
