"""The conditions of every shot, its start, and its line of flight."""

from functools import cache
from types import SimpleNamespace
from typing import Any

import warp as wp

from . import core_surface, rigid_body, structs
from .variant import Variant


@cache
def build(variant: Variant) -> SimpleNamespace:
    """Device functions of the shots for one variant."""
    struct = structs.build(variant)
    real, vec3, quat = variant.real, variant.vec3, variant.quat
    use = variant.use(core_surface, rigid_body)

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

    return SimpleNamespace(**locals())
