"""The exposure gained in a step as whole numbers. Their sum is the same in any order, so lanes may add in any order."""

from functools import cache
from types import SimpleNamespace

import warp as wp

from . import constants, interaction, lanes, structs
from .variant import Variant


@cache
def build(variant: Variant) -> SimpleNamespace:
    """Device functions of whole numbers in a field of float32."""
    struct = structs.build(variant)
    real = variant.real
    one, sheet, tiny = real(1.0), real(constants.SHEET.value), real(constants.TINY.value)
    use = variant.use(interaction)

    @wp.func
    def units(law: struct.Law, window: struct.Window, coarsest: real, velocity: real, dt: real):
        """Units per exposure [1/s]: one advancing sheet, or the coarsest patch, gives `sheet` units to a node. The
        rounding is then that of float32, and 128 times as much still fits. A node lies below a few sheets of a core."""
        patches = wp.max(one, coarsest * window.per_cell * window.per_cell)
        return sheet / (wp.max(use.interaction.exposure_in(law, dt, velocity), tiny) * patches)

    # Bits are copied, because a compiler assumes that numbers of different types do not share memory.
    @wp.func_native("""
    assert(index >= 0 && index + stride + 1 < field.shape[0]);
    const float high = amount * y, low = amount - high;
    const auto add = [](float* at, float share) {
    #if defined(__CUDA_ARCH__)
        atomicAdd(reinterpret_cast<int*>(at), __float2int_rn(share));
    #else
        int held;
        __builtin_memcpy(&held, at, 4);
        held += (int)__builtin_rintf(share);
        __builtin_memcpy(at, &held, 4);
    #endif
    };
    float* const at = field.data + index;
    add(at, low - low * z);
    add(at + 1, low * z);
    add(at + stride, high - high * z);
    add(at + stride + 1, high * z);
    """)
    def scatter(
        field: wp.array(dtype=wp.float32),
        stride: wp.int32,
        index: wp.int32,
        y: wp.float32,
        z: wp.float32,
        amount: wp.float32,
    ):
        """Distribute an amount over four nodes, as `exposure.scatter` does, in whole numbers."""
        ...

    @wp.func_native(
        lanes.share(variant)
        + """
    assert(start >= 0 && start + count <= field.shape[0]);
    for (int j = lane; j < count; j += lanes) {
    #if defined(__CUDA_ARCH__)
        const int held = __float_as_int(field.data[start + j]);
    #else
        int held;
        __builtin_memcpy(&held, field.data + start + j, 4);
    #endif
        field.data[start + j] = (float)held * unit;
    }
    """
    )
    def convert(field: wp.array(dtype=wp.float32), start: wp.int32, count: wp.int32, unit: wp.float32):
        """Convert whole numbers of a unit to numbers."""
        ...

    @wp.func
    def measure(field: wp.array(dtype=wp.float32), window: struct.Window, box: struct.Box, units: real):
        """Convert the whole numbers in the rows of a box to exposure [s]."""
        start, count = window.first + box.y_low * window.cells_z, (box.y_high - box.y_low + 1) * window.cells_z
        convert(field, start, count, one / units)

    return SimpleNamespace(**locals())
