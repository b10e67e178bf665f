"""Hole patterns: where the holes are, how much of the plate they take, and what is no pattern."""

import struct
from pathlib import Path

import numpy as np
import pytest
from matplotlib.path import Path as Polygon
from PIL import Image
from pydantic import ValidationError

from warpimpact.scene import (
    CirclePattern,
    LatticePattern,
    MaskPattern,
    NoPattern,
    SlotPattern,
    TrianglePattern,
)

MM = 1e-3
SLOT = SlotPattern(length="12 mm", width="4 mm", spacing=["8 mm", "16 mm"], staggered=True)
CIRCLE = CirclePattern(diameter="5 mm", spacing=["7 mm", "9 mm"])
# Its apex reaches beyond the middle of the lattice cell.
TRIANGLE = TrianglePattern(side="6 mm", spacing=["7 mm", "5.5 mm"], staggered=True)
LATTICES = pytest.mark.parametrize("pattern", [SLOT, CIRCLE, TRIANGLE], ids=lambda p: p.shape)


def test_slots_are_stadiums_on_a_staggered_lattice() -> None:
    points = {
        (0, 0): True,
        (1.99, 4): True,
        (2.01, 0): False,
        (0, 5.99): True,
        (0, 6.01): False,
        (1.5, 5.5): False,  # the corner that a round end leaves
        (8, 0): False,  # between the slots of an odd row
        (8, 8): True,
        (-8, -8): True,
        (16, 16): True,
    }
    y, z = MM * np.array(list(points), dtype=float).T
    assert SLOT.is_hole(y, z).tolist() == list(points.values())
    assert SLOT.period == (16 * MM, 16 * MM)


def test_a_triangle_points_to_plus_z_about_its_centroid() -> None:
    height = 6 * MM * np.sqrt(0.75)
    inside, outside = (np.array([-height / 3, 2 * height / 3]) * scale for scale in (0.999, 1.001))
    assert TRIANGLE.is_hole(np.zeros(2), inside).all()
    assert not TRIANGLE.is_hole(np.zeros(2), outside).any()
    assert TRIANGLE.is_hole(np.array([2.9 * MM]), np.array([-0.999 * height / 3])).all()


@LATTICES
def test_a_pattern_repeats_with_its_period(pattern: LatticePattern) -> None:
    y, z = np.random.default_rng(1).uniform(-20 * MM, 20 * MM, (2, 20000))
    here = pattern.is_hole(y, z)
    assert np.array_equal(here, pattern.is_hole(y + 3 * pattern.period[0], z - 2 * pattern.period[1]))
    assert 0 < here.mean() < 1


@LATTICES
def test_the_open_area_is_that_of_the_holes(pattern: LatticePattern) -> None:
    count = 1000
    y, z = ((np.arange(count) + 0.5) / count * extent for extent in pattern.period)
    # A sample is wrong only where an outline crosses its cell, at random sign: far less than 1e-3.
    assert pattern.is_hole(y[:, None], z).mean() == pytest.approx(pattern.open_area, abs=1e-3)


@LATTICES
def test_outlines_enclose_the_holes(pattern: LatticePattern) -> None:
    span = (-11 * MM, 12 * MM)
    y, z = np.random.default_rng(2).uniform(*span, (2, 20000))
    outlines = pattern.outlines(span, span)
    points = np.column_stack([y, z])
    enclosed = np.any([Polygon(outline).contains_points(points) for outline in outlines], axis=0)
    # 64 chords around a circle leave out 1.6e-3 of its area.
    assert np.mean(enclosed != pattern.is_hole(y, z)) < 2e-3
    assert all(np.allclose(outline[0], outline[-1], atol=1e-12) for outline in outlines)


def test_a_solid_plate_has_no_hole() -> None:
    solid = NoPattern()
    assert not solid.is_hole(np.zeros((3, 1)), np.zeros(4)).any()
    assert solid.is_hole(np.zeros((3, 1)), np.zeros(4)).shape == (3, 4)
    assert solid.open_area == 0
    assert solid.outlines((0, 1), (0, 1)) == []


