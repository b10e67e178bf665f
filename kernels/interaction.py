"""The stress on a surface element in contact (docs/model.md §4; the paper's eq. 5, general form of Ben-Dor et al.), and
the part of a curved patch that touches: normal and velocity vary linearly over it, and only what closes in touches."""

from functools import cache
from types import SimpleNamespace

import warp as wp

from . import constants, core_surface, structs
from .variant import Variant

EXPONENTIAL = """
    const auto exponential = [](auto x) {
        if constexpr (sizeof(x) == 4) {
    #if defined(__CUDA_ARCH__)
            return expf(x);
    #else
            float t = x * 1.44269504f;
            t = t < -126.0f ? -126.0f : (t > 126.0f ? 126.0f : t);
            const float whole = __builtin_floorf(t + 0.5f);
            const float f = t - whole;
            const float p = 1.0f + f * (0.693147181f + f * (0.240226507f + f * (0.0555041087f
                          + f * (0.00961812911f + f * (0.00133335581f + f * 0.000154035304f)))));
            const int bits = ((int)whole + 127) << 23;
            return p * __builtin_bit_cast(float, bits);
    #endif
        } else return exp(x);
    };
"""
"""Native code of the function `exponential`. It equals wp.exp to the bit in float64, and to 2 ulp in float32, where no
compiler vectorises the call of the library."""


