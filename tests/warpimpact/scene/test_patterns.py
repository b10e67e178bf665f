"""Hole patterns and polygons: where the holes are, their area, how near they come, and what is refused."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from pydantic import TypeAdapter, ValidationError

from warpimpact.scene import (
    AnyPattern,
    CirclePattern,
    EllipsePattern,
    HexagonPattern,
    LatticePattern,
    NoPattern,
    Plate,
    PolygonsPattern,
    SlotPattern,
    SquarePattern,
    TrianglePattern,
)
from warpimpact.scene.geometry import LINES, WHOLE_CELL

MM = 1e-3
ANY: TypeAdapter[Any] = TypeAdapter(AnyPattern)
SLOT = SlotPattern(length="12 mm", width="4 mm", spacing=["8 mm", "16 mm"], staggered=True)
CIRCLE = CirclePattern(diameter="5 mm", spacing=["7 mm", "9 mm"])
# Its apex reaches beyond the middle of the lattice cell.
TRIANGLE = TrianglePattern(side="6 mm", spacing=["7 mm", "5.5 mm"], staggered=True)
UP_AND_DOWN = TrianglePattern(
    side="12 mm",
    corner_radius="1 mm",
    spacing=["21.24 mm", "14.4 mm"],
    holes=[["0 mm", "0 mm"], ["10.62 mm", "3.46 mm", "180 deg"]],
)
SQUARE = SquarePattern(side="4 mm", corner_radius="0.5 mm", rotation="30 deg", spacing=["7 mm", "6 mm"])
HEXAGON = HexagonPattern(width="5 mm", spacing=["6 mm", "7 mm"], staggered=True)
ELLIPSE = EllipsePattern(length="7 mm", width="3 mm", rotation="-40 deg", spacing=["6 mm", "7 mm"])
# Longer than its cell both ways: between two rows of holes lie those of the cells around.
DIAGONAL = SlotPattern(length="10 mm", width="1 mm", rotation="30 deg", spacing=["7 mm", "7 mm"])
LATTICES = pytest.mark.parametrize(
    "pattern", [SLOT, CIRCLE, TRIANGLE, UP_AND_DOWN, SQUARE, HEXAGON, ELLIPSE, DIAGONAL], ids=lambda p: p.shape
)


@pytest.mark.parametrize(("staggered", "neighbours"), [(False, 4), (True, 6)])
def test_a_pitch_is_the_distance_of_the_nearest_neighbours(staggered: bool, neighbours: int) -> None:
    pattern = CirclePattern(diameter="6 mm", spacing="9 mm", staggered=staggered)
    assert pattern.ligament() == pytest.approx(3 * MM, rel=1e-12)
    around = 9 * MM * np.exp(1j * np.radians(np.arange(30 if staggered else 0, 360, 360 / neighbours)))
    assert pattern.is_hole(around.real, around.imag).all()
    np.testing.assert_allclose(pattern.open_area, math.pi * 9 / (81 * (math.sqrt(0.75) if staggered else 1.0)))
    with pytest.raises(ValidationError, match="which is not a length"):
        CirclePattern(diameter="6 mm", spacing="9 kg")


def test_sides_of_holes_on_a_staggered_pitch_face_each_other() -> None:
    hexagons = HexagonPattern(width="6 mm", spacing="6.7 mm", staggered=True)  # sold as H6 T6.7
    assert hexagons.ligament() == pytest.approx(0.7 * MM, rel=1e-9)
    assert hexagons.open_area == pytest.approx((6 / 6.7) ** 2)
    assert hexagons.model_copy(update={"width": "5 mm"}).ligament() == pytest.approx(1.7 * MM, rel=1e-9)
    squares = SquarePattern(side="4 mm", spacing="6 mm", staggered=True)
    assert squares.period == pytest.approx((12 * MM, 6 * MM))
    assert squares.ligament() == pytest.approx(2 * MM, rel=1e-9)


@LATTICES
def test_an_edge_is_as_far_as_the_nearest_outline(pattern: LatticePattern) -> None:
    y, z = np.random.default_rng(3).uniform(-20 * MM, 20 * MM, (2, 2000))
    got = pattern.edge_distance(y, z)
    assert np.array_equal(got < 0, pattern.is_hole(y, z))
    around = shapely.MultiLineString(pattern.outlines((-40 * MM, 40 * MM), (-40 * MM, 40 * MM)))
    assert np.allclose(abs(got), shapely.distance(around, shapely.points(y, z)), rtol=0, atol=1e-12)


def circles(holes: list[Any]) -> CirclePattern:
    return CirclePattern(diameter="5 mm", spacing=["20 mm", "20 mm"], holes=holes)


@pytest.mark.parametrize(
    ("make", "complaint"),
    [
        (
            lambda: CirclePattern(diameter="5 mm", spacing=["4 mm", "9 mm"]),
            r"got diameter = 5 mm, spacing = \(4, 9\) mm, which lets the holes at \(0, 0\) mm and \(-?4, 0\) mm",
        ),
        (
            lambda: CirclePattern(diameter="9.5 mm", spacing="9 mm", staggered=True),
            "got diameter = 9.5 mm, spacing = 9 mm staggered, but the cell must be larger",
        ),
        (
            lambda: HexagonPattern(width="6 mm", spacing="6.7 mm", staggered=True, rotation="0 deg"),
            "got width = 6 mm, spacing = 6.7 mm staggered, rotation = 0 deg, which lets the holes .* between them; "
            r"rotation = 30 deg leaves 0\.7 mm \[",
        ),
        (
            lambda: HexagonPattern(width="6 mm", spacing=["6.05 mm", "6.05 mm"]),
            r"must be left between them \[",
        ),
        (
            lambda: SlotPattern(width="4 mm", length="9 mm", spacing=["12 mm", "5 mm"]),
            r"; rotation = 90 deg leaves 1 mm \[",
        ),
        (lambda: CirclePattern(diameter="5 m", spacing=["1 um", "1 um"]), "the cell must be larger than its holes"),
        (
            lambda: TrianglePattern(side="6 mm", corner_radius="1.8 mm", spacing=[1, 1]),
            "must be smaller than the inradius of the hole",
        ),
        (
            lambda: SLOT.model_validate(SLOT.model_dump() | {"holes": [[0, 0]]}),
            "staggered cannot be combined with holes: it stands for two holes",
        ),
        (lambda: circles([["0 mm", "0 mm"], ["160 mm", "80 mm"]]), "overlap or touch"),
    ],
)
def test_holes_without_a_ligament_are_refused(make: object, complaint: str) -> None:
    with pytest.raises(ValidationError, match=complaint):
        make()


ROWS = "y [mm];z [mm];diameter [mm]\n0;0;5,5\n"
CELL_OF_FILE = {"spacing": ["20 mm", "20 mm"]}


def test_circles_of_a_file_are_those_of_a_list(tmp_path: Path) -> None:
    (tmp_path / "holes.csv").write_text(ROWS + "10;-3;5,5\n")
    read = ANY.validate_python({"file": "holes.csv"} | CELL_OF_FILE, context={"folder": tmp_path})
    assert ANY.validate_json(read.model_dump_json()) == read  # the holes, no more the file
    listed = CirclePattern(diameter="5.5 mm", holes=[[0, 0], ["10 mm", "-3 mm"]], **CELL_OF_FILE)
    assert read.open_area == pytest.approx(listed.open_area, rel=1e-12)
    y, z = np.random.default_rng(3).uniform(-20 * MM, 20 * MM, (2, 2000))
    assert np.allclose(read.edge_distance(y, z), listed.edge_distance(y, z), rtol=0, atol=6e-6)


@pytest.mark.parametrize(
    ("rows", "changes", "complaint"),
    [
        ("5;5;0\n", CELL_OF_FILE, "holes.csv, row 2: got diameter = 0 mm, but it must be greater than 0"),
        ("0;0;5,5\n", CELL_OF_FILE, "holes.csv, row 1: overlaps or touches row 2; give each hole once"),
        (
            "9;9;3\n-9;-9;3\n",
            CELL_OF_FILE,
            "row 2: overlaps or touches row 3 of the next cell; give each hole once and whole",
        ),
        (
            "0;11;1\n",
            CELL_OF_FILE,
            r"row 2: its middle lies outside the cell, which reaches \(10, 10\) mm",
        ),
        ("", {}, "spacing is missing: give the extent of the cell that holes.csv fills"),
        ("", CELL_OF_FILE | {"staggered": True}, "file and staggered cannot be combined"),
        ("5;5;1 mm\n", CELL_OF_FILE, 'line 3: diameter.*: got "1 mm"'),
        ("", {"spacing": ["20 kg", "20 mm"]}, '"20 kg", which is not a length'),
    ],
)
def test_holes_of_a_file_that_cannot_be_are_named(
    rows: str, changes: dict[str, Any], complaint: str, tmp_path: Path
) -> None:
    (tmp_path / "holes.csv").write_text(ROWS + rows)
    with pytest.raises(ValidationError, match=complaint):
        ANY.validate_python({"file": tmp_path / "holes.csv"} | changes)


def test_a_hole_that_the_rim_cuts_comes_once() -> None:
    def plate(spacing: str) -> Plate:
        pattern = CirclePattern(diameter="5 mm", spacing=[spacing, "20 mm"], holes=[["9 mm", 0]])
        return Plate(thickness=1, resistance=1e9, size=["20 mm", "20 mm"], pattern=pattern)

    with pytest.raises(ValidationError, match="comes in again at the opposite rim"):
        plate("20 mm")
    assert not plate("24 mm").is_solid(np.array(9 * MM), np.array(0.0))
    assert plate("24 mm").is_solid(np.array(-9.9 * MM), np.array(0.0))


@pytest.mark.parametrize(
    ("pattern", "area"),
    [
        (EllipsePattern(length=5, width=2, spacing=(8, 8)), 2.5 * math.pi),
        (CirclePattern(diameter=6, spacing=(8, 8)), 9 * math.pi),
        (SlotPattern(length=5, width=2, spacing=(8, 8)), 6 + math.pi),
        (SquarePattern(side=4, spacing=(8, 8)), 16),
        (SquarePattern(side=4, corner_radius=1.5, spacing=(8, 8)), 16 - (4 - math.pi) * 2.25),
        (TrianglePattern(side=4, corner_radius=1, spacing=(8, 8)), 4 * math.sqrt(3) - (3 * math.sqrt(3) - math.pi)),
        (HexagonPattern(width=4, corner_radius=1, spacing=(8, 8)), 8 * math.sqrt(3) - (2 * math.sqrt(3) - math.pi)),
    ],
    ids=lambda value: value.shape if isinstance(value, LatticePattern) else "",
)
def test_areas_are_exact(pattern: LatticePattern, area: float) -> None:
    assert pattern.hole_area == pytest.approx(area, rel=1e-14)
    assert pattern.open_area == pytest.approx(area / 64, rel=1e-14)


@pytest.mark.parametrize(
    ("pattern", "ligament"),
    [
        # Corner to corner, both rounded: each is a square of 3 mm and half a millimetre around it.
        (
            SquarePattern(side=4 * MM, corner_radius=0.5 * MM, spacing=(6 * MM, 11 * MM), staggered=True),
            (math.hypot(3, 2.5) - 1) * MM,
        ),
        # Between the flanks, which are 60 degrees off the y axis.
        (UP_AND_DOWN, (math.sqrt(0.75) * 10.62 + 0.5 * 3.46 - 12 / math.sqrt(3)) * MM),
        # Side by side along both lattice vectors, end past end along their difference.
        (DIAGONAL, (math.hypot(7 * (0.5 + math.sqrt(0.75)) - 9, 7 * (math.sqrt(0.75) - 0.5)) - 1) * MM),
    ],
    ids=["squares", "triangles", "diagonal"],
)
def test_ligaments_have_closed_forms(pattern: LatticePattern, ligament: float) -> None:
    assert pattern.ligament() == pytest.approx(ligament, rel=1e-12)


def test_to_the_rim_counts_what_the_rim_leaves_whole() -> None:
    # Five holes of 5 mm every 7 mm along y: the outer ones reach to 16.5 mm; the next ones from 18.5 mm on.
    assert CIRCLE.ligament((33.5 * MM, 40 * MM)) == pytest.approx(0.25 * MM, rel=1e-9)
    assert CIRCLE.ligament((36.9 * MM, 12 * MM)) == pytest.approx(1.95 * MM, rel=1e-9)
    assert CIRCLE.ligament((39 * MM, 12 * MM)) == pytest.approx(2 * MM, rel=1e-9)  # those are cut, and 2 mm away
    assert CIRCLE.ligament((6 * MM, 8 * MM)) == pytest.approx(0.5 * MM, rel=1e-9)  # a single hole
    assert CIRCLE.ligament((4 * MM, 4 * MM)) == math.inf  # no plate is left around it


@pytest.mark.parametrize(
    "pattern",
    [
        *(SLOT, CIRCLE, TRIANGLE, UP_AND_DOWN, SQUARE, HEXAGON, ELLIPSE, DIAGONAL, NoPattern()),
        PolygonsPattern(spacing=(8 * MM, 6 * MM), polygons=[[(-2 * MM, 0), (2.5 * MM, -MM), (0, 2 * MM)]]),
    ],
    ids=lambda pattern: getattr(pattern, "shape", pattern),
)
def test_shares_of_cells_in_holes_are_those_of_many_points(pattern: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("warpimpact.scene.geometry._PARTS_PER_LOT", 100)  # several lots
    counts, points = (57, 46), 12
    sides = pattern.period[0] / counts[0], pattern.period[1] / counts[1]
    y, z = ((np.arange(points * n) + 0.5) * side / points for n, side in zip(counts, sides, strict=True))
    by_points = pattern.is_hole(y[:, None], z).reshape(counts[0], points, counts[1], points).mean(axis=(1, 3))
    shares = pattern.shares_in_holes(counts, sides) / WHOLE_CELL
    assert shares.mean() == pytest.approx(pattern.open_area, abs=5e-4)  # ten cells across a hole
    np.testing.assert_allclose(shares, by_points, rtol=0, atol=1.5 / points)  # an edge misses a row of points
    assert np.abs(shares - by_points).mean() < 0.1 / points
    assert set(np.unique(shares[(by_points == 0) | (by_points == 1)]).round(1)) <= {0.0, 1.0}


def test_straight_sides_of_holes_are_exact_wherever_they_lie_in_a_cell() -> None:
    pattern, counts = SquarePattern(side=4.53 * MM, spacing=(8.1 * MM, 16.7 * MM)), (61, 113)
    sides = pattern.period[0] / counts[0], pattern.period[1] / counts[1]

    def along(side: float, count: int, period: float) -> Any:
        edges = side * np.arange(count + 1)
        half = 0.5 * pattern.side
        return sum(np.diff(np.clip(edges, at - half, at + half)) for at in (0.0, period)) / side

    exact = np.outer(*map(along, sides, counts, pattern.period))
    shares = pattern.shares_in_holes(counts, sides) / WHOLE_CELL
    # Integers: each of the lines is rounded, at either end, and so is the width of its strip.
    np.testing.assert_allclose(shares, exact, rtol=0, atol=2.01 * LINES / WHOLE_CELL)
    assert ((exact > 0.0) & (exact < 1.0)).sum() > 40


@pytest.mark.parametrize(
    "shape", [{"shape": "slot", "length": 12 * MM, "width": 4.05 * MM}, {"shape": "square", "side": 4.5 * MM}]
)
@pytest.mark.parametrize("cells", [320, 318, 46])
def test_mirrored_holes_have_mirrored_shares_to_the_bit(shape: dict[str, Any], cells: int) -> None:
    kind = SlotPattern if shape["shape"] == "slot" else SquarePattern
    pattern = kind.model_validate(shape | {"spacing": (8 * MM, 16 * MM), "staggered": True})
    inside = pattern.shares_in_holes((cells, cells), (16 * MM / cells, 16 * MM / cells))
    assert np.array_equal(inside, inside[::-1])
    assert np.array_equal(inside, inside[:, ::-1])
    y = (np.arange(320) + 0.5) * 0.05 * MM  # an edge lies in the hole on either side
    points = pattern.is_hole(y[:, None], y)
    assert np.array_equal(points, points[::-1])
    assert np.array_equal(points, points[:, ::-1])


def two_slots(*turns: float, **changes: Any) -> SlotPattern:
    holes = [[0, 0, turns[0]], [8 * MM, 4 * MM, turns[1]]]
    return SlotPattern(**{"length": 5 * MM, "width": 2 * MM, "spacing": (16 * MM, 8 * MM), "holes": holes} | changes)


@pytest.mark.parametrize(
    ("pattern", "expected"),
    [
        (two_slots(0, 0), {(1, -1), (-1, 1), (-1, -1), "centred"}),
        (two_slots(0, 180), {(1, -1), (-1, 1), (-1, -1), "centred"}),  # half a turn does not change a slot
        (two_slots(0, 0.01), {(-1, -1)}),
        (two_slots(17, 17), {(-1, -1), "centred"}),
        (two_slots(17, -17), {(-1, -1)}),  # and glides, which are no mirror images
        (two_slots(17, -17, holes=[[0, 0, 17], [8 * MM, 0, -17]]), {(-1, -1)}),
        (two_slots(0, 0, holes=[[0, 0], [8 * MM - 1e-6, 1e-6]]), set()),
        (UP_AND_DOWN, {(-1, 1)}),
    ],
)
def test_symmetries_of_turned_and_listed_holes(pattern: LatticePattern, expected: set[Any]) -> None:
    got = {along for along in ((1, -1), (-1, 1), (-1, -1)) if pattern.is_symmetric(*along, centred=False)}
    assert got | ({"centred"} if pattern.is_symmetric(1, 1, centred=True) else set()) == expected


CELL = {"spacing": (8e-3, 10e-3)}


ENDS = ((3e-3, 5e-3), (-4e-3, -2.5e-3))  # along y; the second one a cell further overlaps the first
WIDE = [(-5e-3, -1e-3), (5e-3, -1e-3), (5e-3, 2e-3), (-5e-3, 2e-3)]
CORNERS = [(-2e-3, -1e-3), (1e-3, -1e-3), (1e-3, 2e-3), (-2e-3, 2e-3)]


def rounds(diameter: float, *places: tuple[float, float], **more: Any) -> PolygonsPattern:
    """Polygons of 200 corners about these places [m]."""
    turn = np.linspace(0.0, 2.0 * np.pi, 200, endpoint=False)
    circle = 0.5 * diameter * np.column_stack([np.cos(turn), np.sin(turn)])
    return PolygonsPattern(polygons=[(circle + place).tolist() for place in places], **(CELL | more))


def test_polygons_are_the_holes() -> None:
    cell = PolygonsPattern(polygons=[CORNERS], **CELL)
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
        ({"shape": "polygons", "polygons": [CORNERS, CORNERS]}, "cross themselves or overlap"),
        ({"shape": "polygons", "polygons": [[(0, 0), (9e-3, 0), (0, 1e-3)]]}, r"as far as \(9, 1\) mm from the middle"),
    ],
)
def test_a_form_that_is_no_plate_is_refused(given: dict[str, Any], sentence: str) -> None:
    with pytest.raises(ValidationError, match=sentence):
        TypeAdapter[Any](AnyPattern).validate_python({"spacing": ["8 mm", "8 mm"], **given})
