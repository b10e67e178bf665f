"""The shots and the target: conditions and start of a shot; layers, front to back, and how the window of a layer opens.

Layer 0 is the plate.
"""

from functools import cache
from types import SimpleNamespace
from typing import Any

import warp as wp

from . import block, contact, core_surface, nodal, rigid_body, structs
from .variant import Variant


def scheme_of(variant: Variant) -> SimpleNamespace:
    """How one layer loads a core in one step: the functions `fields_of_slot`, `open_window` and `load_on` of the
    consistent law, by one thread or by the lanes of a block, or of the paper's literal scheme."""
    return (nodal if variant.nodal else block if variant.window else contact).build(variant)


@cache
def build(variant: Variant) -> SimpleNamespace:
    """Device functions of the target for one variant."""
    struct, real, vec3, quat = structs.build(variant), variant.real, variant.vec3, variant.quat
    zero, one = wp.float64(0.0), real(1.0)
    use, scheme = variant.use(core_surface, rigid_body), scheme_of(variant)

    @wp.func
    def shot_value(values: wp.array(dtype=Any), shot: wp.int32):
        """The value of one shot, or the value that all shots share."""
        return values[wp.min(shot, values.shape[0] - 1)]

    @wp.func
    def body_of(shots: struct.Shots, shot: wp.int32):
        """The mass properties of a shot's core."""
        body = struct.Body()
        body.mass = shot_value(shots.mass, shot)
        body.inertia_axial = shot_value(shots.inertia_axial, shot)
        body.inertia_transverse = shot_value(shots.inertia_transverse, shot)
        return body

    @wp.func
    def line_of_flight(shots: struct.Shots, shot: wp.int32):
        """Unit vector along the line of fire."""
        obliquity, azimuth = shot_value(shots.obliquity, shot), shot_value(shots.azimuth, shot)
        sine = wp.sin(obliquity)
        return wp.vec3d(wp.cos(obliquity), sine * wp.cos(azimuth), sine * wp.sin(azimuth))

    @wp.func
    def attitude_of(axis: wp.vec3d):
        """The quaternion of the shortest turn from the plate normal to the axis (axis_x > 0)."""
        return wp.normalize(wp.quatd(wp.float64(0.0), -axis[2], axis[1], wp.float64(1.0) + axis[0]))

    @wp.func
    def launch_state(surface: struct.Surface, body: struct.Body, shots: struct.Shots, shot: wp.int32):
        """State with the foremost point at the front face and the centre of mass on the line through the hit."""
        flight = line_of_flight(shots, shot)
        yaw = wp.atan2(flight[1], flight[0]) + shot_value(shots.yaw, shot)
        pitch = wp.atan2(flight[2], flight[0]) + shot_value(shots.pitch, shot)
        axis = wp.normalize(wp.vec3d(wp.float64(1.0), wp.tan(yaw), wp.tan(pitch)))
        turn = attitude_of(axis)
        direction = vec3(real(flight[0]), real(flight[1]), real(flight[2]))
        state = struct.State()
        state.attitude = quat(real(turn[0]), real(turn[1]), real(turn[2]), real(turn[3]))
        state.velocity = real(shot_value(shots.velocity, shot)) * direction
        state.angular_momentum = (body.inertia_axial * real(shot_value(shots.spin, shot))) * use.rigid_body.axis_of(
            state.attitude
        )
        pose = use.core_surface.pose_of(surface, vec3(), state.attitude, state.velocity, vec3())
        _, foremost = use.core_surface.ends_of(surface, pose)
        state.position = (-foremost / direction[0]) * direction
        return state

    @wp.func
    def layer_value(values: wp.array2d(dtype=Any), layer: wp.int32, shot: wp.int32):
        """The value of one layer and shot."""
        return values[layer, wp.min(shot, values.shape[1] - 1)]

    @wp.func
    def plate_of(target: struct.Target, layer: wp.int32):
        """The pattern of a layer."""
        if wp.static(variant.layered):
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
        y = shot_value(shots.hit_y, shot) + wp.float64(home[1]) - layer_value(target.offset_y, layer, shot)
        z = shot_value(shots.hit_z, shot) + wp.float64(home[2]) - layer_value(target.offset_z, layer, shot)
        hit, plate, thickness = wp.vec2d(y, z), plate_of(target, layer), layer_value(target.thickness, layer, shot)
        window = scheme.open_window(plate, real(thickness), context.fields, layer, hit)
        window.weakens = target.weakens[layer]
        return window

    return SimpleNamespace(**locals())
