"""The table of constants: it is whole, its tests and sections exist, and nothing else in the device code is chosen."""

import ast
import re
from pathlib import Path

import numpy as np
import pytest
import warp as wp

from warpimpact.kernels import constants, exposure, lanes, structs
from warpimpact.kernels.continuum import choices
from warpimpact.kernels.variant import Variant

CHECKOUT = Path(__file__).parents[2]
TABLE = {
    f"{home.__name__.rsplit('.', 1)[1]}.{name}": value
    for home in (constants, choices)
    for name, value in vars(home).items()
    if isinstance(value, constants.Constant)
}
PLAIN = {0.0, 0.25, 0.5, 1.0, 1.5, 2.0, 4.0, 6.0, 12.0, 16.0, 20.0, 30.0, 42.0, 64.0}
"""Numbers of formulas in `real(…)`: fractions, factors and those of the series of sine and cosine."""
FILES = sorted(
    path for path in (CHECKOUT / "kernels").rglob("*.py") if path.stem not in ("constants", "choices", "__init__")
)


@pytest.mark.parametrize("name", TABLE)
def test_a_constant_names_a_test_and_a_section_that_exist(name: str) -> None:
    constant = TABLE[name]
    assert constant.unit
    assert constant.reason.endswith(".")
    if constant.section:
        model = (CHECKOUT / "docs" / "model.md").read_text(encoding="utf-8")
        assert re.search(rf"^#+ {re.escape(constant.section)} ", model, re.MULTILINE)
    if constant.test:
        file, function = constant.test.split("::")
        tree = ast.parse((CHECKOUT / "tests" / file).read_text(encoding="utf-8"))
        assert function in {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}


@pytest.mark.parametrize("name", TABLE)
def test_a_constant_is_used(name: str) -> None:
    assert any(name in path.read_text(encoding="utf-8") for path in FILES)


def chosen(tree: ast.AST) -> list[float]:
    """Numbers of a file that go into the device code as `real(…)` or as powers of ten, and are none of a formula."""
    calls = [node for node in ast.walk(tree) if isinstance(node, ast.Call) and ast.unparse(node.func) in REALS]
    numbers = [argument.value for node in calls for argument in node.args if isinstance(argument, ast.Constant)]
    return [number for number in numbers if isinstance(number, int | float) and number not in PLAIN]


REALS = {"real", "wp.float64", "wp.float32", "wp.constant"}


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_no_other_number_is_chosen(file: Path) -> None:
    assert not chosen(ast.parse(file.read_text(encoding="utf-8")))


@pytest.mark.parametrize(("low", "high"), [(30, 45), (12, 100)])
def test_a_strip_of_the_filter_is_whole_vectors(low: int, high: int, device: str) -> None:
    # The columns of a box and of the filter's reach beside it, in vectors of 16 numbers of float32; or whole rows.
    use, struct = Variant().use(exposure), structs.build(Variant())
    Plate, Window, Box, Strip = struct.Plate, struct.Window, struct.Box, struct.Strip

    @wp.kernel(module="unique")
    def cut(plate: Plate, window: Window, box: Box, strips: wp.array(dtype=Strip)):
        strips[0] = use.exposure.strip_of(plate, window, box)

    plate, window, box = Plate(), Window(), Box()
    plate.reach, window.cells_y, window.cells_z = 3, 120, 120
    box.y_low, box.y_high, box.z_low, box.z_high = 40, 50, low, high
    strips = wp.zeros(1, dtype=Strip, device=device)
    wp.launch(cut, 1, inputs=[plate, window, box], outputs=[strips], device=device)
    (strip,) = strips.numpy()
    whole = strip["count"] == 120
    assert strip["count"] % 16 == 0 or whole
    assert whole == (16 * np.ceil((high - low + 7) / 16) > 90)
    first = strip["start"] - (40 - 3) * 120
    assert first <= low - 3
    assert first + strip["count"] > high + 3
    assert strip["rows"] == 11 + 6


def test_lanes_of_a_block_share_out_every_loop() -> None:
    # A native loop over j that names no lanes would be done by each of them.
    for path in FILES:
        text = path.read_text(encoding="utf-8")
        assert not re.search(r"int j = \w+; j < \w+; \+\+j", text), path
        assert text.count("j = lane;") + text.count("j = low;") == text.count("j += lanes)"), path
    assert lanes.share(Variant()) == "constexpr int lane = 0, lanes = 1;"
