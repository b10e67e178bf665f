"""Who computes: a device with Warp on it, its threads, and a token by which another thread ends the computation."""

from __future__ import annotations

import ast
import logging
import os
import shutil
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import psutil
import warp as wp
from filelock import FileLock

from warpimpact.errors import DeviceError
from warpimpact.kernels import lanes

_logger = logging.getLogger(__name__)
PARSING, _BUILDING = threading.RLock(), threading.RLock()
"""Held while something is parsed, such as by numpy the layout of an array of structs; and while kernels are built."""


@contextmanager
def building() -> Iterator[None]:
    """Build kernels, one thread at a time, while any thread that parses holds `PARSING`.

    On Python 3.11 garbage that is collected within a parse lets another thread in, and both parses end with a
    SystemError. Warp parses kernels, so `ast.parse` is replaced within the block.
    """
    with _BUILDING:
        parse = ast.parse

        def parse_alone(*values: Any, **options: Any) -> Any:
            with PARSING:
                return parse(*values, **options)

        ast.parse = parse_alone if sys.version_info < (3, 12) else parse
        try:
            yield
        finally:
            ast.parse = parse


class Cancelled(Exception):
    """The computation was cancelled."""


class Cancel:
    """A token that the march checks between two launches of a kernel."""

    def __init__(self, outer: Cancel | None = None) -> None:
        """Create a token that is also cancelled with an outer one."""
        self._requested, self._outer = threading.Event(), outer

    def cancel(self) -> None:
        """Cancel all computations that were given this token."""
        self._requested.set()

    @property
    def cancelled(self) -> bool:
        """Whether the token, or its outer one, was cancelled."""
        return self._requested.is_set() or (self._outer is not None and self._outer.cancelled)

    def check(self) -> None:
        """Raise Cancelled if the token was cancelled."""
        if self.cancelled:
            raise Cancelled


NEVER = Cancel()
"""Token of computations that nobody cancels."""


@dataclass(frozen=True)
class Worker:
    """Who computes.

    Attributes:
        device: "auto" (CUDA if there is one, else CPU), "cpu", "cuda:0", …
        threads: number of threads on a CPU; None is one for every core that this process may use.
        cancel: token that ends the computation with Cancelled.
    """

    device: str = "auto"
    threads: int | None = None
    cancel: Cancel = NEVER


def find_device(name: str) -> Any:
    """The Warp device of a name; "auto" is CUDA if there is a CUDA device, else the CPU."""
    _start_warp()
    if name == "auto":
        return wp.get_device("cuda:0" if wp.is_cuda_available() else "cpu")
    try:
        return wp.get_device(name)
    except (ValueError, RuntimeError):
        present = ", ".join(str(d) for d in wp.get_devices())
        raise DeviceError(
            f'device: got "{name}", but this machine has no such device; allowed: auto, {present}'
        ) from None


@cache
def _start_warp() -> None:
    """Start Warp without its messages, ready for launches from several threads.

    If there is no CUDA driver, Warp writes a warning directly to file descriptor 2. A user of the CPU does not need it,
    so it is dropped; all other output on this descriptor is passed on. Tile storage on the stack uses an unprotected
    static variable, which crashes threads in debug mode. It is disabled, because no kernel here uses it.
    """
    wp.config.log_level = max(wp.config.log_level, wp.LOG_WARNING)
    wp.config.enable_tiles_in_stack_memory = False
    with _BUILDING, tempfile.TemporaryFile() as aside:
        kept = os.dup(2)
        os.dup2(aside.fileno(), 2)
        try:
            wp.init()
        except OSError as error:
            raise DeviceError(
                f"{error.filename}: kernels cannot be kept there ({error.strerror}); name another folder in the "
                "environment variable WARP_CACHE_PATH"
            ) from None
        finally:
            os.dup2(kept, 2)
            os.close(kept)
            aside.seek(0)
            for line in aside:
                if b"find or load the NVIDIA CUDA driver" not in line:
                    os.write(2, line)


SMALL_MEMORY = 2**24
"""Bytes that every machine has free. The system is not asked about less, because its answer takes as long as some
shots."""


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


def launching(threads: int | None) -> int:
    """Threads that launch on a CPU: the given number, or one per core. Where Warp runs blocks on a CPU, it is one,
    because two threads crash there."""
    return 1 if wp.config.enable_cpu_blocks else threads or cores()


def block_size(kernel: Any, device: Any) -> int:
    """Threads of a block: on CUDA those of the layout, on a CPU 1 unless Warp is told to run blocks there."""
    threads: int = kernel.options.get("launch_bounds", (lanes.THREADS,))[0]
    return threads if device.is_cuda or wp.config.enable_cpu_blocks else 1


@contextmanager
def thread_pool(threads: int) -> Iterator[ThreadPoolExecutor]:
    """Threads that compute while the calling one waits: signals reach the main thread, which must be free for them.

    After an error or an interrupt nobody waits for what they compute.
    """
    pool = ThreadPoolExecutor(threads)
    try:
        yield pool
    finally:
        pool.shutdown(wait=False, cancel_futures=True)


def load(kernel: Any, device: Any) -> None:
    """Load a kernel on a device for launches with Warp's own block size. Compile it if the cache has no copy that can
    be loaded. Several threads may load the same kernel.

    A module is compiled for one block size. By default Warp loads with the block size of CUDA on a CPU, too, and
    compiles again at the launch.
    """
    block, module = block_size(kernel, device), kernel.module
    with _BUILDING:
        loaded = module.execs.get((device.context, block))
        if loaded is not None and loaded.module_hash == module.get_module_hash(block):
            return
    with thread_pool(1) as pool:  # so that Ctrl-C does not wait for the compiler
        compiled = pool.submit(_load, module, device, block)
        while not compiled.done():  # a signal that comes just before a wait is seen when the wait has ended
            wait([compiled], timeout=1.0)
        compiled.result()


def _load(module: Any, device: Any, block: int) -> None:
    begin, folder = time.perf_counter(), Path(wp.config.kernel_cache_dir, module.get_module_identifier(block))
    with building(), ExitStack() as alone:
        if not folder.exists():  # processes that begin together compile it once, or each of them without a lock
            with suppress(OSError, NotImplementedError):
                alone.enter_context(FileLock(folder.with_name(f"{folder.name}.lock")))
        try:
            module.load(device, block)
        except Exception:  # a file of the cache is damaged; a kernel that cannot be compiled fails again
            shutil.rmtree(folder, ignore_errors=True)
            module.load(device, block)
    _logger.debug("%s on %s: loaded in %.2f s", module.name, device, time.perf_counter() - begin)
