"""The element: a hexahedron with one point of integration, its strain, flow, viscosities, failure and forces.

The corners of a hexahedron lie at ξ, η, ζ = ±1. Of their positions and velocities only sums with these signs count:
three that stretch and turn it (ξ, η, ζ), and four hourglasses (ηζ, ζξ, ξη, ξηζ). Forces on the corners are such sums,
too. The flow is modified Johnson–Cook with Voce terms (docs/continuum.md). Exponential and logarithm have no call and
no branch, so that a loop over elements vectorises.
"""

from functools import cache
from types import SimpleNamespace
from typing import Any

import warp as wp

from ..memory import read, write
from ..variant import Variant
from . import choices, fields
from .fields import put_tensor, put_vector, tensor_at, vector_at

THIRD = (0.50000121, 0.57725813, -0.10994401, 0.0477970946, -0.0193042401, 0.00419274174)
"""Polynomial for cos(θ/3) of t = cos(θ/2), by Chebyshev's nodes."""


@cache
def elementary(real: Any) -> SimpleNamespace:
    """`exp` and `log` (of a positive number) for one floating-point type, to some units of the last digit.

    2^t = 2^whole · e^rest, |rest| ≤ ln 2 / 2: a series for the rest, the bits of the exponent for the whole.
    log x = whole ln 2 + 2 artanh f, f = (m − 1) / (m + 1), √½ ≤ m < √2, x = m 2^whole.
    """
    if real is wp.float32:
        kind, whole, end, bits, bias, shift, root = "float", "int", "f", 23, 127, "12582912.0f", "0x3f3504f3"
        high, low, terms = "0.693359375f", "-2.12194440e-4f", (8, 5)
    else:
        kind, whole, end, bits, bias, shift = "double", "long long", "", 52, 1023, "6755399441055744.0"
        high, low, root = "6.93147180369123816490e-01", "1.90821492927058770002e-10", "0x3fe6a09e667f3bcdLL"
        terms = (13, 11)
    series, artanh = f"1.0{end}", "0"
    for k in range(terms[0], 0, -1):
        series = f"(1.0{end} + rest * (1.0{end} / {k}) * {series})"
    for k in range(terms[1], -1, -1):
        artanh = f"(1.0{end} / {2 * k + 1} + square * {artanh})"

    @wp.func_native(f"""
    const {kind} limit = {bias - 1}.0{end};
    {kind} t = x * 1.44269504088896340736{end};
    t = t < -limit ? -limit : t > limit ? limit : t;
    #if defined(__CUDA_ARCH__)
    const {kind} whole = rint{end}(t);
    #else
    const {kind} whole = __builtin_rint{end}(t);
    #endif
    const {kind} rest = (x - whole * {high}) - whole * {low};
    const {whole} raised = (__builtin_bit_cast({whole}, whole + {shift}) + {bias}) << {bits};
    return {series} * __builtin_bit_cast({kind}, raised);
    """)
    def exp(x: real) -> real: ...

    @wp.func_native(f"""
    const {whole} bits = __builtin_bit_cast({whole}, x);
    const {whole} power = (bits - {root}) >> {bits};
    const {kind} m = __builtin_bit_cast({kind}, bits - (power << {bits}));
    const {kind} f = (m - 1) / (m + 1), square = f * f;
    return ({kind})(int)power * 0.69314718055994530942{end} + 2 * f * {artanh};
    """)
    def log(x: real) -> real: ...

    return SimpleNamespace(exp=exp, log=log)


