"""Commands: help, exit code 2 with one sentence, outputs that replace nothing unasked, new, schema, -v and -q."""

import argparse
import errno
import json
from collections.abc import Callable
from pathlib import Path

import pytest
import xarray

from warpimpact import Campaign
from warpimpact.cli import main, parser
from warpimpact.firing.plan import read_test
from warpimpact.identification.fit import read_fit
from warpimpact.optimisation.design import read_design
from warpimpact.results import files

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


def test_memory_that_cannot_be_had_is_reported(
    in_tmp_path: Path, refusal: Refusal, monkeypatch: pytest.MonkeyPatch
) -> None:
    def no_memory(*_: object, **__: object) -> None:
        raise MemoryError("Unable to allocate 8 TiB")

    monkeypatch.setattr("warpimpact.cli.run.run_to_file", no_memory)
    assert refusal(["run", str(SLOTTED_PLATE)]) == "not enough memory: Unable to allocate 8 TiB"
    assert not list(in_tmp_path.iterdir())


def test_results_are_drawn_side_by_side(
    in_tmp_path: Path, capsys: pytest.CaptureFixture[str], refusal: Refusal, make_result: ResultMaker
) -> None:
    Path("b").mkdir()
    for path in ("a.nc", "b/a.nc"):
        files.write(make_result(100), Path(path))
    assert main(["plot", "a.nc", "b/a.nc"]) == 0
    assert capsys.readouterr().out.split() == ["a_a_residual_velocity.png", "a_a_tilt.png"]
    assert refusal(["plot", "a.nc", "a.nc"]) == "a.nc: got this result 2 times, but each result counts once"


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


def test_examples_are_listed_with_their_questions(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["new", "--list"]) == 0
    lines = capsys.readouterr().out.splitlines()
    paths = [path for kind in (".", "fits", "firing", "designs") for path in CAMPAIGNS.glob(f"{kind}/*.toml")]
    assert [line.split()[0] for line in lines] == sorted(path.stem for path in paths)
    assert all("?" in line and "campaigns/" not in line for line in lines)


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


def test_the_schema_is_printed_or_written_once(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["schema"]) == 0
    printed = capsys.readouterr().out
    assert [main(["schema", "-o", "it.json"]) for _ in range(2)] == [0, 2]
    assert Path("it.json").read_text(encoding="utf-8") == printed
    assert json.loads(printed)["title"] == "warpimpact campaign"


@pytest.mark.parametrize(
    ("option", "shown", "hidden"),
    [
        ([], "64 of 64 hits", "warpimpact.solver"),
        (["-q"], "", "of 64 hits"),
        (["-v"], "warpimpact.solver.accuracy: pilot: level 2 errs by", "warpimpact.solver.device"),
    ],
)
def test_more_or_less_is_shown(option: list[str], shown: str, hidden: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", str(CAMPAIGNS / "slotted_plate.toml"), "--count", "64", "--device", "cpu", *option]) == 0
    lines = capsys.readouterr().err
    assert shown in lines
    assert hidden not in lines
