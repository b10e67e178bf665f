"""Masks: the same holes from every format, their ligaments, and files that are no mask."""

import math
import struct
import time
import zlib
from pathlib import Path

import numpy as np
import pytest
import shapely
from matplotlib.path import Path as Polygon
from PIL import Image
from pydantic import ValidationError

from warpimpact.scene import CirclePattern, MaskPattern, SlotPattern
from warpimpact.scene.patterns import mask_files
from warpimpact.scene.patterns.roundings import smallest_gap

MM = 1e-3

ANGLES = np.linspace(0.0, 2.0 * np.pi, 201)
# An L of material, 2 cells along y and 3 along z; as an image the top row is the last along z.
CELLS = np.array([[1, 1, 1], [1, 0, 0]], dtype=np.uint8)
HEAD = '<svg xmlns="http://www.w3.org/2000/svg" width="{}" height="{}" viewBox="0 0 {} {}">'


def drawing(path: Path, width: float, height: float, content: str) -> Path:
    """An SVG file of this extent in mm, ten units of its own to each."""
    head = HEAD.format(f"{width}mm", f"{height}mm", 10 * width, 10 * height)
    path.write_text(f"{head}{content}</svg>", encoding="utf-8")
    return path


@pytest.fixture(params=["npy", "png", "svg"])
def mask(request: pytest.FixtureRequest, tmp_path: Path) -> MaskPattern:
    path = tmp_path / f"mask.{request.param}"
    if request.param == "npy":
        np.save(path, CELLS)
    elif request.param == "png":
        Image.fromarray(255 * CELLS.T[::-1]).save(path)
    else:
        drawing(path, 2, 3, '<path d="M 10 0 h 10 v 20 h -10 z"/>')  # y of a drawing points down
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
    header = b"IHDR" + struct.pack(">II5B", 100_000, 100_000, 8, 0, 0, 0, 0)
    chunks = (struct.pack(">I", len(one) - 4) + one + struct.pack(">I", zlib.crc32(one)) for one in (header, b"IDAT"))
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + b"".join(chunks))


def _cut_png(path: Path) -> None:
    _png(path, np.eye(64, dtype=np.uint8))
    path.write_bytes(path.read_bytes()[:60])


@pytest.mark.parametrize(
    ("name", "write", "complaint"),
    [
        ("a.png", lambda p: _png(p, np.arange(9, dtype=np.uint8).reshape(3, 3)), "is not a mask: a mask has two"),
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
        ("a.svg", lambda p: p.write_text("<svg><path"), "is not an SVG drawing: "),
        ("a.svg", lambda p: p.write_bytes(b"\xff\xfe\xfd"), "is not an SVG drawing: "),
        ("a.svg", lambda p: p.write_text("<html/>"), 'is not an SVG drawing: it begins with "html"'),
        ("a.svg", lambda p: p.write_text('<svg height="1 mm"/>'), "has no width; a drawing has both width and height"),
        ("a.svg", lambda p: p.write_text('<svg width="9 mm" height="9"/>'), 'height: got "9", which has no unit'),
        ("a.svg", lambda p: p.write_text('<svg width="0mm" height="9mm"/>'), "has 0 × 9 cells"),
        ("a.svg", lambda p: drawing(p, 9, 9.5, ""), "is 9 mm × 9.5 mm, which cells of cell_size = 1 mm do not fill"),
        ("a.svg", lambda p: drawing(p, 9, 5000, ""), "has 9 × 5000 cells"),
        ("a.svg", lambda p: drawing(p, 9, 9, '<path fill="none" d="M 0 0 h 50 v 50 z"/>'), "has no filled shape"),
        ("a.svg", lambda p: drawing(p, 9, 9, "<text>4 mm</text>"), "has text, which is not supported; give filled"),
        ("a.svg", lambda p: drawing(p, 9, 9, '<rect clip-path="url(#a)"/>'), "has clip-path, which is not supported"),
        ("a.svg", lambda p: drawing(p, 9, 9, '<rect width="90" height="90"/>'), "is not a mask: a mask has two"),
        ("a.jpg", lambda p: p.write_text(""), "give a .png image, a .npy array or a .svg drawing"),
        ("a.npy", lambda p: None, "there is no file"),
    ],
)
def test_what_is_no_mask_is_refused(tmp_path: Path, name: str, write: object, complaint: str) -> None:
    write(tmp_path / name)
    with pytest.raises(ValidationError, match=complaint):
        MaskPattern(file=tmp_path / name, cell_size="1 mm")


def test_shapes_of_a_drawing_are_those_of_the_lattice(tmp_path: Path) -> None:
    # A slot about the middle as one path, and those about the corners as circles and a turned rectangle each.
    middle = '<path d="M 60 40 v 80 a 20 20 0 0 0 40 0 v -80 a 20 20 0 0 0 -40 0 z"/>'
    corner = (
        '<circle r="20" cy="40"/><circle r="20" cy="-40"/>'
        '<rect x="-40" y="-20" width="80" height="40" transform="rotate(90)" style="stroke:red;fill:#123"/>'
    )
    corners = "".join(f'<g transform="translate({y} {z})">{corner}</g>' for y in (0, 160) for z in (0, 160))
    path = drawing(tmp_path / "a.svg", 16, 16, f'<rect width="160" height="160" fill="none"/>{middle}{corners}')
    mask = MaskPattern(file=path, cell_size="0.1 mm")
    lattice = SlotPattern(length="12 mm", width="4 mm", spacing=["8 mm", "16 mm"], staggered=True)
    assert mask.period == pytest.approx(lattice.period, rel=1e-12)
    at = (np.arange(160) - 79.5) * 0.1 * MM
    assert np.array_equal(mask.is_hole(at[:, None], at), lattice.is_hole(at[:, None], at))
    assert mask.ligament() == pytest.approx(lattice.ligament(), abs=mask.resolution)
    here = mask.edge_distance(at[:, None], at)
    assert np.allclose(here, lattice.edge_distance(at[:, None], at), rtol=0, atol=mask.resolution)


