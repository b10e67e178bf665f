"""What a command writes: no format that its name does not promise, and nothing replaced unasked."""

import errno
from collections.abc import Callable
from pathlib import Path

import pytest
import xarray

from warpimpact.cli import main
from warpimpact.results import files

Refusal = Callable[[list[str]], str]
ResultMaker = Callable[..., xarray.Dataset]
CAMPAIGNS = Path(__file__).parents[3] / "campaigns"


def test_pictures_of_a_result_are_not_replaced_unasked(
    make_result: ResultMaker, tmp_path: Path, refusal: Refusal
) -> None:
    for name in "ab":
        files.write(make_result(20), tmp_path / f"{name}.nc")
    one, other = (str(tmp_path / f"{name}.nc") for name in "ab")
    for command, picture in ((["plot", one], "a_overview.png"), (["plot", one, other], "a_b_tilt.png")):
        (tmp_path / picture).write_text("mine")
        assert f"{picture}: exists already" in refusal(command)
        assert (tmp_path / picture).read_text() == "mine"
        assert main([*command, "--overwrite"]) == 0
        assert (tmp_path / picture).read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("command", [["new", "slotted_plate"], ["plate", str(CAMPAIGNS / "slotted_plate.toml")]])
def test_a_full_disk_is_named_and_cuts_no_file(
    command: list[str], in_tmp_path: Path, refusal: Refusal, monkeypatch: pytest.MonkeyPatch
) -> None:
    def is_full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("warpimpact.results.files._flush", is_full)
    assert "slotted_plate" in (sentence := refusal(command))
    assert sentence.endswith(": cannot be written (the disk is full)")
    assert not list(in_tmp_path.iterdir())


def test_what_is_requested_has_a_picture_of_its_own(make_result: ResultMaker, tmp_path: Path, refusal: Refusal) -> None:
    files.write(make_result(100), tmp_path / "a.nc")
    for quantity in ("P(tilt@130mm > 30 deg)", "P(tilt@130mm < 30 deg)", "P(perforated)"):
        assert main(["plot", str(tmp_path / "a.nc"), "--measure", quantity]) == 0
    assert main(["plot", str(tmp_path / "a.nc"), "--variable", "edge_distance"]) == 0
    assert "--variable: " in refusal(["plot", str(tmp_path / "a.nc"), "--variable", "edges"])
    assert {path.name for path in tmp_path.glob("*.png")} == {
        "a_P_tilt_130mm_above_30_deg.png",
        "a_P_tilt_130mm_below_30_deg.png",
        "a_P_perforated.png",
        "a_edge_distance.png",
    }
