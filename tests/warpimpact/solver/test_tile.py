"""Tile of the plate: material by area, and the filter of the exposure."""

from typing import Any

import numpy as np
import pytest

from warpimpact.scene import CirclePattern, Plate, PolygonsPattern, SlotPattern, TrianglePattern
from warpimpact.solver.device import Cancelled
from warpimpact.solver.grid import FINER, tent_taps
from warpimpact.solver.tile import _KEPT, check_tiles, tile_of

PLATE = Plate(thickness=4e-3, resistance=2.6e9, degradation_length=0.6e-3)
PATTERNS = [
    SlotPattern(length=12e-3, width=4e-3, spacing=(8e-3, 16e-3), staggered=True),
    CirclePattern(diameter=5e-3, spacing=(7.1e-3, 9.3e-3)),
    TrianglePattern(side=6e-3, spacing=(8e-3, 8e-3), staggered=True),
]


@pytest.mark.parametrize("pattern", PATTERNS, ids=lambda pattern: pattern.shape)
def test_tile_has_the_plate_s_share_of_material(pattern: Any) -> None:
    plate = PLATE.model_copy(update={"pattern": pattern})
    spacing = 0.25e-3 / FINER  # the tile's, where the grid's is 0.25 mm
    tile = tile_of(plate, spacing)
    assert tile.material.mean() == pytest.approx(1 - pattern.open_area, abs=5e-4)
    assert tile.material.min() == 0.0
    assert tile.material.max() == 1.0
    assert max(tile.dy, tile.dz) <= spacing
    extent = np.array(tile.material.shape) * (tile.dy, tile.dz)
    np.testing.assert_allclose(extent, pattern.period, rtol=1e-12)


def test_tile_is_kept_for_the_next_shots_but_not_for_another_pattern() -> None:
    def with_slots(width: float) -> Plate:
        return PLATE.model_copy(update={"pattern": PATTERNS[0].model_copy(update={"width": width})})

    one, other = with_slots(2e-3), with_slots(1e-3)
    slotted, again = (PLATE.model_copy(update={"pattern": PATTERNS[0].model_copy()}) for _ in range(2))
    assert tile_of(slotted, 0.5e-3) is tile_of(again, 0.5e-3)
    assert tile_of(one, 0.5e-3) is tile_of(one.model_copy(update={"thickness": 1.0}), 0.5e-3)
    assert (tile_of(one, 0.5e-3).material != tile_of(other, 0.5e-3).material).any()


@pytest.mark.parametrize("ratio", [1.415, 2.5, 7.99])
def test_taps_keep_mass_and_second_moment(ratio: float) -> None:
    taps = tent_taps(ratio, 1.0)
    offsets = np.arange(len(taps)) - len(taps) // 2
    assert len(taps) % 2 == 1
    assert (taps > 0).all()
    np.testing.assert_allclose(taps, taps[::-1], rtol=1e-12)
    assert taps.sum() == pytest.approx(1.0)
    # Bilinear scattering and bilinear reading add a sixth of the cell's square each, on average.
    assert taps @ offsets**2 + 1 / 3 == pytest.approx(ratio**2 / 6, rel=1e-9)


POLYGONS = PolygonsPattern(spacing=(8e-3, 9e-3), polygons=[[(-2e-3, 0.0), (2.5e-3, -1e-3), (0.0, 2e-3)]])


@pytest.mark.parametrize("pattern", [*PATTERNS, POLYGONS], ids=lambda pattern: pattern.shape)
@pytest.mark.parametrize("sharp", [False, True])
def test_a_tile_is_built_in_small_parts_that_may_end_it(
    pattern: Any, sharp: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    plate = PLATE.model_copy(update={"pattern": pattern})
    whole = tile_of(plate, 0.1e-3, sharp=sharp).material
    _KEPT.clear()
    monkeypatch.setattr("warpimpact.solver.tile.CELLS_PER_CHECK", 500)
    part, looks = tile_of(plate, 0.1e-3, sharp=sharp), 0

    def look() -> None:
        nonlocal looks
        looks += 1
        if looks == 12:
            raise Cancelled

    with pytest.raises(Cancelled):
        part.build(look)
    assert not part.built
    part.build(look)
    assert looks > (11 + part.shape[0] if sharp else 24)
    np.testing.assert_array_equal(part.material, whole)


def test_tiles_of_a_target_have_a_budget_of_memory_and_time(monkeypatch: pytest.MonkeyPatch) -> None:
    one, other = (tile_of(PLATE.model_copy(update={"pattern": pattern}), 2e-6) for pattern in PATTERNS[:2])
    check_tiles({one: "plate", other: "layer 1"})
    monkeypatch.setattr("warpimpact.solver.tile.MOST_SECONDS", one.seconds + other.seconds - 1e-6)
    with pytest.raises(MemoryError, match=r"^plate.pattern: got a period of 0.016 m x 0.016 m, .* s are allowed; give"):
        check_tiles({one: "plate", other: "layer 1"})
    check_tiles({one: "plate"})
    monkeypatch.undo()
    monkeypatch.setattr("warpimpact.solver.tile.MOST_BYTES", one.bytes + other.bytes - 1)
    with pytest.raises(MemoryError, match=r"but .* GiB and 20 s are allowed"):
        check_tiles({one: "plate", other: "layer 1"})
