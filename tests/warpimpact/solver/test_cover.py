"""The cover: lengths of material ahead of points of a plate, against points on lines (docs/model.md §4.9)."""

import numpy as np
import pytest

from warpimpact.scene import CirclePattern, Pattern, Plate, SlotPattern
from warpimpact.solver.cover import EDGE_RADII, Cover, CoverRule, cover_of
from warpimpact.solver.tile import check_tiles, tile_of

PUSHED = CoverRule(radius=3e-3, carried=0.2, gap=0.05)
SLOTS = SlotPattern(length=12e-3, width=4e-3, spacing=(8e-3, 16e-3), staggered=True)
WEBS = CirclePattern(diameter=5e-3, spacing=(5.6e-3, 6.3e-3))
STEP = 1e-6


def cover_for(pattern: Pattern, pushed: CoverRule = PUSHED) -> Cover:
    return cover_of(Plate(thickness=4e-3, resistance=1e9, pattern=pattern), 0.5e-3 / 15, pushed, double=True)


def direction(cover: Cover, k: int) -> np.ndarray:
    """A unit vector: an eighth of a turn is as many nodes along z as along y."""
    eighth = 8.0 * k / cover.directions
    side, part = divmod(eighth + 1.0, 2.0)
    across, along = [(part - 1.0, 1.0), (1.0, 1.0 - part), (1.0 - part, -1.0), (-1.0, part - 1.0)][int(side) % 4]
    vector = np.array([across * cover.dy, along * cover.dz])
    return vector / np.hypot(*vector)


def length_at(pattern: Pattern, y: float, z: float, along: np.ndarray, pushed: CoverRule, radius: float) -> float:
    """a + s c − t g, from points on the line, where the core has a radius: 0 where nothing presses."""

    def solid(way: np.ndarray) -> np.ndarray:
        return ~pattern.is_hole(y + way * along[0], z + way * along[1])

    ahead, behind = solid(np.arange(0.0, EDGE_RADII * pushed.radius, STEP)), solid(-np.arange(0.0, radius, STEP))
    if ahead[0]:
        first = len(ahead) if ahead.all() else int(np.argmin(ahead))
        carried = len(behind) if behind.all() else int(np.argmin(behind))
        return STEP * (first + pushed.carried * carried)
    if not behind.any():
        return 0.0
    gap = int(np.argmax(behind))
    rest = behind[gap:]
    carried = len(rest) if rest.all() else int(np.argmin(rest))
    return max(0.0, STEP * (pushed.carried * carried - pushed.gap * gap))


@pytest.mark.parametrize("pattern", [SLOTS, WEBS], ids=["slots", "webs"])
def test_lengths_are_those_of_points_on_lines(pattern: Pattern) -> None:
    # A curved edge is straight between nodes: 0.1 mm apart they err by 0.1²/8r = 0.6 µm, more where a line grazes it.
    cover, rng = cover_for(pattern), np.random.default_rng(1)
    table, errors, inside, pressed = cover.material, [], 0, 0
    for _ in range(80):
        c, k, i, j = (int(rng.integers(count)) for count in (cover.radii, cover.directions, *cover.shape))
        radius = PUSHED.radius * (c + 0.5) / cover.radii
        length = length_at(pattern, i * cover.dy, j * cover.dz, direction(cover, k), PUSHED, radius)
        if length > 0.0:
            errors.append(abs(abs(table[c, k, i, j]) - length))
            in_hole = bool(pattern.is_hole(np.array(i * cover.dy), np.array(j * cover.dz)))
            inside, pressed = inside + in_hole, pressed + 1
        else:
            assert table[c, k, i, j] <= 0.0  # the tile decides: there is no material
    assert inside > 4
    assert pressed > 40
    assert np.median(errors) < 2 * STEP
    assert np.quantile(errors, 0.97) < 20 * STEP


def test_a_cover_is_kept_and_counts_with_the_tiles() -> None:
    plate = Plate(thickness=4e-3, resistance=1e9, pattern=SLOTS)
    cover = cover_for(SLOTS)
    assert cover_for(SLOTS) is cover
    assert cover_for(SLOTS, PUSHED._replace(gap=0.1)) is not cover
    assert cover.bytes == cover.material.nbytes
    fine = cover_of(plate, 1e-6, PUSHED, double=False)
    check_tiles({tile_of(plate, 0.5e-3): "plate", cover: "plate"})
    with pytest.raises(MemoryError, match=r"plate.pattern: got a period of 0.016 m x 0.016 m, in cells of 3e-06 m"):
        check_tiles({fine: "plate"})
