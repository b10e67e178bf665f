"""Earlier hits: a window reads what earlier ones hold, wherever they lie, and keeps what it adds."""

import numpy as np
import pytest
import warp as wp
from scipy.ndimage import map_coordinates

from warpimpact.kernels import channel, earlier, exposure, structs
from warpimpact.kernels.variant import Variant

from .probes import plate_of, poisoned, poisoned_fields

VARIANT = Variant(double=True, burst=True)
use, struct = VARIANT.use(channel, earlier, exposure), structs.build(VARIANT)
Earlier, Plate, Fields, Window = struct.Earlier, struct.Plate, struct.Fields, struct.Window

CELL, CELLS_Y, CELLS_Z = 0.25e-3, 20, 26
SLOTS, COUNT, SLOT = 2, 3, 1
NODES = CELLS_Y * CELLS_Z


def hit(
    plate: Plate,
    fields: Fields,
    earlier: Earlier,
    shot: wp.int32,
    hits: wp.array(dtype=wp.vec2d),
    added: wp.array(dtype=wp.float64),
    found: wp.array(dtype=wp.float64),
) -> None:
    fields = use.exposure.fields_of_slot(fields, SLOT)
    window = use.exposure.open_window(plate, wp.float64(4.0e-3), fields, 0, hits[shot])
    window.weakens = True
    window = use.channel.open_window(earlier, window, wp.float64(4.0e-3), 0)
    use.earlier.begin(earlier, SLOT, shot)
    use.earlier.recall(earlier, fields, plate, window, SLOT, shot, 0, hits[shot])
    for k in range(NODES):
        found[k] = fields.exposure[window.first + k]
        fields.exposure[window.first + k] = found[k] + added[shot * NODES + k]
    use.earlier.keep(earlier, fields, window, SLOT, shot)


kernel = VARIANT.kernel(hit)


def scratch(device: str) -> Earlier:
    """Scratch of earlier hits, with channels on the two faces of a layer, all poisoned."""
    earlier = Earlier()
    earlier.count, earlier.nodes, earlier.layers = COUNT, NODES, 1
    earlier.exposure = poisoned(SLOTS * COUNT * NODES, wp.float64, device)
    earlier.channel_nodes, earlier.planes = 2 * NODES, 2
    earlier.inside = poisoned(SLOTS * COUNT * earlier.channel_nodes, wp.float64, device)
    earlier.sections = poisoned(SLOTS * earlier.planes, struct.Section, device)
    for name, kind in (("hit", wp.vec2d), ("open", wp.bool), ("box", struct.Box), ("through", wp.bool)):
        setattr(earlier, name, poisoned(SLOTS * COUNT, kind, device))
    earlier.first, earlier.first_plane = (wp.zeros(1, dtype=wp.int32, device=device) for _ in range(2))
    earlier.apart = wp.array([4.0e-3], dtype=wp.float64, device=device)
    return earlier


def shoot(y: list[float], z: list[float], added: np.ndarray, device: str) -> tuple[list[np.ndarray], np.ndarray]:
    """What every shot found, and what is kept of all."""
    plate = plate_of(Plate, np.ones((4, 4)), (1e-3, 1e-3), CELL, device)
    fields, earlier = poisoned_fields(Fields, SLOTS, CELLS_Y, CELLS_Z, device), scratch(device)
    hits = wp.array(np.stack([y, z], axis=1), dtype=wp.vec2d, device=device)
    put = [hits, wp.array(added.ravel(), dtype=wp.float64, device=device)]
    found = []
    for shot in range(COUNT):
        found.append(poisoned(NODES, wp.float64, device))
        wp.launch(kernel, 1, inputs=[plate, fields, earlier, shot, *put], outputs=[found[-1]], device=device)
    kept = earlier.exposure.numpy().reshape(SLOTS, COUNT, CELLS_Y, CELLS_Z)
    assert np.isnan(kept[1 - SLOT]).all()  # the other slot is left alone
    return [one.numpy().reshape(CELLS_Y, CELLS_Z) for one in found], kept[SLOT]


def fields_with_a_rim() -> np.ndarray:
    added = np.random.default_rng(0).random((COUNT, CELLS_Y, CELLS_Z))
    return added * np.pad(np.ones((CELLS_Y - 2, CELLS_Z - 2)), 1)


def read_at(field: np.ndarray, shift_y: float, shift_z: float) -> np.ndarray:
    """A field read bilinearly at its own nodes, shifted [m]."""
    i, j = np.mgrid[:CELLS_Y, :CELLS_Z]
    return map_coordinates(field, [i + shift_y / CELL, j + shift_z / CELL], order=1, mode="constant")


@pytest.mark.parametrize(
    "second", [(0.0, 0.0), (0.31e-3, -1.17e-3), (-2.6e-3, 0.9e-3), (4.99e-3, 0.0), (-4.8e-3, -6.4e-3)]
)
def test_a_window_reads_the_sum_of_what_earlier_ones_added(second: tuple[float, float], device: str) -> None:
    y, z = [1.0e-3, 1.0e-3 + second[0], 1.4e-3], [-5.0e-3, -5.0e-3 + second[1], -5.3e-3]
    added = fields_with_a_rim()
    found, kept = shoot(y, z, added, device)
    assert (found[0] == 0.0).all()
    np.testing.assert_allclose(found[1], read_at(added[0], *second), atol=1e-12)
    both = sum(read_at(added[k], y[2] - y[k], z[2] - z[k]) for k in range(2))
    np.testing.assert_allclose(found[2], both, atol=1e-12)
    np.testing.assert_allclose(kept, added, atol=1e-15)


def test_windows_that_do_not_overlap_hold_nothing_of_each_other(device: str) -> None:
    added = fields_with_a_rim()
    found, kept = shoot([0.0, CELLS_Y * CELL, 1e3], [0.0, 0.0, -1e3], added, device)
    assert all((one == 0.0).all() for one in found)
    np.testing.assert_array_equal(kept, added)


def test_the_same_place_reads_every_node_exactly(device: str) -> None:
    added = fields_with_a_rim()
    found, _ = shoot([0.1, 0.1, 0.1], [0.2, 0.2, 0.2], added, device)
    np.testing.assert_array_equal(found[1], added[0])
