"""The block layout on request: what it takes, what it refuses, and windows that do not fit a block."""

import numpy as np
import pytest

from warpimpact.scene import Numerics, Plate, Scene
from warpimpact.solver import grid, simulate
from warpimpact.solver.prepare import prepare
from warpimpact.solver.resolution import LADDER, at_level

from ...verification.scenes import PAPER_CORE, shots_at

PLATE = Plate(thickness=4e-3, resistance=2.6e9, shear_coefficient=1e-9, degradation=0.8, degradation_interval=1e-6)
SCENE = Scene(core=PAPER_CORE, target=PLATE)
SIMPLE, BLOCK = Numerics(level=2), Numerics(level=2, layout="block")


THREE = np.zeros(3)


def test_windows_that_do_not_fit_a_block_are_for_the_simple_layout() -> None:
    shots = shots_at(THREE, obliquity=69.0)
    assert not prepare(SCENE, shots, BLOCK).variant.window
    assert not prepare(SCENE, shots_at(THREE), at_level(len(LADDER) - 1, BLOCK)).variant.window
    simple, block = (simulate.simulate(SCENE, shots, numerics=n) for n in (SIMPLE, BLOCK))
    np.testing.assert_array_equal(block.residual_velocity, simple.residual_velocity)


def test_shots_that_leave_the_window_of_their_block_are_computed_in_the_simple_layout(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(grid, "SLACK", 0.8)
    monkeypatch.setattr(grid, "SIZES", (4096,))  # the build of tests/kernels/test_block.py
    shots = shots_at(THREE, pitch=1.72)
    simple, block = (simulate.simulate(SCENE, shots, numerics=n) for n in (SIMPLE, BLOCK))
    np.testing.assert_array_equal(block.status, simple.status)
    np.testing.assert_array_equal(block.residual_velocity, simple.residual_velocity)
