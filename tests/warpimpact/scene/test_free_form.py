"""Free forms: areas of forms that are circles, squares and stripes, tools, what falls out, and their drawings."""

import math
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
import shapely
from pydantic import TypeAdapter, ValidationError

from warpimpact import Campaign, LevelSetPattern, PolygonsPattern, Supershape, SupershapePattern, Wave
from warpimpact.cli import main
from warpimpact.scene import AnyPattern, CirclePattern, Pattern
from warpimpact.scene.patterns.roundings import smallest_gap

SLOTTED_PLATE = Path(__file__).parents[3] / "campaigns" / "slotted_plate.toml"
CELL = {"spacing": (8e-3, 10e-3), "cell_size": 2.5e-5}


SQUARE = [(-2e-3, -1e-3), (1e-3, -1e-3), (1e-3, 2e-3), (-2e-3, 2e-3)]


def form(*forms: Supershape, **more: Any) -> SupershapePattern:
    return SupershapePattern(forms=forms, **(CELL | more))


@pytest.mark.parametrize(
    ("one", "area"),
    [
        (Supershape(radius=3e-3, lobes=0), np.pi * 9e-6),
        (Supershape(radius=2e-3, lobes=0, stretch=2.0), np.pi * 8e-6),
        (Supershape(radius=3e-3, lobes=4, exponents=(100.0, 100.0, 100.0)), 18e-6),  # a square, to 1 %
        (Supershape(radius=3e-3, lobes=4, exponents=(1.0, 1.0, 1.0), rotation=0.3), 18e-6),
        (Supershape(radius=3e-3, lobes=0, y=3.9e-3, z=-4.8e-3), np.pi * 9e-6),  # across the rim of the cell
    ],
    ids=["circle", "ellipse", "square", "turned square", "moved"],
)
@pytest.mark.parametrize("staggered", [False, True])
def test_areas_of_known_forms(one: Supershape, area: float, staggered: bool) -> None:
    found = form(one, staggered=staggered, spacing=(10e-3, 10e-3))
    assert found.period == pytest.approx((20e-3 if staggered else 10e-3, 10e-3))
    assert found.open_area == pytest.approx(area / 1e-4, rel=0.015)


def test_forms_unite() -> None:
    apart = form(Supershape(radius=1e-3, lobes=0, y=-2e-3), Supershape(radius=1e-3, lobes=0, y=2e-3))
    assert apart.open_area == pytest.approx(2.0 * np.pi * 1e-6 / 8e-5, rel=0.01)
    assert apart.ligament() == pytest.approx(2e-3, abs=2.0 * apart.resolution)
    same = form(*[Supershape(radius=1e-3, lobes=0)] * 3)
    assert same.open_area == pytest.approx(np.pi * 1e-6 / 8e-5, rel=0.01)


def test_a_tool_leaves_what_it_does_not_reach() -> None:
    star = Supershape(radius=3e-3, lobes=5, exponents=(0.5, 1.0, 1.0))
    sharp, cut = form(star), form(star, smallest_feature=1.2e-3)
    assert not (~cut.material & sharp.material).any()
    assert 0.0 < cut.open_area < sharp.open_area
    wide = form(Supershape(radius=2e-3, lobes=0))
    again = form(Supershape(radius=2e-3, lobes=0), smallest_feature=3.5e-3)
    assert again.open_area == pytest.approx(wide.open_area, rel=0.02)
    assert form(Supershape(radius=2e-3, lobes=0), smallest_feature=4.5e-3).open_area == 0.0


def test_a_level_set_has_its_share_and_its_symmetry() -> None:
    even = LevelSetPattern(waves=(Wave(along_y=1, along_z=0), Wave(along_y=0, along_z=1)), share=0.3, **CELL)
    assert even.open_area == pytest.approx(0.3, abs=0.01)
    assert even.is_symmetric(-1, 1, centred=False)
    odd = LevelSetPattern(waves=(*even.waves, Wave(along_y=1, along_z=1, phase=1.0)), share=0.3, **CELL)
    assert not odd.is_symmetric(-1, 1, centred=False)


