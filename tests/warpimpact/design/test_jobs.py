"""The queue computes one job at a time, the most urgent first, and ends what nobody wants."""

import asyncio
import threading
import time
from collections.abc import Callable
from typing import Any

import pytest

from warpimpact.design.server import JobQueue
from warpimpact.solver.worker import Cancel


def until(event: threading.Event) -> Callable[[Cancel], str]:
    """Work that goes on until an event or until it is cancelled."""

    def work(cancel: Cancel) -> str:
        while not event.is_set():
            cancel.check()
            time.sleep(0.001)
        return "done"

    return work


def test_an_urgent_job_puts_off_another_which_then_ends() -> None:
    order, go = list[str](), threading.Event()

    def first(cancel: Cancel) -> str:
        order.append("refine")
        return until(go)(cancel)

    def urgent(_: Cancel) -> str:
        order.append("urgent")
        go.set()
        return "at once"

    async def both() -> list[str]:
        jobs = JobQueue()
        slow = asyncio.ensure_future(jobs.compute(3, first))
        await asyncio.sleep(0.05)
        return [await jobs.compute(0, urgent), await slow]

    assert asyncio.run(both()) == ["at once", "done"]
    assert order == ["refine", "urgent", "refine"]


@pytest.mark.parametrize("waits", [False, True])
def test_what_nobody_awaits_ends_at_once(waits: bool) -> None:
    never, begun, ended = threading.Event(), list[str](), list[str]()

    def work(cancel: Cancel) -> None:
        begun.append("work")
        try:
            until(never)(cancel)
        finally:
            ended.append("work")

    async def left() -> float:
        jobs = JobQueue()
        before = asyncio.ensure_future(jobs.compute(0, until(never))) if waits else None
        job = asyncio.ensure_future(jobs.compute(1, work))
        await asyncio.sleep(0.05)
        job.cancel()
        if before is not None:
            before.cancel()
        begin = time.perf_counter()
        await jobs.compute(3, lambda _: None)
        return time.perf_counter() - begin

    assert asyncio.run(left()) < 1.0
    assert begun == ended == ([] if waits else ["work"])


def test_an_error_comes_to_the_page_and_the_queue_goes_on() -> None:
    def broken(_: Cancel) -> Any:
        raise ZeroDivisionError

    async def both() -> str:
        jobs = JobQueue()
        with pytest.raises(ZeroDivisionError):
            await jobs.compute(0, broken)
        return await jobs.compute(0, lambda _: "goes on")

    assert asyncio.run(both()) == "goes on"
