"""The lanes of a block: the threads of one CUDA warp, which compute one shot together (the block layout).

Every lane holds the whole state of the shot, and computes its motion: the lanes share out only the patches, the rings
and the nodes. A sum over the lanes is formed as a butterfly, which gives every lane the same bits. So every lane takes
the same branches, and no lane waits at a barrier that another one does not reach.

On a CPU a block has one lane, and all of this costs nothing. With Warp's `enable_cpu_blocks` the lanes of a block run
there one after another, from barrier to barrier, on one thread of the machine: for tests.
"""

from functools import cache
from types import SimpleNamespace
from typing import Any

import warp as wp

from . import constants
from .variant import Variant

THREADS, LANES, BLOCKS = (number.value for number in (constants.THREADS, constants.LANES, constants.BLOCKS))
LANE = "WP_TILE_THREAD_IDX"
"""Number of this lane in native code."""
WAIT = "WP_TILE_SYNC();"
"""A barrier in native code on a CPU, where the lanes run one after another and take turns."""


def share(variant: Variant) -> str:
    """Native code before a loop over j that the lanes of a block share out: `for (int j = lane; j < n; j += lanes)`. In
    the simple layout it gives the plain loop."""
    if variant.window:
        return f"const int lane = {LANE}, lanes = WP_TILE_BLOCK_DIM;"
    return "constexpr int lane = 0, lanes = 1;"


def _butterfly(variant: Variant, kind: str, both: str) -> str:
    """Native code that combines the x of all lanes by `both`, an expression of `x` and the x of the `other` lane. In
    the simple layout a lane is alone."""
    if not variant.window:
        return "return x;"
    return f"""
#if defined(__CUDA_ARCH__)
    static_assert(WP_TILE_BLOCK_DIM == {LANES}, "a block is one warp");
    for (int apart = {LANES // 2}; apart > 0; apart /= 2) {{
        const {kind} other = __shfl_xor_sync(0xffffffffu, x, apart);
        x = {both};
    }}
#else
    if constexpr (WP_TILE_BLOCK_DIM > 1) {{
        static {kind} held[WP_TILE_BLOCK_DIM];
        for (int apart = WP_TILE_BLOCK_DIM / 2; apart > 0; apart /= 2) {{
            held[{LANE}] = x;
            WP_TILE_SYNC();
            const {kind} other = held[{LANE} ^ apart];
            WP_TILE_SYNC();
            x = {both};
        }}
    }}
#endif
    return x;
    """


@cache
def build(variant: Variant) -> SimpleNamespace:
    """Device functions of the lanes for one variant."""
    real, reals, vec2, vec3 = variant.real, variant.reals, variant.vec2, variant.vec3
    kind = "double" if variant.double else "float"

    @wp.func_native(f"{share(variant)} return lane;")
    def lane() -> wp.int32:
        """Number of this lane; 0 in the simple layout."""
        ...

    @wp.func_native(f"{share(variant)} return lanes;")
    def count() -> wp.int32:
        """Number of lanes; 1 in the simple layout."""
        ...

    waiting = f"""
    #if defined(__CUDA_ARCH__)
        __syncwarp();
    #else
        {WAIT}
    #endif
    """

    @wp.func_native(waiting if variant.window else "")
    def barrier():
        """Wait for all lanes, so that each sees what the others have written. In the simple layout it does nothing."""
        ...

    @wp.func_native(f"{share(variant)} return j % lanes == lane;")
    def has(j: wp.int32) -> wp.bool:
        """Whether number j, at least 0, is this lane's; always true in the simple layout."""
        ...

    @wp.func_native(_butterfly(variant, kind, "x + other"))
    def total(x: real) -> real:
        """Sum over the lanes: the same bits in each of them."""
        ...

    @wp.func_native(_butterfly(variant, kind, "other < x ? other : x"))
    def lowest(x: real) -> real:
        """Minimum over the lanes."""
        ...

    @wp.func_native(_butterfly(variant, kind, "other > x ? other : x"))
    def highest(x: real) -> real:
        """Maximum over the lanes."""
        ...

    @wp.func_native(_butterfly(variant, "int", "other < x ? other : x"))
    def least(x: wp.int32) -> wp.int32:
        """Minimum over the lanes."""
        ...

    @wp.func_native(_butterfly(variant, "int", "other > x ? other : x"))
    def most(x: wp.int32) -> wp.int32:
        """Maximum over the lanes."""
        ...

    @wp.func
    def total_pair(x: vec2):
        """Sum of each component over the lanes."""
        return vec2(total(x[0]), total(x[1]))

    @wp.func
    def total_triple(x: vec3):
        """Sum of each component over the lanes."""
        return vec3(total(x[0]), total(x[1]), total(x[2]))

    @wp.func
    def any_of(x: wp.bool):
        """Whether x is true for any lane."""
        return most(wp.where(x, 1, 0)) > 0

    def shared(name: str) -> Any:
        """The function that gives a block the nodes of its front window: in its shared memory on CUDA, else in global
        memory."""

        @wp.func_native(f"""
        #if defined(__CUDA_ARCH__)
            __shared__ {kind} {name}[{variant.window}];
            return wp::array_t<{kind}>({name}, {variant.window});
        #else
            assert(first >= 0 && first <= field.shape[0]);
            const int left = field.shape[0] - first;
            return wp::array_t<{kind}>(field.data + first, left < {variant.window} ? left : {variant.window});
        #endif
        """)
        def place(field: reals, first: wp.int32) -> reals:
            """The nodes of the front window. Without shared memory they are those of a field from number `first` on."""
            ...

        return place

    shared_exposure, shared_gain = shared("exposure"), shared("gain")
    return SimpleNamespace(**locals())
