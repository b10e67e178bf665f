"""The element: a hexahedron with one point of integration, its strain, stress, viscosities, failure and forces.

The corners of a hexahedron lie at ξ, η, ζ = ±1. Of their positions and velocities only sums with these signs count:
three that stretch and turn it (ξ, η, ζ), and four hourglasses (ηζ, ζξ, ξη, ξηζ). Forces on the corners are such sums,
too.
"""

from functools import cache
from types import SimpleNamespace

import warp as wp

from .. import memory
from ..variant import Variant
from . import choices, fields, plasticity
from .fields import over_runs


@cache
def build(variant: Variant) -> SimpleNamespace:
    """Device functions of the element for one variant."""
    struct, real = fields.build(variant), variant.real
    access, use = memory.build(real), plasticity.build(variant)
    read, write = access.read, access.write
    vec3, vec6 = wp.types.vector(3, real), wp.types.vector(6, real)
    zero, half, one, two, three = (real(value) for value in (0.0, 0.5, 1.0, 2.0, 3.0))
    third, eighth, of_volume, of_force = (real(value) for value in (1 / 3, 1 / 8, 1 / 64, 1 / 64))
    quadratic, linear = real(choices.QUADRATIC.value), real(choices.LINEAR.value)
    hourglass, firm = real(choices.HOURGLASS.value / 4.0), real(choices.FIRM.value)
    tiny = real(choices.NOTHING.value)
    thinnest, widest, least = (real(share.value) for share in (choices.THINNEST, choices.WIDEST, choices.LEAST_VOLUME))

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
    def vector_at(values: wp.array(dtype=real), size: wp.int32, number: wp.int32):
        return vec3(read(values, number), read(values, size + number), read(values, 2 * size + number))

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
        write(values, 3 * corner * size + element, force[0])
        write(values, (3 * corner + 1) * size + element, force[1])
        write(values, (3 * corner + 2) * size + element, force[2])

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
    def drag(gradient_x: vec3, gradient_y: vec3, gradient_z: vec3, shape: vec3, motion: vec3):
        """Velocity of an hourglass that no uniform gradient of velocity explains."""
        return motion - vec3(wp.dot(gradient_x, shape), wp.dot(gradient_y, shape), wp.dot(gradient_z, shape))

    @wp.func
    def kept(live: wp.bool, vector: vec3):
        """A vector, or zeros; component by component, as a choice between vectors would be a branch."""
        return vec3(wp.where(live, vector[0], zero), wp.where(live, vector[1], zero), wp.where(live, vector[2], zero))

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
    def deform(mesh: struct.Mesh, sheet: struct.Sheet, element: wp.int32, dt: real):
        """Take an element over a step: positions are those at its end, velocities those in its middle."""
        size = mesh.size
        x = modes_of(mesh.position, size, sheet.row, sheet.plane, element)
        v = modes_of(mesh.velocity, size, sheet.row, sheet.plane, element)
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
        before = vec6(
            read(mesh.stress, element),
            read(mesh.stress, size + element),
            read(mesh.stress, 2 * size + element),
            read(mesh.stress, 3 * size + element),
            read(mesh.stress, 4 * size + element),
            read(mesh.stress, 5 * size + element),
        )
        # Elastic trial, then radial return.
        swell = (sheet.bulk - two * third * sheet.shear) * expansion * dt
        trial = before + turned(before, turn) + (two * sheet.shear * dt) * rate
        trial = trial + vec6(swell, swell, swell, zero, zero, zero)
        mean = third * (trial[0] + trial[1] + trial[2])
        square = use.deviator_square(trial, mean)
        equivalent = wp.sqrt(real(1.5) * square)
        strain, heat = read(mesh.strain, element), read(mesh.heat, element)
        mean_rate = third * expansion
        speed = wp.sqrt(real(2.0 / 3.0) * use.deviator_square(rate, mean_rate))
        flow, slope = use.flow_stress(sheet, strain, speed, heat)
        flows = wp.max(equivalent - flow, zero) / (three * sheet.shear + slope)
        share = one - three * sheet.shear * flows / (equivalent + tiny)
        rest = (one - share) * mean
        stress = share * trial + vec6(rest, rest, rest, zero, zero, zero)
        hardened = flow + slope * flows
        largest = use.largest_principal(stress, mean, share * share * square)
        damage = read(mesh.damage, element) + wp.max(largest, zero) * flows / sheet.fracture_work
        heat += sheet.heating * hardened * flows
        # The shape at the end of the step.
        area_xi, area_eta, area_zeta = wp.cross(x.eta, x.zeta), wp.cross(x.zeta, x.xi), wp.cross(x.xi, x.eta)
        volume = of_volume * wp.dot(x.xi, area_xi)
        faces = wp.max(wp.max(wp.dot(area_xi, area_xi), wp.dot(area_eta, area_eta)), wp.dot(area_zeta, area_zeta))
        length = real(16.0) * volume / wp.sqrt(faces + tiny)
        fails = wp.max(
            wp.max(damage - one, heat - one), wp.max(thinnest * rest_length - length, volume - widest * rest_volume)
        )
        live = wp.max(fails, half - alive) < zero
        density = sheet.density * rest_volume / wp.max(volume, least * rest_volume)
        closing = wp.min(expansion, zero)
        speeds = linear * sheet.wave_speed - quadratic * length * closing
        viscous = density * length * closing * -speeds
        # Resistance against hourglasses: c (motion that no uniform gradient explains), back through the same gradients.
        drag_0 = drag(gradient_x, gradient_y, gradient_z, x.eta_zeta - back * v.eta_zeta, v.eta_zeta)
        drag_1 = drag(gradient_x, gradient_y, gradient_z, x.zeta_xi - back * v.zeta_xi, v.zeta_xi)
        drag_2 = drag(gradient_x, gradient_y, gradient_z, x.xi_eta - back * v.xi_eta, v.xi_eta)
        drag_3 = drag(gradient_x, gradient_y, gradient_z, x.all - back * v.all, v.all)
        firmness = wp.sqrt(wp.min(real(1.0), sheet.yield_stress / (firm * sheet.density * sheet.wave_speed)))
        resistance = hourglass * firmness * sheet.density * sheet.wave_speed * rest_length * rest_length
        drag_0 = kept(live, drag_0)
        drag_1 = kept(live, drag_1)
        drag_2 = kept(live, drag_2)
        drag_3 = kept(live, drag_3)
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
        forces.xi = -of_force * symmetric_times(pressed, area_xi) + resistance * by_volume * (
            wp.dot(area_xi, x.eta_zeta) * drag_0
            + wp.dot(area_xi, x.zeta_xi) * drag_1
            + wp.dot(area_xi, x.xi_eta) * drag_2
            + wp.dot(area_xi, x.all) * drag_3
        )
        forces.eta = -of_force * symmetric_times(pressed, area_eta) + resistance * by_volume * (
            wp.dot(area_eta, x.eta_zeta) * drag_0
            + wp.dot(area_eta, x.zeta_xi) * drag_1
            + wp.dot(area_eta, x.xi_eta) * drag_2
            + wp.dot(area_eta, x.all) * drag_3
        )
        forces.zeta = -of_force * symmetric_times(pressed, area_zeta) + resistance * by_volume * (
            wp.dot(area_zeta, x.eta_zeta) * drag_0
            + wp.dot(area_zeta, x.zeta_xi) * drag_1
            + wp.dot(area_zeta, x.xi_eta) * drag_2
            + wp.dot(area_zeta, x.all) * drag_3
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
        write(mesh.stress, element, stress[0])
        write(mesh.stress, size + element, stress[1])
        write(mesh.stress, 2 * size + element, stress[2])
        write(mesh.stress, 3 * size + element, stress[3])
        write(mesh.stress, 4 * size + element, stress[4])
        write(mesh.stress, 5 * size + element, stress[5])
        write(mesh.strain, element, strain + flows)
        write(mesh.heat, element, heat)
        write(mesh.damage, element, damage)
        write(mesh.alive, element, wp.where(live, one, zero))
        # A wave against the viscosity: l / (Q + √(Q² + c²)).
        crossing = length / (speeds + wp.sqrt(speeds * speeds + sheet.wave_speed * sheet.wave_speed))
        write(mesh.crossing, element, wp.where(live, crossing, one))

    deform_all = over_runs(struct, real, deform)
    return SimpleNamespace(**locals())
