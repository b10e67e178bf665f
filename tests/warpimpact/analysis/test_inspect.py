"""What run and inspect print: numbers by hand, accuracy, failures as data, and the answer in whole percent."""

import math
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import xarray

from warpimpact import Campaign, FastLaw, run
from warpimpact.analysis.inspection import answer, failed_shots, inspect_view, share_words, tolerance_text
from warpimpact.analysis.numbers import html_of, interval_text, number_text, text_of
from warpimpact.campaign.evidence import scene_words
from warpimpact.cli import main
from warpimpact.kernels.status import Status
from warpimpact.measures.draws import ends_of_draws, standard_normals
from warpimpact.measures.estimates import estimated, means_of
from warpimpact.measures.hits import passed
from warpimpact.measures.measure import Measure
from warpimpact.measures.references import as_dataset, law_of, nodes_of, with_nodes, with_references
from warpimpact.plotting import save_maps
from warpimpact.records import attributes as attr
from warpimpact.records import variables as v
from warpimpact.results import files
from warpimpact.runs.run import run_to_file
from warpimpact.scene.units import count_text
from warpimpact.statistics.intervals import Estimate, wilson

from ...options import CPU
from ..slotted import CAMPAIGNS, slotted, slotted_text

DRAFT = slotted_text(("count = 4096", "count = 512"))
MIXED = [Status.PERFORATED, Status.ARRESTED, Status.RICOCHETED, Status.UNTOUCHED, Status.UNFINISHED]


@pytest.fixture
def mixed(make_result):
    dataset = make_result(MIXED)
    dataset["residual_velocity"][:] = [700.0, 0.0, 300.0, 800.0, np.nan]
    dataset["deflection"][:] = [3.0, np.nan, 120.0, 1.0, np.nan]
    dataset["tilt"][:] = [[10.0, 40.0], [np.nan] * 2, [np.nan] * 2, [0.0, np.nan], [np.nan] * 2]
    return dataset


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("result") / "a.nc"
    (path.parent / "a.toml").write_text(DRAFT.replace("seed = 1", "seed = 1\nreplicates = 8"), encoding="utf-8")
    run_to_file(Campaign.from_toml(path.parent / "a.toml"), path, options=CPU)
    return path


def test_it_tells_origin_and_numbers_with_intervals(result: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["inspect", str(result)]) == 0
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert lines[0] == ["7.62", "mm", "P80", "core", "against", "a", "slotted", "plate"]
    assert ["hits", "512", "hits,", "sobol", "sampling,", "seed", "1,", "8", "replicates"] in lines
    plate = "plate open area 34.8%, smallest ligament 4.00 mm, areal density 20.5 kg/m²"  # (32 + 4π)/128 is hole
    assert plate.split() in lines
    share = (files.read(result)["draws/status"].values == Status.PERFORATED).mean()
    assert next(line for line in lines if line[:1] == ["perforated"])[1] == f"{share:.2%}"
    passing = files.read(result)["draws"].to_dataset().where(lambda of: of["status"] == Status.PERFORATED)
    means = passing["residual_velocity"].mean("drawn_hit").values  # of the hits that pass in each draw
    row = next(line for line in lines if line[:4] == ["residual", "velocity,", "mean", "[m/s]"])
    assert float(row[4]) == pytest.approx(means.mean(), abs=0.01)
    assert [float(row[5]), float(row[7])] == pytest.approx(ends_of_draws(means), abs=25.0)
    assert lines[-1] == ["0", "of", "512", "shots", "failed"]


def test_it_gives_the_campaign_back(result: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["inspect", str(result), "--campaign"]) == 0
    assert capsys.readouterr().out == (result.parent / "a.toml").read_text(encoding="utf-8") + "\n"


