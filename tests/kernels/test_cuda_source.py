"""The device code compiles for CUDA (sm_90), on a machine without a GPU too."""

import re
from collections import Counter
from pathlib import Path
from typing import Any

import pytest
import warp as wp

from warpimpact.kernels import free_flight, march
from warpimpact.kernels.continuum import march_many
from warpimpact.kernels.lanes import LANES
from warpimpact.kernels.variant import Variant

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


@pytest.mark.parametrize("double", [False, True])
def test_the_march_of_many_hits_keeps_no_struct_in_local_memory(double: bool, tmp_path: Path) -> None:
    """A thread of a node or an element has all in registers, whatever of the structs of its hit it reads."""
    kernels = vars(march_many.build(Variant(double=double)).kernels)
    wp.compile_aot_module(kernels["move"].module, arch=90, use_ptx=True, module_dir=tmp_path)
    ptx = next(tmp_path.glob("*.ptx")).read_text()
    entries = dict(re.findall(r"\.entry (\w+?)_(.*?)^}", ptx, re.MULTILINE | re.DOTALL))
    assert sorted(entries) == sorted(kernels)
    for name, entry in entries.items():
        assert "ret;" in entry
        assert "__local_depot" not in entry, name


@pytest.mark.parametrize(
    ("variant", "barriers"),
    [
        (Variant(window=512, degrades=False, rimmed=True, bends=True, tabled=True), 0),
        (Variant(window=2048), 7),
        (Variant(window=2048, layered=True), 18),
    ],
)
def test_block_keeps_its_front_window_in_shared_memory(variant: Variant, barriers: int, tmp_path: Path) -> None:
    kernel = march.build(variant).kernel
    wp.compile_aot_module(kernel.module, arch=90, use_ptx=True, module_dir=tmp_path)
    ptx = next(tmp_path.glob("*.ptx")).read_text()
    shared = re.findall(r"\.shared \.align 4 \.b8 \S*?(exposure|gain)\[(\d+)\]", ptx)
    assert shared == ([("exposure", "8192"), ("gain", "8192")] if variant.degrades else [])
    assert f".maxntid {LANES}, 1, 1" in ptx
    used = Counter(re.findall(r"^\s+(?:@!?%p\d+ )?((?:ld|st|atom|red|shfl|bar|barrier)\.[\w.:]+)", ptx, re.MULTILINE))
    spaces = {name.split(".")[1] for name in used if name.startswith(("ld.", "st.", "atom.", "red."))}
    named = {"global", "shared", "local", "param", "const"}
    # Only plates of layers and what else is added have generic addresses there.
    assert spaces <= named | ({"u32", "f32"} if variant.layered or variant.bends else set())
    assert used["shfl.sync.bfly.b32"] >= 5 * 20
    assert not [name for name in used if name.startswith("bar.sync")]  # a warp waits for itself alone
    assert used["bar.warp.sync"] == barriers  # kernels/block.py says what for
    if variant.degrades:
        assert used["ld.shared.f32"] >= 4 + 4
        assert sum(count for name, count in used.items() if name.startswith(("atom.shared.add", "red.shared.add"))) >= 4
