"""The page in a real browser."""

import json
import re
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest

from warpimpact.analysis.comparison import compare, short_view
from warpimpact.analysis.effectiveness import effectiveness
from warpimpact.analysis.numbers import digits_of, number_text
from warpimpact.campaign.campaign import Campaign
from warpimpact.cli import main
from warpimpact.design.designs import from_address
from warpimpact.results import files
from warpimpact.runs.run import run

from ...options import CPU


def settled(browser: Any) -> None:
    """Wait for the last stage of a design, after a change."""
    measured = "return performance.getEntriesByName('first map').length"
    browser.wait(lambda: "Complete" not in browser.text("#status") or browser.driver.execute_script(measured))
    browser.wait(lambda: "Complete" in browser.text("#status"))


def move(browser: Any, control: str, value: float) -> None:
    """Move a slider as a hand does."""
    browser.driver.execute_script(
        "performance.clearMeasures(); const slider = document.getElementById(arguments[0]); slider.focus();"
        "slider.value = arguments[1]; slider.dispatchEvent(new Event('input', {bubbles: true}))",
        control,
        value,
    )


def toml(browser: Any, tmp_path: Path) -> Path:
    """What the button "Campaign file" gives."""
    browser.driver.execute_cdp_cmd(
        "Browser.setDownloadBehavior", {"behavior": "allow", "downloadPath": str(tmp_path), "eventsEnabled": False}
    )
    browser.press("#save")
    browser.wait(lambda: list(tmp_path.glob("*.toml")))
    (path,) = tmp_path.glob("*.toml")
    return path


@pytest.fixture(scope="module")
def coarse(small: Path) -> Path:
    """The slotted plate at a level that needs no pilot."""
    path = small.with_name("coarse.toml")
    path.write_text(small.read_text().replace('fidelity = "standard"', "level = 0"))
    return path


def opened(browser: Any, address: str, width: int = 1400) -> Any:
    browser.open("about:blank")
    browser.open(address, width)
    browser.wait(lambda: "Complete" in browser.text("#status"))
    # A design that stays for a while is in the address.
    browser.wait(lambda: len(browser.driver.execute_script("return location.hash")) > 1)
    return browser


@pytest.fixture(scope="module")
def address(serve: Callable[..., str], coarse: Path) -> str:
    return serve(coarse)


@pytest.fixture
def page(browser: Any, address: str) -> Any:
    return opened(browser, address)


def test_a_slider_moves_and_the_numbers_are_those_of_run(
    browser: Any, serve: Callable[..., str], small: Path, tmp_path: Path
) -> None:
    page = opened(browser, serve(small))
    move(page, "control-plate-pattern-width", 5.2)
    settled(page)
    campaign = toml(page, tmp_path)
    assert tomllib.loads(campaign.read_text())["plate"]["pattern"]["width"] == "5.2 mm"
    result = tmp_path / "a.nc"
    assert main(["run", str(campaign), "-o", str(result)]) == 0
    dataset = files.read(result)
    shown = page.text("#answer")
    for measure in effectiveness(dataset).itertuples():
        digits = digits_of(measure.measure)
        texts = number_text(measure.value, digits), number_text(measure.solid, digits), number_text(measure.ratio)
        numbers = map(re.escape, texts)
        assert re.search(rf"{re.escape(measure.measure.label)}.*?{'.*?'.join(numbers)}", shown)
    velocities = page.driver.execute_script("return document.getElementById('map-0').data[0].z.flat()")
    assert set(velocities) <= {float(f"{value:.5g}") for value in dataset["residual_velocity"].values.tolist()}
    assert len(set(velocities)) > 500
    assert page.text("#tested").startswith("Outside the tested range: weakening")
    assert "Outside the tested range: weakening" in page.text("#rests")
    assert page.values("#title") == ["7.62 mm P80 core against a slotted plate, width 5.2 mm"]
    loaded = "return performance.getEntriesByType('resource').map((e) => new URL(e.name).host)"
    assert set(page.driver.execute_script(loaded)) == {urlsplit(page.driver.current_url).netloc}  # nothing else
    assert page.errors() == []


