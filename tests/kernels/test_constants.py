"""The table of constants: it is whole, and its tests and sections exist."""

import ast
import re
from pathlib import Path

import numpy as np
import pytest
import warp as wp

from warpimpact.kernels import constants, exposure, structs
from warpimpact.kernels.continuum import choices
from warpimpact.kernels.variant import Variant

CHECKOUT = Path(__file__).parents[2]
TABLE = {
    f"{home.__name__.rsplit('.', 1)[1]}.{name}": value
    for home in (constants, choices)
    for name, value in vars(home).items()
    if isinstance(value, constants.Constant)
}
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
