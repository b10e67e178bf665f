"""Shots at many scenes give the outcomes of each alone."""

from pathlib import Path
from threading import Event
from typing import Any

import numpy as np
import pytest

from warpimpact import Campaign, Numerics, Scene, simulate
from warpimpact.scene import Shots
from warpimpact.solver.device import Cancel, Cancelled, Worker
from warpimpact.solver.memory import Memory
from warpimpact.solver.simulate import simulate_many

CAMPAIGNS = Path(__file__).parents[3] / "campaigns"
LEVEL = Numerics(level=0)


def scenes_of(*names: str, hits: int) -> list[tuple[Scene, Shots]]:
    campaigns = [Campaign.from_toml(CAMPAIGNS / f"{name}.toml") for name in names]
    return [(one.scene, one.sampler().shots(0, hits + k)) for k, one in enumerate(campaigns)]


@pytest.mark.parametrize("threads", [1, 5])
def test_outcomes_are_those_of_each_scene_alone(threads: int) -> None:
    scenes, progress = scenes_of("slotted_plate", "round_holes", "layered_target", "slotted_plate", hits=5), []
    many = simulate_many(scenes, LEVEL, Worker("cpu", threads), lambda *now: progress.append(now))
    for actual, (scene, shots) in zip(many, scenes, strict=True):
        alone = simulate(scene, shots, numerics=LEVEL, device="cpu", threads=1)
        assert vars(actual).keys() == vars(alone).keys()
        for name, values in vars(alone).items():
            assert np.array_equal(getattr(actual, name), values, equal_nan=values.dtype.kind == "f"), name
    total = sum(len(shots) for _, shots in scenes)
    assert progress[-1] == (total, total)
    assert [done for done, _ in progress] == sorted(done for done, _ in progress)


def test_an_error_of_a_scene_ends_the_others() -> None:
    scenes = scenes_of("slotted_plate", "round_holes", hits=4)
    with pytest.raises(ValueError, match="give a level"):
        simulate_many(scenes, Numerics(), Worker("cpu", 2))


def test_a_cancelled_computation_ends() -> None:
    cancel = Cancel()
    with pytest.raises(Cancelled):
        simulate_many(
            scenes_of("slotted_plate", "round_holes", hits=64),
            LEVEL,
            Worker("cpu", 2, cancel),
            lambda *_: cancel.cancel(),
        )
    assert cancel.cancelled


def test_an_interrupt_does_not_wait_for_a_long_shot(monkeypatch: pytest.MonkeyPatch) -> None:
    ((scene, shots),), launch, over = scenes_of("slotted_plate", hits=8), Memory.launch, Event()
    begun, ended = list[int](), list[int]()

    def slow(self: Memory, *arguments: Any) -> int:
        begun.append(1)
        if len(begun) == 2:
            over.wait(30.0)
            ended.append(2)
        return launch(self, *arguments)

    def interrupt(done: int, total: int) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(Memory, "launch", slow)
    with pytest.raises(KeyboardInterrupt):
        simulate(scene, shots, numerics=LEVEL, device="cpu", threads=2, progress=interrupt)
    assert not ended
    over.set()