def test_an_impossible_plate_shows_the_sentence(page: Any) -> None:
    move(page, "control-plate-pattern-width", 14.0)
    page.wait(lambda: page.text("#sentence"))
    sentence = "plate.pattern: got length = 12 mm, but the length must be at least the width, 14 mm"
    assert page.text("#sentence") == sentence
    assert page.text("#status").startswith("No map of this design.")
    assert page.find("#save")[0].get_property("disabled")  # there is no campaign that run takes
    assert page.errors() == []


def type_number(browser: Any, control: str, text: str) -> None:
    """Type into the field beside a slider."""
    (field,) = browser.find(f"{control}-number")
    field.send_keys("\ue009a\ue000", text)  # Control and A, then no key held


def test_a_number_is_taken_as_it_is_typed(page: Any) -> None:
    """With a comma or a point, in the unit shown or with another; the slider stands on it exactly."""
    thickness, velocity = "#control-plate-thickness", "#control-impact-velocity"
    for control, text, value, words in (
        (thickness, "8,5", "8.5", "thickness 8.5 mm"),
        (velocity, "878", "878", "velocity 878 m/s"),
        (velocity, "0.6 km/s", "600", "velocity 0.6 km/s"),
    ):
        type_number(page, control, text)
        page.wait(lambda control=control, value=value: page.values(control) == [value])
        page.wait(lambda words=words: words in page.values("#title")[0])
    move(page, thickness.removeprefix("#"), 5.0)  # its map may come after the sentence, which stays
    type_number(page, velocity, "1,000")
    page.wait(lambda: page.text("#sentence").startswith('velocity: got "1,000", but it takes a number in m/s'))
    page.wait(lambda: "thickness 5 mm" in page.values("#title")[0])
    assert page.text("#sentence").startswith('velocity: got "1,000"')
    type_number(page, velocity, "1")
    page.wait(lambda: "read as 1 m/s" in page.text("#numbers"))
    assert "unit" not in page.text("#numbers")
    assert page.errors() == []


def test_the_address_holds_the_design_and_undo_brings_it_back(page: Any) -> None:
    thickness = "#control-plate-thickness"
    before = page.driver.current_url
    move(page, thickness.removeprefix("#"), 5.0)
    page.wait(lambda: page.values("#title")[0].endswith("a slotted plate, thickness 5 mm"))
    page.wait(lambda: page.driver.current_url != before)
    address = page.driver.current_url
    page.press("#undo")
    page.wait(lambda: page.values(thickness) == ["4"] and page.values("#title")[0].endswith("a slotted plate"))
    page.open("about:blank")
    page.open(address)
    page.wait(lambda: page.values(thickness) == ["5"])
    page.driver.execute_script("navigator.clipboard.writeText = async (text) => { window.copied = text; }")
    page.press("#copy")
    page.wait(lambda: page.text("#copy") == "Copied")
    copied = page.driver.execute_script("return window.copied")
    assert urlsplit(copied)[:3] == (*urlsplit(page.driver.current_url)[:2], "/")  # without the token
    design = Campaign.from_text(json.dumps(from_address(copied)), name="address", folder=Path("/"))
    assert design.plate.thickness == 5e-3
    assert page.errors() == []


def test_a_click_on_the_map_shows_that_hit(page: Any) -> None:
    page.point_at("#map-0 .nsewdrag", 0.1, 0.2, click=True)
    page.wait(lambda: "Trajectory of hit" in page.text("#note"))
    assert re.match(r"hit \d+ at y = ", page.text("#hit-text"))
    assert "bit-identical" in page.text("#hit-text")
    assert len(page.find("#passage .scatterlayer .trace")) >= 4
    page.find("#figures button")[2].click()
    page.wait(lambda: page.find("#figure")[0].is_displayed())
    assert page.errors() == []


