"""Access to contiguous arrays in a form that a compiler can vectorise.

Warp's own indexing takes any stride and counts negative indices from the end, so a compiler cannot see that neighbours
are adjacent in memory. A function is defined for each type that it returns: definitions of a name are overloads.
"""

from typing import Any

import warp as wp

ACROSS = """
    const auto across = [](const auto* from, auto z) {  // linear interpolation between a number and the next one
    #if !defined(__CUDA_ARCH__)
        if constexpr (sizeof(z) == 4) {  // a CPU reads two neighbours at once in half the time
            unsigned long long both;
            memcpy(&both, from, sizeof(both));
            const float first = __builtin_bit_cast(float, (unsigned)both);
            return first + z * (__builtin_bit_cast(float, (unsigned)(both >> 32)) - first);
        }
    #endif
        return from[0] + z * (from[1] - from[0]);
    };
"""
"""Native code of the function `across`: linear interpolation from an address on, at a place between 0 and 1."""
READ = "assert(index >= 0 && index < array.shape[0]); return array.data[index];"
WRITE = "assert(index >= 0 && index < array.shape[0]); array.data[index] = value;"
PART = """
    assert(first >= 0 && first + count <= array.shape[0]);
    auto part = array;
    part.data += first;
    part.shape[0] = count;
    return part;
"""
"""Native code of an access: Warp's debug mode checks the bounds here, as it does for its own indexing."""


@wp.func_native(READ)
def read(array: wp.array(dtype=wp.float32), index: wp.int32) -> wp.float32:
    """array[index]"""
    ...


@wp.func_native(READ)
def read(array: wp.array(dtype=wp.float64), index: wp.int32) -> wp.float64:  # noqa: F811
    """array[index]"""
    ...


@wp.func_native(READ)
def read(array: wp.array(dtype=wp.int32), index: wp.int32) -> wp.int32:  # noqa: F811
    """array[index]"""
    ...


@wp.func_native(WRITE)
def write(array: wp.array(dtype=Any), index: wp.int32, value: Any):
    """array[index] = value"""
    ...


@wp.func_native(PART)
def part_of(array: wp.array(dtype=wp.float32), first: wp.int32, count: wp.int32) -> wp.array(dtype=wp.float32):
    """array[first : first + count]"""
    ...


@wp.func_native(PART)
def part_of(  # noqa: F811
    array: wp.array(dtype=wp.float64), first: wp.int32, count: wp.int32
) -> wp.array(dtype=wp.float64):
    """array[first : first + count]"""
    ...
