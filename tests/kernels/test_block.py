"""The block layout: 32 lanes compute a shot as one thread does, in whatever order they run (kernels/block.py).

Warp runs the lanes of a block on a CPU one after another, from barrier to barrier (`enable_cpu_blocks`). So a barrier
that is missing shows as a wrong outcome, and so does a place that only another lane has written: scratch is poisoned.
"""

import ctypes
from typing import Any, NamedTuple

import numpy as np
import pytest
import warp as wp

from warpimpact.kernels.status import Status
from warpimpact.scene import (
    CirclePattern,
    Core,
    FreeSurface,
    Impact,
    Interaction,
    Layer,
    Plate,
    Record,
    Scene,
    Shots,
    Target,
)
from warpimpact.solver import grid
from warpimpact.solver.fast_law import FastLaw
from warpimpact.solver.simulate import simulate

from ..verification.scenes import paper_plate
from .probes import OGIVE, PAPER

SLOTTED = paper_plate()
ROUND = SLOTTED.model_copy(update={"pattern": CirclePattern(diameter=5e-3, spacing=(8e-3, 8e-3))})
SIMPLE, BLOCK = FastLaw(level=2), FastLaw(level=2, layout="block")
NORMAL, OBLIQUE = {}, {"obliquity": 0.35, "azimuth": 0.7, "yaw": 0.1, "pitch": 0.05}


class Case(NamedTuple):
    """A core, the plate and the layers behind it, the impact, and the interaction."""

    core: Core = PAPER
    plate: Plate = SLOTTED
    impact: dict[str, float] = NORMAL
    interaction: dict[str, Any] = NORMAL
    behind: tuple[Layer, ...] = ()


SOUND = SLOTTED.model_copy(update={"degradation": 1.0})
BASE = Layer(thickness=6e-3, resistance=1.5e9, shear_coefficient=0.05, gap=20e-3)
WEAK = Layer(**SLOTTED.model_copy(update={"thickness": 2e-3}).model_dump(), gap=10e-3)
TOUCHING = Layer(**ROUND.model_copy(update={"thickness": 1.5e-3}).model_dump())
SCENES = {
    "slots": Case(),
    "oblique and yawed": Case(impact=OBLIQUE),
    "a shank in round holes": Case(OGIVE, ROUND, {"pitch": 0.015}),
    "stress that depends on the rate, beside the rim": Case(
        plate=SLOTTED.model_copy(update={"size": (9e-3, 30e-3)}), interaction={"linear": 0.1, "quadratic": 0.5}
    ),
    "layers": Case(impact=OBLIQUE, behind=(BASE, WEAK, TOUCHING)),
    "near a free surface": Case(plate=SOUND, impact=OBLIQUE, interaction={"free_surface": FreeSurface()}),
}
CHECKED = ("slots", "layers", "near a free surface")
"""Those that together read and write all arrays, whose bounds the debug mode checks."""
IN_RELEASE = pytest.mark.skipif("config.getoption('warp_mode') == 'debug'", reason="others read and write these arrays")
ROUNDING = {"residual_velocity": 0.1, "tilt": np.radians(0.5)}
ROUNDING |= {"layer_residual_velocity": 0.1, "layer_tilt": np.radians(0.5), "depth": 1e-5}
"""Largest difference by another order of summation [m/s, rad, m]: some hits near an edge multiply it."""


@pytest.fixture
def in_blocks(monkeypatch: pytest.MonkeyPatch) -> pytest.MonkeyPatch:
    """Blocks of 32 lanes on the CPU, and scratch that is NaN until it is written."""
    monkeypatch.setattr(wp.config, "enable_cpu_blocks", True)
    empty = wp.empty

    def nan_until_written(*args: Any, **kwargs: Any) -> wp.array:
        array = empty(*args, **kwargs)
        ctypes.memset(array.ptr, 0xFF, array.capacity)
        return array

    monkeypatch.setattr(wp, "empty", nan_until_written)
    return monkeypatch


def shots_of(count: int, **columns: float) -> Shots:
    """Hits all over a unit cell, at 825 m/s except for the given columns."""
    rng = np.random.default_rng(3)
    values = dict.fromkeys(Impact.model_fields, 0.0) | {"velocity": 825.0} | columns
    hits = {name: rng.uniform(-most, most, count) for name, most in (("hit_y", 4e-3), ("hit_z", 8e-3))}
    return Shots(**hits, **{name: np.full(count, value) for name, value in values.items()})


def scene_of(name: str, count: int) -> tuple[Scene, Shots]:
    case = SCENES[name]
    target, record = Target(layers=(case.plate, *case.behind)), Record(standoffs=(0.13,))
    scene = Scene(core=case.core, target=target, interaction=Interaction(**case.interaction), record=record)
    return scene, shots_of(count, **case.impact)


def by_one_thread(scene: Scene, shots: Shots) -> Any:
    """Outcomes of the simple layout, which runs no blocks on a CPU."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(wp.config, "enable_cpu_blocks", False)
        return simulate(scene, shots, method=SIMPLE, device="cpu")


def assert_same(outcomes: Any, expected: Any) -> None:
    """Nearly all equal to the rounding of single precision; no status differs, and no outcome by much."""
    for name in {"status", "layer_status", "stopped_in"} & vars(expected).keys():
        np.testing.assert_array_equal(getattr(outcomes, name), getattr(expected, name), err_msg=name)
    assert (expected.status < Status.UNFINISHED).all()
    for name in ROUNDING.keys() & vars(expected).keys():
        got, wanted, most = getattr(outcomes, name), getattr(expected, name), ROUNDING[name]
        np.testing.assert_array_equal(np.isnan(got), np.isnan(wanted), err_msg=name)
        difference = np.abs(got - wanted)[~np.isnan(wanted)]
        assert difference.max(initial=0.0) <= most, name
        assert np.median(np.append(difference, 0.0)) <= 0.005 * most, name


@pytest.fixture(autouse=True)
def one_size(monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> None:
    """On a CPU all windows have one size, so that scenes share builds."""
    if getattr(request.node, "callspec", None) is None or request.node.callspec.params.get("device", "cpu") == "cpu":
        monkeypatch.setattr(grid, "SIZES", (4096,))


# What 32 lanes compute in another test, one lane need not compute again.
@pytest.mark.parametrize("name", SCENES if wp.is_cuda_available() else ["slots"])
def test_block_computes_what_one_thread_computes(name: str, device: str) -> None:
    scene, shots = scene_of(name, 48)
    simple, by_block = (simulate(scene, shots, method=n, device=device) for n in (SIMPLE, BLOCK))
    assert_same(by_block, simple)


@pytest.mark.parametrize("name", [pytest.param(name, marks=[] if name in CHECKED else IN_RELEASE) for name in SCENES])
def test_lanes_that_run_one_after_another_compute_what_one_thread_computes(
    name: str, in_blocks: pytest.MonkeyPatch
) -> None:
    scene, shots = scene_of(name, 6 if wp.config.mode == "debug" else 12)  # a lane at a time, and every place checked
    by_block = simulate(scene, shots, method=BLOCK, device="cpu")
    assert_same(by_block, by_one_thread(scene, shots))
    again = simulate(scene, shots, method=BLOCK, device="cpu")
    for column, values in vars(by_block).items():
        np.testing.assert_array_equal(getattr(again, column), values, err_msg=column)