def test_a_pinned_design_is_compared_shot_by_shot(page: Any, coarse: Path) -> None:
    page.press("#pin")
    move(page, "control-plate-thickness", 5.0)
    page.wait(lambda: page.find("#every") and "Complete" in page.text("#status"))
    tables = tomllib.loads(coarse.read_text())
    tables["plate"]["thickness"] = "5 mm"
    thicker = Campaign.from_text(json.dumps(tables), name="thicker", folder=coarse.parent)
    results = [run(one, references=True, options=CPU) for one in (thicker, Campaign.from_toml(coarse))]
    comparison = compare(dict(zip(["this design", "pin A"], results, strict=True)))
    assert next(iter(short_view(comparison))) in page.text("#answer")
    assert "better than" not in page.text("#answer")
    scales = page.driver.execute_script(
        "return [0, 1].map((k) => document.getElementById(`map-${k}`).data[0]).map((t) => [t.zmin, t.zmax])"
    )
    assert scales[0] == scales[1]
    assert page.errors() == []


def test_an_address_of_others_is_only_text(page: Any, coarse: Path) -> None:
    others = tomllib.loads(coarse.read_text()) | {"title": "of others"}
    script = {"name": "<img src=x onerror='document.title=1'>", "design": others}
    held = {"design": others, "pins": [None, script], "variable": ["<img src=x>"]}
    address = page.driver.current_url.partition("#")[0]
    packed = page.driver.execute_async_script("address.packed(arguments[0]).then(arguments[1])", held)
    opened(page, f"{address}#{packed}")
    assert page.values("#title") == ["of others"]
    assert "<img src=x" in page.text("#maps")
    assert not page.find("img[src=x]")
    assert page.errors() == []


def test_text_of_others_is_text(browser: Any, serve: Callable[..., str], coarse: Path, tmp_path: Path) -> None:
    hostile = '<img src=x onerror="document.title=1">"\'</script>${7*7}'
    path = tmp_path / "<b>x&.toml"
    path.write_text(
        coarse.read_text().replace('title = "7.62 mm P80 core against a slotted plate"', f"title = '''{hostile}'''")
    )
    opened(browser, serve(path), 390)
    assert browser.values("#title") == [hostile]
    assert browser.driver.title == f"{hostile} · warpimpact design"
    assert not browser.find("img[src=x]")
    assert browser.driver.execute_script("return document.documentElement.scrollWidth") <= 390  # a phone
    browser.wait(lambda: browser.find("#answer table"))
    assert browser.driver.execute_script("return document.getElementById('maps').offsetHeight / innerHeight") < 1 / 3
    assert browser.errors() == []


def test_a_grip_of_the_plate_is_dragged(page: Any) -> None:
    from selenium.webdriver.common.action_chains import ActionChains

    grips = page.find("#plate .grip")
    labels = [grip.get_attribute("aria-label") for grip in grips]
    assert labels == [f"plate pattern {name}" for name in ("width", "length", "spacing 0", "spacing 1")]
    per_mm = page.driver.execute_script("const at = document.getElementById('plate'); return at.getScreenCTM().a")
    way = round(per_mm)
    ActionChains(page.driver).click_and_hold(grips[0]).move_by_offset(way, 0).pause(0.1).release().perform()
    width = 4.0 + 2.0 * way / per_mm  # a grip is at half the width
    page.wait(lambda: float(page.values("#control-plate-pattern-width")[0]) == pytest.approx(width, abs=0.11))
    page.find("#plate .grip")[0].send_keys("\ue012")  # arrow to the left
    page.wait(lambda: float(page.values("#control-plate-pattern-width")[0]) == pytest.approx(width - 0.1, abs=0.11))
    assert page.errors() == []
