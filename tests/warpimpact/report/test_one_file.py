"""`inspect` and `report` show files of every kind: the view of the kind and its figures, escaped."""

import html
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray

from warpimpact.analysis.numbers import html_of, text_of
from warpimpact.cli import main
from warpimpact.firing.plan import read_test
from warpimpact.firing.simulate import Response, firing_view, simulate_test
from warpimpact.results import files
from warpimpact.results import front as f
from warpimpact.results.kinds import FIRING

V50_TEST = Path(__file__).parents[3] / "campaigns" / "firing" / "v50_test.toml"


@pytest.mark.usefixtures("in_tmp_path")
def test_a_firing_test_is_inspected_and_reported_alone(capsys: pytest.CaptureFixture[str]) -> None:
    files.write(simulate_test(read_test(V50_TEST), Response(np.linspace(800.0, 1100.0, 40))), Path("a.nc"))
    assert main(["inspect", "a.nc"]) == 0
    view = firing_view(files.read(Path("a.nc"), FIRING))
    assert capsys.readouterr().out == f"{text_of(view)}\n"
    assert main(["report", "a.nc"]) == 0
    page = Path("a.html").read_text(encoding="utf-8")
    assert html_of(dict(list(view.items())[1:]), "h2") in page
    assert '<meta name="viewport" content="width=device-width' in page  # a phone shows it at the width of its screen
    assert page.count("<img") == 1
    assert html.escape(V50_TEST.read_text(encoding="utf-8").splitlines()[0]) in page
    capsys.readouterr()
    assert main(["report", "a.nc", "a.nc", "-o", "b.html"]) == 2
    assert "one of which is a firing test, which is reported alone" in capsys.readouterr().err


def test_a_click_on_a_front_shows_the_design(searched: xarray.Dataset, tmp_path: Path, browser: Any) -> None:
    files.write(searched, tmp_path / "front.nc")
    assert main(["report", str(tmp_path / "front.nc")]) == 0
    browser.open(f"file://{tmp_path}/front.html")
    points, sections = browser.find("svg a"), browser.find(".design")
    assert len(points) == len(sections) == searched.sizes["front"]
    last = len(points) - 1
    browser.driver.execute_script("arguments[0].scrollIntoView({block: 'center'})", points[last])
    points[last].click()
    assert [section.is_displayed() for section in sections] == [k == last for k in range(len(points))]
    assert str(searched[f.FILE].values[last]) in sections[last].text
    assert 'thickness = "4 mm"' in sections[last].text
    assert len(sections[last].find_elements("css selector", "img")) == 1  # plate and map
    assert browser.errors() == []
