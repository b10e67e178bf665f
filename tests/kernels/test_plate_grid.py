"""The grid of the plate: windows onto the periodic tile, interpolation, and the tent filter (MODEL.md §4)."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
import warp as wp
from numpy.typing import NDArray

from warpimpact.kernels import plate_grid
from warpimpact.kernels.variant import Variant

from .probes import plate_of, poisoned, poisoned_fields

Array = NDArray[np.float64]

VARIANT = Variant(double=True)
real = VARIANT.real
grid = plate_grid.build(VARIANT)
Plate, Fields, Window, Box = grid.Plate, grid.Fields, grid.Window, grid.Box

DY, DZ = 0.25e-3, 0.2e-3
CELLS_Y, CELLS_Z = 24, 30
SLOTS = 3
TILE = np.random.default_rng(1).random((7, 11))


def lay(
    plate: Plate,
    fields: Fields,
    hit_y: wp.array(dtype=wp.float64),
    hit_z: wp.array(dtype=wp.float64),
    windows: wp.array(dtype=Window),
) -> None:
    slot = wp.tid()
    windows[slot] = grid.open_window(plate, fields, slot, hit_y[slot], hit_z[slot])


def look_up(
    fields: Fields,
    windows: wp.array(dtype=Window),
    slot: wp.int32,
    field: wp.array(dtype=real),
    y: wp.array(dtype=real),
    z: wp.array(dtype=real),
    values: wp.array(dtype=real),
) -> None:
    i = wp.tid()
    values[i] = grid.gather(field, fields.cells_z, grid.cell_at(fields, windows[slot], y[i], z[i]))


def gain(fields: Fields, windows: wp.array(dtype=Window), slot: wp.int32, y: real, z: real, amount: real) -> None:
    grid.scatter(fields.gain, fields.cells_z, grid.cell_at(fields, windows[slot], y, z), amount)


def spread(plate: Plate, fields: Fields, windows: wp.array(dtype=Window), slot: wp.int32, box: Box) -> None:
    grid.spread(plate, fields, windows[slot], box)


def settle(plate: Plate, fields: Fields, windows: wp.array(dtype=Window), slot: wp.int32, box: Box) -> None:
    grid.settle(plate, fields, windows[slot], box)


LAY, LOOK_UP, GAIN, SPREAD, SETTLE = (VARIANT.kernel(function) for function in (lay, look_up, gain, spread, settle))


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

    def centres(self, slot: int) -> tuple[Array, Array]:
        """Centres of a window's cells relative to its hit [m], along y and along z."""
        window = self.windows.numpy()[slot]
        y = window["y0"] + (np.arange(CELLS_Y) - CELLS_Y // 2) * DY
        z = window["z0"] + (np.arange(CELLS_Z) - CELLS_Z // 2) * DZ
        return y, z

    def launch(self, kernel: Any, *inputs: Any) -> None:
        wp.launch(kernel, 1, inputs=inputs, device=self.device)


def lay_windows(hits: Any, device: str, *, size: Any = (np.inf, np.inf), length: float = 0.5e-3) -> Laid:
    plate = plate_of(Plate, TILE, DY, DZ, device, size=size, length=length)
    fields = poisoned_fields(Fields, SLOTS, CELLS_Y, CELLS_Z, device)
    hits = np.broadcast_to(np.asarray(hits, dtype=float), (SLOTS, 2))
    windows = poisoned(SLOTS, Window, device)
    hit_y, hit_z = (wp.array(np.ascontiguousarray(h), dtype=wp.float64, device=device) for h in hits.T)
    wp.launch(LAY, SLOTS, inputs=[plate, fields, hit_y, hit_z], outputs=[windows], device=device)
    return Laid(plate, fields, windows, device)


def box_about(y: int, z: int) -> Any:
    """The box of the four cells from (y, z) on."""
    box = Box()
    box.y_low, box.y_high, box.z_low, box.z_high = y, y + 1, z, z + 1
    return box


PERIOD = np.array([TILE.shape[0] * DY, TILE.shape[1] * DZ])
HITS = np.array([[1.1e-4, 3.9e-4], [-2.3e-3, -7.7e-4], [5.05e-3, -1.03e-3]])


@pytest.mark.parametrize("shift", [0, 1, -1, 40_000, -40_000])
def test_window_shows_the_periodic_tile(shift: int, device: str) -> None:
    hits = HITS + shift * PERIOD  # up to 70 m away, where float32 coordinates would be cells off
    laid = lay_windows(hits, device)
    for slot, hit in enumerate(hits):
        y, z = laid.centres(slot)
        row = np.floor((hit[0] + y) / DY).astype(int) % TILE.shape[0]
        column = np.floor((hit[1] + z) / DZ).astype(int) % TILE.shape[1]
        np.testing.assert_array_equal(laid.read("material")[slot], TILE[np.ix_(row, column)])
        # The hit lies in the middle cell, and cells are where the tile has them.
        assert abs(y[CELLS_Y // 2]) <= DY / 2
        assert abs(z[CELLS_Z // 2]) <= DZ / 2
        np.testing.assert_allclose((HITS[slot][0] + y) / DY % 1, 0.5, atol=1e-6)
        np.testing.assert_allclose((HITS[slot][1] + z) / DZ % 1, 0.5, atol=1e-6)


def test_fresh_window_has_no_exposure(device: str) -> None:
    laid = lay_windows(HITS, device)
    for name in ("exposure", "gain"):
        np.testing.assert_array_equal(laid.read(name), 0.0)


def test_window_ends_at_the_rim_of_a_finite_plate(device: str) -> None:
    size = np.array([3.3e-3, 2.5e-3])  # no multiples of the cells
    laid = lay_windows(HITS / 10, device, size=size)
    for slot, hit in enumerate(HITS / 10):
        shares = []
        for centres, at, width, extent in zip(laid.centres(slot), hit, (DY, DZ), size, strict=True):
            edges = np.clip(at + centres[:, None] + [-width / 2, width / 2], -extent / 2, extent / 2)
            shares.append(np.diff(edges, axis=1)[:, 0] / width)
        pristine = lay_windows(HITS / 10, device).read("material")[slot]
        expected = pristine * np.outer(*shares)
        np.testing.assert_allclose(laid.read("material")[slot], expected, atol=1e-12)
        assert np.outer(*shares).sum() * DY * DZ == pytest.approx(size.prod())  # the test sees all of it


def test_interpolation_reproduces_a_linear_field(device: str) -> None:
    laid, slot = lay_windows(HITS, device), 1
    y, z = laid.centres(slot)
    values = np.full((SLOTS, CELLS_Y, CELLS_Z), np.nan)  # a look into another window shows
    values[slot] = 3.0 + 2e3 * y[:, None] - 5e3 * z[None, :]
    laid.write("exposure", values)
    at = np.random.default_rng(2).random((500, 2))
    at_y, at_z = y[0] + at[:, 0] * (y[-1] - y[0]), z[0] + at[:, 1] * (z[-1] - z[0])
    found = poisoned(500, real, device)
    inputs = [laid.fields, laid.windows, slot, laid.fields.exposure]
    inputs += [wp.array(a, dtype=real, device=device) for a in (at_y, at_z)]
    wp.launch(LOOK_UP, 500, inputs=inputs, outputs=[found], device=device)
    np.testing.assert_allclose(found.numpy(), 3.0 + 2e3 * at_y - 5e3 * at_z, rtol=1e-12, atol=1e-12)


def test_scatter_conserves_amount_and_place(device: str) -> None:
    laid, slot, amount = lay_windows(HITS, device), 2, 0.7
    y, z = 1.234e-3, -0.815e-3
    for _ in range(2):  # adds to what is there
        laid.launch(GAIN, laid.fields, laid.windows, slot, y, z, amount)
    gained = laid.read("gain")
    at_y, at_z = laid.centres(slot)
    assert np.count_nonzero(gained) == np.count_nonzero(gained[slot]) == 4
    assert gained.min() >= 0.0
    assert gained.sum() == pytest.approx(2 * amount, rel=1e-14)
    assert (gained[slot].sum(axis=1) @ at_y) / (2 * amount) == pytest.approx(y, rel=1e-12)
    assert (gained[slot].sum(axis=0) @ at_z) / (2 * amount) == pytest.approx(z, rel=1e-12)


def exposed_at_a_point(laid: Laid, slot: int, y: float, z: float) -> tuple[Array, Array]:
    """Exposure [cells_y, cells_z] at mid-step and at the end of a step, of a point that gains 1."""
    at_y, at_z = laid.centres(slot)
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
    # ℓ = 4 cells along y and 5 along z: gain 1 over a cell is K times the cell's area at every node.
    length, slot = 1.0e-3, 1
    laid = lay_windows(HITS, device, length=length)
    _, exposure = exposed_at_a_point(laid, slot, *point)
    tents = [
        np.maximum(0.0, 1.0 - np.abs(centres - at) / length) * width / length
        for centres, at, width in zip(laid.centres(slot), point, (DY, DZ), strict=True)
    ]
    np.testing.assert_allclose(exposure, np.outer(*tents), atol=1e-15)


@pytest.mark.parametrize("length", [0.26e-3, 0.37e-3, 0.5e-3, 0.61e-3, 1.13e-3])
@pytest.mark.parametrize("point", POINTS)
def test_exposure_keeps_mass_place_and_second_moment(point: tuple[float, float], length: float, device: str) -> None:
    # The taps' own second moment is ℓ²/6 − g²/6; interpolation at fraction f of a cell adds g² f(1 − f),
    # g²/6 on average.
    slot = 1
    laid = lay_windows(HITS, device, length=length)
    _, exposure = exposed_at_a_point(laid, slot, *point)
    assert exposure.min() >= 0.0
    assert exposure.sum() == pytest.approx(1.0, rel=1e-12)
    for axis, width in enumerate((DY, DZ)):
        distance = laid.centres(slot)[axis] - point[axis]
        along = exposure.sum(axis=1 - axis)
        fraction = (-distance[0] / width) % 1.0
        expected = length**2 / 6 + width**2 * (fraction * (1 - fraction) - 1 / 6)
        assert along @ distance == pytest.approx(0.0, abs=1e-12 * width)
        assert along @ distance**2 == pytest.approx(expected, rel=1e-9)


def test_mid_step_has_half_of_the_exposure_and_the_step_clears_its_gain(device: str) -> None:
    laid = lay_windows(HITS, device)
    middle, end = exposed_at_a_point(laid, 0, *POINTS[1])
    assert end.any()
    np.testing.assert_allclose(middle, end / 2, rtol=1e-14)
    np.testing.assert_array_equal(laid.read("gain"), 0.0)
    _, twice = exposed_at_a_point(laid, 0, *POINTS[1])
    np.testing.assert_allclose(twice, 2 * end, rtol=1e-14)


def test_length_below_the_cells_leaves_the_interpolation_alone(device: str) -> None:
    laid = lay_windows(HITS, device, length=0.1e-3)
    laid.launch(GAIN, laid.fields, laid.windows, 1, *POINTS[1], 1.0)
    gained = laid.read("gain")[1]
    _, exposure = exposed_at_a_point(lay_windows(HITS, device, length=0.1e-3), 1, *POINTS[1])
    np.testing.assert_allclose(exposure, gained, atol=1e-15)
