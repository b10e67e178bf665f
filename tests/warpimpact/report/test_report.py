"""The report: its choice of hits, its text, its escaping, files of every kind, and its use in a real browser."""

import gzip
import html
import json
import re
import tomllib
from base64 import b64decode
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray

from warpimpact.analysis.comparison import compare, comparison_view, short_view, verdict_of
from warpimpact.analysis.effectiveness import effectiveness
from warpimpact.analysis.inspection import answer, range_note
from warpimpact.analysis.numbers import digits_of, html_of, number_text, text_of
from warpimpact.campaign.campaign import CampaignError
from warpimpact.cli import main
from warpimpact.firing.simulate import Response, firing_view, read_test, simulate_test
from warpimpact.kernels.status import Status
from warpimpact.measures.references import split_pictures
from warpimpact.records import variables as v
from warpimpact.records.kinds import FIRING
from warpimpact.report import hit_data, report
from warpimpact.results import files
from warpimpact.results.dataset import stored_columns
from warpimpact.runs.run import run

from ...options import CPU
from ..drawn import with_draws
from ..slotted import CAMPAIGNS, slotted

TRAJECTORIES = 6
ResultMaker = Callable[..., xarray.Dataset]


def data_of(path: Path) -> dict:
    """The data that the page's script reads."""
    (actual,) = re.findall(r'<script id="data" type="application/gzip">(.*?)</script>', path.read_text())
    return json.loads(gzip.decompress(b64decode(actual)))


