"""Hostile input and files that are not what a command takes: one sentence and exit code 2, nothing unbounded."""

import os
import re
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
import xarray
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PIL import Image

from warpimpact import CampaignError, run
from warpimpact.campaign.campaign import Campaign
from warpimpact.cli import main
from warpimpact.cli.messages import Plain, say
from warpimpact.errors import OutputError
from warpimpact.identification.fit import read_fit
from warpimpact.optimisation.design import read_design
from warpimpact.results import files
from warpimpact.scene.input_files import read_text
from warpimpact.scene.units import Length, quantity

Refusal = Callable[[list[str]], str]
CAMPAIGNS = Path(__file__).parents[3] / "campaigns"
BASE = (CAMPAIGNS / "slotted_plate.toml").read_text(encoding="utf-8").replace("\nhits = 12", "")


def listed(name: str) -> str:
    """The campaign with a list of hits."""
    before, after = BASE.split("[hits]")[0], BASE.split("[numerics]")[1]
    return f'{before}[hits]\nsampling = "list"\nfile = "{name}"\n\n[numerics]{after}'


ZIGZAG = np.random.default_rng(1).uniform((-8e-3, -4e-3), (8e-3, 4e-3), (400, 2)).tolist()
HOSTILE = {
    "nested arrays": ("a = " + "[" * 100_000 + "]" * 100_000, "nested too deep"),
    "a tower of powers": (BASE.replace('"4 mm"', '"4 m**9**9**9"', 1), 'whose unit "m**9**9**9" is not one of names'),
    "a long file name": (listed("z" * 300), "but there is no file"),
    "a device": (listed("/dev/zero"), "but there is no file /dev/zero"),
    "a terminal's commands": (BASE.replace('title = "', 'title = "\\u001b[31m', 1), "without control characters"),
    "a tiny length": (
        re.sub("degradation_length *= .*", 'degradation_length = "1 nm"', BASE),
        "needs at least 3.022e-06 m",
    ),
    "a zigzag": (
        f'{BASE.split("[plate.pattern]")[0]}[plate.pattern]\nshape = "polygons"\nspacing = ["16 mm", "8 mm"]\n'
        f"polygons = {[ZIGZAG]}\n\n[impact]{BASE.split('[impact]')[1]}",
        "got polygons that cross themselves or overlap",
    ),
}


@pytest.mark.parametrize("case", HOSTILE)
def test_a_hostile_campaign_is_refused_in_a_sentence(case: str, in_tmp_path: Path, refusal: Refusal) -> None:
    text, expected = HOSTILE[case]
    Path("a.toml").write_text(text, encoding="utf-8")
    assert expected in refusal(["run", "a.toml"])


def test_a_hostile_list_of_hits_is_refused_without_its_text(in_tmp_path: Path, refusal: Refusal) -> None:
    Path("a.toml").write_text(listed("a.csv"), encoding="utf-8")
    Path("a.csv").write_text("secret:x:0:0\nsecret\n", encoding="utf-8")
    sentence = refusal(["run", "a.toml"])
    assert "line 1: the header must be hit_y,hit_z" in sentence
    assert "secret" not in sentence


WRITING = {  # commands that write a file, with what they read
    "run": ["run", "a.toml", "-o"],
    "continuum": ["continuum", "a.toml", "--material", "ARMOX560T Johnson-Cook", "-o"],
    "limit": ["limit", "a.toml", "-o"],
    "replay": ["replay", "b.nc", "--hit", "0", "-o"],
}


@pytest.mark.parametrize(
    ("command", "read"),
    [*((name, read) for name in ("run", "continuum", "limit") for read in ("a.toml", "hits.csv")), ("replay", "b.nc")],
)
@pytest.mark.parametrize("link", ["symbolic", "hard"])
def test_no_command_writes_over_what_it_reads(
    command: str, read: str, link: str, in_tmp_path: Path, refusal: Refusal
) -> None:
    Path("a.toml").write_text(listed("hits.csv"), encoding="utf-8")
    Path("hits.csv").write_text("hit_y,hit_z\n0,0\n", encoding="utf-8")
    Path("b.nc").write_bytes(b"")
    (Path("out.nc").symlink_to if link == "symbolic" else Path("out.nc").hardlink_to)(read)
    before = Path(read).read_bytes()
    assert f"out.nc: is the same file as {read}, which this command reads" in refusal(
        [*WRITING[command], "out.nc", "--overwrite"]
    )
    assert Path(read).read_bytes() == before


