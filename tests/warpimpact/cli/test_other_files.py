"""Files that are not what a command takes: no regular file, nested without end, or a file of another kind."""

import os
from collections.abc import Callable
from pathlib import Path

import pytest
import xarray
from PIL import Image

from warpimpact import CampaignError, run
from warpimpact.identification.fit import read_fit
from warpimpact.optimisation.design import read_design
from warpimpact.results import files
from warpimpact.results.kinds import HIT_MAP
from warpimpact.scene.input_files import read_text

CAMPAIGNS = Path(__file__).parents[3] / "campaigns"
SLOTTED = (CAMPAIGNS / "slotted_plate.toml").read_text(encoding="utf-8")
TEXTS: dict[str, tuple[str, str]] = {
    "a campaign": (SLOTTED, "warpimpact run takes it"),
    "a design file": ("variables = { thickness = [1, 2] }", "warpimpact optimise takes it"),
    "a fit": ("[[shot]]\nname = 'a'", "warpimpact identify takes it"),
    "a test file": ("[target]\nmean = 800", "warpimpact test takes it"),
    "a catalogue": ("[[material]]\nname = 'a'", "warpimpact catalogue --file takes it"),
}
Refusal = Callable[[list[str]], str]
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
    sentence = f"is a map of hits, not a TOML file; {HIT_MAP.use}"
    for command in ("run", "plate", "sweep", "optimise", "test", "limit"):
        assert refusal([command, "a.nc"]) == f"a.nc: {sentence}"
    assert refusal(["export", "b.toml"]) == f"b.toml: {sentence}"
    for read in (run, read_design, read_fit):
        with pytest.raises(CampaignError, match="a map of hits, not a TOML file"):
            read("a.nc")


@pytest.mark.parametrize(
    ("mark", "sentence"),
    [
        ("hit map 1", 'its attribute "warpimpact_kind" is "hit map 1"; this version reads hit map 4, sweep 4,'),
        ("posterior 1", "is a posterior, as warpimpact identify writes, not a map of hits"),
        ("", 'is no file of this version of warpimpact: its attribute "warpimpact_kind" is "";'),
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
