"""Torque-free flight behind the plate, and the attitude of the core at the stand-offs (docs/model.md §1)."""

from functools import cache
from types import SimpleNamespace

import warp as wp

from . import rigid_body, structs, target
from .status import Status
from .variant import Variant


@cache
def build(variant: Variant) -> SimpleNamespace:
    """The free-flight kernel and the struct it fills, for one variant."""
    struct = structs.build(variant)
    real, vec3 = variant.real, variant.vec3
    zero, undefined = real(0.0), real(wp.nan)
    use = variant.use(rigid_body, target)
    angle_between, axis_at = use.rigid_body.angle_between, use.rigid_body.axis_at

    def free_flight(
        # inputs
        shots: struct.Shots,
        target: struct.Target,
        contact: struct.Outcomes,
        standoffs: wp.array(dtype=wp.float64),
        ahead: real,
        # outputs
        report: struct.Report,
    ):
        """Report one shot per thread.

        `standoffs` are distances behind the rear face [m]. They count for the point of the axis that lies `ahead` of
        the centre of mass, towards the nose [m].
        """
        shot = wp.tid()
        body = use.target.body_of(shots, shot)
        status = contact.status[shot]
        direction = use.target.line_of_flight(shots, shot)
        flight = vec3(real(direction[0]), real(direction[1]), real(direction[2]))
        velocity, axis = contact.velocity[shot], contact.axis[shot]
        momentum = contact.angular_momentum[shot]
        failed = status >= Status.UNFINISHED
        moves = not failed and status != Status.ARRESTED
        passes = status == Status.PERFORATED or (status == Status.UNTOUCHED and velocity[0] > zero)
        nothing = vec3(undefined, undefined, undefined)

        report.residual_velocity[shot] = wp.where(moves, wp.length(velocity), wp.where(failed, undefined, zero))
        report.deflection[shot] = wp.where(moves, angle_between(velocity, flight), undefined)
        omega = use.rigid_body.angular_velocity(body, axis, momentum)
        report.angular_velocity[shot] = wp.where(moves, omega, wp.where(failed, nothing, vec3()))
        report.energy_loss[shot] = wp.where(failed, undefined, contact.energy_loss[shot])
        report.contact_duration[shot] = wp.where(failed, undefined, contact.contact_duration[shot])
        for k in range(standoffs.shape[0]):
            then = vec3(undefined, undefined, undefined)
            if passes:
                distance = real(standoffs[k] + use.target.depth_of(target, shot)) - contact.position[shot][0]
                then = axis_at(body, axis, momentum, ahead, velocity[0], distance)
            report.tilt[shot, k] = angle_between(then, flight)
            report.pitch[shot, k] = wp.atan2(then[2], then[0])
            report.yaw[shot, k] = wp.atan2(then[1], then[0])
            report.total_yaw[shot, k] = angle_between(then, velocity)

    kernel = variant.kernel(free_flight)
    return SimpleNamespace(**locals())