def test_slices_change_nothing(result: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    dataset = files.read(result)
    whole = text_of(inspect_view(dataset))
    monkeypatch.setattr("warpimpact.measures.estimates.SLICE", 100)
    assert text_of(inspect_view(dataset)) == whole


def test_failed_shots_are_listed_with_their_inputs_and_count_in_no_number(make_result, monkeypatch) -> None:
    statuses = np.array([Status.PERFORATED] * 6, dtype=np.int8)
    statuses[[1, 4]] = Status.UNFINISHED, Status.NOT_FINITE
    dataset = make_result(statuses)
    monkeypatch.setattr("warpimpact.measures.estimates.SLICE", 4)
    sentence, table = failed_shots(dataset)["failures"]
    assert list(table.columns[:4]) == ["status", "hit_y [m]", "hit_z [m]", "impact_velocity [m s-1]"]
    assert table["status"].to_dict() == {1: "unfinished", 4: "not_finite"}
    assert table.loc[4].tolist()[1:4] == [dataset["hit_y"][4], dataset["hit_z"][4], 825.0]
    assert sentence == "2 of 6 shots failed"
    row = next(line for line in text_of(inspect_view(dataset)).splitlines() if line.startswith("perforated"))
    assert row.split()[1] == "100.00%"


@pytest.mark.parametrize(("allowed", "code"), [("0.5", 3), ("1", 0)])
def test_a_run_goes_on_and_ends_with_3_when_too_many_failed(
    allowed: str, code: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("warpimpact.solver.resolution.STEP_ALLOWANCE", 0.01)  # no shot ends so soon
    text = DRAFT.replace("count = 512", "count = 300") + f"failed_share = {allowed}\n"
    (tmp_path / "a.toml").write_text(text, encoding="utf-8")
    output = tmp_path / "a.nc"
    assert main(["run", str(tmp_path / "a.toml"), "-o", str(output), "--device", "cpu"]) == code
    shown = capsys.readouterr()
    assert "300 failed" in shown.err
    message = "100 % of the shots failed, more than output.failed_share (50 %)" in shown.err
    assert message == (code == 3)
    assert (files.read(output)["status"] == Status.UNFINISHED).all()
    assert main(["inspect", str(output)]) == 0
    shown = capsys.readouterr().out
    assert "300 of 300 shots failed" in shown
    assert sum(" unfinished " in line for line in shown.splitlines()) == 300


def test_the_accuracy_is_reported(result: Path) -> None:
    lines = text_of(inspect_view(files.read(result))).splitlines()
    (accuracy,) = (line for line in lines if line.startswith("accuracy"))
    assert "within the tolerance of draft (5 m/s and 5 deg for 90 % of the hits); estimated errors: " in accuracy


def test_a_run_without_standoffs_is_reported_and_drawn(tmp_path: Path) -> None:
    dataset = run(slotted(('["50 mm", "130 mm"]', "[]"), count=64), options=CPU)
    assert dataset.sizes["standoff"] == 0
    files.write(dataset, tmp_path / "a.nc")
    message = text_of(inspect_view(files.read(tmp_path / "a.nc")))
    assert "deflection" in message
    assert "tilt" not in message
    assert all(path.is_file() for path in save_maps(dataset, tmp_path, "a"))


@pytest.mark.parametrize(
    ("measure", "expected"),
    [
        ("mean(residual_velocity)", (2, 750.0, 50.0)),
        ("mean(deflection)", (2, 2.0, 1.0)),
        ("mean(tilt@50mm)", (2, 5.0, 5.0)),
        ("mean(tilt@130mm)", (1, 40.0, 0.0)),
    ],
)
def test_means_count_only_what_passed_the_plate_and_exists(mixed, measure, expected) -> None:
    assert passed(mixed).tolist() == [True, False, False, True, False]
    (actual,) = estimated(mixed, [Measure.parse(measure).of(mixed)]).values()
    assert (actual.count, actual.value, actual.spread) == expected


TABLE = pd.DataFrame(
    {"speed": [123.45, math.nan], "interval": ["1 to 2", ""]}, index=pd.Index(["a", "<b>"], name="plate")
)
VIEW = {"": ["One sentence."], "nothing": [], "Speeds & more": [TABLE, "A note."]}


def test_a_view_as_text_has_a_table_without_the_name_of_its_index_on_a_line_of_its_own() -> None:
    assert text_of(VIEW) == (
        "One sentence.\n\nSpeeds & more\nplate   speed interval\na       123.5   1 to 2\n<b>         -\nA note."
    )


def test_html_has_the_same_cells_and_escapes_them() -> None:
    page = html_of(VIEW)
    assert "<h3>Speeds &amp; more</h3>" in page
    assert [cell in page for cell in ("<th>&lt;b&gt;</th>", "<td>123.5</td>", "<td>-</td>")] == [True] * 3
    assert ("nothing" in page, page.count("<table")) == (False, 1)


@pytest.mark.parametrize(
    ("number", "text"), [(7.77e-14, "0.000"), (-1e-6, "0.000"), (1.5e-5, "1.500e-05"), (math.nan, "-")]
)
def test_what_is_zero_within_rounding_is_shown_as_0(number: float, text: str) -> None:
    assert number_text(number) == text


def test_an_interval_names_what_is_not_known_of_it() -> None:
    nan = math.nan
    assert interval_text(nan, nan, 1.0) == "not determined"
    assert (interval_text(nan, 2.0), interval_text(1.0, nan)) == ("at most 2.000", "at least 1.000")
    assert interval_text(0.1, 0.2, 0.0123, ".1%") == "10.0% to 20.0%, numerics ± 1.2%"
    assert interval_text(0.1, 0.2, 0.0123) == "0.1000 to 0.2000, numerics ± 0.012"


def test_the_scene_is_one_clause() -> None:
    assert scene_words(Campaign.from_toml(CAMPAIGNS / "addon.toml")) == (
        ".30 AP M2 at 878 m/s and 30° against 6 mm of HHA Class 1 with round holes, 28% open, then 50 mm of air and "
        "25 mm of AA5083-H131 (add-on 33.9 kg/m², base 66.5 kg/m², whole target 100 kg/m²)"
    )


def test_a_default_answer_behind_a_base_is_within_a_point_and_needs_no_words() -> None:
    given = Campaign.from_toml(CAMPAIGNS / "addon.toml", count=128)
    campaign = given.computed_by(given.continuum.model_copy(update={"hits": None}))
    result = run(campaign, options=CPU)
    assert not any("numerics" in line for line in answer(result) if isinstance(line, str))
    accuracy = tolerance_text(result)
    assert accuracy is not None
    assert accuracy.startswith(
        "within the tolerance of the answer (1 % in P(base perforated) and 1 % of the impact velocity in means); "
    )
    assert result.attrs["numerics"].startswith("tolerance of the answer, consistent scheme")
    passing = Measure.parse("P(base_perforated)")
    assert 0.0 < estimated(result, [passing])[passing].numerics <= 0.01
    fine = run(campaign.model_copy(update={"numerics": FastLaw(level=4)}), options=CPU)
    coarse, fine = (as_dataset(law_of(one)) for one in (result, fine))
    assert abs(passed(coarse).mean() - passed(fine).mean()) <= 0.01
    speeds = (one[v.RESIDUAL_VELOCITY].mean() for one in (coarse, fine))
    assert abs(float(next(speeds) - next(speeds))) <= 0.01 * 878.0


def test_an_answer_says_how_many_pass_and_how_they_fly(make_plate_result) -> None:
    ends = np.array([Status.PERFORATED, Status.UNTOUCHED, Status.ARRESTED, Status.UNFINISHED])
    result = make_plate_result(np.array([700.4, 801.0, 0.0, np.nan]), np.array([10.0, 20.9, np.nan, np.nan]), ends)
    _, numbers, law, *_ = answer(result, "It costs.")
    low, high = wilson(2, 3, 0.95)
    assert numbers == (
        f"Between {math.floor(100 * low)} and {math.ceil(100 * high)} % of the bullets pass (best estimate 67 %); "
        "those that pass have a mean residual velocity of 750.7 m/s and a mean tilt at 130 mm of 15.45°; 1 shot failed."
    )
    assert law == "By the fast law alone. It costs."


@pytest.mark.parametrize(
    ("value", "low", "high", "words"),
    [
        (0.735, 0.2181, 0.9783, "between 21 and 98 %"),  # ends are rounded outwards
        (1.0, 0.9958, 1.0, "over 99 %"),
        (0.999, 0.953, 1.0, "over 95 %"),
        (0.0, 0.0, 0.004, "under 1 %"),
        (0.0, 0.0, 0.39, "between 0 and 39 %"),
        (0.5, math.nan, math.nan, "1 of 2"),
        (math.nan, math.nan, math.nan, "not known"),
    ],
)
def test_words_are_those_that_the_interval_carries(value: float, low: float, high: float, words: str) -> None:
    assert share_words(Estimate(value, low, high, count=2)) == words


def test_what_nobody_knows_is_called_not_known(make_plate_result, make_answer) -> None:
    """In half of the draws all pass, in the others none."""
    velocity = np.outer(np.arange(128) % 2, np.full(64, 300.0))
    lines = answer(make_answer(make_plate_result(np.full(64, 300.0)), velocity))
    assert lines[1].startswith("How many bullets pass is not known: between 0 and 100 % (best estimate 50 %); those")


def by_elements(result: xarray.DataTree, count: int) -> xarray.DataTree:
    """The same with so many hits by elements of a plate of "hard" steel."""
    elements = result["law"].to_dataset().isel(hit=slice(count))
    settings = {
        attr.CONTINUUM: '{"materials": ["hard"], "fidelity": "draft"}',
        attr.NUMERICS: "finite elements",
    }
    elements = elements.assign_coords(hit=np.arange(count)).assign_attrs(settings)
    tree = with_references(as_dataset(result), {"elements": elements})
    return with_nodes(as_dataset(result), {**nodes_of(result), **nodes_of(tree)})


@pytest.mark.usefixtures("all_draws")
@pytest.mark.parametrize("by_strength", [True, False])
def test_more_elements_are_offered_only_where_they_narrow_an_interval(
    by_strength: bool, make_plate_result, make_answer
) -> None:
    """Half a width takes four times the hits, if nothing but the elements leaves it open."""
    normals = standard_normals("hard" if by_strength else "what elements leave open")
    result = make_answer(make_plate_result(np.full(64, 300.0)), 300.0 + np.outer(normals, np.full(64, 30.0)))
    line = answer(by_elements(result, 12))[2]
    assert line.startswith("By the fast law and 12 hits by finite elements. ")
    if by_strength:
        assert "Most of the interval of the mean residual velocity is that of the strength of hard: more hits" in line
    else:
        (more,) = re.findall(r"About (\d+) more hits by elements would halve the interval of the mean res", line)
        assert 36 <= int(more) <= 48


@pytest.mark.usefixtures("all_draws")
def test_only_one_table_has_the_numbers_of_the_law(make_result, make_answer) -> None:
    """The law says 123.4 m/s, and the draws 300 ± 20 m/s."""
    velocity = np.random.default_rng(3).normal(300.0, 10.0, (128, 1)) + np.zeros(64)
    result = by_elements(
        make_answer(make_result(64).assign(residual_velocity=("hit", np.full(64, 123.4))), velocity), 12
    )
    view = inspect_view(result)
    assert "123.4" in text_of({"": view["where it comes from"]})
    assert "123.4" not in text_of({name: parts for name, parts in view.items() if name != "where it comes from"})
    mean = next(line for line in text_of(view).splitlines() if line.startswith("residual velocity, mean")).split()
    assert float(mean[4]) == pytest.approx(velocity.mean(), abs=0.01)
    assert [float(mean[5]), float(mean[7])] == pytest.approx(ends_of_draws(velocity[:, 0]), abs=0.01)


def test_numerics_beyond_their_tolerance_name_a_level_to_compare(make_plate_result) -> None:
    result = make_plate_result(np.full(3, 700.0)).assign_attrs(
        tolerance_met=0, resolution='{"level": 4}', residual_velocity_error=2.2
    )
    assert answer(result)[3] == (
        "The numerics err by 2.2 m/s, more than their tolerance. To see what that moves, run with numerics.level = 6 "
        "and compare both results."
    )


def test_one_hit_is_no_plural(make_plate_result) -> None:
    assert answer(make_plate_result(np.array([700.0])))[1].startswith("1 of 1 bullets pass; ")
    assert (count_text(0, "hit"), count_text(np.int64(1), "hit"), count_text(2, "hit")) == ("0 hits", "1 hit", "2 hits")


def test_a_plate_that_stops_every_core_has_no_residual_velocity(make_result) -> None:
    assert answer(make_result([Status.ARRESTED] * 300))[1] == "Under 2 % of the bullets pass."


def test_a_tilt_that_is_the_deflection_is_shown_once(make_plate_result) -> None:
    result = make_plate_result(np.full(3, 300.0), np.array([10.0, 20.0, 30.0]), np.zeros(3, dtype=np.int8))
    both = (v.DEFLECTION, v.TILT)
    assert len(means_of(result.assign(deflection=result.tilt[:, 1] + 1.0), both)) == 3
    result["tilt"] = result.tilt.isel(standoff=[1, 1]).assign_coords(standoff=result.standoff)
    assert [one.text for one in means_of(result.assign(deflection=result.tilt[:, 1] + 0.05), both)] == [
        "mean(deflection)"
    ]