def test_islands_in_a_path_are_material(tmp_path: Path) -> None:
    ring = drawing(tmp_path / "a.svg", 8, 8, '<path d="M 20 20 h 40 v 40 h -40 z M 30 30 h 10 v 10 h -10 z"/>')
    mask = MaskPattern(file=ring, cell_size="0.5 mm")
    assert mask.open_area == pytest.approx(15 / 64)
    assert mask.is_hole(MM * np.array([-1.5, -0.5]), MM * np.array([1.5, 0.5])).tolist() == [True, False]
    assert mask.ligament() == pytest.approx(4 * MM)  # to the next period; within the ring there is no second hole


@pytest.mark.parametrize("cells", [40, 200])
def test_the_ligament_of_a_mask_is_within_its_resolution(tmp_path: Path, cells: int) -> None:
    lattice = CirclePattern(diameter="5 mm", spacing=["6 mm", "10 mm"], staggered=True)
    y, z = (((np.arange(cells) + 0.5) / cells - 0.5) * extent for extent in (10 * MM, 10 * MM))
    lattice = lattice.model_copy(update={"spacing": (5 * MM, 10 * MM)})  # square cells: 10 mm by 10 mm
    np.save(tmp_path / "a.npy", ~lattice.is_hole(y[:, None], z))
    mask = MaskPattern(file=tmp_path / "a.npy", cell_size=10 * MM / cells)
    assert mask.ligament() == pytest.approx((math.hypot(5, 5) - 5) * MM, abs=mask.resolution)
    # On a plate of 9.5 mm the corner holes are cut; the middle one is 2.07 mm from these, 2.25 mm from the rim.
    assert mask.ligament((9.5 * MM, 9.5 * MM)) == pytest.approx((math.hypot(5, 5) - 5) * MM, abs=mask.resolution)
    assert mask.ligament((6 * MM, 6 * MM)) == pytest.approx(0.5 * MM, abs=mask.resolution)


def test_a_mask_of_one_hole_on_a_small_plate_has_the_rim_alone(tmp_path: Path) -> None:
    cells = np.ones((10, 10))
    cells[4:6, 4:6] = 0
    np.save(tmp_path / "a.npy", cells)
    mask = MaskPattern(file=tmp_path / "a.npy", cell_size="1 mm")
    assert mask.ligament((6 * MM, 8 * MM)) == pytest.approx(2 * MM)
    assert mask.ligament() == pytest.approx(8 * MM)
    with pytest.raises(ValueError, match=r'margin cannot be combined with shape = "mask", .*: it has no single holes'):
        mask.bounded((6 * MM, 8 * MM), 1 * MM)


def test_the_smallest_gap_is_the_least_distance_of_any_two_shapes() -> None:
    rng = np.random.default_rng(3)
    places = np.stack(np.meshgrid(np.arange(5.0), np.arange(7.0)), axis=-1).reshape(-1, 1, 2)
    angles = np.sort(rng.uniform(0.0, 2.0 * np.pi, (35, 40)), axis=1)
    turned = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    shapes = places + rng.uniform(0.1, 0.48, (35, 1, 1)) * np.concatenate([turned, turned[:, :1]], axis=1)
    polygons = shapely.polygons(shapes)
    apart = shapely.distance(polygons[:, None], polygons)[~np.eye(35, dtype=bool)]
    assert smallest_gap([[shape] for shape in shapes]) == pytest.approx(apart.min(), rel=1e-12)
    circle = np.stack([np.cos(ANGLES), np.sin(ANGLES)], axis=-1)
    assert smallest_gap([[2.0 * circle, circle], [0.4 * circle]]) == pytest.approx(
        0.6, rel=1e-3
    )  # an island with a hole
    assert smallest_gap([[shapes[0]]]) == smallest_gap([]) == math.inf


def test_the_ligament_of_noise_takes_no_longer_than_its_outline_is_long(tmp_path: Path) -> None:
    # One hole winds through the whole mask and holds hundreds of others.
    np.save(tmp_path / "a.npy", np.random.default_rng(1).random((300, 300)) > 0.7)
    mask = MaskPattern(file=tmp_path / "a.npy", cell_size="0.05 mm")
    begin = time.process_time()
    assert mask.ligament() == pytest.approx(math.sqrt(0.5) * 0.05 * MM)  # from corner to corner
    assert time.process_time() - begin < 5.0


def test_a_drawing_that_takes_too_long_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = drawing(tmp_path / "a.svg", 9, 9, '<rect width="40" height="40"/>')
    monkeypatch.setattr(mask_files, "_LONGEST", 0.001)
    with pytest.raises(ValidationError, match=r"takes more than 0\.001 s to draw; give fewer or simpler shapes"):
        MaskPattern(file=path, cell_size="1 mm")


def test_a_drawing_that_takes_too_much_of_the_processor_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = drawing(tmp_path / "a.svg", 9, 9, f"<style>{'a ' * 1_000_000}</style>")  # hours in a regular expression
    monkeypatch.setattr(mask_files, "_LONGEST", 2.0)
    monkeypatch.setattr(mask_files, "_PATIENCE", 300.0)
    with pytest.raises(ValidationError, match="takes more than 2 s to draw; give fewer or simpler shapes"):
        MaskPattern(file=path, cell_size="1 mm")
