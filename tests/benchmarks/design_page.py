"""How long the page of `warpimpact design` takes from a change to the first map, in a headless Chromium.

    python tests/benchmarks/design_page.py        # writes results/design_page.json; needs chromium and chromedriver
    chrt -r 1 python tests/benchmarks/design_page.py        # the same ahead of other work on a busy machine
    python tests/benchmarks/design_page.py film        # writes the film and pictures campaigns/gallery/design*

A slider of the slotted plate moves. The time ends when the browser has drawn the map. In "rested" the map of the design
before was complete; in "refining" it was still being refined, which the change ends. In the film a hand widens the
slots, tilts the line of fire and clicks a hit. Each frame is taken when the browser has drawn the map of its design;
frames follow each other in 0.2 s, which is about what a first map takes.
"""

from __future__ import annotations

import io
import os
import shutil
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
from bench import CAMPAIGN, CHECKOUT, machine, store
from PIL import Image
from selenium import webdriver
from selenium.webdriver.common.action_chains import ActionChains

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


def measure() -> None:
    """Time changes of a slider, and store their times."""
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


# --- The film and the pictures of the page, for the README and the how-to page ---

GALLERY = CHECKOUT / "campaigns" / "gallery"
WIDE, TALL, SHOWN = 1280, 860, 960
FRAME, HELD = 200, 5  # [ms]; frames that a complete map is held
POINTER = """
let dot = document.getElementById("film-pointer");
if (!dot) {
  dot = document.createElement("div");
  dot.id = "film-pointer";
  dot.style = "position:fixed;width:18px;height:18px;border-radius:50%;background:#d55e00b0;border:2px solid white;"
    + "transform:translate(-50%,-50%);pointer-events:none;z-index:9";
  document.body.append(dot);
}
[dot.style.left, dot.style.top] = [`${arguments[0]}px`, `${arguments[1]}px`];
"""
SLIDE = """
performance.clearMeasures();
const slider = document.getElementById(arguments[0]), box = slider.getBoundingClientRect();
slider.value = arguments[1];
slider.dispatchEvent(new Event("input", { bubbles: true }));
const share = (slider.value - slider.min) / (slider.max - slider.min);
return [box.left + 8 + share * (box.width - 16), box.top + box.height / 2];
"""


def taken(driver: Any) -> Image.Image:
    """The page as it is."""
    return Image.open(io.BytesIO(driver.get_screenshot_as_png())).convert("RGB")


def slid(driver: Any, slider: str, values: Sequence[float]) -> Iterator[Image.Image]:
    """A frame for each value of a slider, then for each stage until the map is complete, which is held."""
    for value in values:
        at = driver.execute_script(SLIDE, slider, round(float(value), 3))
        wait(lambda: driver.execute_script(FIRST))
        driver.execute_script(POINTER, *at)
        yield taken(driver)
    wait(lambda: "Draft" in driver.find_element("id", "status").text or is_complete(driver))
    yield taken(driver)
    wait(lambda: is_complete(driver))
    yield from [taken(driver)] * HELD


def clicked(driver: Any) -> Iterator[Image.Image]:
    """A hit beside a slot is clicked, and its trajectory comes."""
    place = driver.find_element("css selector", "#map-0 .nsewdrag")
    right, down = round(0.2 * place.size["width"]), round(0.1 * place.size["height"])
    ActionChains(driver).move_to_element_with_offset(place, right, down).click().perform()
    box = place.rect
    driver.execute_script(POINTER, box["x"] + box["width"] / 2 + right, box["y"] + box["height"] / 2 + down)
    yield from [taken(driver)] * 2
    wait(lambda: "Trajectory of hit" in driver.find_element("id", "note").text)
    wait(lambda: driver.find_elements("css selector", "#flight .scatterlayer .trace"))
    driver.execute_script("document.getElementById('film-pointer').remove()")
    top = driver.execute_script("return document.getElementById('trajectory').getBoundingClientRect().top")
    for share in np.linspace(0.2, 1.0, 4):
        driver.execute_script("scrollTo(0, arguments[0])", share * top)
        yield taken(driver)
    yield from [taken(driver)] * 9


def film(driver: Any) -> Iterator[Image.Image]:
    """The frames: eight seconds."""
    yield from [taken(driver)] * 2
    yield from slid(driver, "control-plate-pattern-width", np.linspace(4.2, 6.0, 6))
    yield from slid(driver, "control-impact-obliquity", np.arange(5, 31, 5))
    yield from clicked(driver)


def shown(driver: Any, address: str, *, dark: bool) -> None:
    """The page of an address, complete."""
    scheme = [{"name": "prefers-color-scheme", "value": "dark" if dark else "light"}]
    driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": scheme})
    size = {"width": WIDE, "height": TALL, "deviceScaleFactor": 1, "mobile": False}
    driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    driver.get(address)
    wait(lambda: is_complete(driver))


def save_picture(picture: Image.Image, name: str) -> None:
    """A picture with few colours, which is small."""
    path = GALLERY / name
    picture.quantize(256, dither=Image.Dither.NONE).save(path, optimize=True)
    print(path, path.stat().st_size)


def record() -> None:
    """Take the film and the pictures."""
    layered = CHECKOUT / "campaigns" / "layered_target.toml"
    with page(str(CAMPAIGN), str(layered)) as address, browser(WIDE, TALL) as driver:
        shown(driver, address, dark=False)
        save_picture(taken(driver), "design_page.png")
        frames = [frame.resize((SHOWN, SHOWN * TALL // WIDE), Image.Resampling.LANCZOS) for frame in film(driver)]
        path = GALLERY / "design.webp"
        style: dict[str, Any] = {"save_all": True, "duration": FRAME, "loop": 0, "quality": 50, "method": 6}
        frames[0].save(path, append_images=frames[1:], **style)
        print(path, path.stat().st_size, f"{1e-3 * FRAME * len(frames):.1f} s")
        shown(driver, address, dark=True)
        driver.execute_script(
            "const picker = document.getElementById('designs'); picker.value = 'layered_target';"
            "picker.dispatchEvent(new Event('change')); performance.clearMeasures();"
        )
        wait(lambda: driver.find_elements("id", "control-layer-0-gap") and is_complete(driver))
        driver.find_element("id", "pin").click()
        driver.execute_script(SLIDE, "control-layer-0-gap", 40)
        wait(lambda: driver.execute_script(FIRST) and is_complete(driver))
        wait(lambda: "Which protects better" in driver.find_element("id", "answer").text)
        save_picture(taken(driver), "design_pinned.png")


if __name__ == "__main__":
    record() if sys.argv[1:] == ["film"] else measure()
