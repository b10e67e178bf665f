"""Memory: bounded for any count, and smaller after a failed allocation."""

import tracemalloc
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from warpimpact import Campaign
from warpimpact.kernels.status import Status
from warpimpact.records.outcomes import Outcomes
from warpimpact.records.variables import EXIT_VARIABLES, OUTCOME_VARIABLES
from warpimpact.results import files
from warpimpact.runs import answer
from warpimpact.runs.run import run_to_file
from warpimpact.runs.store import Store
from warpimpact.scene import Layer, Target
from warpimpact.solver import replay
from warpimpact.solver.fast_law import FastLaw
from warpimpact.solver.memory import Memory
from warpimpact.solver.simulate import simulate

from ...options import CPU
from ..slotted import slotted


@pytest.fixture
def campaign() -> Campaign:
    return slotted(count=256)


def at_once(memory: Memory, *_: object) -> tuple[Memory, None, None]:
    """A march that computes nothing."""
    return memory, None, None


def made_up(memory: Memory, _: None) -> Outcomes:
    """Outcomes without computing: numbers that zlib cannot make smaller."""
    numbers, prepared = np.random.default_rng(0), memory.prepared
    sizes = {"hit": len(prepared.shots), "standoff": len(prepared.scene.record.standoffs), "axis": 3}
    names = (*OUTCOME_VARIABLES[2:], *EXIT_VARIABLES)  # without status, and whether a core passes
    columns = {str(name): numbers.random([sizes[of] for of in name.dims]) for name in names}
    return Outcomes(status=np.zeros(sizes["hit"], dtype=np.int8), **columns)


def test_memory_does_not_grow_with_the_count(
    campaign: Campaign, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("warpimpact.solver.marching.march", at_once)
    monkeypatch.setattr(Memory, "report", made_up)
    monkeypatch.setattr("warpimpact.runs.store.HELD_BYTES", 2**20)
    monkeypatch.setattr("warpimpact.runs.compute.CHUNKS", 64)  # chunks of any run have the same size
    monkeypatch.setattr(answer, "_FREE", answer._FREE._replace(task=2**13))  # and tasks of draws
    output, peaks = tmp_path / "a.nc", list[int]()
    for count in (2**13, 2**14, 3 * 2**15):  # the first one imports what is needed
        hits = campaign.hits.model_copy(update={"count": count})
        tracemalloc.start()
        try:
            run_to_file(campaign.model_copy(update={"hits": hits}), Store(output, overwrite=True), options=CPU)
            peaks.append(tracemalloc.get_traced_memory()[1])
        finally:
            tracemalloc.stop()
    numbers = 8 + (4 + 4 * 3 + 4 * 2) / 2  # of a shot, and of its outcome at two stand-offs in single precision
    with files.opened(output) as dataset:
        assert dataset.sizes["hit"] == count
        assert dataset["tilt"].encoding["chunksizes"] == (files.FILE_CHUNK, 2)
        assert (dataset["status"] == Status.PERFORATED).all()
    further = 3 * 2**15 - 2**14  # many, as chunks that wait to be written differ by 2 MB from run to run
    assert peaks[2] - peaks[1] < further * numbers * 8 / 3  # bytes; a third of what the further hits take


def test_a_failing_allocation_changes_no_bit(campaign: Campaign, monkeypatch: pytest.MonkeyPatch) -> None:
    shots = campaign.sampler().shots(0, 64)

    def computed() -> Outcomes:
        return simulate(campaign.scene, shots, method=campaign.numerics, device="cpu", threads=4)

    plenty, granted, original = computed(), 0, Memory.scratch

    def scarce(task: Any, *arguments: Any) -> Any:
        """Memory for one slot in the first two attempts and for two later."""
        nonlocal granted
        granted += 1
        if granted in (2, 4):
            raise RuntimeError("Failed to allocate 1000 bytes on device 'cpu'")
        return original(task, *arguments)

    monkeypatch.setattr(Memory, "scratch", scarce)
    little = computed()
    assert granted >= 5  # 4 slots fail at the second, 2 at the second, 1 does not; wider windows come after these
    assert np.array_equal(plenty.residual_velocity, little.residual_velocity)
    assert np.array_equal(plenty.tilt, little.tilt)


def test_windows_that_do_not_fit_are_refused(campaign: Campaign, monkeypatch: pytest.MonkeyPatch) -> None:
    base = Layer(**campaign.plate.model_dump() | {"thickness": 0.2}, gap=0.0)  # wide, however narrow the plate's is
    scene = campaign.scene.model_copy(update={"target": Target(layers=(campaign.plate, base))})
    monkeypatch.setattr("warpimpact.solver.memory.free_memory", lambda: 2**16)
    monkeypatch.setattr("warpimpact.solver.memory.SMALL_MEMORY", 0)
    with pytest.raises(MemoryError, match=r"needs .* GiB in .* nodes .*; give a lower level"):
        simulate(scene, campaign.sampler().shots(0, 1), method=FastLaw(level=0), device="cpu")


def test_a_replay_that_does_not_fit_is_refused(campaign: Campaign, monkeypatch: pytest.MonkeyPatch) -> None:
    shots, numerics = campaign.sampler().shots(0, 1), FastLaw(level=0)
    memory, _, contact = replay.traced(campaign.scene, shots, numerics)
    assert memory.prepared.rows == contact.steps.numpy().max() + 1  # a shot may take thousands of times as many
    monkeypatch.setattr(replay, "free_memory", lambda: 2**16)
    with pytest.raises(MemoryError, match=r"history of \d+ steps with 6 snapshots of \d+ cells needs .* GiB are free"):
        replay.replay(campaign.scene, shots, numerics=numerics)