@pytest.mark.parametrize(
    ("make", "complaint"),
    [
        (
            lambda: CirclePattern(diameter="5 mm", spacing=["4 mm", "9 mm"]),
            "got spacing = 4 mm along y, but it must be larger than the hole, 5 mm",
        ),
        (
            lambda: SlotPattern(length="12 mm", width="4 mm", spacing=["8 mm", "12 mm"], staggered=True),
            "got spacing = 12 mm along z, but it must be larger than the hole, 12 mm",
        ),
        (lambda: SlotPattern(length="3 mm", width="4 mm", spacing=[1, 1]), "at least as long as wide, 4 mm"),
        (lambda: TrianglePattern(side="-1 mm", spacing=[1, 1]), "greater than 0"),
        (lambda: CirclePattern(diameter="5 mm", spacing=["8 mm"]), "Field required"),
    ],
)
def test_holes_without_a_ligament_are_refused(make: object, complaint: str) -> None:
    with pytest.raises(ValidationError, match=complaint):
        make()


# An L of material, 2 cells along y and 3 along z; as an image the top row is the last along z.
CELLS = np.array([[1, 1, 1], [1, 0, 0]], dtype=np.uint8)


@pytest.fixture(params=["npy", "png"])
def mask(request: pytest.FixtureRequest, tmp_path: Path) -> MaskPattern:
    path = tmp_path / f"mask.{request.param}"
    if request.param == "npy":
        np.save(path, CELLS)
    else:
        Image.fromarray(255 * CELLS.T[::-1]).save(path)
    return MaskPattern(file=path, cell_size="1 mm")


def test_a_mask_lies_centred_and_repeats(mask: MaskPattern) -> None:
    y, z = MM * np.array([-0.5, 0.5])[:, None], MM * np.array([-1.0, 0.0, 1.0])
    hole = CELLS == 0
    assert np.array_equal(mask.is_hole(y, z), hole)
    assert np.array_equal(mask.is_hole(y + 4 * MM, z - 9 * MM), hole)
    assert mask.period == (2 * MM, 3 * MM)
    assert mask.open_area == pytest.approx(1 / 3)


def test_outlines_of_a_mask_pass_between_hole_and_material(mask: MaskPattern) -> None:
    (outline,) = mask.outlines((-1 * MM, 1 * MM), (-1.5 * MM, 1.5 * MM))
    assert np.allclose(outline[0], outline[-1])
    polygon = Polygon(outline)
    assert polygon.contains_points(MM * np.array([(0.5, 0), (0.5, 1)])).all()
    assert not polygon.contains_points(MM * np.array([(0.5, -1), (-0.5, 0), (1.5, 0)])).any()


def _png(path: Path, cells: np.ndarray) -> None:
    Image.fromarray(cells).save(path)


def _huge_png(path: Path) -> None:
    """Only a header, of an image that would take 10 GB."""
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + struct.pack(">I4sII", 13, b"IHDR", 100_000, 100_000))


def _cut_png(path: Path) -> None:
    _png(path, np.eye(64, dtype=np.uint8))
    path.write_bytes(path.read_bytes()[:60])


@pytest.mark.parametrize(
    ("name", "write", "complaint"),
    [
        (
            "a.png",
            lambda p: _png(p, np.arange(9, dtype=np.uint8).reshape(3, 3)),
            "is not a mask: a mask has two",
        ),
        ("a.png", lambda p: _png(p, np.zeros((3, 3), dtype=np.uint8)), "is not a mask: a mask has two"),
        ("a.png", lambda p: _png(p, np.zeros((3, 3, 4), dtype=np.uint8)), "grey or 1-bit image, not RGBA"),
        ("a.png", lambda p: p.write_text("no image at all, but long"), "is not a PNG image"),
        ("a.png", _huge_png, "has 100000 × 100000 cells, but a mask has at least 1 and at most 4096"),
        ("a.png", _cut_png, "is a damaged PNG image"),
        ("a.npy", lambda p: p.write_text("no array"), "is not an array of numbers"),
        ("a.npy", lambda p: np.save(p, np.zeros(3)), "a mask is a two-dimensional array of numbers"),
        ("a.npy", lambda p: np.save(p, np.array([["x"]])), "a mask is a two-dimensional array of numbers"),
        ("a.npy", lambda p: np.save(p, np.array([[0, np.nan]])), "is not a mask: a mask has two values"),
        ("a.npy", lambda p: np.save(p, np.zeros((1, 4097))), "has 1 × 4097 cells"),
        ("a.npy", lambda p: np.save(p, np.zeros((0, 4))), "has 0 × 4 cells"),
        ("a.jpg", lambda p: p.write_text(""), "give a .png image or a .npy array"),
        ("a.npy", lambda p: None, "there is no file"),
    ],
)
def test_what_is_no_mask_is_refused(tmp_path: Path, name: str, write: object, complaint: str) -> None:
    write(tmp_path / name)
    with pytest.raises(ValidationError, match=complaint):
        MaskPattern(file=tmp_path / name, cell_size="1 mm")
