"""The queue computes one job at a time, urgent ones first, and ends what nobody wants."""

import asyncio
import threading
import time

import pytest

from warpimpact.design.server import JobQueue
from warpimpact.solver.worker import Cancel


def wait(cancel: Cancel, event: threading.Event) -> None:
    """Work until an event or until it is cancelled."""
    while not event.wait(0.001):
        cancel.check()


def test_an_urgent_job_puts_off_one_that_refines_which_then_ends() -> None:
    order, go = list[str](), threading.Event()

    def refine(cancel: Cancel) -> str:
        order.append("refine")
        wait(cancel, go)
        return "done"

    def urgent(_: Cancel) -> str:
        order.append("urgent")
        go.set()
        return "at once"

    async def both() -> list[str]:
        jobs = JobQueue()
        slow = asyncio.ensure_future(jobs.compute(refine, refines=True))
        await asyncio.sleep(0.05)
        return [await jobs.compute(urgent), await slow]

    assert asyncio.run(both()) == ["at once", "done"]
    assert order == ["refine", "urgent", "refine"]


@pytest.mark.parametrize("refines", [False, True])
def test_what_nobody_awaits_ends_at_once(refines: bool) -> None:
    ended = list[str]()

    def endless(cancel: Cancel) -> None:
        try:
            wait(cancel, threading.Event())
        finally:
            ended.append("endless")
            raise ZeroDivisionError  # an error that nobody awaits stops no queue

    async def left() -> float:
        jobs = JobQueue()
        job, waiting = (asyncio.ensure_future(jobs.compute(endless, refines=refines)) for _ in range(2))
        await asyncio.sleep(0.05)
        for one in (job, waiting):
            one.cancel()
        begin = time.perf_counter()
        await jobs.compute(lambda _: None)
        return time.perf_counter() - begin

    assert asyncio.run(left()) < 1.0
    assert ended == ["endless"]
