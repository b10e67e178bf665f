"""The conditions of every shot.

Every array has one value for all shots or one value per shot. The same line reads both.
"""

from functools import cache
from types import SimpleNamespace
from typing import Any

import warp as wp

from . import core_surface, rigid_body
from .variant import Variant


@cache
def build(variant: Variant) -> SimpleNamespace:
    """Device functions of the shots for one variant."""
    real, vec3, quat = variant.real, variant.vec3, variant.quat
    use = variant.use(core_surface, rigid_body)
    Surface, Pose = use.core_surface.Surface, use.core_surface.Pose
    Body, State = use.rigid_body.Body, use.rigid_body.State

    @wp.struct
    class Shots:
        """Arrays of shape [1] or [shots], SI and radians.

        Hit point, velocity and attitude on impact (docs/model.md §1); the members of Body, the strength of the core
        [Pa], `onset_share` of Law, the time step [s] where it is shortest, and the distance [m] at impact velocity
        after which a shot that has not ended is given up. `plates` is the number of the target's plates, and `surface`
        that of the core's surface, where these come from tables.
        """

        hit_y: wp.array(dtype=wp.float64)
        hit_z: wp.array(dtype=wp.float64)
        velocity: wp.array(dtype=wp.float64)
        obliquity: wp.array(dtype=wp.float64)
        azimuth: wp.array(dtype=wp.float64)
        pitch: wp.array(dtype=wp.float64)
        yaw: wp.array(dtype=wp.float64)
        spin: wp.array(dtype=wp.float64)
        mass: wp.array(dtype=real)
        inertia_axial: wp.array(dtype=real)
        inertia_transverse: wp.array(dtype=real)
        strength: wp.array(dtype=real)
        onset_share: wp.array(dtype=real)
        plates: wp.array(dtype=wp.int32)
        surface: wp.array(dtype=wp.int32)
        time_step: wp.array(dtype=wp.float64)
        longest_way: wp.array(dtype=wp.float64)

    @wp.func
    def own(values: wp.array(dtype=Any), shot: wp.int32):
        """The value of one shot."""
        return values[wp.min(shot, values.shape[0] - 1)]

    @wp.func
    def body_of(shots: Shots, shot: wp.int32):
        body = Body()
        body.mass = own(shots.mass, shot)
        body.inertia_axial = own(shots.inertia_axial, shot)
        body.inertia_transverse = own(shots.inertia_transverse, shot)
        return body

    @wp.func
    def line_of_flight(shots: Shots, shot: wp.int32):
        """Unit vector along the line of fire."""
        obliquity, azimuth = own(shots.obliquity, shot), own(shots.azimuth, shot)
        sine = wp.sin(obliquity)
        return wp.vec3d(wp.cos(obliquity), sine * wp.cos(azimuth), sine * wp.sin(azimuth))

    @wp.func
    def attitude_of(axis: wp.vec3d):
        """The shortest turn that takes the plate normal to the axis (axis_x > 0)."""
        return wp.normalize(wp.quatd(wp.float64(0.0), -axis[2], axis[1], wp.float64(1.0) + axis[0]))

    @wp.func
    def foremost(surface: Surface, pose: Pose):
        """How far the core reaches ahead of its centre of mass along x [m]."""
        front = -surface.bounding_radius
        for index in range(surface.rings):
            ring = use.core_surface.ring_at(surface, pose, index)
            broadside = use.core_surface.broadside(pose)
            middle = ring.station * pose.axis[0] + ring.radius * broadside
            front = wp.max(front, middle + wp.abs(ring.half_axial * pose.axis[0] + ring.half_radial * broadside))
        return front

    @wp.func
    def launch_state(surface: Surface, body: Body, shots: Shots, shot: wp.int32):
        """State with the foremost point at the front face, the centre of mass on the line through the hit."""
        flight = line_of_flight(shots, shot)
        yaw = wp.atan2(flight[1], flight[0]) + own(shots.yaw, shot)
        pitch = wp.atan2(flight[2], flight[0]) + own(shots.pitch, shot)
        axis = wp.normalize(wp.vec3d(wp.float64(1.0), wp.tan(yaw), wp.tan(pitch)))
        turn = attitude_of(axis)
        direction = vec3(real(flight[0]), real(flight[1]), real(flight[2]))
        state = State()
        state.attitude = quat(real(turn[0]), real(turn[1]), real(turn[2]), real(turn[3]))
        state.velocity = real(own(shots.velocity, shot)) * direction
        state.angular_momentum = (body.inertia_axial * real(own(shots.spin, shot))) * use.rigid_body.axis_of(
            state.attitude
        )
        pose = use.core_surface.pose_of(surface, vec3(), state.attitude, state.velocity, vec3())
        state.position = (-foremost(surface, pose) / direction[0]) * direction
        return state

    return SimpleNamespace(**locals())
