"""How long the page of `warpimpact design` takes from a change to the first map, in a headless Chromium.

    python tests/benchmarks/design_page.py        # writes results/design_page.json; needs chromium and chromedriver
    chrt -r 1 python tests/benchmarks/design_page.py        # the same ahead of other work on a busy machine

A slider of the slotted plate moves. The time ends when the browser has drawn the map. In "rested" the map of the design
before was complete; in "refining" it was still being refined, which the change ends.
"""

from __future__ import annotations

import os
import shutil
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from bench import CAMPAIGN, machine, store
from selenium import webdriver

COMMAND = [sys.executable, "-c", "from warpimpact.cli import command; command()", "design", "--no-browser"]
CHANGES, PAUSE, LONGEST = 50, 0.6, 120.0
SLIDER, SHORTEST, STEP = "control-plate-pattern-length", 4.5, 0.1
"""Length of the slots [mm]; the longest of all changes leaves ligaments."""
MOVE = f"""
performance.clearMeasures();
const slider = document.getElementById("{SLIDER}");
slider.value = arguments[0];
slider.dispatchEvent(new Event("input", {{ bubbles: true }}));
"""
FIRST = "return performance.getEntriesByName('first map').map((entry) => entry.duration)"


@contextmanager
def page(*campaigns: str) -> Iterator[str]:
    """The address of a page that is being served."""
    with subprocess.Popen([*COMMAND, *campaigns], stdout=subprocess.PIPE, text=True) as server:
        assert server.stdout is not None
        try:
            yield server.stdout.readline().strip()
        finally:
            server.terminate()


@contextmanager
def browser(width: int = 1280, height: int = 900) -> Iterator[Any]:
    """A headless Chromium."""
    options = webdriver.ChromeOptions()
    for argument in ("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"):
        options.add_argument(argument)
    options.add_argument(f"--window-size={width},{height}")
    options.binary_location = shutil.which("chromium") or ""
    driver = webdriver.Chrome(options=options, service=webdriver.ChromeService(shutil.which("chromedriver")))
    try:
        yield driver
    finally:
        driver.quit()


def wait(condition: Callable[[], Any]) -> Any:
    """What a condition returns once that is true."""
    end = time.monotonic() + LONGEST
    while not (value := condition()):
        if time.monotonic() > end:
            raise TimeoutError("the page does not answer")
        time.sleep(0.02)
    return value


def is_complete(driver: Any) -> bool:
    """Whether the last stage is shown."""
    return "Complete" in driver.find_element("id", "status").text


def first_map(driver: Any, length: float) -> float:
    """Wall time [s] from a change of the slider to the first map."""
    driver.execute_script(MOVE, round(length, 1))
    (milliseconds,) = wait(lambda: driver.execute_script(FIRST))
    return 1e-3 * milliseconds


def measured(driver: Any, between: Callable[[], Any], lengths: Sequence[float]) -> dict[str, float]:
    """Median and 95th percentile of the wall times of some changes [s], each to a design that was not there before."""
    times = []
    for length in lengths:
        between()
        times.append(first_map(driver, length))
    return {"median": statistics.median(times), "p95": statistics.quantiles(times, n=20, method="inclusive")[-1]}


def main() -> None:
    load = os.getloadavg()[0]
    with page(str(CAMPAIGN)) as address, browser() as driver:
        driver.get(address)
        wait(lambda: is_complete(driver))
        first_map(driver, SHORTEST)  # loads what the first change needs
        lengths = [SHORTEST + STEP * (1 + place) for place in range(2 * CHANGES)]
        seconds = {
            "rested": measured(driver, lambda: wait(lambda: is_complete(driver)), lengths[::2]),
            "refining": measured(driver, lambda: time.sleep(PAUSE), lengths[1::2]),
        }
    ahead = os.sched_getscheduler(0) != os.SCHED_OTHER
    conditions = {"changes": CHANGES, "load_before": load, "ahead_of_other_work": ahead}
    store("design_page", {**conditions, "seconds": seconds, "machine": machine()})


if __name__ == "__main__":
    main()
