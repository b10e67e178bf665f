"""Access to flat arrays: written values are read, and debug mode stops at an index outside."""

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import warp as wp

from warpimpact.kernels import memory
from warpimpact.kernels.variant import Variant

from .probes import poisoned

COUNT = 100


def access_kernel(dtype: Any) -> Any:
    """Kernel that writes every third element and reads all elements."""
    access = memory.build(dtype)

    def fill(values: wp.array(dtype=dtype), array: wp.array(dtype=dtype)) -> None:
        i = wp.tid()
        access.write(array, 3 * i, access.read(values, i))

    return Variant().kernel(fill)


@pytest.mark.parametrize("dtype", [wp.float32, wp.int32])
def test_what_is_written_is_where_it_should_be(dtype: Any, device: str) -> None:
    values = wp.array(np.arange(1, COUNT + 1), dtype=dtype, device=device)
    array = poisoned(3 * COUNT, dtype, device)
    before = array.numpy().copy()
    wp.launch(access_kernel(dtype), COUNT, inputs=[values], outputs=[array], device=device)
    after = array.numpy()
    np.testing.assert_array_equal(after[::3], np.arange(1, COUNT + 1))
    for k in (1, 2):
        np.testing.assert_array_equal(after[k::3], before[k::3])


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
print("came through")
"""


@pytest.mark.parametrize(("access", "index"), [("read", 7), ("read", 8), ("write", -1)])
def test_debug_mode_stops_at_what_lies_outside(access: str, index: int, tmp_path: Path) -> None:
    # Release mode does not check; negative indices do not count from the end.
    script = tmp_path / "outside.py"
    script.write_text(SCRIPT)
    ended = subprocess.run([sys.executable, script, access, str(index)], capture_output=True, text=True)
    inside = 0 <= index < 8
    assert ("came through" in ended.stdout) == (ended.returncode == 0) == inside, ended.stderr
    assert ("index >= 0 && index < array.shape[0]" in ended.stdout + ended.stderr) == (not inside)
