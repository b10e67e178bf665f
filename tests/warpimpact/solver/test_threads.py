"""How shots are dealt out to the threads of a CPU."""

from pathlib import Path
from threading import Event
from typing import Any

import pytest

from warpimpact import Campaign, Numerics, simulate
from warpimpact.solver.memory import Memory

CAMPAIGN = Path(__file__).parents[3] / "campaigns" / "slotted_plate.toml"


def test_an_interrupt_does_not_wait_for_a_long_shot(monkeypatch: pytest.MonkeyPatch) -> None:
    campaign, launch, over = Campaign.from_toml(CAMPAIGN), Memory.launch, Event()
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
    shots = campaign.sampler().shots(0, 8)
    with pytest.raises(KeyboardInterrupt):
        simulate(campaign.scene, shots, numerics=Numerics(level=0), device="cpu", threads=2, progress=interrupt)
    assert not ended
    over.set()