@cache
def build(variant: Variant) -> SimpleNamespace:
    """Device functions of the contact law for one variant."""
    struct = structs.build(variant)
    real = variant.real
    zero, sixth, half, one = real(0.0), real(1.0 / 6.0), real(0.5), real(1.0)
    tiny, at_rest = real(constants.TINY.value), real(constants.AT_REST.value)
    smallest_onset = real(constants.SMALLEST_ONSET.value)
    use = variant.use(core_surface)

    @wp.func
    def onset_speed(law: struct.Law, dt: real, velocity: real, impact_velocity: real):
        """Closing speed over which contact sets in [m/s]. It follows a core that slows down, so that the core is
        arrested at the right place."""
        wider = wp.min(law.onset_jump * dt, law.onset_limit * velocity)
        return wp.max(wp.max(law.onset_share * velocity, wider), smallest_onset * impact_velocity)

    @wp.func
    def per_speed(velocity: real, impact_velocity: real):
        """One over the velocity of the core [s/m], finite at rest."""
        return one / wp.max(velocity, smallest_onset * impact_velocity)

    @wp.func
    def contact_of(law: struct.Law, closing: real, variation: real, speed: real):
        """Contact of a patch whose closing speeds are spread evenly over closing ± variation [m/s].

        Each part of the patch is in contact by min(1, v_p·n / onset) where v_p·n > 0 (docs/model.md §4). The contact is
        the exact mean over the patch, and the mean place of its touching parts, each weighed by its share. The patch
        has three pieces, on which the share is 0, linear and 1: the piece that moves away, the piece on the ramp and
        the piece in full contact.

        Args:
            speed: upper bound of the speed of all points of the core [m/s].
        """
        middle = closing - at_rest * speed
        per_variation = one / (variation + tiny)
        away = wp.clamp(half - half * middle * per_variation, zero, one)
        full = wp.clamp(half + half * (middle - law.onset) * per_variation, zero, one)
        ramp = wp.max(zero, one - away - full)
        per_onset = one / law.onset
        low = wp.clamp((middle - variation) * per_onset, zero, one)
        high = wp.clamp((middle + variation) * per_onset, zero, one)
        mean = half * (low + high)
        contact = struct.Contact()
        contact.share = full + ramp * mean
        contact.slope = ramp * per_onset
        moment = full * (one - full) + ramp * (mean * (away - full) + sixth * ramp * (high - low))
        contact.shift = moment * per_variation / (contact.share + tiny)
        return contact

    @wp.func
    def variations(ring: struct.Ring, patch: struct.Patch):
        """Half of the variation of the closing speed over a patch, along the meridian and around [m/s]. Along the
        meridian the swing of the core counts, too: at 10⁴ rad/s it is more than the bend of a slender core's
        surface."""
        meridian = ring.turn_axial * patch.velocity_axial + ring.turn_radial * patch.velocity_outward
        meridian += use.core_surface.half_lever(ring) * patch.swing
        return meridian, ring.sector * ring.normal_radial * patch.velocity_around

    @wp.func
    def grip_of(law: struct.Law, pose: struct.Pose, ring: struct.Ring, patch: struct.Patch):
        """Contact of a curved patch: normal and velocity vary linearly over it, and only the part that closes in
        touches. Without this, contact along a shank would come and go by whole patches."""
        meridian, around = variations(ring, patch)
        return contact_of(law, patch.closing, wp.sqrt(meridian * meridian + around * around), pose.speed)

    @wp.func
    def face_of(ring: struct.Ring, patch: struct.Patch, shift: real):
        """The part of a patch in contact, from its grip's shift. Its power is taken at its own closing speed, so the
        load of a part that closes in never drives the core."""
        meridian, around = variations(ring, patch)
        face = struct.Face()
        face.axial = ring.normal_axial + shift * meridian * ring.turn_axial
        face.outward = ring.normal_radial + shift * meridian * ring.turn_radial
        face.around = shift * around * ring.sector * ring.normal_radial
        face.closing = patch.closing + shift * (meridian * meridian + around * around)
        face.station = ring.station + shift * meridian * ring.half_axial
        face.radius = ring.radius + shift * meridian * ring.half_radial
        return face

    @wp.func
    def normal_along_x(pose: struct.Pose, patch: struct.Patch, face: struct.Face):
        """Component along x of the normal of the part in contact."""
        return face.axial * pose.axis[0] + face.outward * patch.outward_x + face.around * patch.around_x

    @wp.func
    def steady_slope(law: struct.Law, share: real, slope: real, closing: real):
        """Derivative of the share of contact by the closing speed [s/m].

        Where a core swings between two walls from step to step, the chord down to no contact replaces the derivative,
        because full contact has no slope, and a long step carries the core across the whole ramp. The change of the
        last step is predicted, so the chord adds an error of second order.
        """
        return wp.where(closing < law.steadied, share / wp.max(closing, tiny), slope)

    @wp.func
    def stress_slope(law: struct.Law, closing: real):
        """Derivative of the normal stress by the closing speed [Pa s/m]."""
        slope = law.a1 + real(2.0) * law.a2 * closing
        if wp.static(variant.free_surface):
            slope += wp.where(closing * law.per_speed < one, law.a0 * law.attack * law.per_speed, zero)
        return slope

    @wp.func
    def friction_per_speed(law: struct.Law, sliding: real, speed: real):
        """Friction over normal stress and sliding speed [s/m]: η / |v_t|, finite where nothing slides."""
        return law.friction / wp.max(sliding, at_rest * speed)

    @wp.func_native(EXPONENTIAL + "return exponential(x);")
    def exp_single(x: wp.float32) -> wp.float32:
        """e^x between 2^-126 and 2^126, NaN for NaN."""
        ...

    exponential = wp.exp if variant.double else exp_single

    @wp.func
    def normal_stress(law: struct.Law, closing: real, radius: real):
        """Normal stress [Pa] of undamaged material at closing speed v_n, on a core that has this radius there [m]."""
        stress = law.a0
        if wp.static(variant.free_surface):
            stress *= one / (one + radius * law.per_reach) + law.attack * wp.min(closing * law.per_speed, one)
        if wp.static(variant.rate_dependent):
            stress += closing * (law.a1 + law.a2 * closing)
        return stress

    @wp.func
    def exposure_in(law: struct.Law, dt: real, velocity: real):
        """Exposure by a step under one advancing sheet: the time of the step [s], or its path [m] at this velocity."""
        return wp.where(law.by_path, velocity * dt, dt)

    @wp.func
    def remaining(law: struct.Law, exposure: real):
        """Share of the resistance left after an exposure T [s]: β^(T/Δt_β); or S [m]: β^(S/Δs_β)."""
        return exponential(law.decay_rate * exposure)

    return SimpleNamespace(**locals())
