"""Signals wait for the end of steps that must not be interrupted."""

import signal
import threading

import pytest

from warpimpact.results.interrupts import uninterrupted


@pytest.fixture
def interrupted():
    """SIGTERM as a run handles it, and SIGINT as the program of a terminal does: a background job may ignore it."""

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    before = {number: signal.signal(number, interrupt) for number in (signal.SIGINT, signal.SIGTERM)}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_waits_for_the_end_of_the_block(number: signal.Signals, interrupted: None) -> None:
    reached = []
    handler = signal.getsignal(number)
    with pytest.raises(KeyboardInterrupt):  # noqa: PT012
        with uninterrupted():
            signal.raise_signal(number)
            reached.append("the end")
        reached.append("what follows")
    assert reached == ["the end"]
    assert signal.getsignal(number) is handler


def test_what_goes_wrong_inside_is_told() -> None:
    with pytest.raises(OSError, match="full"), uninterrupted():
        raise OSError("full")


def test_other_threads_need_no_signals() -> None:
    def work() -> None:
        with uninterrupted():
            done.append(True)

    done: list[bool] = []
    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert done == [True]