def scripts_of(text: str) -> tuple[str, str]:
    """Plotly, as the page unpacks it, and the page's own script."""
    (packed,) = re.findall(r'<script id="plotly" type="application/gzip">(.*?)</script>', text)
    (own,) = re.findall(r"<script>(.*?)</script>", text, flags=re.DOTALL)
    return gzip.decompress(b64decode(packed)).decode(), own


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Holds the results of two plates and their report."""
    folder = tmp_path_factory.mktemp("report")
    for name, width in (("narrow", "4 mm"), ("<b>wide", "5 mm")):
        changed = slotted(('width = "4 mm"', f'width = "{width}"'), ("7.62 mm", f"{name} </script>"), count=400)
        files.write(run(changed, options=CPU), folder / f"{name}.nc")
    command = ["report", *(str(folder / f"{name}.nc") for name in ("narrow", "<b>wide")), "-o", str(folder / "a.html")]
    assert main([*command, "--trajectories", str(TRAJECTORIES)]) == 0
    return folder


def test_page_holds_the_hits_of_each_result(folder: Path) -> None:
    page = data_of(folder / "a.html")
    for name, shown in zip(("narrow", "<b>wide"), page["results"], strict=True):
        dataset = files.read(folder / f"{name}.nc")
        assert shown["number"] == list(range(400))
        np.testing.assert_allclose(shown["y"], dataset["hit_y"] * 1e3, rtol=1e-4)
        np.testing.assert_allclose(shown["columns"]["tilt at 130 mm"], dataset["tilt"][:, 1], rtol=1e-4)
        assert np.shape(shown["nearest"]) == (160, 160)
        assert len(shown["trajectories"]) == TRAJECTORIES
        fastest = dataset["residual_velocity"].values.argmax()
        assert str(fastest) in shown["trajectories"]
        assert str(shown["first"]) in shown["trajectories"]
        history = shown["trajectories"][str(fastest)]
        assert [len(history[part]) for part in ("inside", "behind")] == [5, 2]


def test_page_says_how_well_each_plate_protects(folder: Path) -> None:
    text = html.unescape(re.sub(r"<[^>]*>", " ", (folder / "a.html").read_text()))
    for name in ("narrow", "<b>wide"):
        for measure in effectiveness(files.read(folder / f"{name}.nc")).itertuples():
            digits = digits_of(measure.measure)
            numbers = number_text(measure.value, digits), number_text(measure.solid, digits), number_text(measure.ratio)
            row = r"\s+.*\s+".join(map(re.escape, numbers))
            assert re.search(rf"{re.escape(measure.measure.label)}.*\s+{row}", text)


def test_page_compares_the_plates(folder: Path) -> None:
    text = html.unescape((folder / "a.html").read_text())
    names = ["narrow", "<b>wide"]
    with files.opened(folder / "narrow.nc") as narrow, files.opened(folder / "<b>wide.nc") as wide:
        stored = dict(zip(names, [narrow, wide], strict=True))
        comparison = compare(dict(zip(names, list(stored.values()), strict=True)))
        answers = [html.unescape(html_of({"": answer(result)})) for result in stored.values()]
    verdict = text[: text.index("<h2>")]
    assert all(words in verdict for words in answers)
    for sentence in verdict_of(comparison):
        assert f"<strong>{sentence}</strong>" in verdict
    assert html.unescape(html_of(short_view(comparison, range_note(stored.values())))) in text
    assert html.unescape(html_of(comparison_view(comparison))) in text
    assert text.count('<img src="data:image/png;base64,') == 1


def test_page_names_its_plates_and_says_each_note_once(folder: Path) -> None:
    text = (folder / "a.html").read_text()
    assert "<title>Plates compared: narrow, &lt;b&gt;wide</title>" in text
    assert [text.count(note) for note in ("Intervals hold what the sample", "The core is one rigid body")] == [1, 1]
    assert len(text) < 3e6


def test_page_loads_nothing_and_escapes_what_files_say(folder: Path) -> None:
    text = (folder / "a.html").read_text()
    library, script = scripts_of(text)
    for part in (library, script, re.sub(r"<script.*?</script>", "", text, flags=re.DOTALL)):
        assert not re.search(r"https?://(?!www\.w3\.org/)", part)
    assert "showSendToCloud: false" in script
    own = re.sub(r"<script>.*?</script>", "", text, flags=re.DOTALL)
    assert not re.search(r'(src|href)="(?!data:|#)', own)
    assert "default-src 'none'" in own
    assert "&lt;b&gt;wide" in own
    assert "<b>" not in own
    assert own.count("</script>") == 2  # those of the data and of Plotly; titles contain others


def test_the_page_of_an_answer_begins_with_what_decides(make_result: ResultMaker, tmp_path: Path) -> None:
    passes = np.broadcast_to((np.arange(32) < 24)[:, None], (32, 512))
    result = with_draws(make_result(512), passes, elements=[5, 70, 200])
    text = report.report_page({"a": result}, folders={"a": tmp_path}, trajectories=0)
    (tmp_path / "a.html").write_text(text, encoding="utf-8")
    assert html_of({"": answer(result)}) in text
    assert "3 hits by elements" in text
    data = data_of(tmp_path / "a.html")
    assert data["variables"][0] == {
        "key": "share that passes",
        "label": "share that passes [%]",
        "signed": False,
        "share": True,
    }
    assert '<option value="share that passes" selected>' in text
    (shown,) = data["results"]
    assert shown["elements"] == [5, 70, 200]
    assert set(shown["columns"]["share that passes"]) == {75.0}
    assert "contact duration, by the fast law" in shown["columns"]


def test_a_click_shows_the_pictures_of_the_nearest_hit_by_elements(
    make_result: ResultMaker, tmp_path: Path, browser: Any
) -> None:
    """Each cell of a picture has the colour of its label, with y or z upwards."""
    labels = np.repeat(np.random.default_rng(1).integers(0, 5, (2, 5, 6, 2)), 3, axis=-1).astype(np.int8)
    columns = {v.PICTURE: labels, v.PICTURE_TIME: np.outer([1.0, 2.0], v.INSTANTS) * 5e-5}
    axes = {v.HIT: np.array([5, 70]), v.ALONG: 2e-4 * np.arange(6), v.ACROSS: 2e-4 * np.arange(6)}
    _, node = split_pictures(xarray.Dataset(stored_columns(columns, columns), stored_columns(axes, axes)))
    result = with_draws(make_result(512), np.ones((32, 512), dtype=bool), elements=[5, 70])
    result["pictures"] = xarray.DataTree(node["pictures"][0])
    text = report.report_page({"a": result}, folders={"a": tmp_path}, trajectories=0)
    (tmp_path / "a.html").write_text(text, encoding="utf-8")
    browser.open((tmp_path / "a.html").as_uri())
    browser.wait(lambda: browser.find("#map-0 .nsewdrag"))
    browser.point_at("#map-0 .nsewdrag", 0.1, 0.1, click=True)
    browser.wait(lambda: len(browser.find("#pictures-0 canvas")) == 5)
    hit = int(re.search(r"Sections of hit (\d+), the nearest", browser.text("#picture-note-0"))[1])
    script = "return [...document.querySelector('canvas').getContext('2d').getImageData(0, 0, 6, 6).data]"
    colours = [(0, 0, 0, 0), *(bytes.fromhex(of[1:] + "ff") for of in hit_data.LABEL_COLOURS.values())]
    drawn = np.reshape(browser.driver.execute_script(script), (6, 6, 4))
    expected = np.array([list(of) for of in colours])[labels[[5, 70].index(hit), 0, ::-1]]
    np.testing.assert_array_equal(drawn, expected)
    assert browser.errors() == []


def test_large_results_are_thinned_evenly_and_it_is_reported(
    make_result: ResultMaker, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    dataset = make_result(5000)
    files.write(dataset, tmp_path / "a.nc")
    monkeypatch.setattr(report, "MOST_HITS", 1000)
    assert main(["report", str(tmp_path / "a.nc"), "--trajectories", "0"]) == 0
    assert "the map shows 1000 of the 5000 hits" in (tmp_path / "a.html").read_text()
    (shown,) = data_of(tmp_path / "a.html")["results"]
    np.testing.assert_allclose(shown["y"], dataset["hit_y"][shown["number"]] * 1e3, rtol=1e-4)
    counts, *_ = np.histogram2d(shown["y"], shown["z"], bins=4)
    assert counts.min() > 30  # 62.5 each


def test_trajectories_are_of_the_worst_and_of_evenly_spread_hits(make_result: ResultMaker) -> None:
    dataset = make_result(np.where(np.arange(512) % 2, Status.PERFORATED, Status.ARRESTED))
    chosen = hit_data.worst_and_spread(dataset, 16)
    assert chosen[:4] == [511, 509, 507, 505]  # the velocity rises with the number
    assert len(set(chosen)) == 16
    points = np.stack([dataset["hit_y"], dataset["hit_z"]], axis=-1)
    offset = points[:, None] - points[chosen]
    offset -= dataset.attrs["plate_period"] * np.round(offset / dataset.attrs["plate_period"])
    assert np.linalg.norm(offset, axis=-1).min(axis=1).max() < 4e-3  # of a cell of 16 mm x 8 mm
    some = dataset.isel(hit=slice(7, None)).assign_coords(hit=np.arange(7, 512))
    assert hit_data.worst_and_spread(some, 16, first=[7])[:5] == [7, 511, 509, 507, 505]


def test_a_lost_file_is_reported_and_nothing_written(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def lost(*_: object, **__: object) -> None:
        raise CampaignError("the campaign in the result: hits.file: there is no file hits.csv")

    monkeypatch.setattr(report, "replay", lost)
    assert main(["report", str(folder / "narrow.nc"), "-o", str(tmp_path / "a.html")]) == 2
    remedy = "give the folder of the campaign's files with --campaign-folder, or --trajectories 0"
    assert f"hits.csv; {remedy}" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def open_report(browser: Any, page: Path, width: int) -> None:
    browser.open(page.as_uri(), width)
    browser.wait(lambda: browser.find("#map-1 .nsewdrag") and browser.find("#map-0 .nsewdrag"))


@pytest.mark.parametrize("width", [1280, 390])
def test_browser_shows_a_hit_on_hover_and_its_trajectory_on_click(browser: Any, folder: Path, width: int) -> None:
    dataset = files.read(folder / "narrow.nc")
    points = np.stack([dataset["hit_y"], dataset["hit_z"]], axis=-1)
    place = np.array([-3e-3, 2.5e-3])
    near = np.argsort(np.linalg.norm(points - place, axis=1))[:6].tolist()
    open_report(browser, folder / "a.html", width)
    assert "Trajectory of hit" in browser.text("#note-0")

    there = place / 16e-3 * [1, -1]  # of a cell of 16 mm x 16 mm
    browser.point_at("#map-0 .nsewdrag", *there)
    browser.wait(lambda: "hit " in browser.text("#map-0 .hovertext"))
    shown = browser.text("#map-0 .hovertext")
    hit = int(re.search(r"hit (\d+): (?:most often )?perforated", shown)[1])
    assert hit in near
    # The page holds rounded values, and rounds them once more to four digits.
    velocity = float(re.search(r"residual velocity: ([\d.]+) m/s", shown)[1])
    assert velocity == pytest.approx(float(dataset["residual_velocity"][hit]), abs=0.06)

    browser.point_at("#map-0 .nsewdrag", *there, click=True)
    browser.wait(lambda: browser.text("#hit-text-0").startswith("hit ") and "nearest" in browser.text("#note-0"))
    picked = int(re.match(r"hit (\d+): (?:most often )?perforated", browser.text("#hit-text-0"))[1])
    assert picked in near
    trajectories = [int(hit) for hit in data_of(folder / "a.html")["results"][0]["trajectories"]]
    away = points[trajectories] - points[picked]
    away -= 16e-3 * np.round(away / 16e-3)
    nearest = trajectories[int(np.linalg.norm(away, axis=1).argmin())]
    assert f"Hit {picked} has no trajectory in this report. Shown is hit {nearest}," in browser.text("#note-0")
    for views, cores in (("#passage-0", 10), ("#flight-0", 6)):
        assert len(browser.find(f"{views} .scatterlayer .trace")) == cores
    lengths = browser.driver.execute_script(
        "return [0, 1].map((k) => document.getElementById(`map-${k}`)._fullLayout.xaxis._m)"
    )
    assert lengths[0] == pytest.approx(lengths[1], rel=0.02)  # pixels per mm
    assert browser.errors() == []
    page = browser.driver.execute_script("return document.documentElement.scrollWidth")
    assert page <= width
    ends = "return [...document.querySelectorAll('select, p, h1')].map((e) => e.getBoundingClientRect().right)"
    assert max(browser.driver.execute_script(ends)) <= width


def test_a_solid_plate_has_no_places(make_result: ResultMaker, tmp_path: Path, browser: Any) -> None:
    """Its map is as large as the other one, so places in it are none of its hits."""
    holed, solid = make_result(100), make_result(100)
    solid = solid.assign({name: solid[name] / 16 for name in ("hit_y", "hit_z")})
    solid.attrs |= {"plate_period": np.array(solid.attrs["plate_period"]) / 16, "campaign": '{"plate": {}}'}
    plates = {"holed": holed, "solid": solid}
    page = report.report_page(plates, folders=dict.fromkeys(plates, tmp_path), trajectories=0)
    (tmp_path / "a.html").write_text(page, encoding="utf-8")
    open_report(browser, tmp_path / "a.html", 1280)
    places = {}
    for number in range(2):
        browser.point_at(f"#map-{number} .nsewdrag", 0.1, 0.1)
        browser.wait(lambda at=f"#map-{number} .hovertext": "hit " in browser.text(at))
        places[number] = "y = " in browser.text(f"#map-{number} .hovertext")
    assert places == {0: True, 1: False}
    assert page.count("Hit positions do not matter on a solid plate.") == 1
    assert [bool(browser.text(f"#map-{number} .xtick").split()) for number in range(2)] == [True, False]
    assert browser.errors() == []


def test_browser_changes_the_map_and_keeps_one_scale(browser: Any, folder: Path) -> None:
    open_report(browser, folder / "a.html", 1280)
    for key in ("tilt at 130 mm", "pitch at 50 mm", "status"):
        browser.driver.execute_script(
            "const picker = document.getElementById('variable'); picker.value = arguments[0];"
            "picker.dispatchEvent(new Event('change'))",
            key,
        )
        scales = browser.driver.execute_script(
            "return [0, 1].map((k) => document.getElementById(`map-${k}`).data[0]).map((t) => [t.zmin, t.zmax])"
        )
        assert scales[0] == scales[1]
        assert key != "pitch at 50 mm" or scales[0][0] == -scales[0][1]
    assert "⊙ fire" in browser.text("#map-0 .annotation-text")
    assert browser.errors() == []


V50_TEST = CAMPAIGNS / "firing" / "v50_test.toml"


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
    assert str(searched["front_file"].values[last]) in sections[last].text
    campaign = tomllib.loads(str(searched["front_campaign"].values[last]))
    assert f'thickness = "{campaign["plate"]["thickness"]}"' in sections[last].text
    assert len(sections[last].find_elements("css selector", "img")) == 1  # plate and map
    assert browser.errors() == []
