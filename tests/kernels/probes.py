"""Common parts of the tests of device functions: structs and arrays in, poisoned arrays out; all in float64."""

import ctypes
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpimpact.scene import ConeCore, Core, OgiveCore, PolynomialCore
from warpimpact.solver import structs
from warpimpact.solver.grid import Grid, tent_taps
from warpimpact.solver.rings import rings_of
from warpimpact.solver.tile import Tile

PAPER = PolynomialCore(coefficients=(3.0e-4, 0.24, -5.29), length=27.86e-3, density=7850.0)
OGIVE = OgiveCore(diameter=6.17e-3, crh=3.0, length=27.0e-3, mass=5.25e-3)
CONE = ConeCore(diameter=6.0e-3, length=20.0e-3, cone_length=12.0e-3, mass=3.0e-3)


def records(struct: Any, device: str, **columns: Any) -> wp.array:
    """An array of structs [n] from columns of shape [n, ...]; a column without n holds for all structs."""
    names = struct.numpy_dtype()["names"]
    assert set(columns) <= set(names), "a misspelt member would stay zero unnoticed"
    count = max(len(np.atleast_1d(column)) for column in columns.values())
    values = np.zeros(count, dtype=struct.numpy_dtype())
    for name, column in columns.items():
        values[name] = column
    return wp.array(values, dtype=struct, device=device)


def poisoned(shape: int | tuple[int, ...], dtype: Any, device: str) -> wp.array:
    """An array with all bits set, which is NaN in every float. So a test sees a value that a kernel did not write."""
    array = wp.empty(shape, dtype=dtype, device="cpu")
    ctypes.memset(array.ptr, 0xFF, array.capacity)
    return array.to(device)


def attitudes(rng: np.random.Generator, count: int) -> NDArray[np.float64]:
    """Random unit quaternions (x, y, z, w), shape [count, 4]."""
    quaternions = rng.standard_normal((count, 4))
    return quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)


def astride(count: int) -> dict[str, NDArray[np.float64]]:
    """Random poses and motions of a core near the slab."""
    rng = np.random.default_rng(count)
    return {
        "position": rng.uniform(-8e-3, 8e-3, (count, 3)),
        "attitude": attitudes(rng, count),
        "velocity": 500.0 * rng.standard_normal((count, 3)),
        "omega": 2e4 * rng.standard_normal((count, 3)),
    }


def surface_of(struct: Any, core: Core, axial: int, around: int, device: str) -> Any:
    """The Surface of a core in `axial` × `around` patches and its discs."""
    put = structs.ToDevice(device, wp.float64)
    return structs.surface_of(struct, core, rings_of(core, axial, around), around, put)


def plate_of(
    struct: Any,
    tile: NDArray[np.float64],
    period: Any,
    spacing: float,
    device: str,
    *,
    length: float = 0.5e-3,
    size: Any = (np.inf, np.inf),
    real: Any = wp.float64,
) -> Any:
    """The Plate of a tile of material fractions, with the filter of a degradation length on a grid of some spacing."""
    (rows, columns), tent = tile.shape, tent_taps(length, spacing)
    grid = Grid(
        tile=Tile(tile.shape, period[0] / rows, period[1] / columns, lambda _: tile),
        period=period,
        half_size=(size[0] / 2, size[1] / 2),
        spacing=spacing,
        taps=np.append(tent[len(tent) // 2 :], 0.0),
    )
    return structs.plate_of(struct, grid, structs.ToDevice(device, real))


def poisoned_fields(struct: Any, slots: int, cells_y: int, cells_z: int, device: str, *, real: Any = wp.float64) -> Any:
    """The Fields of some slots with one window each, all values poisoned. Seen as a whole, they are those of one slot
    with as many layers."""
    fields, nodes = struct(), cells_y * cells_z
    fields.nodes = nodes
    sizes = {"first": np.arange(slots) * nodes, "cells_y": np.full(slots, cells_y), "cells_z": np.full(slots, cells_z)}
    for name, values in sizes.items():
        setattr(fields, name, wp.array(values, dtype=wp.int32, device=device))
    for name in ("exposure", "gain", "filtered"):
        setattr(fields, name, poisoned(slots * nodes, real, device))
    return fields


def poisoned_touches(struct: Any, slots: int, surface: Any, device: str) -> Any:
    """The Touches of some slots, all values poisoned."""
    touches = struct()
    for name, variable in struct.vars.items():
        patches = 1 if name in ("ring_area", "sums", "total_area") else surface.around
        setattr(touches, name, poisoned(slots * surface.rings * patches, variable.type.dtype, device))
    return touches
