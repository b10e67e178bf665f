"""The table of constants is whole; debug mode checks bounds; the device code compiles for CUDA without a GPU."""

import ast
import re
import subprocess
import sys
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import warp as wp

from warpimpact.kernels import constants, exposure, free_flight, march, structs
from warpimpact.kernels.continuum import choices, march_many
from warpimpact.kernels.lanes import LANES
from warpimpact.kernels.variant import Variant

CHECKOUT = Path(__file__).parents[2]
TABLE = {
    f"{home.__name__.rsplit('.', 1)[1]}.{name}": value
    for home in (constants, choices)
    for name, value in vars(home).items()
    if isinstance(value, constants.Constant)
}
FILES = sorted(
    path
    for folder in ("kernels", "warpimpact/continuum")
    for path in (CHECKOUT / folder).rglob("*.py")
    if path.stem not in ("constants", "choices", "__init__")
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


SCRIPT = """
import sys
import warp as wp

wp.config.mode = "debug"
from warpimpact.kernels.memory import read, write
from warpimpact.kernels.variant import Variant

def look(array: wp.array(dtype=wp.float32), index: wp.int32, values: wp.array(dtype=wp.float32)) -> None:
    values[0] = read(array, index)

def put(array: wp.array(dtype=wp.float32), index: wp.int32, values: wp.array(dtype=wp.float32)) -> None:
    write(array, index, values[0])

kernel = Variant().kernel({"read": look, "write": put}[sys.argv[1]])
arrays = [wp.zeros(n, dtype=wp.float32, device="cpu") for n in (8, 1)]
wp.launch(kernel, 1, inputs=[arrays[0], int(sys.argv[2]), arrays[1]], device="cpu")
"""


@pytest.mark.parametrize(("access", "index"), [("read", 8), ("write", -1)])
def test_debug_mode_stops_at_what_lies_outside(access: str, index: int, tmp_path: Path) -> None:
    # Release mode does not check; negative indices do not count from the end.
    script = tmp_path / "outside.py"
    script.write_text(SCRIPT)
    ended = subprocess.run([sys.executable, script, access, str(index)], capture_output=True, text=True)
    assert ended.returncode != 0
    assert "index >= 0 && index < array.shape[0]" in ended.stdout + ended.stderr


pytestmark = pytest.mark.skipif(
    "config.getoption('warp_mode') == 'debug'", reason="bounds are checked where kernels run, and none runs here"
)


# The simple layout; the block layout is compiled below, with layers.
@pytest.mark.parametrize(
    ("stage", "variant"),
    [
        (march, Variant(double=True, nodal=True)),
        (free_flight, Variant(double=True)),
    ],
)
def test_kernel_compiles_to_ptx(stage: Any, variant: Variant, tmp_path: Path) -> None:
    kernel = stage.build(variant).kernel
    wp.compile_aot_module(kernel.module, arch=90, use_ptx=True, module_dir=tmp_path)
    (ptx,) = tmp_path.glob("*.ptx")
    entries = [line for line in ptx.read_text().splitlines() if ".entry" in line]
    assert len(entries) == 1
    assert f" {kernel.key}_" in entries[0]


def test_the_march_of_many_hits_keeps_no_struct_in_local_memory(tmp_path: Path) -> None:
    """A thread of a node or an element has all in registers, whatever of the structs of its hit it reads."""
    kernels = march_many.build(Variant())
    wp.compile_aot_module(kernels["move"].module, arch=90, use_ptx=True, module_dir=tmp_path)
    ptx = next(tmp_path.glob("*.ptx")).read_text()
    entries = dict(re.findall(r"\.entry (\w+?)_(.*?)^}", ptx, re.MULTILINE | re.DOTALL))
    assert sorted(entries) == sorted(kernels)
    for name, entry in entries.items():
        assert "ret;" in entry
        assert "__local_depot" not in entry, name


def test_block_keeps_its_front_window_in_shared_memory(tmp_path: Path) -> None:
    kernel = march.build(Variant(window=2048)).kernel
    wp.compile_aot_module(kernel.module, arch=90, use_ptx=True, module_dir=tmp_path)
    ptx = next(tmp_path.glob("*.ptx")).read_text()
    shared = re.findall(r"\.shared \.align 4 \.b8 \S*?(exposure|gain)\[(\d+)\]", ptx)
    assert shared == [("exposure", "8192"), ("gain", "8192")]
    assert f".maxntid {LANES}, 1, 1" in ptx
    used = Counter(re.findall(r"^\s+(?:@!?%p\d+ )?((?:ld|st|atom|red|shfl|bar|barrier)\.[\w.:]+)", ptx, re.MULTILINE))
    spaces = {name.split(".")[1] for name in used if name.startswith(("ld.", "st.", "atom.", "red."))}
    assert spaces <= {"global", "shared", "local", "param", "const"}  # no generic addresses
    assert used["shfl.sync.bfly.b32"] >= 5 * 20
    assert not [name for name in used if name.startswith("bar.sync")]  # a warp waits for itself alone
    assert used["bar.warp.sync"] == 7  # kernels/block.py says what for
    assert used["ld.shared.f32"] >= 4 + 4
    assert sum(count for name, count in used.items() if name.startswith(("atom.shared.add", "red.shared.add"))) >= 4
