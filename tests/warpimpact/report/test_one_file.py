"""`inspect` and `report` show files of every kind: the view of the kind and its figures, escaped."""

import html
from pathlib import Path

import numpy as np
import pytest
import xarray

from warpimpact.cli import main
from warpimpact.firing.firing_view import firing_view
from warpimpact.records.variable import Variable
from warpimpact.results import files, firing, kinds
from warpimpact.results.dataset import dataset_of
from warpimpact.results.declared import Declaration, Text, finite
from warpimpact.results.kind import Kind
from warpimpact.view.view import Section, Table, html_of, number, text_of

KNOWN_TARGET = Path(__file__).parents[3] / "campaigns" / "firing" / "known_target.toml"

DEPTH = Variable("depth", ("row",), "m", "depth of a mark")
MARKS = Kind(
    "a list of marks",
    "warpimpact inspect and report take it",
    (DEPTH,),
    fault=Declaration({DEPTH: DEPTH.dims}, rules={DEPTH: finite}, attributes={"title": Text}).fault,
    view=lambda dataset: [
        Section([Table([number("depth", "mm")], [(1e3 * d,) for d in dataset[DEPTH].values])], "a<b")
    ],
)


@pytest.mark.usefixtures("in_tmp_path")
def test_a_new_kind_is_its_declaration(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kinds, "NETCDF", (*kinds.NETCDF, MARKS))
    dataset = dataset_of({DEPTH: np.array([1e-3, 2e-3])}, {"title": "marks"})
    files.write(dataset, Path("marks.nc"))
    assert main(["inspect", "marks.nc"]) == 0
    assert capsys.readouterr().out == "a<b\ndepth [mm]\n     1.000\n     2.000\n"
    assert main(["report", "marks.nc"]) == 0
    page = Path("marks.html").read_text(encoding="utf-8")
    assert "<h1>marks</h1><h2>a&lt;b</h2>" in page
    assert "<meta name='viewport' content='width=device-width" in page  # a phone shows it at the width of its screen
    files.write(dataset.assign({DEPTH: dataset[DEPTH] * np.nan}), Path("marks.nc"))
    for command in ("inspect", "report"):
        assert main([command, "marks.nc", *(["--overwrite"] if command == "report" else [])]) == 2
        assert 'not a list of marks of warpimpact, or damaged: its variable "depth"' in capsys.readouterr().err
    assert main(["plot", "marks.nc"]) == 2
    assert "is a list of marks, not a map of hits; warpimpact inspect and report" in capsys.readouterr().err


@pytest.mark.usefixtures("in_tmp_path")
def test_a_firing_test_is_inspected_and_reported(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["test", str(KNOWN_TARGET), "-o", "a.nc", "-q"]) == 0
    printed = capsys.readouterr().out
    assert main(["inspect", "a.nc"]) == 0
    assert printed.startswith(shown := capsys.readouterr().out)
    view = firing_view(files.read(Path("a.nc"), firing.FIRING))
    assert shown == f"{text_of(view)}\n"
    assert main(["report", "a.nc"]) == 0
    page = Path("a.html").read_text(encoding="utf-8")
    assert html_of(view[1:], "h2") in page
    assert page.count("<img") == 1  # no directions were asked for
    assert html.escape(KNOWN_TARGET.read_text(encoding="utf-8").splitlines()[0]) in page


def test_no_two_kinds_have_one_name() -> None:
    every = [value for module in (kinds, files) for value in vars(module).values() if isinstance(value, Kind)]
    names = {kind.name for kind in every}
    assert len(names) == len({id(kind) for kind in every})


def test_a_posterior_whose_draws_are_needed_is_one(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    xarray.Dataset(attrs={"effective_sample_size": 1000.0}).to_netcdf(tmp_path / "fit.nc")
    assert main(["inspect", str(tmp_path / "fit.nc")]) == 2
    assert 'not a posterior of warpimpact, or damaged: it has no group "posterior"' in capsys.readouterr().err
