"""The device code compiles for CUDA (sm_90), on a machine without a GPU too."""

from pathlib import Path
from typing import Any

import pytest
import warp as wp

from warpimpact.kernels import free_flight, march
from warpimpact.kernels.variant import Variant


@pytest.mark.parametrize("stage", [march, free_flight])
@pytest.mark.parametrize(
    "variant",
    [
        Variant(bends=True),
        Variant(double=True, nodal=True),
        Variant(bends=True, layered=True),
        Variant(burst=True, layered=True),
    ],
)
def test_kernel_compiles_to_ptx(stage: Any, variant: Variant, tmp_path: Path) -> None:
    kernel = stage.build(variant).kernel
    wp.compile_aot_module(kernel.module, arch=90, use_ptx=True, module_dir=tmp_path)
    (ptx,) = tmp_path.glob("*.ptx")
    entries = [line for line in ptx.read_text().splitlines() if ".entry" in line]
    assert len(entries) == 1
    assert f" {kernel.key}_" in entries[0]
