"""Windows that follow a core: the bits are those of windows that are wide enough from the start (kernels/layers.py)."""

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pytest

from warpimpact.scene import Hits, Impact, Numerics, Plate, Scene, Target, make_shots
from warpimpact.solver import grid
from warpimpact.solver.device import find_device
from warpimpact.solver.marching import march
from warpimpact.solver.memory import Memory
from warpimpact.solver.prepare import prepare

from ..verification.scenes import PAPER_CORE, layer, paper_plate

HITS = 16
PLATE = paper_plate(degradation_interval=None, degradation_distance=0.8e-3)
SOFT = Plate(thickness=25e-3, resistance=0.4e9, degradation=0.9, degradation_distance=0.8e-3)


class Marched(NamedTuple):
    outcomes: dict[str, Any]
    first: int
    last: int


def marched(target: tuple[Plate, ...], impact: dict[str, float], device: str, *, slide: bool) -> Marched:
    scene = Scene(core=PAPER_CORE, target=Target(layers=target))
    shots = make_shots(Impact(velocity=825.0, **impact), Hits(count=HITS, seed=2), target[0])
    prepared = replace(prepare(scene, shots, Numerics(level=0)), slide=slide)
    memory = Memory(prepared, find_device(device))
    _, last, outcomes = march(memory)
    names = ("status", "steps", "velocity", "position", "axis", "angular_momentum", "energy_loss")
    return Marched({name: getattr(outcomes, name).numpy() for name in names}, prepared.cells, last)


@pytest.mark.parametrize(
    ("target", "impact"),
    [
        ((PLATE, layer(SOFT, gap=0.05)), {"obliquity": 45.0, "azimuth": 250.0}),  # cores turn in the layer behind
        ((PLATE, layer(SOFT, gap=0.02)), {"obliquity": 60.0, "azimuth": 250.0}),  # and go far aside
    ],
)
def test_a_window_that_follows_the_core_has_the_bits_of_a_wide_one(
    target: tuple[Plate, ...], impact: dict[str, float], device: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(grid, "SLACK", 0.2)  # narrow, so that they have to slide often
    monkeypatch.setattr(grid, "WIDER_BEHIND", 0.1)
    wide, follows = (marched(target, impact, device, slide=slide) for slide in (False, True))
    for name, values in wide.outcomes.items():
        np.testing.assert_array_equal(follows.outcomes[name], values, err_msg=name)
    assert follows.first == wide.first
    assert follows.last < wide.last