def test_what_a_hole_surrounds_falls_out() -> None:
    # A ring of waves: largest at a distance from the middle, smallest in the middle and at the rim.
    ring = LevelSetPattern(
        waves=(
            *(Wave(along_y=k, along_z=0, amplitude=a) for k, a in ((1, 1.0), (2, -1.0))),
            *(Wave(along_y=0, along_z=k, amplitude=a) for k, a in ((1, 1.0), (2, -1.0))),
        ),
        share=0.35,
        spacing=(8e-3, 8e-3),
    )
    holes = ~ring.material
    assert holes.mean() > 0.36  # with the middle
    middle = tuple(side // 2 for side in holes.shape)
    assert holes[middle]


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
    assert bounds == pytest.approx((-2e-3, -1e-3, 1e-3, 2e-3), abs=cell.resolution)
    across = rounds(3e-3, (3.9e-3, -4.8e-3), staggered=True)
    assert across.open_area == pytest.approx(np.pi * 2.25e-6 / 8e-5, rel=0.01)


@pytest.mark.parametrize("cell_size", [2.5e-4, 5e-5])
def test_the_ligament_of_cells_is_within_their_resolution(cell_size: float) -> None:
    lattice = CirclePattern(diameter=5e-3, spacing=(5e-3, 10e-3), staggered=True)
    spacing = (10e-3, 10e-3)
    cells: Pattern = rounds(5e-3, (0.0, 0.0), (5e-3, 5e-3), spacing=spacing, cell_size=cell_size)
    between = (math.hypot(5.0, 5.0) - 5.0) * 1e-3
    assert lattice.ligament() == pytest.approx(between)
    assert cells.ligament() == pytest.approx(between, abs=cells.resolution)
    # On a plate of 9.5 mm the corner holes are cut; the middle one is 2.07 mm from these, 2.25 mm from the rim.
    assert cells.ligament((9.5e-3, 9.5e-3)) == pytest.approx(between, abs=cells.resolution)
    assert cells.ligament((6e-3, 6e-3)) == pytest.approx(0.5e-3, abs=cells.resolution)
    at = (np.arange(200) - 99.5) * 5e-5
    distances = (pattern.edge_distance(at[:, None], at) for pattern in (cells, lattice))
    np.testing.assert_allclose(*distances, rtol=0, atol=cells.resolution)
    with pytest.raises(ValueError, match=r"margin cannot be combined with shape = .*: it has no single holes"):
        cells.bounded((6e-3, 8e-3), 1e-3)


def test_the_smallest_gap_is_the_least_distance_of_any_two_shapes() -> None:
    rng = np.random.default_rng(3)
    places = np.stack(np.meshgrid(np.arange(5.0), np.arange(7.0)), axis=-1).reshape(-1, 1, 2)
    angles = np.sort(rng.uniform(0.0, 2.0 * np.pi, (35, 40)), axis=1)
    turned = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    shapes = places + rng.uniform(0.1, 0.48, (35, 1, 1)) * np.concatenate([turned, turned[:, :1]], axis=1)
    polygons = shapely.polygons(shapes)
    apart = shapely.distance(polygons[:, None], polygons)[~np.eye(35, dtype=bool)]
    assert smallest_gap([[shape] for shape in shapes]) == pytest.approx(apart.min(), rel=1e-12)
    assert smallest_gap([[shapes[0]]]) == smallest_gap([]) == math.inf


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ({"shape": "supershape", "forms": [{"radius": "6 mm"}]}, "cut the plate apart"),
        ({"shape": "level_set", "waves": [{"along_y": 1, "along_z": 0}], "share": 0.3}, "cut the plate apart"),
        ({"shape": "level_set", "waves": [{"along_y": 0, "along_z": 0}], "share": 0.3}, "waves that cancel"),
        ({"shape": "supershape", "forms": [{"radius": "1 mm"}], "cell_size": "1 um"}, "larger cell_size"),
        ({"shape": "supershape", "forms": []}, "at least 1"),
        ({"shape": "polygons", "polygons": [[(0, 0), (1e-3, 1e-3), (1e-3, 0), (0, 1e-3)]]}, "cross themselves"),
        ({"shape": "polygons", "polygons": [SQUARE, SQUARE]}, "cross themselves or overlap"),
        ({"shape": "polygons", "polygons": [SQUARE[:2]]}, "at least 3"),
        ({"shape": "polygons", "polygons": [[(0, 0), (9e-3, 0), (0, 1e-3)]]}, r"as far as \(9, 1\) mm from the middle"),
        ({"shape": "supershape", "forms": [{"radius": "1 mm", "exponents": [0, 1, 1]}]}, "greater than 0.05"),
    ],
)
def test_a_form_that_is_no_plate_is_refused(given: dict[str, Any], sentence: str) -> None:
    with pytest.raises(ValidationError, match=sentence):
        TypeAdapter[Any](AnyPattern).validate_python({"spacing": ["8 mm", "8 mm"], **given})


@pytest.mark.parametrize("suffix", [".svg", ".dxf"])
def test_a_drawing_has_the_holes(suffix: str, tmp_path: Path) -> None:
    text = SLOTTED_PLATE.read_text(encoding="utf-8")
    head, _, tail = text.partition("[plate.pattern]")
    _, _, rest = tail.partition("\n[")
    pattern = (
        '[plate.pattern]\nshape = "supershape"\nspacing = ["9 mm", "9 mm"]\nforms = [{ radius = "3 mm", lobes = 3 }]\n'
    )
    (tmp_path / "free.toml").write_text(f"{head}{pattern}\n[{rest}", encoding="utf-8")
    output = tmp_path / f"free{suffix}"
    assert main(["export", str(tmp_path / "free.toml"), "-o", str(output)]) == 0
    drawn = Campaign.from_toml(tmp_path / "free.toml").plate.pattern
    if suffix == ".svg":
        (path,) = ElementTree.parse(output).getroot()
        rings = path.attrib["d"].removeprefix("M").removesuffix("Z").split("ZM")
        outlines = [np.array([point.split(",") for point in ring.split("L")], dtype=float) for ring in rings]
    else:
        import ezdxf

        shapes = ezdxf.readfile(output).modelspace().query('*[layer=="HOLES"]')
        outlines = [np.array(shape.get_points("xy")) for shape in shapes]
    area = sum(0.5 * abs(np.linalg.det(np.stack([one, np.roll(one, -1, axis=0)], axis=1)).sum()) for one in outlines)
    assert area / 81.0 == pytest.approx(drawn.open_area, abs=0.01)
    assert main(["export", str(tmp_path / "free.toml"), "-o", str(output)]) == 2  # it exists
    assert main(["export", str(tmp_path / "free.toml"), "-o", str(tmp_path / "a.pdf")]) == 2
