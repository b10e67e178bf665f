"""Commands: help, exit code 2, outputs that replace nothing, new and schema, progress, names of the catalogue."""

import argparse
import errno
import io
import json
import os
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
import xarray

from warpimpact import Campaign
from warpimpact.cli import main, parser
from warpimpact.cli.common import show_progress
from warpimpact.firing.simulate import read_test
from warpimpact.identification.fit import read_fit
from warpimpact.measures.estimates import estimated
from warpimpact.measures.measure import Measure
from warpimpact.optimisation.design import read_design
from warpimpact.plotting import variable_map
from warpimpact.records import attributes as attr
from warpimpact.results import files
from warpimpact.runs.options import RunProgress
from warpimpact.statistics.intervals import Estimate

Refusal = Callable[[list[str]], str]
ResultMaker = Callable[..., xarray.Dataset]
SLOTTED_PLATE = Path(__file__).parents[3] / "campaigns" / "slotted_plate.toml"


def test_every_command_has_an_example_and_writes_a_file_or_a_folder() -> None:
    (commands,) = (action for action in parser()._actions if isinstance(action, argparse._SubParsersAction))
    for name, one in commands.choices.items():
        assert f"example: warpimpact {name}" in one.format_help()
        options = {action.dest: str(action.metavar) for action in one._actions}
        assert "FOLDER" not in options.get("output", ""), name
        assert options.get("folder", "FOLDER") == "FOLDER", name


def test_a_bad_campaign_is_refused(in_tmp_path: Path, refusal: Refusal) -> None:
    Path("wrong.toml").write_text(SLOTTED_PLATE.read_text().replace("= 0.8 ", "= 1.8 "))
    sentence = refusal(["run", "wrong.toml"])
    assert sentence == "wrong.toml: plate.degradation: got 1.8, but it must be less than or equal to 1"
    assert [path.name for path in in_tmp_path.iterdir()] == ["wrong.toml"]


def test_an_existing_output_is_kept_and_an_absent_device_named(in_tmp_path: Path, refusal: Refusal) -> None:
    assert 'got "cuda:99"' in refusal(["run", str(SLOTTED_PLATE), "--count", "4", "--device", "cuda:99"])
    assert not list(in_tmp_path.iterdir())
    Path("slotted_plate.nc").write_text("precious")
    sentence = refusal(["run", str(SLOTTED_PLATE)])
    assert sentence == "slotted_plate.nc: exists already; name another file or give --overwrite"
    assert Path("slotted_plate.nc").read_text() == "precious"


@pytest.mark.parametrize(
    ("output", "sentence"),
    [
        ("nowhere/a.nc", "nowhere: cannot be written into (No such file or directory)"),
        (".", ".: is a folder, but the output is one file"),
    ],
)
def test_an_output_that_cannot_be_written_is_refused_before_computing(
    in_tmp_path: Path, refusal: Refusal, output: str, sentence: str
) -> None:
    assert refusal(["run", str(SLOTTED_PLATE), "-o", output, "--overwrite"]) == sentence
    assert not list(in_tmp_path.iterdir())


def test_a_count_is_a_whole_number_however_it_is_written(capsys: pytest.CaptureFixture[str]) -> None:
    for text, count in (("400", 400), ("1e4", 10_000), ("2.0", 2)):
        assert parser().parse_args(["run", "a.toml", "--count", text]).count == count
    for text in ("1.5", "0", "-3", "many", "nan", "inf"):
        with pytest.raises(SystemExit):
            main(["run", "a.toml", f"--count={text}"])
        sentence = f'argument --count: got "{text}", but it must be a whole number of at least 1, such as 2 or 1e4\n'
        assert capsys.readouterr().err.endswith(sentence)


@pytest.mark.usefixtures("unrendered")
def test_pictures_of_a_result_stay(make_result: ResultMaker, tmp_path: Path, refusal: Refusal) -> None:
    for name in "ab":
        files.write(make_result(20), tmp_path / f"{name}.nc")
    one, other = (str(tmp_path / f"{name}.nc") for name in "ab")
    for command, picture in (
        (["plot", one, "--variable", "deflection"], "a_deflection.png"),
        (["plot", one, other], "a_b_tilt.png"),
    ):
        (tmp_path / picture).write_text("mine")
        assert f"{picture}: exists already" in refusal(command)
        assert (tmp_path / picture).read_text() == "mine"
        assert main([*command, "--overwrite"]) == 0
        assert (tmp_path / picture).read_text() != "mine"


@pytest.mark.parametrize("command", [["new", "slotted_plate"], ["plate", str(SLOTTED_PLATE)]])
def test_a_full_disk_is_named_and_cuts_no_file(
    command: list[str], in_tmp_path: Path, refusal: Refusal, monkeypatch: pytest.MonkeyPatch
) -> None:
    def is_full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("warpimpact.results.files._flush", is_full)
    assert "slotted_plate" in (sentence := refusal(command))
    assert sentence.endswith(": cannot be written (the disk is full)")
    assert not list(in_tmp_path.iterdir())


