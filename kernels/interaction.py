"""What a surface element in contact carries (MODEL.md §4; the paper's eq. 5, general form of Ben-Dor et al.)."""

from functools import cache
from types import SimpleNamespace

import warp as wp

from .variant import Variant


@cache
def build(variant: Variant) -> SimpleNamespace:
    """Device functions of the contact law for one variant."""
    real, vec3 = variant.real, variant.vec3
    zero, one = real(0.0), real(1.0)
    # A wall sliding along itself has v_p·n = 0 up to rounding; below this share of |v_p| it does not touch.
    at_rest = real(1.0e-5)
    smallest_onset = real(1.0e-4)  # of the impact velocity: keeps the ramp's slope finite

    @wp.struct
    class Law:
        """Normal stress a0 + a1 v_n + a2 v_n² [Pa], friction η and ln(β)/Δt_β [1/s].

        `onset` is the closing speed [m/s] over which contact sets in (`onset_speed`): a multiple, `onset_jump`
        [m/s²], of the time step, and at most the share `onset_limit` of the core's velocity.
        """

        a0: real
        a1: real
        a2: real
        friction: real
        decay_rate: real
        onset_jump: real
        onset_limit: real
        onset: real

    @wp.func
    def onset_speed(law: Law, dt: real, velocity: real, impact_velocity: real):
        """Closing speed over which contact sets in [m/s]: vanishes with the time step, and follows a core that
        slows down, so that it is arrested where it should be."""
        return wp.max(wp.min(law.onset_jump * dt, law.onset_limit * velocity), smallest_onset * impact_velocity)

    @wp.func
    def contact_fraction(law: Law, closing: real, speed: real):
        """Share of the traction at closing speed v_p·n: 0 at rest, 1 from the onset speed on.

        The law jumps at v_p·n = 0; a wall pressed sideways rests within the ramp. The onset speed vanishes
        with the time step.
        """
        return wp.clamp((closing - at_rest * speed) / law.onset, zero, one)

    @wp.func
    def normal_stress(law: Law, closing: real):
        """Normal stress [Pa] of undamaged material at closing speed v_n."""
        stress = law.a0
        if wp.static(variant.rate_dependent):
            stress += closing * (law.a1 + law.a2 * closing)
        return stress

    @wp.func
    def stress_slope(law: Law, closing: real):
        """Derivative of the normal stress by the closing speed [Pa s/m]."""
        return law.a1 + real(2.0) * law.a2 * closing

    @wp.func
    def traction_direction(law: Law, normal: vec3, velocity: vec3, closing: real, speed: real):
        """−n + η t with t against the sliding velocity; traction = stress × this."""
        direction = -normal
        if wp.static(variant.rubs):
            sliding = velocity - closing * normal
            direction -= sliding * (law.friction / wp.max(wp.length(sliding), at_rest * speed))
        return direction

    @wp.func
    def remaining(law: Law, exposure: real):
        """Share of the resistance left after an exposure T [s]: β^(T/Δt_β)."""
        return wp.exp(law.decay_rate * exposure)

    return SimpleNamespace(
        Law=Law,
        onset_speed=onset_speed,
        contact_fraction=contact_fraction,
        normal_stress=normal_stress,
        stress_slope=stress_slope,
        traction_direction=traction_direction,
        remaining=remaining,
    )
