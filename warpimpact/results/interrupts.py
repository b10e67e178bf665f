"""Ctrl-C and the SIGTERM of a batch system. Both stop a process in the same way, both wait for the end of a protected
block, and neither is lost."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager

_asked: list[int] = []
"""Signals that asked this process to stop, since `terminated_as_interrupted` began."""


@contextmanager
def terminated_as_interrupted() -> Iterator[None]:
    """Treat SIGTERM like Ctrl-C. A batch system sends it to a job whose time is used up.

    Both signals are remembered, because code that ignores exceptions, such as a destructor or an import, may lose the
    exception (`stop_if_asked`).
    """
    if threading.current_thread() is not threading.main_thread():  # signals reach the main thread only
        yield
        return

    def interrupt(number: int, _: object) -> None:
        _asked.append(number)
        raise KeyboardInterrupt

    # A shell has its background jobs ignore SIGINT, and this does not change that.
    numbers = [number for number in _STOPPING if signal.getsignal(number) is not signal.SIG_IGN]
    before = {number: signal.signal(number, interrupt) for number in numbers}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        _asked.clear()


def stop_if_asked() -> None:
    """Raise KeyboardInterrupt if a signal has asked for it."""
    if _asked:
        raise KeyboardInterrupt


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Hold signals back until the end of the block.

    A signal raises an exception between any two instructions. A lock of xarray may then stay locked, and the file
    cannot be closed: closing waits for this lock forever.
    """
    if threading.current_thread() is not threading.main_thread():  # signals reach the main thread only
        yield
        return
    caught: list[int] = []
    handlers = {number: signal.signal(number, lambda got, _: caught.append(got)) for number in _STOPPING}
    try:
        yield
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
        if caught:
            signal.raise_signal(caught[0])


_STOPPING = (signal.SIGINT, signal.SIGTERM)
