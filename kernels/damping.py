"""Damping: how the load of a ring resists a change of velocity. It makes a step implicit where contact is stiff."""

from functools import cache
from types import SimpleNamespace

import warp as wp

from . import structs
from .variant import Variant


@cache
def build(variant: Variant) -> SimpleNamespace:
    """Sums over a ring, and the blocks of the damping that follow from them, for one variant."""
    struct = structs.build(variant)
    real, vec2, vec3, mat33 = variant.real, variant.vec2, variant.vec3, variant.mat33
    zero = real(0.0)

    @wp.func
    def damping_vv(s: struct.Sums):
        """Σ slope n nᵀ."""
        return mat33(
            s.aa, s.ar[0], s.ar[1],
            s.ar[0], s.rr[0], s.rr[1],
            s.ar[1], s.rr[1], s.rr[2],
        )  # fmt: skip

    @wp.func
    def damping_vw(s: struct.Sums):
        """Σ slope n (arm × n)ᵀ."""
        return mat33(
            zero, -s.al[1], s.al[0],
            zero, -s.rl[1], s.rl[0],
            zero, -s.rl[2], s.rl[1],
        )  # fmt: skip

    @wp.func
    def damping_ww(s: struct.Sums):
        """Σ slope (arm × n)(arm × n)ᵀ."""
        return mat33(
            zero, zero, zero,
            zero, s.ll[2], -s.ll[1],
            zero, -s.ll[1], s.ll[0],
        )  # fmt: skip

    @wp.func
    def joined(a: struct.Sums, b: struct.Sums):
        """Sums over two sets of patches."""
        a.force += b.force
        a.moment += b.moment
        a.aa += b.aa
        a.ar += b.ar
        a.rr += b.rr
        a.al += b.al
        a.rl += b.rl
        a.ll += b.ll
        return a

    return SimpleNamespace(**locals())
