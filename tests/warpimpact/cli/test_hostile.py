"""Hostile input: one sentence and exit code 2, whatever is in a file; no traceback, no hang, nothing unbounded."""

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from warpimpact.campaign.campaign import Campaign
from warpimpact.campaign.text import CampaignError
from warpimpact.cli import main
from warpimpact.cli.messages import Plain, say
from warpimpact.scene.units import Length, quantity

Refusal = Callable[[list[str]], str]
SHIPPED = Path(__file__).parents[3] / "campaigns"
BASE = (SHIPPED / "slotted_plate.toml").read_text(encoding="utf-8")


def listed(name: str) -> str:
    """The campaign with a list of hits."""
    before, after = BASE.split("[hits]")[0], BASE.split("[numerics]")[1]
    return f'{before}[hits]\nsampling = "list"\nfile = "{name}"\n\n[numerics]{after}'


ZIGZAG = np.random.default_rng(1).uniform((-8e-3, -4e-3), (8e-3, 4e-3), (400, 2)).tolist()
CAMPAIGNS = {
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


@pytest.mark.parametrize("case", CAMPAIGNS)
def test_a_hostile_campaign_is_refused_in_a_sentence(case: str, in_tmp_path: Path, refusal: Refusal) -> None:
    text, expected = CAMPAIGNS[case]
    Path("a.toml").write_text(text, encoding="utf-8")
    assert expected in refusal(["run", "a.toml"])


def test_a_hostile_list_of_hits_is_refused_without_its_text(in_tmp_path: Path, refusal: Refusal) -> None:
    Path("a.toml").write_text(listed("a.csv"), encoding="utf-8")
    Path("a.csv").write_text("secret:x:0:0\nsecret\n", encoding="utf-8")
    sentence = refusal(["run", "a.toml"])
    assert "line 1: the header must be hit_y,hit_z" in sentence
    assert "secret" not in sentence


def test_a_name_that_is_no_text_is_refused(in_tmp_path: Path, refusal: Refusal) -> None:
    name = os.fsdecode(b"a\xff.toml")
    shutil.copyfile(SHIPPED / "slotted_plate.toml", name)
    sentence = refusal(["run", name, "--count", "64", "--device", "cpu"])
    assert "the name contains bytes that are not UTF-8; rename the file" in sentence


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
    command = ["sh", "-c", '"$0" "$@" >&-', sys.executable, "-m", "warpimpact", "plate", SHIPPED / "slotted_plate.toml"]
    assert (
        subprocess.run(command, check=False, cwd=tmp_path, env=os.environ | {"MPLBACKEND": "nonsense"}).returncode == 0
    )
