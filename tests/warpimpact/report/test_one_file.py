"""`inspect` and `report` show files of every kind: the view of the kind and its figures, escaped."""

import html
from pathlib import Path

import pytest
import xarray

from warpimpact.cli import main
from warpimpact.firing.firing_view import firing_view
from warpimpact.results import files
from warpimpact.results.kinds import FIRING
from warpimpact.view.view import html_of, text_of

KNOWN_TARGET = Path(__file__).parents[3] / "campaigns" / "firing" / "known_target.toml"


@pytest.mark.usefixtures("in_tmp_path")
def test_a_firing_test_is_inspected_and_reported(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["test", str(KNOWN_TARGET), "-o", "a.nc", "-q"]) == 0
    printed = capsys.readouterr().out
    assert main(["inspect", "a.nc"]) == 0
    assert printed.startswith(shown := capsys.readouterr().out)
    view = firing_view(files.read(Path("a.nc"), FIRING))
    assert shown == f"{text_of(view)}\n"
    assert main(["report", "a.nc"]) == 0
    page = Path("a.html").read_text(encoding="utf-8")
    assert html_of(view[1:], "h2") in page
    assert "<meta name='viewport' content='width=device-width" in page  # a phone shows it at the width of its screen
    assert page.count("<img") == 1  # no directions were asked for
    assert html.escape(KNOWN_TARGET.read_text(encoding="utf-8").splitlines()[0]) in page


def test_a_posterior_without_draws_is_no_whole_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    xarray.Dataset(attrs={"warpimpact_kind": "posterior 1"}).to_netcdf(tmp_path / "fit.nc")
    assert main(["inspect", str(tmp_path / "fit.nc")]) == 2
    assert 'is no whole file of a posterior, it has no "posterior"' in capsys.readouterr().err
