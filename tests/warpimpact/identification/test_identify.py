"""From a fit file to a posterior file: groups, resume, figures, and the command."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import xarray

from warpimpact.campaigns import gallery
from warpimpact.cli import main
from warpimpact.identification import identify
from warpimpact.identification.fit import Fit
from warpimpact.identification.identify import rounds
from warpimpact.identification.posterior import learnt, parameters_of
from warpimpact.identification.posterior_view import posterior_view
from warpimpact.plotting.posterior import hits_figure, measured_figure, pairs_figure
from warpimpact.results import posterior_file
from warpimpact.results.files import read_tree
from warpimpact.view.view import text_of

FitMaker = Callable[..., Fit]


def test_the_file_has_the_groups_that_arviz_reads(posterior: Path) -> None:
    tree = xarray.open_datatree(posterior)
    assert set(posterior_file.GROUPS) == set(tree.children)
    for group in ("posterior", "prior", "sample_stats", "log_likelihood", "posterior_predictive"):
        assert {"chain", "draw"} <= set(tree[group].sizes)
    assert tree["posterior"].sizes == {"chain": 1, "draw": 100, "shot": 2}
    assert tree["observed_data"]["measured"].dims == ("observation",)
    assert tree["posterior_predictive"]["measured"].dims == ("chain", "draw", "observation")
    assert tree["posterior"]["resistance"].attrs["units"] == "Pa"
    tree.close()


def test_arviz_reads_it(posterior: Path) -> None:
    arviz = pytest.importorskip("arviz_base")
    tree = arviz.convert_to_datatree(str(posterior))
    assert arviz.extract(tree)["resistance"].sizes == {"sample": 100}
    tree.close()


def test_draws_hold_together(posterior: Path) -> None:
    """A draw has the numbers of the set that it is."""
    tree = read_tree(posterior)
    which = tree["sample_stats"]["set"].values[0]
    for name in parameters_of(tree):
        assert tree["posterior"][name].values[0] == pytest.approx(tree["sets"][name].values[which])
    weight = tree["sets"]["weight"].values
    assert weight.sum() == pytest.approx(1.0)
    # Systematic resampling gives every set its share within one draw.
    assert np.bincount(which, minlength=len(weight)) == pytest.approx(100 * weight, abs=1.0)
    assert float(tree["best"]["misfit"].sum()) == pytest.approx(tree["sets"]["misfit"].values.sum(axis=1).min())


def test_the_resistance_is_learnt_and_told(posterior: Path) -> None:
    tree = read_tree(posterior)
    resistance = learnt(tree)["resistance"]
    assert resistance.quantiles[2] - resistance.quantiles[0] < 0.8 * (resistance.prior[2] - resistance.prior[0])
    text = text_of(posterior_view(tree))
    assert "resistance [GPa]" in text
    assert "effective sample size" in text
    assert ("NOT CONVERGED" in text) == (not tree.attrs[posterior_file.CONVERGED])


def test_figures_are_drawn(posterior: Path) -> None:
    tree = read_tree(posterior)
    assert len(pairs_figure(tree).axes) == 10
    assert len(measured_figure(tree).axes) == 2
    assert len(hits_figure(tree).axes) == 2
    assert [len(figure.axes) for _, figure, _ in gallery.pictures_of_fit(posterior)] == [2, 10]


def test_rounds_are_whole_blocks(make_fit: FitMaker, small: tuple[str, str]) -> None:
    plan = make_fit(small).sampling
    assert sum(rounds(plan)) <= plan.sets * identify.DISCREPANCIES
    assert all(count % (plan.shared * identify.DISCREPANCIES) == 0 for count in rounds(plan))


@pytest.mark.usefixtures("in_tmp_path")
def test_the_command(
    text: str,
    small: tuple[str, str],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("fit.toml").write_text(text.replace(*small), encoding="utf-8")
    assert main(["identify", "fit.toml", "--device", "cpu"]) == 0
    shown = capsys.readouterr()
    assert "written to fit.nc" in shown.out
    assert shown.err.startswith("warpimpact: computes at most 128 sets of parameters, ")
    assert re.search(r"roughly [\d.]+ (s|min) on \d+ core", shown.err.splitlines()[0])
    assert "of 128 sets, " in shown.err
    assert sorted(path.name for path in tmp_path.glob("*.png")) == ["fit_hits.png", "fit_measured.png", "fit_pairs.png"]
    assert main(["report", "fit.nc"]) == 0
    page = Path("fit.html").read_text(encoding="utf-8")
    assert page.count("data:image/png;base64,") == 3
    assert "resistance [GPa]" in page
    capsys.readouterr()
    assert main(["identify", "fit.toml", "--device", "cpu"]) == 2
    assert "exists already" in capsys.readouterr().err
    Path("bad.toml").write_text(text.replace("between holes", "nowhere"), encoding="utf-8")
    assert main(["identify", "bad.toml"]) == 2
    assert 'hit: got "nowhere", but it must be "unknown"' in capsys.readouterr().err
