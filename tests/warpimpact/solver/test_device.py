"""Kernels made ready on a device."""

import threading
from pathlib import Path

import pytest
import warp as wp
from filelock import FileLock

from warpimpact.kernels.variant import Variant
from warpimpact.solver import device as device_module
from warpimpact.solver.device import find_device, load


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


def test_ctrl_c_does_not_wait_for_the_compiler(monkeypatch: pytest.MonkeyPatch) -> None:
    def six(values: wp.array(dtype=wp.float32)) -> None:
        values[wp.tid()] = 6.0

    built = threading.Event()

    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(device_module, "_load", lambda *_: built.wait())
    monkeypatch.setattr(device_module, "wait", interrupted)
    with pytest.raises(KeyboardInterrupt):
        load(Variant().kernel(six), find_device("cpu"))
    assert not built.is_set()
    built.set()


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
