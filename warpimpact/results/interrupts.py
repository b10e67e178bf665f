"""Ctrl-C and the SIGTERM of a batch system: they stop alike, and wait for what must not be broken off."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def terminated_as_interrupted() -> Iterator[None]:
    """A batch system ends what has used up its time by SIGTERM: that stops as cleanly as Ctrl-C."""

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGTERM, interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


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