@pytest.mark.parametrize("command", ["run", "continuum", "limit"])
def test_a_name_too_long_to_be_written_is_refused_before_anything_is_computed(
    command: str, in_tmp_path: Path, refusal: Refusal, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("warpimpact.runs.options.RunOptions.computer", lambda _: 1 / 0)
    Path("a.toml").write_text(BASE, encoding="utf-8")
    name = f"{'n' * (os.pathconf('.', 'PC_NAME_MAX') - 10)}.nc"
    assert refusal([*WRITING[command], name]) == f"{name}: cannot be written (File name too long)"
    with pytest.raises(OutputError, match="cannot be written"):
        files.check_writable(Path(name))
    assert [path.name for path in in_tmp_path.iterdir()] == ["a.toml"]


@pytest.mark.usefixtures("in_tmp_path")
def test_a_bug_has_a_traceback(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object, **__: object) -> None:
        raise ZeroDivisionError("a\x1b[31m")

    monkeypatch.setattr(Campaign, "from_toml", broken)
    assert main(["plate", "a.toml"]) == 70
    *lines, sentence = capsys.readouterr().err.splitlines()
    assert lines[-1] == "ZeroDivisionError: a\\x1b[31m"
    assert sentence.startswith("warpimpact: error: this is a bug of warpimpact ")


def test_control_characters_are_never_printed(capsys: pytest.CaptureFixture[str]) -> None:
    print("a\x1b]0;title\x07\x9b31m\u202eb\n", end="", file=Plain(sys.stdout))
    say("c\x1b[2J\nd" + "e" * 5000)
    shown = capsys.readouterr()
    assert shown.out == "a\\x1b]0;title\\x07\\x9b31m\\u202eb\n"
    assert shown.err.startswith("warpimpact: c\\x1b[2J\\nd")
    assert len(shown.err) < 2100
    with pytest.raises(SystemExit):
        main(["run", "a.toml", "--nonsense", "\x1b[31m"])
    assert capsys.readouterr().err.endswith("unrecognized arguments: --nonsense \\x1b[31m\n")


SMALL = settings(max_examples=60, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))


@SMALL
@given(st.integers(0, len(BASE) - 1), st.integers(0, 200), st.text(max_size=20))
def test_a_campaign_file_with_anything_in_it_is_read_or_refused(at: int, taken: int, put: str) -> None:
    with suppress(CampaignError):
        Campaign.from_text(BASE[:at] + put + BASE[at + taken :], name="a.toml", folder=Path())


@SMALL
@given(st.text("0123456789.eE+-*^/() mskgdPaN²⁹\x00°", max_size=90))
def test_any_quantity_is_read_or_refused(text: str) -> None:
    with suppress(ValueError):
        assert np.isfinite(quantity(Length)(text))


def test_a_closed_stream_and_a_backend_end_in_no_bug(tmp_path: Path) -> None:
    (tmp_path / "matplotlibrc").write_text("text.usetex: True")
    plate, environment = CAMPAIGNS / "slotted_plate.toml", os.environ | {"MPLBACKEND": "nonsense"}
    command = ["sh", "-c", '"$0" "$@" >&-', sys.executable, "-m", "warpimpact", "plate", plate]
    assert subprocess.run(command, check=False, cwd=tmp_path, env=environment).returncode == 0


TEXTS: dict[str, tuple[str, str]] = {
    "a campaign": (BASE, "warpimpact run takes it"),
    "a design file": ("variables = { thickness = [1, 2] }", "warpimpact optimise takes it"),
    "a fit": ("[[shot]]\nname = 'a'", "warpimpact identify takes it"),
    "a test file": ("[target]\nmean = 800", "warpimpact test takes it"),
    "a catalogue": ("[[material]]\nname = 'a'", "warpimpact catalogue --file takes it"),
}
ResultMaker = Callable[..., xarray.Dataset]


