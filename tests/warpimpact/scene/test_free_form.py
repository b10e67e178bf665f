"""Free forms: areas of forms that are circles, squares and stripes, tools, what falls out, and their drawings."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import TypeAdapter, ValidationError

from warpimpact import Campaign, LevelSetPattern, MaskPattern, Supershape, SupershapePattern, Wave
from warpimpact.cli import main
from warpimpact.scene import AnyPattern

SLOTTED_PLATE = Path(__file__).parents[3] / "campaigns" / "slotted_plate.toml"
CELL = {"spacing": (8e-3, 10e-3), "cell_size": 2.5e-5}


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


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ({"shape": "supershape", "forms": [{"radius": "6 mm"}]}, "cut the plate apart"),
        ({"shape": "level_set", "waves": [{"along_y": 1, "along_z": 0}], "share": 0.3}, "cut the plate apart"),
        ({"shape": "level_set", "waves": [{"along_y": 0, "along_z": 0}], "share": 0.3}, "waves that cancel"),
        ({"shape": "supershape", "forms": [{"radius": "1 mm"}], "cell_size": "1 um"}, "larger cell_size"),
        ({"shape": "supershape", "forms": []}, "at least 1"),
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
        mask = MaskPattern(file=output, cell_size=5e-5)
        assert mask.period == pytest.approx(drawn.period)
        assert mask.open_area == pytest.approx(drawn.open_area, abs=0.005)
        return
    import ezdxf

    outlines = [
        np.array(one.get_points("xy")) for one in ezdxf.readfile(output).modelspace().query('*[layer=="HOLES"]')
    ]
    area = sum(0.5 * abs(np.cross(one, np.roll(one, -1, axis=0)).sum()) for one in outlines)
    assert area / 81.0 == pytest.approx(drawn.open_area, abs=0.01)
    assert main(["export", str(tmp_path / "free.toml"), "-o", str(output)]) == 2  # it exists
    assert main(["export", str(tmp_path / "free.toml"), "-o", str(tmp_path / "a.pdf")]) == 2
