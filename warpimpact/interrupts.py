"""Ctrl-C, and the SIGTERM of a batch system, that wait for what must not be broken off."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Hold signals back until the end of the block, and act on them then.

    An exception between any two instructions, as a signal raises it, leaves a lock of xarray's taken, and closing the
    file waits for that lock for ever.
    """
    if threading.current_thread() is not threading.main_thread():  # which no signal reaches
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
