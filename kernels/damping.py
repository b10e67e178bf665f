"""Damping: how the load of a ring resists a change of velocity. It makes a step implicit where contact is stiff."""

from functools import cache
from types import SimpleNamespace

import warp as wp

from . import core_surface
from .variant import Variant


@cache
def build(variant: Variant) -> SimpleNamespace:
    """Sums over a ring, and the blocks of the damping that follow from them, for one variant."""
    real, vec2, vec3, mat33 = variant.real, variant.vec2, variant.vec3, variant.mat33
    zero = real(0.0)
    Ring = core_surface.build(variant).Ring

    @wp.struct
    class Sums:
        """Sums over a ring: force [N] and moment [N m] along the body axes; the derivative of the tractions by the
        closing speed [N s/m], weighted by 1, cos, sin, cos² and cos sin of the azimuth."""

        force: vec3
        moment: vec3
        slopes: real
        slopes_c: real
        slopes_s: real
        slopes_cc: real
        slopes_cs: real

    @wp.struct
    class Slopes:
        """Σ slope × two factors. The factors are the normal's components along the axis (a) and outwards (r), and its
        lever about the centre of mass (l). Each r or l brings a cos or sin of the azimuth: (cos, sin) for one of them,
        (cos², cos sin, sin²) for two."""

        aa: real
        ar: vec2
        rr: vec3
        al: vec2
        rl: vec3
        ll: vec3

    @wp.func
    def slopes_of(ring: Ring, s: Sums):
        """The slopes of a ring. Its normals are n = (a, r cos, r sin), and arm × n = l (0, −sin, cos)."""
        a, r = ring.normal_axial, ring.normal_radial
        lever = ring.station * r - ring.radius * a
        once, twice = vec2(s.slopes_c, s.slopes_s), vec3(s.slopes_cc, s.slopes_cs, s.slopes - s.slopes_cc)
        slopes = Slopes()
        slopes.aa = a * a * s.slopes
        slopes.ar = a * r * once
        slopes.rr = r * r * twice
        slopes.al = a * lever * once
        slopes.rl = r * lever * twice
        slopes.ll = lever * lever * twice
        return slopes

    @wp.func
    def damping_vv(s: Slopes):
        """Σ slope n nᵀ."""
        return mat33(
            s.aa, s.ar[0], s.ar[1],
            s.ar[0], s.rr[0], s.rr[1],
            s.ar[1], s.rr[1], s.rr[2],
        )  # fmt: skip

    @wp.func
    def damping_vw(s: Slopes):
        """Σ slope n (arm × n)ᵀ."""
        return mat33(
            zero, -s.al[1], s.al[0],
            zero, -s.rl[1], s.rl[0],
            zero, -s.rl[2], s.rl[1],
        )  # fmt: skip

    @wp.func
    def damping_ww(s: Slopes):
        """Σ slope (arm × n)(arm × n)ᵀ."""
        return mat33(
            zero, zero, zero,
            zero, s.ll[2], -s.ll[1],
            zero, -s.ll[1], s.ll[0],
        )  # fmt: skip

    @wp.func
    def added(a: Slopes, b: Slopes):
        """Sum of the slopes of two sets of rings."""
        a.aa += b.aa
        a.ar += b.ar
        a.rr += b.rr
        a.al += b.al
        a.rl += b.rl
        a.ll += b.ll
        return a

    @wp.func
    def joined(a: Sums, b: Sums):
        """Sums over a ring in two layers."""
        a.force += b.force
        a.moment += b.moment
        a.slopes += b.slopes
        a.slopes_c += b.slopes_c
        a.slopes_s += b.slopes_s
        a.slopes_cc += b.slopes_cc
        a.slopes_cs += b.slopes_cs
        return a

    return SimpleNamespace(
        Sums=Sums,
        Slopes=Slopes,
        slopes_of=slopes_of,
        added=added,
        joined=joined,
        damping_vv=damping_vv,
        damping_vw=damping_vw,
        damping_ww=damping_ww,
    )
