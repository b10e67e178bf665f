"""The report of a search: a click on a point of the front shows its plate, its map and its campaign."""

from pathlib import Path
from typing import Any

import pytest
import xarray

from warpimpact.cli import main
from warpimpact.results import files
from warpimpact.results import front as f


def test_a_click_shows_the_design(searched: xarray.Dataset, tmp_path: Path, browser: Any) -> None:
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


def test_a_search_is_reported_alone(
    searched: xarray.Dataset, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("a.nc", "b.nc"):
        files.write(searched, tmp_path / name)
    assert main(["report", str(tmp_path / "a.nc"), str(tmp_path / "b.nc")]) == 2
    assert "one of which is a search for designs, which is reported alone" in capsys.readouterr().err
