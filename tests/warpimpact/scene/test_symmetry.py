"""Symmetries of plate and shot: all that exist and no others, and the irreducible part of the cell."""

from itertools import combinations
from typing import Any

import numpy as np
import pytest

from warpimpact.scene import (
    CirclePattern,
    Hits,
    Impact,
    NoPattern,
    Pattern,
    Plate,
    Scatter,
    SlotPattern,
    Symmetry,
    TrianglePattern,
    make_shots,
    symmetries_used,
)
from warpimpact.scene.sampling import SYMMETRIES, irreducible_part, symmetries

MM = 1e-3
HITS = Hits(count=1024, irreducible=True)
STRAIGHT = Impact(velocity=825)
SLOTS = SlotPattern(length="12 mm", width="4 mm", spacing=["8 mm", "16 mm"], staggered=True)
ROWS = SLOTS.model_copy(update={"staggered": False})
HOLES = CirclePattern(diameter="9 mm", spacing=["12.5 mm", "21.65 mm"], staggered=True)
TRIANGLES = TrianglePattern(side="6 mm", spacing=["7 mm", "5.5 mm"], staggered=True)
SPECKS = TrianglePattern(side="5 um", spacing=["7 mm", "5.5 mm"])  # holes that a grid over the cell would miss


def plate(pattern: Pattern, **changes: Any) -> Plate:
    return Plate(**{"thickness": 4 * MM, "resistance": 2.6e9, "pattern": pattern} | changes)


def got(plate: Plate, impact: Impact = STRAIGHT) -> set[str]:
    return {str(symmetry) for symmetry in symmetries(plate, impact)}


def centred(*names: str) -> set[str]:
    return {*names, *(f"{name} + centring" for name in names)}


ALL = ("(y, z)", "(-y, z)", "(y, -z)", "(-y, -z)")


@pytest.mark.parametrize(
    ("scene", "expected"),
    [
        (plate(SLOTS), centred(*ALL)),
        (plate(HOLES), centred(*ALL)),
        (plate(NoPattern()), centred(*ALL)),
        (plate(ROWS), {*ALL}),
        (plate(TRIANGLES), centred("(y, z)", "(-y, z)")),
        (plate(SPECKS), {"(y, z)", "(-y, z)"}),
        (plate(SLOTS, size=[40 * MM, 40 * MM]), {*ALL}),
        (plate(TRIANGLES, size=[40 * MM, 4 * MM]), {"(y, z)", "(-y, z)"}),
    ],
    ids=["slots", "holes", "solid", "rows", "triangles", "specks", "slots with a rim", "triangles with a rim"],
)
def test_of_a_plate(scene: Plate, expected: set[str]) -> None:
    assert got(scene) == expected


@pytest.mark.parametrize(
    ("impact", "expected"),
    [
        ({"obliquity": "20 deg", "azimuth": "0 deg"}, centred("(y, z)", "(y, -z)")),
        ({"obliquity": "20 deg", "azimuth": "90 deg"}, centred("(y, z)", "(-y, z)")),
        ({"obliquity": "20 deg", "azimuth": "35 deg"}, centred("(y, z)")),
        ({"azimuth": "35 deg"}, centred(*ALL)),
        ({"pitch": "1 deg"}, centred("(y, z)", "(-y, z)")),
        ({"yaw": "1 deg"}, centred("(y, z)", "(y, -z)")),
        ({"spin": 1e4}, centred("(y, z)", "(-y, -z)")),
        ({"spin": 1e4, "pitch": "1 deg"}, centred("(y, z)")),
        ({"obliquity": "20 deg", "azimuth": "90 deg", "pitch": "-1 deg"}, centred("(y, z)", "(-y, z)")),
    ],
    ids=lambda value: "-".join(value) if isinstance(value, dict) else "",
)
def test_of_a_shot(impact: dict[str, Any], expected: set[str]) -> None:
    assert got(plate(SLOTS), Impact(velocity=825, **impact)) == expected


def groups() -> list[tuple[Symmetry, ...]]:
    """Every group that symmetries can form."""

    def after(one: Symmetry, other: Symmetry) -> Symmetry:
        return Symmetry(one.along_y * other.along_y, one.along_z * other.along_z, one.centred != other.centred)

    subsets = (s for n in (1, 2, 4, 8) for s in combinations(SYMMETRIES, n))
    return [s for s in subsets if all(after(a, b) in s for a in s for b in s)]


@pytest.mark.parametrize("group", groups(), ids=lambda group: ", ".join(map(str, group)))
def test_images_of_the_irreducible_part_cover_the_cell_once(group: tuple[Symmetry, ...]) -> None:
    cell = (16 * MM, 9 * MM)
    y, z = np.random.default_rng(3).uniform(-0.5, 0.5, (2, 500)) * np.array(cell)[:, None]
    (low_y, high_y), (low_z, high_z) = irreducible_part(group)
    times = np.zeros(500, dtype=int)
    for symmetry in group:
        at_y, at_z = symmetry.image(y, z, cell)
        assert (np.abs(at_y) <= 0.5 * cell[0]).all()
        assert (np.abs(at_z) <= 0.5 * cell[1]).all()
        across, along = at_y / cell[0], at_z / cell[1]
        times += (low_y < across) & (across < high_y) & (low_z < along) & (along < high_z)
    assert (times == 1).all()


@pytest.mark.parametrize("pattern", [SLOTS, TRIANGLES], ids=["slots", "triangles"])
def test_images_of_a_hit_see_the_plate_alike(pattern: Pattern) -> None:
    scene = plate(pattern)
    shots = make_shots(STRAIGHT, HITS, scene)
    assert len(shots) == 1024
    places = [one.image(shots.hit_y, shots.hit_z, scene.sampled_cell) for one in symmetries_used(STRAIGHT, HITS, scene)]
    solid = np.array([scene.is_solid(*place) for place in places])
    assert 0.0 < solid.mean() < 1.0
    assert (solid == solid[:1]).all()


@pytest.mark.parametrize("name", ["obliquity", "azimuth", "pitch", "yaw", "spin"])
def test_scatter_that_symmetry_would_turn_is_refused(name: str) -> None:
    scatter = Scatter(**{name: {"distribution": "uniform", "low": 0.0, "high": 0.1}})
    with pytest.raises(
        ValueError, match=f"hits.irreducible = true cannot be combined with a distribution of impact.{name}: a"
    ):
        make_shots(STRAIGHT, HITS, plate(SLOTS), scatter)
    assert len(make_shots(STRAIGHT, Hits(count=64), plate(SLOTS), scatter)) == 64
