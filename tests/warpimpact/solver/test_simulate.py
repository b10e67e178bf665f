"""Shots at many scenes, kernels made ready on a device, and the block layout on request."""

import threading
from pathlib import Path
from threading import Event
from typing import Any

import numpy as np
import pytest
import warp as wp
from filelock import FileLock

from warpimpact import Campaign, simulate
from warpimpact.kernels.variant import Variant
from warpimpact.scene import Plate, Scene, Shots
from warpimpact.solver import grid
from warpimpact.solver.device import Worker, find_device, load
from warpimpact.solver.fast_law import FastLaw
from warpimpact.solver.memory import Memory
from warpimpact.solver.prepare import prepare
from warpimpact.solver.resolution import LADDER
from warpimpact.solver.simulate import simulate_many

from ...verification.scenes import PAPER_CORE, shots_at

CAMPAIGNS = Path(__file__).parents[3] / "campaigns"
LEVEL = FastLaw(level=0)


def scenes_of(*names: str, hits: int) -> list[tuple[Scene, Shots]]:
    campaigns = [Campaign.from_toml(CAMPAIGNS / f"{name}.toml") for name in names]
    return [(one.scene, one.sampler().shots(0, hits + k)) for k, one in enumerate(campaigns)]


@pytest.mark.parametrize("threads", [1, 5])
def test_outcomes_are_those_of_each_scene_alone(threads: int) -> None:
    scenes, progress = scenes_of("slotted_plate", "round_holes", "layered_target", "slotted_plate", hits=5), []
    many = simulate_many(scenes, LEVEL, Worker("cpu", threads), lambda *now: progress.append(now))
    for actual, (scene, shots) in zip(many, scenes, strict=True):
        alone = simulate(scene, shots, method=LEVEL, device="cpu", threads=1)
        assert vars(actual).keys() == vars(alone).keys()
        for name, values in vars(alone).items():
            assert np.array_equal(getattr(actual, name), values, equal_nan=values.dtype.kind == "f"), name
    total = sum(len(shots) for _, shots in scenes)
    assert progress[-1] == (total, total)
    assert [done for done, _ in progress] == sorted(done for done, _ in progress)


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
        simulate(scene, shots, method=LEVEL, device="cpu", threads=2, progress=interrupt)
    assert not ended
    over.set()


def test_a_damaged_cache_is_compiled_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def two(values: wp.array(dtype=wp.float32)) -> None:
        values[wp.tid()] = 2.0

    device = find_device("cpu")
    monkeypatch.setattr(wp.config, "kernel_cache_dir", str(tmp_path))
    kernel = Variant().kernel(two)

    def twos() -> list[float]:
        kernel.module.unload()  # as a process that starts
        load(kernel, device)
        values = wp.zeros(2, dtype=wp.float32, device=device)
        wp.launch(kernel, 2, outputs=[values], device=device)
        return list(values.numpy())

    assert twos() == [2.0, 2.0]
    (compiled,), (meta,) = tmp_path.glob("*/*.o"), tmp_path.glob("*/*.meta")
    compiled.write_bytes(compiled.read_bytes()[:-9])
    assert twos() == [2.0, 2.0]
    meta.unlink()
    assert twos() == [2.0, 2.0]
    before = compiled.stat().st_mtime_ns
    assert twos() == [2.0, 2.0]
    assert compiled.stat().st_mtime_ns == before  # what is whole is not compiled again


def test_what_another_process_compiles_is_waited_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def four(values: wp.array(dtype=wp.float32)) -> None:
        values[wp.tid()] = 4.0

    kernel, device = Variant().kernel(four), find_device("cpu")
    monkeypatch.setattr(wp.config, "kernel_cache_dir", str(tmp_path / "cache"))
    (tmp_path / "cache").mkdir()
    load(kernel, device)
    kernel.module.unload()
    (folder,) = (path for path in (tmp_path / "cache").iterdir() if path.is_dir())
    folder.rename(tmp_path / "compiled")
    with FileLock(folder.with_name(f"{folder.name}.lock")):  # as another process that compiles it
        waiting = threading.Thread(target=load, args=(kernel, device))
        waiting.start()
        waiting.join(0.5)
        assert waiting.is_alive()
        assert not folder.exists()
        (tmp_path / "compiled").rename(folder)
        (file,) = folder.glob("*.o")
        before = file.stat().st_mtime_ns
    waiting.join()
    assert file.stat().st_mtime_ns == before  # and was not compiled again


PLATE = Plate(thickness=4e-3, resistance=2.6e9, shear_coefficient=1e-9, degradation=0.8, degradation_interval=1e-6)
SCENE = Scene(core=PAPER_CORE, target=PLATE)
SIMPLE, BLOCK = FastLaw(level=2), FastLaw(level=2, layout="block")


THREE = np.zeros(3)


def test_windows_that_do_not_fit_a_block_are_for_the_simple_layout() -> None:
    shots = shots_at(THREE, obliquity=69.0)
    assert not prepare(SCENE, shots, BLOCK).variant.window
    assert not prepare(SCENE, shots_at(THREE), BLOCK.at_level(len(LADDER) - 1)).variant.window
    simple, block = (simulate(SCENE, shots, method=n) for n in (SIMPLE, BLOCK))
    np.testing.assert_array_equal(block.residual_velocity, simple.residual_velocity)


def test_shots_that_leave_the_window_of_their_block_are_computed_in_the_simple_layout(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(grid, "SLACK", 0.8)
    monkeypatch.setattr(grid, "SIZES", (4096,))  # the build of tests/kernels/test_block.py
    shots = shots_at(THREE, pitch=1.72)
    simple, block = (simulate(SCENE, shots, method=n) for n in (SIMPLE, BLOCK))
    np.testing.assert_array_equal(block.status, simple.status)
    np.testing.assert_array_equal(block.residual_velocity, simple.residual_velocity)
