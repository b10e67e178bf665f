"""Flow and failure: modified Johnson–Cook with Voce terms, radial return, Cockcroft–Latham (docs/continuum.md)."""

from functools import cache
from types import SimpleNamespace

import warp as wp

from ..variant import Variant
from . import choices, fields, transcendental

THIRD = (0.50000121, 0.57725813, -0.10994401, 0.0477970946, -0.0193042401, 0.00419274174)
"""Polynomial for cos(θ/3) of t = cos(θ/2), by Chebyshev's nodes."""


@cache
def build(variant: Variant) -> SimpleNamespace:
    """Device functions of the flow for one variant."""
    struct, real = fields.build(variant), variant.real
    exp, log = transcendental.build(real).exp, transcendental.build(real).log
    vec6 = wp.types.vector(6, real)
    zero, half, one, two, three = (real(value) for value in (0.0, 0.5, 1.0, 2.0, 3.0))
    third, tiny = real(1.0 / 3.0), real(choices.UNSTRESSED.value)
    c0, c1, c2, c3, c4, c5 = (real(value) for value in THIRD)
    least_strain, least_heat = real(choices.LEAST_STRAIN.value), real(choices.COOLEST.value)

    @wp.func
    def flow_stress(sheet: struct.Sheet, strain: real, rate: real, heat: real):
        """σ = (A + B ε^n + Σ Q (1 − e^(−C ε))) (1 + ε̇/ε̇₀)^c (1 − T*^m) [Pa], and its slope over ε [Pa]."""
        known = wp.max(strain, least_strain)
        power = sheet.hardening * exp(sheet.exponent * log(known))
        first = sheet.voce_stress[0] * exp(-sheet.voce_rate[0] * strain)
        second = sheet.voce_stress[1] * exp(-sheet.voce_rate[1] * strain)
        cold = sheet.yield_stress + power + sheet.voce_stress[0] - first + sheet.voce_stress[1] - second
        slope = sheet.exponent * power / known + sheet.voce_rate[0] * first + sheet.voce_rate[1] * second
        fast = exp(sheet.rate_exponent * log(one + rate / sheet.reference_rate))
        warm = one - exp(sheet.softening * log(wp.min(wp.max(heat, least_heat), one)))
        return cold * fast * warm, slope * fast * warm

    @wp.func
    def deviator_square(stress: vec6, mean: real):
        """s : s of the deviator [Pa²]."""
        a, b, c = stress[0] - mean, stress[1] - mean, stress[2] - mean
        shear = stress[3] * stress[3] + stress[4] * stress[4] + stress[5] * stress[5]
        return a * a + b * b + c * c + two * shear

    @wp.func
    def largest_principal(stress: vec6, mean: real, square: real):
        """Largest principal stress [Pa]: mean + 2 √(J₂/3) cos(θ/3), cos θ = (3√3/2) J₃ / J₂^(3/2).

        cos(θ/3) is a smooth function of t = cos(θ/2): a polynomial of it errs by 2e-6.
        """
        a, b, c = stress[0] - mean, stress[1] - mean, stress[2] - mean
        xy, yz, zx = stress[3], stress[4], stress[5]
        third_invariant = a * b * c + two * xy * yz * zx - a * yz * yz - b * zx * zx - c * xy * xy
        second = half * square + tiny
        radius = wp.sqrt(second * third)
        cosine = half * third_invariant / (radius * radius * radius)
        t = wp.sqrt(half * (one + wp.min(wp.max(cosine, -one), one)))
        share = c0 + t * (c1 + t * (c2 + t * (c3 + t * (c4 + t * c5))))
        return mean + two * radius * share

    return SimpleNamespace(**locals())
