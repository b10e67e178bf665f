"""The plate: where a shot finds the periodic tile and the rim, its own grid of exposure, and the tent filter
(docs/model.md §4)."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
import warp as wp
from numpy.typing import NDArray
from scipy import ndimage

from warpimpact.kernels import exposure, plate_grid, structs
from warpimpact.kernels.variant import Variant
from warpimpact.solver.grid import tent_taps

from .probes import plate_of, poisoned, poisoned_fields

Array = NDArray[np.float64]

VARIANT, SINGLE = Variant(double=True), Variant()
real = VARIANT.real
use, single = (variant.use(exposure, plate_grid) for variant in (VARIANT, SINGLE))
struct = structs.build(VARIANT)
Plate, Fields, Window, Cell, Box = struct.Plate, struct.Fields, struct.Window, struct.Cell, struct.Box

CELL = 0.25e-3
CELLS_Y, CELLS_Z = 24, 30
SLOTS = 3
THICKNESS = wp.constant(4.0e-3)
TILE = np.random.default_rng(1).random((29, 44))
PERIOD = np.array([1.7e-3, 2.3e-3])
HITS = np.array([[1.1e-4, 3.9e-4], [-2.3e-3, -7.7e-4], [5.05e-3, -1.03e-3]])


def lay(
    plate: Plate,
    fields: Fields,
    hits: wp.array(dtype=wp.vec2d),
    windows: wp.array(dtype=Window),
) -> None:
    slot = wp.tid()
    windows[slot] = use.exposure.open_window(plate, real(THICKNESS), fields, slot, hits[slot])


def gain(fields: Fields, windows: wp.array(dtype=Window), slot: wp.int32, y: real, z: real, amount: real) -> None:
    cell = use.plate_grid.cell_at(windows[slot], y, z)
    use.exposure.scatter(fields.gain, windows[slot].cells_z, cell.index, cell.y, cell.z, amount)


def spread(plate: Plate, fields: Fields, windows: wp.array(dtype=Window), slot: wp.int32, box: Box) -> None:
    use.exposure.spread(plate, fields, windows[slot], box)


def settle(plate: Plate, fields: Fields, windows: wp.array(dtype=Window), slot: wp.int32, box: Box) -> None:
    use.exposure.settle(plate, fields, windows[slot], box)


LAY, GAIN, SPREAD, SETTLE = (VARIANT.kernel(function) for function in (lay, gain, spread, settle))


def beneath_kernel(variant: Variant) -> Any:
    """Kernel of the material under points, and of the share of a grid cell about them that lies on the plate."""
    part, real = plate_grid.build(variant), variant.real
    Plate = structs.build(variant).Plate

    def beneath(
        plate: Plate,
        hit: wp.vec2d,
        y: wp.array(dtype=real),
        z: wp.array(dtype=real),
        material: wp.array(dtype=real),
        shares: wp.array(dtype=real),
    ) -> None:
        i = wp.tid()
        window = part.window_at(plate, real(THICKNESS), 0, 2, 2, hit)
        material[i] = plate.tile[part.tile_at(plate, window, y[i], z[i])]
        shares[i] = part.on_plate(plate, window, y[i], z[i])

    return variant.kernel(beneath)


BENEATH = {variant: beneath_kernel(variant) for variant in (VARIANT, SINGLE)}


@dataclass
class Laid:
    """Windows laid about hits, one per slot, and their fields."""

    plate: Any
    fields: Any
    windows: wp.array
    device: str

    def read(self, name: str) -> Array:
        """A copy of a field, shape [slots, cells_y, cells_z]."""
        return getattr(self.fields, name).numpy().reshape(SLOTS, CELLS_Y, CELLS_Z).copy()

    def write(self, name: str, values: Array) -> None:
        getattr(self.fields, name).assign(values.reshape(-1))

    def launch(self, kernel: Any, *inputs: Any) -> None:
        wp.launch(kernel, 1, inputs=inputs, device=self.device)


# Nodes of any window relative to its hit [m], along y and along z.
NODES = tuple((np.arange(count) - count // 2) * CELL for count in (CELLS_Y, CELLS_Z))


def lay_windows(device: str, *, length: float = 0.5e-3) -> Laid:
    plate = plate_of(Plate, TILE, PERIOD, CELL, device, length=length)
    fields = poisoned_fields(Fields, SLOTS, CELLS_Y, CELLS_Z, device)
    windows = poisoned(SLOTS, Window, device)
    hits = wp.array(HITS, dtype=wp.vec2d, device=device)
    wp.launch(LAY, SLOTS, inputs=[plate, fields, hits], outputs=[windows], device=device)
    return Laid(plate, fields, windows, device)


def beneath(variant: Variant, hit: Array, y: Array, z: Array, device: str, **plate: Any) -> tuple[Array, Array]:
    """Material under points relative to a hit [m], and shares of the grid cells about them on the plate."""
    outputs = [poisoned(len(y), variant.real, device) for _ in range(2)]
    inputs = [
        plate_of(structs.build(variant).Plate, TILE, PERIOD, CELL, device, real=variant.real, **plate),
        wp.vec2d(*hit),
        *(wp.array(a, dtype=variant.real, device=device) for a in (y, z)),
    ]
    wp.launch(BENEATH[variant], len(y), inputs=inputs, outputs=outputs, device=device)
    material, shares = (array.numpy() for array in outputs)
    return material, shares


def box_about(y: int, z: int) -> Any:
    """The box of the four nodes from (y, z) on."""
    box = Box()
    box.y_low, box.y_high, box.z_low, box.z_high = y, y + 1, z, z + 1
    return box


@pytest.mark.parametrize(("variant", "rounding"), [(VARIANT, 1e-8), (SINGLE, 2e-4)], ids=["double", "single"])
@pytest.mark.parametrize("shift", [0, -1, 40_000])
def test_material_is_that_of_the_cell_of_the_periodic_tile(
    shift: int, variant: Variant, rounding: float, device: str
) -> None:
    # Up to 90 m away, where float32 coordinates would be cells off.
    y, z = np.random.default_rng(3).uniform(-8e-3, 8e-3, (2, 5000))
    for hit in HITS:
        actual, _ = beneath(variant, hit + shift * PERIOD, y, z, device)
        places = np.stack([(at + a) / p * n for at, a, p, n in zip(hit, (y, z), PERIOD, TILE.shape, strict=True)])
        sure = (np.abs(places - np.round(places)) > rounding).all(axis=0)  # not on a line between cells
        row, column = (np.floor(at).astype(int) % n for at, n in zip(places, TILE.shape, strict=True))
        np.testing.assert_allclose(actual[sure], TILE[row, column][sure], rtol=1e-6)
        assert sure.sum() > 4900


@pytest.mark.parametrize("far", [0.0, 70.0])
@pytest.mark.parametrize(("variant", "rounding"), [(VARIANT, 1e-9), (SINGLE, 1e-5)], ids=["double", "single"])
def test_finite_plate_ends_at_its_rim(far: float, variant: Variant, rounding: float, device: str) -> None:
    # The share of half a cell of the grid about a point that lies within the rim, here 70 m away too.
    size, y, z = np.array([3.3e-3, 2.5e-3]) + 2 * far, *np.random.default_rng(4).uniform(-4e-3, 4e-3, (2, 5000))
    for hit in HITS / 10 + far:
        _, actual = beneath(variant, hit, y, z, device, size=size)
        shares = []
        for points, at, extent in zip((y, z), hit, size, strict=True):
            edges = np.clip(at + points[:, None] + [-CELL / 4, CELL / 4], -extent / 2, extent / 2)
            shares.append(np.diff(edges, axis=1)[:, 0] / (CELL / 2))
        np.testing.assert_allclose(actual, np.prod(shares, axis=0), atol=rounding)
        assert {0.0, 1.0} < set(actual)


def exposed_at_a_point(laid: Laid, slot: int, y: float, z: float) -> tuple[Array, Array]:
    """Exposure [cells_y, cells_z] at mid-step and at the end of a step, of a point that gains 1."""
    at_y, at_z = NODES
    box = box_about(int(np.searchsorted(at_y, y)) - 1, int(np.searchsorted(at_z, z)) - 1)
    laid.launch(GAIN, laid.fields, laid.windows, slot, y, z, 1.0)
    laid.launch(SPREAD, laid.plate, laid.fields, laid.windows, slot, box)
    middle = laid.read("exposure")
    laid.launch(SETTLE, laid.plate, laid.fields, laid.windows, slot, box)
    end = laid.read("exposure")
    others = [k for k in range(SLOTS) if k != slot]
    assert not end[others].any()
    return middle[slot], end[slot]


POINTS = [(0.0, 0.0), (1.234e-3, -0.815e-3), (-1.41e-3, 1.27e-3)]


@pytest.mark.parametrize("point", POINTS)
def test_exposure_of_a_point_is_the_tent_at_the_nodes(point: tuple[float, float], device: str) -> None:
    # Half-width m = 4 cells, ℓ² = m² + 1 cells² (a sixth each for scattering and reading): gain 1 over a cell is,
    # for a whole m, the tent of that half-width times the cell's area at every node.
    half_width, slot = 4 * CELL, 1
    laid = lay_windows(device, length=np.sqrt(17.0) * CELL)
    _, exposure = exposed_at_a_point(laid, slot, *point)
    tents = [
        np.maximum(0.0, 1.0 - np.abs(nodes - at) / half_width) * CELL / half_width
        for nodes, at in zip(NODES, point, strict=True)
    ]
    np.testing.assert_allclose(exposure, np.outer(*tents), atol=1e-12)


@pytest.mark.parametrize("length", [0.3e-3, 0.8e-3, 1.13e-3])
def test_step_s_gain_is_convolved_with_the_taps(length: float, device: str) -> None:
    # Random gain in a box as near the window's edge as the filter's reach allows, on a plate that has exposure.
    laid, slot, rng = lay_windows(device, length=length), 1, np.random.default_rng(7)
    taps, reach = tent_taps(length, CELL), laid.plate.reach
    box = Box()
    rows = 2 * reach + 1
    box.y_low, box.y_high = rows, CELLS_Y - 1 - rows
    box.z_low, box.z_high = reach, CELLS_Z - 1 - reach
    before, gain = np.full((SLOTS, CELLS_Y, CELLS_Z), np.nan), np.full((SLOTS, CELLS_Y, CELLS_Z), np.nan)
    before[slot], gain[slot] = rng.random((CELLS_Y, CELLS_Z)), 0.0
    inner = (slot, slice(box.y_low, box.y_high + 1), slice(box.z_low, box.z_high + 1))
    gain[inner] = rng.random(gain[inner].shape)
    for name, values in (("exposure", before), ("gain", gain)):  # a read of another slot is visible
        laid.write(name, values)
    expected = ndimage.convolve(gain[slot], np.outer(taps, taps), mode="constant")
    for kernel, share in ((SPREAD, 0.5), (SETTLE, 1.0)):
        laid.launch(kernel, laid.plate, laid.fields, laid.windows, slot, box)
        np.testing.assert_allclose(laid.read("exposure")[slot], before[slot] + share * expected, rtol=1e-13)
    np.testing.assert_array_equal(laid.read("gain")[slot], 0.0)
