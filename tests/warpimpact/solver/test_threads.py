"""How shots are dealt out to the threads of a CPU."""

from pathlib import Path
from threading import Event
from typing import Any

import pytest

from warpimpact import Campaign, Numerics, simulate
from warpimpact.solver.marching import CPU_CHUNK
from warpimpact.solver.memory import Memory

CAMPAIGN = Path(__file__).parents[3] / "campaigns" / "slotted_plate.toml"


@pytest.mark.parametrize("hits", [24, 700])
@pytest.mark.parametrize("threads", [2, 3])
def test_launches_begin_and_end_with_single_shots(hits: int, threads: int, monkeypatch: pytest.MonkeyPatch) -> None:
    campaign, counts, launch = Campaign.from_toml(CAMPAIGN), [], Memory.launch

    def recorded(self: Memory, *arguments: Any) -> int:
        counts.append(arguments[-1])
        return launch(self, *arguments)

    monkeypatch.setattr(Memory, "launch", recorded)
    monkeypatch.setattr("warpimpact.solver.marching.CPU_LAUNCH", 1e9)  # however slow the machine
    shots = campaign.sampler().shots(0, hits)
    simulate(campaign.scene, shots, numerics=Numerics(level=2), device="cpu", threads=threads)
    first_windows = counts[: next(k + 1 for k in range(len(counts)) if sum(counts[: k + 1]) >= hits)]
    assert sum(first_windows) == hits
    assert max(first_windows) <= max(1, min(CPU_CHUNK, hits // (2 * threads)))
    assert max(first_windows) > 1
    assert first_windows[: 2 * threads] == [1] * 2 * threads
    assert first_windows[-threads:] == [1] * threads


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
