"""Signals wait for the end of steps that must not be interrupted."""

import signal
import threading
from contextlib import suppress

import pytest

from warpimpact.results.interrupts import stop_if_asked, terminated_as_interrupted, uninterrupted


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


def test_other_threads_need_no_signals() -> None:
    def work() -> None:
        with uninterrupted():
            done.append(True)

    done: list[bool] = []
    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert done == [True]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_that_comes_where_exceptions_are_ignored_is_not_lost(
    number: signal.Signals, interrupted: None
) -> None:
    with pytest.raises(KeyboardInterrupt), terminated_as_interrupted():  # noqa: PT012
        with suppress(KeyboardInterrupt):
            signal.raise_signal(number)  # as in code that ignores all exceptions: a destructor, some imports
        stop_if_asked()
    stop_if_asked()  # of the next command nobody has asked anything


def test_a_background_job_goes_on_ignoring_ctrl_c(interrupted: None) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with terminated_as_interrupted():
        signal.raise_signal(signal.SIGINT)
        stop_if_asked()
