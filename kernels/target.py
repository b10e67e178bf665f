"""The target: its layers, front to back (layer 0 is the plate), and how the window of a layer opens."""

from functools import cache
from types import SimpleNamespace
from typing import Any

import warp as wp

from . import scheme, shots, structs
from .variant import Variant


@cache
def build(variant: Variant) -> SimpleNamespace:
    """Device functions of the target for one variant."""
    struct, real, vec3 = structs.build(variant), variant.real, variant.vec3
    zero, one = wp.float64(0.0), real(1.0)
    use = variant.use(scheme, shots)

    @wp.func
    def layer_value(values: wp.array2d(dtype=Any), layer: wp.int32, shot: wp.int32):
        """The value of one layer and shot."""
        return values[layer, wp.min(shot, values.shape[1] - 1)]

    @wp.func
    def plate_of(target: struct.Target, layer: wp.int32):
        """The pattern of a layer."""
        if wp.static(variant.tabled):
            plate = target.plates[target.first + layer]
        elif wp.static(variant.layered):
            plate = target.plates[layer]
        else:
            plate = target.plates
        return plate

    @wp.func
    def law_of(target: struct.Target, common: struct.Law, layer: wp.int32, shot: wp.int32):
        """The law of a layer. The onset of contact in a step is common to all layers."""
        law = common
        law.by_path = target.by_path[layer]
        law.a0 = layer_value(target.a0, layer, shot)
        law.a1 = layer_value(target.a1, layer, shot)
        law.a2 = layer_value(target.a2, layer, shot)
        law.friction = layer_value(target.friction, layer, shot)
        law.degradation = layer_value(target.degradation, layer, shot)
        law.decay_rate = layer_value(target.decay_rate, layer, shot)
        law.onset_jump = layer_value(target.onset_jump, layer, shot)
        law.per_reach = layer_value(target.per_reach, layer, shot)
        return law

    @wp.func
    def faces_of(target: struct.Target, layer: wp.int32, shot: wp.int32):
        """Front and rear face of a layer behind the front of the target [m]."""
        front = real(layer_value(target.front, layer, shot))
        return front, front + real(layer_value(target.thickness, layer, shot))

    @wp.func
    def depth_of(target: struct.Target, shot: wp.int32):
        """The rear face of the target behind its front [m], in float64."""
        last = target.count - 1
        return layer_value(target.front, last, shot) + layer_value(target.thickness, last, shot)

    @wp.func
    def open_window(context: struct.Context, layer: wp.int32, home: vec3):
        """Open a layer's window about a place relative to the hit [m], on an untouched layer."""
        target, shots, shot = context.target, context.shots, context.shot
        y = use.shots.shot_value(shots.hit_y, shot) + wp.float64(home[1]) - layer_value(target.offset_y, layer, shot)
        z = use.shots.shot_value(shots.hit_z, shot) + wp.float64(home[2]) - layer_value(target.offset_z, layer, shot)
        hit, plate, thickness = wp.vec2d(y, z), plate_of(target, layer), layer_value(target.thickness, layer, shot)
        window = use.scheme.open_window(plate, real(thickness), context.fields, layer, hit)
        window.weakens = target.weakens[layer]
        return window

    return SimpleNamespace(**locals())
