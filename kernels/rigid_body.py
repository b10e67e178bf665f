"""Motion of a rigid body of revolution (docs/model.md §5; the paper's eqs. 1 and 3).

The state holds the angular momentum in the plate frame, not the angular velocity, because the angular momentum is
constant between contacts. So a drift is exact for any time step, and the rotational energy stays exact.
"""

import math
from functools import cache
from types import SimpleNamespace

import warp as wp

from . import constants, structs
from .variant import Variant


@cache
def build(variant: Variant) -> SimpleNamespace:
    """Device functions of the motion for one variant."""
    struct = structs.build(variant)
    real, vec3, mat33, quat = variant.real, variant.vec3, variant.mat33, variant.quat
    zero, half, one = real(0.0), real(0.5), real(1.0)
    iterations = wp.constant(constants.ITERATIONS.value)
    quarter, six, twelve, twenty, thirty, forty_two = (real(value) for value in (0.25, 6.0, 12.0, 20.0, 30.0, 42.0))
    gamma, two_gamma = real(1.0 - math.sqrt(0.5)), real(2.0 - math.sqrt(2.0))
    small_square = real(constants.SMALL_ANGLE.value**2)
    faint = real(constants.LEAST_SWING.value)
    least_normal = real(
        math.ldexp(1.0, -1022 if variant.double else -126)
    )  # the inverse of a smaller number is infinite

    @wp.func
    def angle_between(a: vec3, b: vec3):
        """Angle between two vectors [rad]."""
        return wp.atan2(wp.length(wp.cross(a, b)), wp.dot(a, b))

    @wp.func
    def axis_of(attitude: quat):
        """Unit vector along the core towards its nose."""
        return wp.quat_rotate(attitude, vec3(one, zero, zero))

    @wp.func
    def angular_velocity(body: struct.Body, axis: vec3, angular_momentum: vec3):
        """ω = I⁻¹ L in the plate frame, I = I_t 1 + (I_a − I_t) a aᵀ."""
        along = wp.dot(angular_momentum, axis) * axis
        return along / body.inertia_axial + (angular_momentum - along) / body.inertia_transverse

    @wp.func
    def angular_momentum(body: struct.Body, axis: vec3, omega: vec3):
        """L = I ω in the plate frame."""
        along = wp.dot(omega, axis) * axis
        return body.inertia_axial * along + body.inertia_transverse * (omega - along)

    @wp.func
    def kinetic_energy(body: struct.Body, axis: vec3, velocity: vec3, momentum: vec3):
        """Translation and rotation [J]."""
        omega = angular_velocity(body, axis, momentum)
        return half * (body.mass * wp.dot(velocity, velocity) + wp.dot(momentum, omega))

    @wp.func
    def rotation(vector: vec3):
        """The quaternion of a rotation vector [rad]."""
        square = quarter * wp.dot(vector, vector)  # of half the angle
        # The series is exact to the last bit of float64 for the turn of one step. A sine is a call and takes ten times
        # as long.
        scale = half - half * square / six * (one - square / twenty * (one - square / forty_two))
        cosine = one - half * square * (one - square / twelve * (one - square / thirty))
        if square > small_square:
            half_angle = wp.sqrt(square)
            scale = half * wp.sin(half_angle) / half_angle
            cosine = wp.cos(half_angle)
        return quat(scale * vector[0], scale * vector[1], scale * vector[2], cosine)

    @wp.func
    def turned(body: struct.Body, axis: vec3, momentum: vec3, time: real):
        """The axis after a time of torque-free motion. It precesses about L at |L|/I_t."""
        return wp.quat_rotate(rotation((time / body.inertia_transverse) * momentum), axis)

    @wp.func
    def axis_at(body: struct.Body, axis: vec3, momentum: vec3, ahead: real, velocity: real, distance: real):
        """The axis when the point `ahead` of the centre of mass has moved by `distance` along x.

        The swing of the point changes the time of flight, which a fixed-point iteration finds. It converges if the
        swing is slower than the flight. If `ahead` is 0, the first iteration is exact.
        """
        then = axis
        for _ in range(iterations):
            time = (distance - ahead * then[0]) / velocity
            then = turned(body, axis, momentum, time)
            if ahead == zero:
                break
        return then

    @wp.func
    def drift(body: struct.Body, state: struct.State, dt: real):
        """Torque-free motion over dt, exact for any dt (the symmetric top)."""
        momentum = state.angular_momentum
        # The rate about the axis within the precession: (L·a)(1/I_a − 1/I_t) [rad/s].
        roll_rate = wp.dot(momentum, axis_of(state.attitude)) * (
            one / body.inertia_axial - one / body.inertia_transverse
        )
        precession = rotation((dt / body.inertia_transverse) * momentum)
        roll = rotation(vec3(dt * roll_rate, zero, zero))
        moved = struct.State()
        moved.position = state.position + dt * state.velocity
        moved.attitude = wp.normalize(precession * state.attitude * roll)
        moved.velocity = state.velocity
        moved.angular_momentum = momentum
        return moved

    @wp.func
    def velocity_change(body: struct.Body, load: struct.Load, dt: real):
        """Change Δu = (Δv, Δω) of the velocities, along the body axes, by a load over dt; and the change e in the mean
        damping of the load: M Δu = dt (F − D e).

        With J = 2 D the load's full derivative, Rosenbrock's method of second order in two stages of the same matrix,
        γ = 1 − √½:

            (M + γ dt J) Δu₁ = dt F,        (M + γ dt J) Δu = γ dt F + (1 − γ) M Δu₁.

        So e = 2 γ (Δu + (1 − γ) Δu₁). The method damps at once what a step cannot resolve, such as a wall on the steep
        ramp of the contact. The trapezoidal rule of the same order would let it ring.
        """
        # In units of m and I_t, so that the determinants of a small core do not underflow.
        light, agile = dt / body.mass, dt / body.inertia_transverse
        ratio = body.inertia_axial / body.inertia_transverse
        force, moment = light * load.force, agile * load.moment
        dv, dw = force, vec3(moment[0] / ratio, moment[1], moment[2])
        felt_v, felt_w = dv, dw
        if load.damped:
            light *= two_gamma
            agile *= two_gamma
            vw, wv = load.damping_vw, wp.transpose(load.damping_vw)
            vv = wp.inverse(wp.identity(3, dtype=real) + light * load.damping_vv)
            inertia = mat33(ratio, zero, zero, zero, one, zero, zero, zero, one)
            ww = wp.inverse(inertia + agile * (load.damping_ww - light * (wv * vv * vw)))
            dw = ww * (moment - agile * (wv * (vv * force)))
            dv = vv * (force - light * (vw * dw))
            felt_v, felt_w = (one - gamma) * dv, (one - gamma) * dw
            force = gamma * force + (one - gamma) * dv
            moment = gamma * moment + (one - gamma) * vec3(ratio * dw[0], dw[1], dw[2])
            dw = ww * (moment - agile * (wv * (vv * force)))
            dv = vv * (force - light * (vw * dw))
            felt_v, felt_w = two_gamma * (felt_v + dv), two_gamma * (felt_w + dw)
        return dv, dw, felt_v, felt_w

    @wp.func
    def restraint(body: struct.Body, state: struct.State, dv: vec3, dw: vec3):
        """Largest share, at most 1, of a change of velocities along the body axes that does not raise the kinetic
        energy.

        Every surface element takes power from the core, so the energy cannot grow in continuous time. A finite step may
        overshoot where a core comes to rest. Then the step ends at the least energy along its direction.
        """
        axis = axis_of(state.attitude)
        dv_plate, dw_plate = wp.quat_rotate(state.attitude, dv), wp.quat_rotate(state.attitude, dw)
        omega = angular_velocity(body, axis, state.angular_momentum)
        dl = angular_momentum(body, axis, dw_plate)
        slope = body.mass * wp.dot(dv_plate, state.velocity) + wp.dot(dl, omega)
        curvature = body.mass * wp.dot(dv_plate, dv_plate) + wp.dot(dl, dw_plate)
        share = one
        if slope + curvature > zero:
            share = wp.max(zero, -slope / wp.max(curvature, least_normal))
        return share

    @wp.func
    def kick(body: struct.Body, state: struct.State, load: struct.Load, dt: real):
        """Change the velocities by the load over dt."""
        axis = axis_of(state.attitude)
        dv_body, dw_body, _, _ = velocity_change(body, load, dt)
        dv, dw = wp.quat_rotate(state.attitude, dv_body), wp.quat_rotate(state.attitude, dw_body)
        share = restraint(body, state, dv_body, dw_body)
        kicked = struct.State()
        kicked.position = state.position
        kicked.attitude = state.attitude
        kicked.velocity = state.velocity + share * dv
        kicked.angular_momentum = state.angular_momentum + share * angular_momentum(body, axis, dw)
        return kicked

    @wp.func
    def change_between(body: struct.Body, before: struct.State, after: struct.State):
        """The change of the velocities between two states, as by a kick."""
        momentum = after.angular_momentum - before.angular_momentum
        change = struct.Change()
        change.velocity = wp.quat_rotate_inv(before.attitude, after.velocity - before.velocity)
        change.omega = wp.quat_rotate_inv(before.attitude, angular_velocity(body, axis_of(before.attitude), momentum))
        return change

    @wp.func
    def in_step(change: struct.Change, share: real):
        """The change in a step that is `share` times as long, under the same load."""
        predicted = struct.Change()
        predicted.velocity = share * change.velocity
        predicted.omega = share * change.omega
        return predicted

    @wp.func
    def swings(body: struct.Body, before: struct.Change, last: struct.Change):
        """Whether a step has reversed the change across the axis by the step before, by more than rounding can: in a
        straight shot nothing else acts across the axis."""
        pushed = before.velocity[1] * last.velocity[1] + before.velocity[2] * last.velocity[2]
        turned = before.omega[1] * last.omega[1] + before.omega[2] * last.omega[2]
        rounding = faint * wp.abs(before.velocity[0] * last.velocity[0])
        return body.mass * (pushed + rounding) + body.inertia_transverse * turned < zero

    @wp.func
    def mean_load(body: struct.Body, state: struct.State, load: struct.Load, dt: real):
        """The mean force and moment of a kick over its step, in the plate frame."""
        dv, dw, _, _ = velocity_change(body, load, dt)
        share = restraint(body, state, dv, dw)
        spin = body.inertia_axial / body.inertia_transverse * dw[0]
        force, moment = (body.mass / dt) * dv, (body.inertia_transverse / dt) * vec3(spin, dw[1], dw[2])
        return share * wp.quat_rotate(state.attitude, force), share * wp.quat_rotate(state.attitude, moment)

    return SimpleNamespace(**locals())
