"""A shot has the same bits in any company: threads, chunks, batches, order, and widths of windows."""

from functools import cache
from typing import Any, NamedTuple

import numpy as np
import pytest

from warpimpact.scene import Interaction, Layer, Plate, Record, Scene, Shots, Target
from warpimpact.solver import grid, marching
from warpimpact.solver.fast_law import FastLaw
from warpimpact.solver.simulate import simulate

from .scenes import BASE, PAPER_CORE, STANDOFFS, paper_plate, scattered_hits, shots_at

SHOTS = 24


class Case(NamedTuple):
    """A build of the kernels: what is shot at, and how it is computed."""

    plate: Plate = paper_plate()
    behind: tuple[Layer, ...] = ()
    numerics: dict[str, Any] = {}  # noqa: RUF012
    interaction: Interaction = Interaction()
    bending: bool = False
    varies: tuple[str, ...] = ()


CASES = {
    "single": Case(),
    "double": Case(numerics={"precision": "double"}),
    "fixed step": Case(numerics={"time_step": 0.7e-6}),
    "nodal": Case(numerics={"scheme": "nodal", "grid_spacing": 1e-4}),
    "rate and rim": Case(
        paper_plate(size=(24e-3, 30e-3)), interaction=Interaction(static=0.9, linear=0.3, quadratic=0.2)
    ),
    "bending": Case(bending=True),
    "layers": Case(behind=(BASE,)),
    "plates of their own": Case(varies=("resistance", "thickness", "degradation", "mass")),
}
"""All kinds of targets and schemes. The block layout has a build for every size of window, and another build may round
otherwise: tests/kernels/test_block.py."""
RANGES = {"resistance": (1.5e9, 3.5e9), "thickness": (2e-3, 6e-3), "degradation": (0.6, 0.95), "mass": (3e-3, 6e-3)}


@cache
def scene_of(name: str) -> tuple[Scene, Shots, FastLaw]:
    """Velocities, obliquities and attitudes that differ from hit to hit, so that windows and steps do."""
    case, rng = CASES[name], np.random.default_rng(1)
    arrivals = {"velocity": (300.0, 900.0), "obliquity": (0.0, 60.0), "azimuth": (0.0, 360.0), "spin": (0.0, 2e4)}
    arrivals |= dict.fromkeys(("pitch", "yaw"), (-10.0, 10.0))
    hits = scattered_hits(SHOTS) + rng.normal(0.0, 2e-3, (2, SHOTS))
    shots = shots_at(*hits, **{column: rng.uniform(*ends, SHOTS) for column, ends in arrivals.items()})
    own = {column: rng.uniform(*RANGES[column], SHOTS) for column in case.varies}
    record = Record(standoffs=STANDOFFS, bending=case.bending)
    target = Target(layers=(case.plate, *case.behind))
    scene = Scene(core=PAPER_CORE, target=target, interaction=case.interaction, record=record)
    return scene, Shots(**shots.columns | own), FastLaw(**{"level": 0} | case.numerics)


def computed(name: str, which: Any = slice(None), device: str = "cpu", **settings: Any) -> dict[str, np.ndarray]:
    """Outcomes of some of the shots of a case."""
    scene, shots, numerics = scene_of(name)
    return vars(simulate(scene, shots[which], method=numerics, device=device, **settings))


@cache
def expected(name: str, device: str) -> dict[str, np.ndarray]:
    return computed(name, device=device)


def assert_expected(got: dict[str, np.ndarray], name: str, device: str) -> None:
    for column, values in expected(name, device).items():
        np.testing.assert_array_equal(got[column], values, err_msg=column)


@pytest.mark.parametrize("name", CASES)
def test_a_shot_has_the_same_bits_alone_and_in_another_order(name: str, device: str) -> None:
    count = len(scene_of(name)[1])
    alone = [computed(name, slice(k, k + 1), device) for k in range(count)]
    assert_expected({column: np.concatenate([one[column] for one in alone]) for column in alone[0]}, name, device)
    backwards = computed(name, np.arange(count)[::-1], device)
    assert_expected({column: values[::-1] for column, values in backwards.items()}, name, device)


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize(("threads", "seconds"), [(1, 0.25), (2, 0.0)])
def test_threads_and_chunks_change_no_bit(
    name: str, threads: int, seconds: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(marching, "SHORTEST", 0.0)
    monkeypatch.setattr(marching, "LONGEST", seconds)
    assert_expected(computed(name, threads=threads), name, "cpu")


@pytest.mark.parametrize("name", ["single", "nodal", "rate and rim"])
def test_shots_that_leave_narrow_windows_have_the_bits_of_wide_ones(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    expected(name, "cpu")
    for width in ("SLACK", "NODAL_SLACK"):
        monkeypatch.setattr(grid, width, 0.3 * getattr(grid, width))
    assert_expected(computed(name), name, "cpu")