def test_what_is_requested_has_a_picture_of_its_own(
    make_result: ResultMaker, in_tmp_path: Path, refusal: Refusal
) -> None:
    files.write(make_result(100), Path("a.nc"))
    assert main(["plot", "a.nc"]) == 0
    for quantity in ("P(tilt@130mm > 30 deg)", "P(tilt@130mm < 30 deg)"):
        assert main(["plot", "a.nc", "--measure", quantity]) == 0
    assert main(["plot", "a.nc", "--variable", "edge_distance"]) == 0
    assert "--variable: " in refusal(["plot", "a.nc", "--variable", "edges"])
    names = ("overview", "verdict", "P_tilt_130mm_above_30_deg", "P_tilt_130mm_below_30_deg", "edge_distance")
    assert {path.name for path in in_tmp_path.glob("*.png")} == {f"a_{name}.png" for name in names}


CAMPAIGNS = Path(__file__).parents[3] / "campaigns"


pytestmark = pytest.mark.usefixtures("in_tmp_path")


@pytest.mark.parametrize("name", ["layered_target", "paper_shots"])
def test_a_new_campaign_can_be_read(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    Path("folder").mkdir()
    assert main(["new", name, "-o", "folder/my.toml"]) == 0
    written = capsys.readouterr().out.split()
    assert all(Path(file).is_file() for file in written)
    first, rest = Path("folder/my.toml").read_text(encoding="utf-8").split("\n", 1)
    assert first == "#:schema warpimpact.schema.json"
    source = (CAMPAIGNS / f"{name}.toml").read_text(encoding="utf-8")
    assert rest == source.replace(f"campaigns/{name}.toml", "my.toml")  # comments name the file itself
    assert "$defs" in json.loads(Path("folder/warpimpact.schema.json").read_text(encoding="utf-8"))
    assert Campaign.from_toml("folder/my.toml") == Campaign.from_toml(CAMPAIGNS / f"{name}.toml").model_copy(
        update={"hits": Campaign.from_toml("folder/my.toml").hits}
    )


@pytest.mark.parametrize(
    ("name", "kind", "is_read"),
    [
        ("paper_fit", "fit", lambda path: len(read_fit(path).shots) == 2),
        ("lightest_plate", "design", lambda path: len(read_design(path).file.objectives) == 2),
        ("v50_test", "test", lambda path: read_test(path).target.campaign == Path("plate_and_base.toml").absolute()),
    ],
)
def test_another_new_file_can_be_read(name: str, kind: str, is_read: Callable[[str], bool]) -> None:
    assert main(["new", name]) == 0
    assert is_read(f"{name}.toml")
    assert [path.name for path in Path().glob("*.json")] == [f"warpimpact.{kind}.schema.json"]


LOUD = argparse.Namespace(quiet=False)
VELOCITY = "mean(residual_velocity) 731.25 (730.5 to 732) m/s"


def progress_at(done: int, *, failed: int = 0, resumed: int = 100) -> RunProgress:
    estimates = {Measure.parse("mean(residual_velocity)"): Estimate(731.25, 730.5, 732.0, done, 10.0)}
    return RunProgress(done, 1000, done, resumed, failed, estimates)


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    now = [0.0]
    monkeypatch.setattr("warpimpact.cli.common.time.monotonic", lambda: now[0])
    return now


def test_a_log_gets_a_line_per_tenth_and_per_minute(capsys: pytest.CaptureFixture[str], clock: list[float]) -> None:
    with show_progress(LOUD) as show:
        for done in range(100, 1001, 10):
            clock[0] += 0.1
            show(progress_at(done, failed=done // 300))
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 10
    assert lines[0] == "100 of 1000 hits"
    # 100 hits a second; no rate stands in a line before 2 s have passed since the first of them.
    assert "hits/s" not in "".join(lines[:2])
    assert lines[3] == f"400 of 1000 hits, 100 hits/s, 6 s left; 1 failed, {VELOCITY}"
    assert lines[-1].startswith("1000 of 1000 hits, 100 hits/s, 0 s left; ")
    clock[0] = 0.0
    with show_progress(LOUD) as show:
        for _ in range(100):
            show(progress_at(101))
            clock[0] += 60.0
    assert len(capsys.readouterr().err.splitlines()) == 100


def test_a_terminal_gets_one_line_that_never_goes_back(monkeypatch: pytest.MonkeyPatch, clock: list[float]) -> None:
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setattr("shutil.get_terminal_size", lambda: os.terminal_size((80, 24)))
    with show_progress(LOUD) as show:
        for done in (100, 200, 600, 590, 1000):  # hits under way may be given up
            show(progress_at(done, failed=3))
            clock[0] += 1.0
    *lines, end = terminal.getvalue().split("\x1b[K")
    assert end == "\n"
    assert [line.split()[0] for line in lines] == ["100", "200", "600", "600", "1000"]
    assert lines[-1] == f"\r1000 of 1000 hits, 266.7 hits/s, 0 s left; 3 failed, {VELOCITY}"[:80]


def test_a_log_says_what_a_pilot_tries_and_counts_no_time_of_it(
    capsys: pytest.CaptureFixture[str], clock: list[float]
) -> None:
    begun = progress_at(0, resumed=0)
    with show_progress(LOUD) as show:
        for tenth in range(700):
            show(replace(begun, piloting=True, level=2 if tenth < 300 else 4))
            clock[0] += 0.1
        for done, seconds in ((0, 20.0), (1, 3.0), (0, 0.99), (400, 0.0)):  # kernels are compiled before the first hit
            show(progress_at(done, resumed=0))
            clock[0] += seconds
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == "choosing the resolution: level 2 (2 s)"
    assert sum("level 4" in line for line in lines) < 10
    assert [line for line in lines if line.startswith("0 of")] == ["0 of 1000 hits"]
    assert lines[-1].startswith("400 of 1000 hits, 100 hits/s, 6 s left; ")
    assert sum(" s left" in line for line in lines) == 1


CAMPAIGN = """
title = "named"
catalogue = "own.toml"
core = { threat = "7.62x51 P80 AP" }
plate = { material = "own steel", thickness = "20 mm" }
hits = { sampling = "grid", count = 4 }
numerics = { level = 0 }
output = { solid_reference = false }
"""
OWN = """
[[material]]
name = "own steel"
density = 7850
resistance = "1 GPa"
rows = { "7.62x51 P80 AP" = 3 }
thickness_high = "10 mm"
"""
LINES = (
    "Outside the tested range: thickness.",
    "core: 7.62x51 P80 AP (assumed: bullet; quoted at second hand: bullet mass, velocity)",
    "plate: own steel, resistance 1 GPa (3 limit velocities; nothing assumed)",
    "thickness (plate): 20 mm, but limit velocities of own steel were measured at 0 to 10 mm",
)


def test_names_are_carried_along(in_tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Path("own.toml").write_text(OWN, encoding="utf-8")
    Path("named.toml").write_text(CAMPAIGN, encoding="utf-8")
    assert main(["run", "named.toml", "--device", "cpu"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert LINES[0] in lines
    assert LINES[1] not in lines
    assert LINES[3] not in lines
    assert main(["inspect", "named.nc"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line for line in LINES if line not in lines] == []
    assert main(["run", "named.toml", "--count", "8", "-o", "other.nc", "--device", "cpu"]) == 0
    capsys.readouterr()
    assert main(["compare", "named.nc", "other.nc"]) == 0
    assert capsys.readouterr().out.splitlines().count(LINES[0]) == 1
    dataset = files.read(Path("named.nc"))
    assert dataset.attrs[attr.CATALOGUE_NAMES].splitlines() == list(LINES[1:3])
    assert json.loads(dataset.attrs[attr.OUTSIDE_TESTED_RANGE]) == [LINES[3]]
    below = " ".join(variable_map(dataset, "residual_velocity").legends[0].get_title().get_text().split())
    assert all(line in below for line in dataset.attrs[attr.CATALOGUE_NAMES].splitlines())
    assert main(["report", "named.nc", "-o", "named.html"]) == 0
    page = Path("named.html").read_text(encoding="utf-8")
    assert all(line in page for line in LINES[:3])


def test_the_command_lists_shows_and_draws(in_tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Path("own.toml").write_text(OWN, encoding="utf-8")
    assert main(["catalogue", "--file", "own.toml"]) == 0
    listed = capsys.readouterr().out
    assert all(name in listed for name in ("14.5 mm BS41", "own steel"))
    assert main(["catalogue", "14.5 mm B32", "-o", "core.png"]) == 0
    assert "STANAG 4569 level 4" in capsys.readouterr().out
    assert Path("core.png").stat().st_size > 10_000
    assert [main(["catalogue", *name]) for name in (["7.62x39 API BZ", "-o", "no.png"], ["P81"])] == [2, 2]


def test_limit_tells_where_a_test_is_expected(in_tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = CAMPAIGN.replace('catalogue = "own.toml"\n', "").replace("7.62x51 P80 AP", ".30 AP M2").replace("= 4", "= 1")
    text = text.replace('"own steel", thickness = "20 mm"', '"HHA Class 1", thickness = "6 mm"')
    Path("hha.toml").write_text(text, encoding="utf-8")
    assert main(["limit", "hha.toml", "-o", "limit.nc", "--device", "cpu"]) == 0
    (line,) = (line for line in capsys.readouterr().out.splitlines() if "a test of this material" in line)
    low, high = (float(word) for word in line.split() if word.replace(".", "").isdigit())
    dataset = files.read(Path("limit.nc"))
    factors, value = dataset.attrs[attr.LIMIT_FACTORS], float(dataset["limit_velocity"].item())
    assert (low, high) == pytest.approx((value * factors[0], value * factors[1]), rel=1e-3)
    (estimate,) = estimated(dataset, [Measure.parse("V50")]).values()
    assert low < estimate.low < value < estimate.high < high  # the material without the scatter of tests
    (chance,) = estimated(dataset, [Measure.parse(f"P(limit_velocity < {1.01 * value} m/s)")]).values()
    assert 0.5 < chance.value < 0.8
