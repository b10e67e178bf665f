"""The device that computes, and Warp on it."""

from __future__ import annotations

import os
import tempfile
from contextlib import suppress
from pathlib import Path
from typing import Any

import psutil
import warp as wp


class DeviceError(RuntimeError):
    """The device asked for is not there; the message is for a person."""


def find_device(name: str) -> Any:
    """The Warp device of a name; "auto" takes CUDA where there is one."""
    _start_warp()
    if name == "auto":
        return wp.get_device("cuda:0" if wp.is_cuda_available() else "cpu")
    try:
        return wp.get_device(name)
    except (ValueError, RuntimeError):
        present = ", ".join(str(d) for d in wp.get_devices())
        raise DeviceError(f'device: got "{name}", which this machine lacks; allowed: auto, {present}') from None


def _start_warp() -> None:
    """Start Warp, quietly and fit for launches from several threads.

    Warp writes its word that there is no CUDA driver straight to file descriptor 2, where it is no concern of who
    asked for no GPU; everything else written there is passed on. Tile storage on the stack, which no kernel here
    uses, goes through one unguarded static and crashes threads in debug mode.
    """
    wp.config.log_level = max(wp.config.log_level, wp.LOG_WARNING)
    wp.config.enable_tiles_in_stack_memory = False
    kept = os.dup(2)
    with tempfile.TemporaryFile() as aside:
        os.dup2(aside.fileno(), 2)
        try:
            wp.init()
        finally:
            os.dup2(kept, 2)
            os.close(kept)
            aside.seek(0)
            for line in aside:
                if b"find or load the NVIDIA CUDA driver" not in line:
                    os.write(2, line)


def free_memory() -> int:
    """Memory that this process may still take [bytes]: of the machine, its control group and its own limits."""
    process = psutil.Process()
    free = [int(psutil.virtual_memory().available)]
    with suppress(OSError, ValueError):  # a control group without a limit says "max"
        group = Path("/sys/fs/cgroup")
        free.append(int((group / "memory.max").read_text()) - int((group / "memory.current").read_text()))
    with suppress(ImportError, AttributeError):  # systems without such limits
        import resource

        taken = process.memory_info()
        for limit, used in ((resource.RLIMIT_AS, taken.vms), (resource.RLIMIT_DATA, taken.rss)):
            most = resource.getrlimit(limit)[0]
            free += [most - used] if most != resource.RLIM_INFINITY else []
    return max(0, min(free))


def cores() -> int:
    """Cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def load(kernel: Any, device: Any) -> None:
    """Have a kernel ready on a device for launches of Warp's own block size, compiled if it is not cached yet.

    A module is compiled for one block size; without it Warp would take that of CUDA on a CPU, too, and compile again
    when the kernel is launched.
    """
    kernel.module.load(device, 1 if device.is_cpu else 256)