@cache
def build(variant: Variant) -> Any:
    """The device function `deform` for one precision."""
    struct, real = fields.build(variant), variant.real
    exp, log = elementary(real).exp, elementary(real).log
    vec3, vec6 = wp.types.vector(3, real), wp.types.vector(6, real)
    zero, half, one, two, three = (real(value) for value in (0.0, 0.5, 1.0, 2.0, 3.0))
    third, of_volume, of_force = (real(value) for value in (1 / 3, 1 / 64, 1 / 64))
    quadratic, linear = real(choices.QUADRATIC.value), real(choices.LINEAR.value)
    firm = real(choices.YIELD_SPEED.value)
    tiny, unstressed = real(choices.LEAST_DIVISOR.value), real(choices.LEAST_DEVIATOR.value)
    c0, c1, c2, c3, c4, c5 = (real(value) for value in THIRD)
    least_strain, least_heat = real(choices.LEAST_STRAIN.value), real(choices.LEAST_HEAT.value)
    thinnest, shortest = real(choices.THINNEST.value), real(choices.SHORTEST.value)
    widest, least = real(choices.WIDEST.value), real(choices.LEAST_VOLUME.value)
    folded = real(choices.FOLDED.value)

    @wp.struct
    class Modes:
        """Sums of a vector over the corners with the signs of each mode."""

        xi: vec3
        eta: vec3
        zeta: vec3
        eta_zeta: vec3
        zeta_xi: vec3
        xi_eta: vec3
        all: vec3

    @wp.func
    def modes_of(values: wp.array(dtype=real), size: wp.int32, row: wp.int32, plane: wp.int32, element: wp.int32):
        """The modes of a vector of the nodes; ξ runs along x, through the planes, η along y and ζ along z."""
        a, b = vector_at(values, size, element), vector_at(values, size, element + 1)
        c, d = vector_at(values, size, element + row), vector_at(values, size, element + row + 1)
        sum_0, along_0 = a + b, b - a
        sum_1, along_1 = c + d, d - c
        all_0, eta_0, zeta_0, twist_0 = sum_0 + sum_1, sum_1 - sum_0, along_0 + along_1, along_1 - along_0
        e, f = vector_at(values, size, element + plane), vector_at(values, size, element + plane + 1)
        g, h = vector_at(values, size, element + plane + row), vector_at(values, size, element + plane + row + 1)
        sum_2, along_2 = e + f, f - e
        sum_3, along_3 = g + h, h - g
        all_1, eta_1, zeta_1, twist_1 = sum_2 + sum_3, sum_3 - sum_2, along_2 + along_3, along_3 - along_2
        modes = Modes()
        modes.xi = all_1 - all_0
        modes.eta = eta_0 + eta_1
        modes.zeta = zeta_0 + zeta_1
        modes.eta_zeta = twist_0 + twist_1
        modes.zeta_xi = zeta_1 - zeta_0
        modes.xi_eta = eta_1 - eta_0
        modes.all = twist_1 - twist_0
        return modes

    @wp.func
    def put(values: wp.array(dtype=real), size: wp.int32, element: wp.int32, corner: wp.int32, force: vec3):
        put_vector(values, size, 3 * corner * size + element, force)

    @wp.func
    def spread(values: wp.array(dtype=real), size: wp.int32, element: wp.int32, modes: Modes):
        """Write the forces on the corners: each mode with its sign."""
        all_0, all_1 = -modes.xi, modes.xi
        eta_0, eta_1 = modes.eta - modes.xi_eta, modes.eta + modes.xi_eta
        zeta_0, zeta_1 = modes.zeta - modes.zeta_xi, modes.zeta + modes.zeta_xi
        twist_0, twist_1 = modes.eta_zeta - modes.all, modes.eta_zeta + modes.all
        sum_0, along_0, sum_1, along_1 = all_0 - eta_0, zeta_0 - twist_0, all_0 + eta_0, zeta_0 + twist_0
        put(values, size, element, 0, sum_0 - along_0)
        put(values, size, element, 1, sum_0 + along_0)
        put(values, size, element, 2, sum_1 - along_1)
        put(values, size, element, 3, sum_1 + along_1)
        sum_2, along_2, sum_3, along_3 = all_1 - eta_1, zeta_1 - twist_1, all_1 + eta_1, zeta_1 + twist_1
        put(values, size, element, 4, sum_2 - along_2)
        put(values, size, element, 5, sum_2 + along_2)
        put(values, size, element, 6, sum_3 - along_3)
        put(values, size, element, 7, sum_3 + along_3)

    @wp.func
    def symmetric_times(stress: vec6, area: vec3):
        return vec3(
            stress[0] * area[0] + stress[3] * area[1] + stress[5] * area[2],
            stress[3] * area[0] + stress[1] * area[1] + stress[4] * area[2],
            stress[5] * area[0] + stress[4] * area[1] + stress[2] * area[2],
        )

    @wp.func
    def turned(stress: vec6, turn: vec3):
        """Jaumann's change W σ − σ W of a stress by a small rotation vector: W r = turn × r."""
        x, y, z = turn[0], turn[1], turn[2]
        xx, yy, zz, xy, yz, zx = stress[0], stress[1], stress[2], stress[3], stress[4], stress[5]
        return vec6(
            two * (y * zx - z * xy),
            two * (z * xy - x * yz),
            two * (x * yz - y * zx),
            z * (xx - yy) + y * yz - x * zx,
            x * (yy - zz) + z * zx - y * xy,
            y * (zz - xx) + x * xy - z * yz,
        )

    @wp.func
    def drag(live: wp.bool, gradient_x: vec3, gradient_y: vec3, gradient_z: vec3, shape: vec3, motion: vec3):
        """Velocity of an hourglass that no uniform gradient of velocity explains; 0 of an element that has failed, by
        component, as a choice between vectors would be a branch."""
        rest = motion - vec3(wp.dot(gradient_x, shape), wp.dot(gradient_y, shape), wp.dot(gradient_z, shape))
        return vec3(wp.where(live, rest[0], zero), wp.where(live, rest[1], zero), wp.where(live, rest[2], zero))

    @wp.func
    def back_through(area: vec3, x: Modes, drag_0: vec3, drag_1: vec3, drag_2: vec3, drag_3: vec3):
        """Resistance against hourglasses on one of the modes that stretch an element."""
        first = wp.dot(area, x.eta_zeta) * drag_0 + wp.dot(area, x.zeta_xi) * drag_1
        return first + wp.dot(area, x.xi_eta) * drag_2 + wp.dot(area, x.all) * drag_3

    @wp.func
    def kept_stress(live: wp.bool, stress: vec6):
        """A stress, or zeros."""
        return vec6(
            wp.where(live, stress[0], zero),
            wp.where(live, stress[1], zero),
            wp.where(live, stress[2], zero),
            wp.where(live, stress[3], zero),
            wp.where(live, stress[4], zero),
            wp.where(live, stress[5], zero),
        )

    @wp.func
    def flow_stress(material: struct.Material, strain: real, rate: real, heat: real):
        """σ = (A + B ε^n + Σ Q (1 − e^(−C ε))) (1 + ε̇/ε̇₀)^c (1 − T*^m) [Pa], and its slope over ε [Pa]."""
        known = wp.max(strain, least_strain)
        power = material.hardening * exp(material.exponent * log(known))
        first = material.voce_stress[0] * exp(-material.voce_rate[0] * strain)
        second = material.voce_stress[1] * exp(-material.voce_rate[1] * strain)
        cold = material.yield_stress + power + material.voce_stress[0] - first + material.voce_stress[1] - second
        slope = material.exponent * power / known + material.voce_rate[0] * first + material.voce_rate[1] * second
        fast = exp(material.rate_exponent * log(one + rate / material.reference_rate))
        warm = one - exp(material.softening * log(wp.min(wp.max(heat, least_heat), one)))
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
        second = half * square + unstressed
        radius = wp.sqrt(second * third)
        cosine = half * third_invariant / (radius * radius * radius)
        t = wp.sqrt(half * (one + wp.min(wp.max(cosine, -one), one)))
        share = c0 + t * (c1 + t * (c2 + t * (c3 + t * (c4 + t * c5))))
        return mean + two * radius * share

    @wp.func
    def corner(x: Modes, xi: real, eta: real, zeta: real):
        """Jacobian at a corner, 64 times its volume where the element is a parallelepiped."""
        along_xi = x.xi + eta * x.xi_eta + zeta * x.zeta_xi + (eta * zeta) * x.all
        along_eta = x.eta + xi * x.xi_eta + zeta * x.eta_zeta + (xi * zeta) * x.all
        along_zeta = x.zeta + eta * x.eta_zeta + xi * x.zeta_xi + (xi * eta) * x.all
        return wp.dot(along_xi, wp.cross(along_eta, along_zeta))

    @wp.func
    def least_corner(x: Modes):
        """The least Jacobian at a corner; negative where an element is folded."""
        near = wp.min(corner(x, -one, -one, -one), corner(x, -one, -one, one))
        near = wp.min(near, wp.min(corner(x, -one, one, -one), corner(x, -one, one, one)))
        far = wp.min(corner(x, one, -one, -one), corner(x, one, -one, one))
        return wp.min(near, wp.min(far, wp.min(corner(x, one, one, -one), corner(x, one, one, one))))

    @wp.func
    def deform(mesh: struct.Mesh, block: struct.Block, element: wp.int32, dt: real):
        """Take an element over a step: positions are those at its end, velocities those in its middle."""
        size, material = mesh.size, block.material
        x = modes_of(mesh.position, size, block.row, block.plane, element)
        v = modes_of(mesh.velocity, size, block.row, block.plane, element)
        rest_volume, rest_length = read(mesh.volume, element), read(mesh.length, element)
        alive = read(mesh.alive, element)
        # Gradients at the middle of the step: a rigid rotation strains nothing.
        back = half * dt
        xi, eta, zeta = x.xi - back * v.xi, x.eta - back * v.eta, x.zeta - back * v.zeta
        area_xi, area_eta, area_zeta = wp.cross(eta, zeta), wp.cross(zeta, xi), wp.cross(xi, eta)
        determinant = wp.max(wp.dot(xi, area_xi), tiny)
        inverse = one / determinant
        by_xi, by_eta, by_zeta = inverse * area_xi, inverse * area_eta, inverse * area_zeta
        gradient_x = v.xi[0] * by_xi + v.eta[0] * by_eta + v.zeta[0] * by_zeta
        gradient_y = v.xi[1] * by_xi + v.eta[1] * by_eta + v.zeta[1] * by_zeta
        gradient_z = v.xi[2] * by_xi + v.eta[2] * by_eta + v.zeta[2] * by_zeta
        rate = vec6(
            gradient_x[0],
            gradient_y[1],
            gradient_z[2],
            half * (gradient_x[1] + gradient_y[0]),
            half * (gradient_y[2] + gradient_z[1]),
            half * (gradient_z[0] + gradient_x[2]),
        )
        turn = (
            half
            * dt
            * vec3(gradient_z[1] - gradient_y[2], gradient_x[2] - gradient_z[0], gradient_y[0] - gradient_x[1])
        )
        expansion = rate[0] + rate[1] + rate[2]
        before = tensor_at(mesh.stress, size, element)
        # Elastic trial, then radial return.
        swell = (material.bulk - two * third * material.shear) * expansion * dt
        trial = before + turned(before, turn) + (two * material.shear * dt) * rate
        trial = trial + vec6(swell, swell, swell, zero, zero, zero)
        mean = third * (trial[0] + trial[1] + trial[2])
        square = deviator_square(trial, mean)
        equivalent = wp.sqrt(real(1.5) * square)
        strain, heat = read(mesh.strain, element), read(mesh.heat, element)
        mean_rate = third * expansion
        speed = wp.sqrt(real(2.0 / 3.0) * deviator_square(rate, mean_rate))
        flow, slope = flow_stress(material, strain, speed, heat)
        flows = wp.max(equivalent - flow, zero) / (three * material.shear + slope)
        share = one - three * material.shear * flows / (equivalent + tiny)
        rest = (one - share) * mean
        stress = share * trial + vec6(rest, rest, rest, zero, zero, zero)
        hardened = flow + slope * flows
        largest = largest_principal(stress, mean, share * share * square)
        damage = read(mesh.damage, element) + wp.max(largest, zero) * flows / material.fracture_work
        heat += material.heating * hardened * flows
        # The shape at the end of the step.
        area_xi, area_eta, area_zeta = wp.cross(x.eta, x.zeta), wp.cross(x.zeta, x.xi), wp.cross(x.xi, x.eta)
        volume = of_volume * wp.dot(x.xi, area_xi)
        faces = wp.max(wp.max(wp.dot(area_xi, area_xi), wp.dot(area_eta, area_eta)), wp.dot(area_zeta, area_zeta))
        length = real(16.0) * volume / wp.sqrt(faces + tiny)
        fails = wp.max(
            wp.max(damage - one, heat - one),
            wp.max(wp.max(thinnest * rest_length, shortest * block.finest) - length, volume - widest * rest_volume),
        )
        fold = wp.min(folded - of_volume * least_corner(x) / wp.max(rest_volume, tiny), strain - block.folding)
        fails = wp.max(fails, fold)
        parts = wp.max(mean - material.spall, largest - material.tensile)
        fails = wp.max(fails, wp.max(parts, strain - material.ductility))
        live = wp.max(fails, half - alive) < zero
        density = material.density * rest_volume / wp.max(volume, least * rest_volume)
        closing = wp.min(expansion, zero)
        speeds = linear * material.wave_speed - quadratic * length * closing
        viscous = density * length * closing * -speeds
        # Resistance against hourglasses: c (motion that no uniform gradient explains), back through the same gradients.
        drag_0 = drag(live, gradient_x, gradient_y, gradient_z, x.eta_zeta - back * v.eta_zeta, v.eta_zeta)
        drag_1 = drag(live, gradient_x, gradient_y, gradient_z, x.zeta_xi - back * v.zeta_xi, v.zeta_xi)
        drag_2 = drag(live, gradient_x, gradient_y, gradient_z, x.xi_eta - back * v.xi_eta, v.xi_eta)
        drag_3 = drag(live, gradient_x, gradient_y, gradient_z, x.all - back * v.all, v.all)
        firmness = wp.sqrt(wp.min(real(1.0), material.yield_stress / (firm * material.density * material.wave_speed)))
        resistance = (
            real(0.25) * block.hourglass * firmness * material.density * material.wave_speed * rest_length * rest_length
        )
        squares = wp.dot(drag_0, drag_0) + wp.dot(drag_1, drag_1) + wp.dot(drag_2, drag_2) + wp.dot(drag_3, drag_3)
        # Forces on the corners.
        stress = kept_stress(live, stress)
        viscous = wp.where(live, viscous, zero)
        pressed = stress - vec6(viscous, viscous, viscous, zero, zero, zero)
        by_volume = one / wp.max(real(64.0) * volume, tiny)
        forces = Modes()
        forces.eta_zeta = -resistance * drag_0
        forces.zeta_xi = -resistance * drag_1
        forces.xi_eta = -resistance * drag_2
        forces.all = -resistance * drag_3
        braking = resistance * by_volume
        forces.xi = -of_force * symmetric_times(pressed, area_xi) + braking * back_through(
            area_xi, x, drag_0, drag_1, drag_2, drag_3
        )
        forces.eta = -of_force * symmetric_times(pressed, area_eta) + braking * back_through(
            area_eta, x, drag_0, drag_1, drag_2, drag_3
        )
        forces.zeta = -of_force * symmetric_times(pressed, area_zeta) + braking * back_through(
            area_zeta, x, drag_0, drag_1, drag_2, drag_3
        )
        spread(mesh.force, size, element, forces)
        stretched = half * (before + stress)
        power = (
            stretched[0] * rate[0]
            + stretched[1] * rate[1]
            + stretched[2] * rate[2]
            + two * (stretched[3] * rate[3] + stretched[4] * rate[4] + stretched[5] * rate[5])
            - viscous * expansion
        )
        write(mesh.work, element, read(mesh.work, element) + wp.where(live, dt * of_volume * determinant * power, zero))
        write(mesh.hourglass_work, element, read(mesh.hourglass_work, element) + dt * resistance * squares)
        put_tensor(mesh.stress, size, element, stress)
        write(mesh.strain, element, strain + flows)
        write(mesh.heat, element, heat)
        write(mesh.damage, element, damage)
        write(mesh.alive, element, wp.where(live, one, zero))
        # A wave against the viscosity: l / (Q + √(Q² + c²)).
        crossing = length / (speeds + wp.sqrt(speeds * speeds + material.wave_speed * material.wave_speed))
        write(mesh.crossing, element, wp.where(live, crossing, one))

    return deform


deform = build(Variant())
deform.add_overload(build(Variant(double=True)))
