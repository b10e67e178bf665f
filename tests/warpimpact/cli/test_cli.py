"""The command: help, version, and exit code 2 with one sentence and nothing written."""

import argparse
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path

import pytest
import xarray

from warpimpact.cli import main, parser
from warpimpact.results import files

Refusal = Callable[[list[str]], str]
SLOTTED_PLATE = Path(__file__).parents[3] / "campaigns" / "slotted_plate.toml"


def test_every_command_has_an_example(capsys: pytest.CaptureFixture[str]) -> None:
    (commands,) = (action for action in parser()._actions if isinstance(action, argparse._SubParsersAction))
    assert all(f"example: warpimpact {name}" in one.format_help() for name, one in commands.choices.items())
    with pytest.raises(SystemExit) as ended:
        main(["--version"])
    assert ended.value.code == 0
    assert capsys.readouterr().out == f"warpimpact {version('warpimpact')}\n"


def test_an_output_is_a_file_and_a_folder_has_its_own_option() -> None:
    (commands,) = (action for action in parser()._actions if isinstance(action, argparse._SubParsersAction))
    for name, one in commands.choices.items():
        options = {action.dest: str(action.metavar) for action in one._actions}
        assert "FOLDER" not in options.get("output", ""), name
        assert options.get("folder", "FOLDER") == "FOLDER", name


def test_a_bad_campaign_is_refused(in_tmp_path: Path, refusal: Refusal) -> None:
    Path("wrong.toml").write_text(SLOTTED_PLATE.read_text().replace("= 0.8 ", "= 1.8 "))
    sentence = refusal(["run", "wrong.toml"])
    assert sentence == "wrong.toml: plate.degradation: got 1.8, but it must be less than or equal to 1"
    assert [path.name for path in in_tmp_path.iterdir()] == ["wrong.toml"]


def test_an_existing_output_is_kept(in_tmp_path: Path, refusal: Refusal) -> None:
    Path("slotted_plate.nc").write_text("precious")
    sentence = refusal(["run", str(SLOTTED_PLATE)])
    assert sentence == "slotted_plate.nc: exists already; name another file or give --overwrite"
    assert Path("slotted_plate.nc").read_text() == "precious"


@pytest.mark.parametrize(
    ("output", "sentence"),
    [
        ("nowhere/a.nc", "nowhere: cannot be written into (No such file or directory)"),
        ("file/a.nc", "file: cannot be written into (Not a directory)"),
        (".", ".: is a folder, but the output is one file"),
    ],
)
def test_an_output_that_cannot_be_written_is_refused_before_computing(
    in_tmp_path: Path, refusal: Refusal, output: str, sentence: str
) -> None:
    Path("file").touch()
    assert refusal(["run", str(SLOTTED_PLATE), "-o", output, "--overwrite"]) == sentence
    assert [path.name for path in in_tmp_path.iterdir()] == ["file"]


def test_an_absent_device_is_refused(in_tmp_path: Path, refusal: Refusal) -> None:
    sentence = refusal(["run", str(SLOTTED_PLATE), "--count", "4", "--device", "cuda:99"])
    assert 'got "cuda:99"' in sentence
    assert not list(in_tmp_path.iterdir())


def test_memory_that_cannot_be_had_is_reported(
    in_tmp_path: Path, refusal: Refusal, monkeypatch: pytest.MonkeyPatch
) -> None:
    def no_memory(*_: object, **__: object) -> None:
        raise MemoryError("Unable to allocate 8 TiB")

    monkeypatch.setattr("warpimpact.cli.run.run_to_file", no_memory)
    assert refusal(["run", str(SLOTTED_PLATE)]) == "not enough memory: Unable to allocate 8 TiB"
    assert not list(in_tmp_path.iterdir())


def test_results_are_drawn_side_by_side(
    in_tmp_path: Path, capsys: pytest.CaptureFixture[str], refusal: Refusal, make_result: Callable[..., xarray.Dataset]
) -> None:
    Path("b").mkdir()
    for path in ("a.nc", "b/a.nc"):
        files.write(make_result(100), Path(path))
    assert main(["plot", "a.nc", "b/a.nc"]) == 0
    assert capsys.readouterr().out.split() == [
        f"a_a_{name}.png" for name in ("residual_velocity", "deflection", "tilt")
    ]
    assert refusal(["plot", "a.nc", "a.nc"]) == "a.nc: got this result 2 times, but each result counts once"
