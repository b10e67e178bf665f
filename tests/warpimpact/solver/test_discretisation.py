"""Rings, tiles and covers against areas, volumes and points on lines."""

from typing import Any

import numpy as np
import pytest

from warpimpact.errors import TooLong
from warpimpact.scene import (
    CirclePattern,
    ConeCore,
    Core,
    OgiveCore,
    Pattern,
    Plate,
    PolygonsPattern,
    PolynomialCore,
    ProfileCore,
    SlotPattern,
    TrianglePattern,
)
from warpimpact.solver.cover import EDGE_RADII, Cover, CoverRule, cover_of
from warpimpact.solver.device import Cancelled
from warpimpact.solver.grid import FINER, tent_taps
from warpimpact.solver.rings import rings_of
from warpimpact.solver.tile import _KEPT, check_tiles, tile_of

PAPER = PolynomialCore(coefficients=(3.0e-4, 0.24, -5.29), length=27.86e-3, density=7850.0)
OGIVE = OgiveCore(diameter=6.17e-3, crh=3.0, length=27.0e-3, density=7850.0)
CONE = ConeCore(diameter=6.0e-3, length=20.0e-3, cone_length=12.0e-3, density=7850.0)
TABLE = ProfileCore(s=(0.0, 3e-3, 11e-3, 20e-3), r=(1e-3, 2e-3, 3e-3, 2.5e-3), density=7850.0)
CORES = pytest.mark.parametrize("core", [PAPER, OGIVE, CONE, TABLE], ids=["paper", "ogive", "cone", "table"])


@CORES
def test_rings_close_the_surface(core: Core) -> None:
    around = 16
    rings = rings_of(core, 20, around)
    assert around * rings.area_axial.sum() == pytest.approx(0.0, abs=1e-12 * np.pi * core.max_radius**2)
    # Seen from the side a core shows 2 ∫ r ds; azimuths of the patches are those of their middles.
    s, weights = np.polynomial.legendre.leggauss(200)
    shadow = core.length * core.radius(core.length * (1 + s) / 2) @ weights
    facing = np.cos(2 * np.pi * (np.arange(around) + 0.5) / around).clip(0).sum()
    assert facing * rings.area_radial.sum() == pytest.approx(shadow, rel=1e-4)


@CORES
def test_volume_of_the_rings_converges_to_the_core_s(core: Core) -> None:
    # V = ⅓ ∮ x·dA with one point per patch: second order in the rings.
    volume = core.mass_properties.mass / 7850.0
    errors = []
    for axial in (16, 32, 64):
        rings = rings_of(core, axial, 256)
        actual = 256 / 3 * (rings.station @ rings.area_axial + rings.radius @ rings.area_radial)
        errors.append(abs(actual / volume - 1))
    assert errors[0] < 0.01
    assert errors[2] < max(errors[0] / 8, 1e-4)


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
    with pytest.raises(TooLong, match=r"^plate.pattern: got a period of 0.016 m x 0.016 m, .* s are allowed; give"):
        check_tiles({one: "plate", other: "layer 1"})
    check_tiles({one: "plate"})
    monkeypatch.undo()
    monkeypatch.setattr("warpimpact.solver.tile.MOST_BYTES", one.bytes + other.bytes - 1)
    with pytest.raises(MemoryError, match=r"takes .* GiB, but .* GiB are allowed"):
        check_tiles({one: "plate", other: "layer 1"})


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
