"""Damping: how the load of a ring resists a change of velocity. It makes a step implicit where contact is stiff."""

from functools import cache
from types import SimpleNamespace

import warp as wp

from .variant import Variant


@cache
def build(variant: Variant) -> SimpleNamespace:
    """Sums over a ring, and the blocks of the damping that follow from them, for one variant."""
    real, vec2, vec3, mat33 = variant.real, variant.vec2, variant.vec3, variant.mat33
    zero = real(0.0)

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

    @wp.struct
    class Sums:
        """Sums over some patches: force [N] and moment [N m] along the body axes, and the slopes of the tractions
        [N s/m]."""

        force: vec3
        moment: vec3
        slopes: Slopes

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
        """Sums over two sets of patches."""
        a.force += b.force
        a.moment += b.moment
        a.slopes = added(a.slopes, b.slopes)
        return a

    return SimpleNamespace(**locals())
