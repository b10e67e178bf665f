"""The command: help, version, and exit code 2 with one sentence and nothing written."""

import re
import subprocess
import sys
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path

import pytest
import xarray

from warpimpact.cli import main
from warpimpact.results import files

Refusal = Callable[[list[str]], str]
SLOTTED_PLATE = Path(__file__).parents[3] / "campaigns" / "slotted_plate.toml"


@pytest.mark.parametrize(
    "command",
    [
        [],
        ["run"],
        ["inspect"],
        ["plot"],
        ["validate"],
        ["compare"],
        ["plate"],
        ["identify"],
        ["continuum"],
        ["catalogue"],
        ["test"],
        ["optimise"],
    ],
)
def test_help_shows_how(command: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main([*command, "--help"])
    assert ended.value.code == 0
    shown = capsys.readouterr().out
    assert shown.startswith(" ".join(["usage: warpimpact", *command]))
    assert re.search(r"xample:\s+warpimpact", shown)


def test_version_is_that_of_the_package(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["--version"])
    assert ended.value.code == 0
    assert capsys.readouterr().out == f"warpimpact {version('warpimpact')}\n"


def test_help_imports_nothing_heavy() -> None:
    code = (
        "import sys, warpimpact.cli\n"
        "try: warpimpact.cli.main(['run', '--help'])\n"
        "except SystemExit: pass\n"
        "heavy = {'numpy', 'scipy', 'pydantic', 'xarray', 'matplotlib', 'warp', 'tqdm'}\n"
        "sys.stderr.write(' '.join(heavy & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.stderr == ""


@pytest.mark.parametrize("arguments", [[], ["fly"], ["run"], ["run", "a.toml", "--count", "many"]])
def test_a_wrong_command_line_ends_with_2(arguments: list[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    assert ended.value.code == 2


def test_a_bad_campaign_is_refused(in_tmp_path: Path, refusal: Refusal) -> None:
    Path("wrong.toml").write_text(SLOTTED_PLATE.read_text().replace("= 0.8 ", "= 1.8 "))
    sentence = refusal(["run", "wrong.toml"])
    assert sentence == "wrong.toml: plate.degradation: got 1.8, but it must be less than or equal to 1"
    assert [path.name for path in in_tmp_path.iterdir()] == ["wrong.toml"]


def test_a_count_of_0_is_refused(in_tmp_path: Path, refusal: Refusal) -> None:
    sentence = refusal(["run", str(SLOTTED_PLATE), "--count", "0"])
    assert sentence == f"{SLOTTED_PLATE}: hits.count: got 0, but it must be greater than or equal to 1"
    assert not list(in_tmp_path.iterdir())


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


def test_memory_that_cannot_be_had_is_told(
    in_tmp_path: Path, refusal: Refusal, monkeypatch: pytest.MonkeyPatch
) -> None:
    def no_memory(*_: object, **__: object) -> None:
        raise MemoryError("Unable to allocate 8 TiB")

    monkeypatch.setattr("warpimpact.runs.run.run_to_file", no_memory)
    assert refusal(["run", str(SLOTTED_PLATE)]) == f"{SLOTTED_PLATE}: Unable to allocate 8 TiB"
    assert not list(in_tmp_path.iterdir())


def test_what_is_no_result_is_not_plotted(in_tmp_path: Path, refusal: Refusal) -> None:
    Path("a.nc").write_text("no netCDF")
    assert refusal(["plot", "a.nc"]).startswith("a.nc: cannot be read as a netCDF file")
    assert [path.name for path in in_tmp_path.iterdir()] == ["a.nc"]


def test_results_are_drawn_beside_each_other(
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
