"""Ctrl-C and the SIGTERM of a batch system: both stop in the same way, and both wait for the end of a protected
block."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def terminated_as_interrupted() -> Iterator[None]:
    """Treat SIGTERM like Ctrl-C. A batch system sends it to a job whose time is used up."""

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGTERM, interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


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
    handlers = {number: signal.signal(number, lambda got, _: caught.append(got)) for number in _HELD_BACK}
    try:
        yield
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
        if caught:
            signal.raise_signal(caught[0])


_HELD_BACK = (signal.SIGINT, signal.SIGTERM)