@pytest.mark.parametrize(
    "arguments",
    [
        *(["catalogue", "--file", "{}"], ["run", "{}"], ["identify", "{}"], ["optimise", "{}"], ["test", "{}"]),
        *(["design", "--no-browser", "{}"], ["inspect", "{}"], ["report", "{}", "-o", "a.html"]),
    ],
    ids=lambda arguments: arguments[0],
)
def test_what_may_have_no_end_is_not_opened(arguments: list[str], in_tmp_path: Path, refusal: Refusal) -> None:
    os.mkfifo("pipe")
    for path in ("/dev/zero", "pipe"):
        assert refusal([one.format(path) for one in arguments]) == f"{path}: cannot be read (it is no file)"
    with Path("large.toml").open("wb") as file:
        file.truncate(2**32)
    assert "large.toml: at most 1048576 characters are read" in refusal(["run", "large.toml"])


def test_an_editors_encoding_is_read_or_named(tmp_path: Path) -> None:
    path, text = tmp_path / "a.toml", 'title = "Stahl, gehärtet"\n'
    path.write_text(text, encoding="utf-8-sig")  # as Notepad
    assert read_text(path) == text
    for encoding, sentence in (
        ("utf-16", "its encoding is UTF-16; save it as UTF-8"),
        ("cp1252", "perhaps Windows-1252"),
    ):
        path.write_text(text, encoding=encoding)
        with pytest.raises(ValueError, match=sentence):
            read_text(path)


@pytest.mark.parametrize("kind", TEXTS)
def test_a_text_is_named_as_what_it_is(kind: str, in_tmp_path: Path, refusal: Refusal) -> None:
    text, use = TEXTS[kind]
    Path("a.toml").write_text(text, encoding="utf-8")
    for arguments in (["inspect", "a.toml"], ["report", "a.toml", "-o", "a.html"]):
        assert refusal(arguments) == f"a.toml: is {kind}, not a result; {use}"
    commands = {"run": "a campaign", "optimise": "a design file", "identify": "a fit", "test": "a test file"}
    for command, wanted in commands.items():
        if wanted != kind:
            assert refusal([command, "a.toml"]) == f"a.toml: is {kind}, not {wanted}; {use}"


def test_a_result_is_named_where_a_text_is_taken(make_result: ResultMaker, in_tmp_path: Path, refusal: Refusal) -> None:
    files.write(make_result(20), Path("a.nc"))
    files.write(make_result(20), Path("b.toml"))
    sentence = "{0}: is a netCDF file, not a TOML file; warpimpact inspect {0} says what it holds"
    for command in ("run", "plate", "sweep", "optimise", "test", "limit"):
        assert refusal([command, "a.nc"]) == sentence.format("a.nc")
    assert refusal(["export", "b.toml"]) == sentence.format("b.toml")
    for read in (run, read_design, read_fit):
        with pytest.raises(CampaignError, match="a netCDF file, not a TOML file"):
            read("a.nc")


@pytest.mark.parametrize(
    ("mark", "sentence"),
    [
        ("hit map 4", 'a.nc: was written by another version of warpimpact ("hit map 4"); compute it again'),
        ("posterior 1", "is a posterior, as warpimpact identify writes, not a map of hits"),
        ("", 'is no file of this version of warpimpact: it has no attribute "warpimpact_kind";'),
    ],
)
def test_another_version_or_kind_is_named(
    mark: str, sentence: str, make_result: ResultMaker, in_tmp_path: Path, refusal: Refusal
) -> None:
    files.write(make_result(20).assign_attrs(warpimpact_kind=mark), Path("a.nc"))
    for arguments in (["plot", "a.nc"], ["replay", "a.nc", "--hit", "0"]):
        assert sentence in refusal(arguments)


def test_a_truncated_result_and_a_picture_are_named(
    make_result: ResultMaker, in_tmp_path: Path, refusal: Refusal
) -> None:
    Image.new("1", (2, 2)).save("a.png")
    assert refusal(["inspect", "a.png"]) == "a.png: cannot be read as a netCDF file"
    assert "a.png: is not valid TOML" in refusal(["run", "a.png"])
    files.write(make_result(2000), Path("a.nc"))
    data = Path("a.nc").read_bytes()
    for size in (int(0.9 * len(data)), 0):
        Path("a.nc").write_bytes(data[:size])
        assert "a.nc: cannot be read as a netCDF file" in refusal(["inspect", "a.nc"])
