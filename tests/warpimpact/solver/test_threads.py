"""How shots are dealt out to the threads of a CPU."""

from pathlib import Path
from threading import Event
from typing import Any

import pytest

from warpimpact import Campaign, Numerics, simulate
from warpimpact.solver.marching import Chunks
from warpimpact.solver.memory import Memory

CAMPAIGN = Path(__file__).parents[3] / "campaigns" / "slotted_plate.toml"


@pytest.mark.parametrize(("pace", "most", "fewest"), [(1.0, 1, 1), (0.1, 2, 1), (1e-4, 60, 20), (1e-9, 60, 60)])
def test_chunks_begin_with_a_shot_and_take_neither_too_long_nor_too_little(pace: float, most: int, fewest: int) -> None:
    chunks, counts, together = Chunks(700, 6, 60), list[int](), 0
    while (chunk := chunks.take())[1]:
        assert chunk[0] == together
        counts, together = [*counts, chunk[1]], together + chunk[1]
        chunks.computed(chunk[1], pace * chunk[1])
    assert (sum(counts), chunks.done, counts[0], max(counts), min(counts[1:-1])) == (700, 700, 1, most, fewest)
    assert counts[1:] == sorted(counts[1:], reverse=True)


@pytest.mark.parametrize(("hits", "threads"), [(24, 2), (700, 3)])
def test_every_shot_is_launched_once(hits: int, threads: int, monkeypatch: pytest.MonkeyPatch) -> None:
    campaign, launched, launch = Campaign.from_toml(CAMPAIGN), list[int](), Memory.launch

    def recorded(self: Memory, *arguments: Any) -> int:
        launched.extend(range(arguments[-2], sum(arguments[-2:])))
        return launch(self, *arguments)

    monkeypatch.setattr(Memory, "launch", recorded)
    monkeypatch.setattr("warpimpact.solver.marching.MAX_DOUBLINGS", 1)
    shots = campaign.sampler().shots(0, hits)
    simulate(campaign.scene, shots, numerics=Numerics(level=0), device="cpu", threads=threads)
    assert sorted(launched) == [*range(hits)]


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
