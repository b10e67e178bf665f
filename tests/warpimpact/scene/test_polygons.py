"""Polygons: areas, ligaments, what is refused, and drawings."""

import math
from typing import Any

import numpy as np
import pytest
import shapely
from pydantic import TypeAdapter, ValidationError

from warpimpact import PolygonsPattern
from warpimpact.scene import AnyPattern, CirclePattern

CELL = {"spacing": (8e-3, 10e-3)}


ENDS = ((3e-3, 5e-3), (-4e-3, -2.5e-3))  # along y; the second one a cell further overlaps the first
WIDE = [(-5e-3, -1e-3), (5e-3, -1e-3), (5e-3, 2e-3), (-5e-3, 2e-3)]
SQUARE = [(-2e-3, -1e-3), (1e-3, -1e-3), (1e-3, 2e-3), (-2e-3, 2e-3)]


def rounds(diameter: float, *places: tuple[float, float], **more: Any) -> PolygonsPattern:
    """Polygons of 200 corners about these places [m]."""
    turn = np.linspace(0.0, 2.0 * np.pi, 200, endpoint=False)
    circle = 0.5 * diameter * np.column_stack([np.cos(turn), np.sin(turn)])
    return PolygonsPattern(polygons=[(circle + place).tolist() for place in places], **(CELL | more))


def test_polygons_are_the_holes() -> None:
    cell = PolygonsPattern(polygons=[SQUARE], **CELL)
    assert cell.open_area == pytest.approx(9.0 / 80.0, rel=1e-12)
    y, z = 1e-3 * np.array([0.9, 1.1, -1.9, 8.9]), 1e-3 * np.array([1.9, 1.9, -0.9, -8.1])
    assert cell.is_hole(y, z).tolist() == [True, False, True, True]
    (outline,) = cell.outlines((-4e-3, 4e-3), (-5e-3, 5e-3))
    bounds = shapely.Polygon(outline).bounds
    assert bounds == pytest.approx((-2e-3, -1e-3, 1e-3, 2e-3), abs=1e-15)
    across = rounds(3e-3, (3.9e-3, -4.8e-3), staggered=True)
    assert across.open_area == pytest.approx(np.pi * 2.25e-6 / 8e-5, rel=0.01)


def test_ligaments_of_polygons_approach_those_of_circles() -> None:
    lattice = CirclePattern(diameter=5e-3, spacing=(5e-3, 10e-3), staggered=True)
    cells = rounds(5e-3, (0.0, 0.0), (5e-3, 5e-3), spacing=(10e-3, 10e-3))
    assert cells.ligament() == pytest.approx((math.hypot(5.0, 5.0) - 5.0) * 1e-3, abs=1e-6)
    assert cells.ligament((6e-3, 6e-3)) == pytest.approx(0.5e-3, abs=1e-6)  # of chords
    at = (np.arange(200) - 99.5) * 5e-5
    distances = (abs(pattern.edge_distance(at[:, None], at)) for pattern in (cells, lattice))
    np.testing.assert_allclose(*distances, rtol=0, atol=4e-6)


def test_polygons_that_overlap_those_of_the_next_cell_unite() -> None:
    high, low = ([(y, z) for y, z in ((a, -1e-3), (b, -1e-3), (b, 1e-3), (a, 1e-3))] for a, b in ENDS)
    both = PolygonsPattern(polygons=[high, low], **CELL)
    assert both.open_area == pytest.approx(2.5 * 2.0 / 80.0, rel=1e-12)
    assert both.ligament() == pytest.approx(5.5e-3, rel=1e-12)
    (outline,) = both.outlines((2.9e-3, 5.6e-3), (-1e-3, 1e-3))
    assert shapely.Polygon(outline).bounds == pytest.approx((3e-3, -1e-3, 5.5e-3, 1e-3), abs=1e-15)


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ({"shape": "polygons", "polygons": [WIDE]}, "overlap or touch"),
        ({"shape": "polygons", "polygons": [[(0, 0), (1e-3, 1e-3), (1e-3, 0), (0, 1e-3)]]}, "cross themselves"),
        ({"shape": "polygons", "polygons": [SQUARE, SQUARE]}, "cross themselves or overlap"),
        ({"shape": "polygons", "polygons": [[(0, 0), (9e-3, 0), (0, 1e-3)]]}, r"as far as \(9, 1\) mm from the middle"),
    ],
)
def test_a_form_that_is_no_plate_is_refused(given: dict[str, Any], sentence: str) -> None:
    with pytest.raises(ValidationError, match=sentence):
        TypeAdapter[Any](AnyPattern).validate_python({"spacing": ["8 mm", "8 mm"], **given})
