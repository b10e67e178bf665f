"""Access to flat arrays: debug mode stops at an index outside."""

import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = """
import sys
import warp as wp

wp.config.mode = "debug"
from warpimpact.kernels import memory
from warpimpact.kernels.variant import Variant

access = memory.build(wp.float32)

def look(array: wp.array(dtype=wp.float32), index: wp.int32, values: wp.array(dtype=wp.float32)) -> None:
    values[0] = access.read(array, index)

def put(array: wp.array(dtype=wp.float32), index: wp.int32, values: wp.array(dtype=wp.float32)) -> None:
    access.write(array, index, values[0])

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
