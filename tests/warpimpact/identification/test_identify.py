"""From a fit file to a posterior: closed forms, known parameters, the file, figures, and the command."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray
from scipy.stats import multivariate_normal

from warpimpact.analysis.numbers import text_of
from warpimpact.campaigns import gallery
from warpimpact.cli import main
from warpimpact.identification import identify as identifying
from warpimpact.identification.fit import Fit
from warpimpact.identification.identify import (
    identify,
    is_converged,
    material_draws,
    parameters_of,
    posterior_view,
    prior_points,
    sample_chains,
)
from warpimpact.plotting.studies import hits_figure, pairs_figure
from warpimpact.records.kinds import POSTERIOR
from warpimpact.results import files
from warpimpact.runs.options import RunOptions
from warpimpact.scene import Hits, make_shots
from warpimpact.solver.simulate import simulate

from ...options import CPU

FitMaker = Callable[..., Fit]


@pytest.mark.parametrize("noise", [0.0, 0.7])
def test_a_linear_model_has_its_exact_posterior(make_fit: FitMaker, noise: float) -> None:
    """The posterior of a linear model with normal errors is normal, also where the likelihood is an unbiased estimate
    with a log-normal error."""
    fit, rng = make_fit(("[sampling]", "[sampling]\nsets = 16384\neffective = 2000")), np.random.default_rng(1)
    matrix, data, std = rng.standard_normal((4, 4)), np.array([1.0, -1.0, 2.0, 0.5]), 0.7

    def density(points: np.ndarray) -> np.ndarray:
        log = multivariate_normal(data, std**2 * np.eye(4)).logpdf(points @ matrix.T) - 0.5 * (points**2).sum(axis=1)
        return np.asarray(log + noise * rng.standard_normal(len(points)) - 0.5 * noise**2)

    start = prior_points(fit, 512)
    chains = sample_chains(density, start, density(start), fit)
    precision = np.eye(4) + matrix.T @ matrix / std**2
    mean, spread = np.linalg.solve(precision, matrix.T @ data / std**2), np.sqrt(np.diag(np.linalg.inv(precision)))
    sample = chains["point"].values.reshape(-1, 4)
    assert is_converged(chains, 2000)
    assert np.abs(sample.mean(axis=0) - mean) / spread == pytest.approx(0.0, abs=5.0 / np.sqrt(2000.0))
    assert sample.std(axis=0) == pytest.approx(spread, rel=0.1)


def test_known_parameters_are_recovered(make_fit: FitMaker) -> None:
    """Five shots of a plate with Y = 2 GPa and η = 0.05, at hits that the fit does not know."""
    base = make_fit(("[sampling]\nhits = 64", "[sampling]\nsets = 2048\neffective = 100\nhits = 32"))
    truth = {"plate.resistance": 2e9, "plate.shear_coefficient": 0.05}
    scene, rng = base.scene_of(base.shots[0], truth), np.random.default_rng(4)
    plate = scene.target.layers[0]
    given = base.shots[0]
    shots = make_shots(given.impact, Hits(count=5, sampling="random", seed=7), plate)
    outcomes = simulate(scene, shots, method=base.file.numerics, device="cpu")
    measured = []
    for k in range(5):
        numbers = tuple(
            one._replace(value=float(one.of(outcomes)[k] + one.std * rng.standard_normal()))
            for one in given.observations
        )
        measured.append(replace(given, name=f"shot {k}", observations=numbers))
    posterior = identify(replace(base, shots=tuple(measured)), options=CPU)
    for name, value in (("resistance", 2e9), ("shear_coefficient", 0.05)):
        low, high = np.quantile(posterior[name].values, [0.025, 0.975])
        assert low < value < high
    assert posterior["resistance"].attrs["verdict"] == "determined"
    assert posterior.attrs["converged"]


def test_a_posterior_has_draws_and_their_quality(posterior: xarray.Dataset) -> None:
    assert parameters_of(posterior) == ["resistance", "shear_coefficient", "discrepancy_velocity", "discrepancy_angle"]
    assert posterior.sizes == {"draw": 100, "shot": 2}
    assert posterior["hit_y"].dims == posterior["log_likelihood"].dims == ("draw", "shot")
    assert posterior["resistance"].attrs["units"] == "Pa"
    assert 1e9 < posterior["resistance"].values.min() < posterior["resistance"].values.max() < 4e9
    text = text_of(posterior_view(posterior))
    assert "resistance [GPa]" in text
    assert ("NOT CONVERGED" in text) == (not posterior.attrs["converged"])


def test_nobody_changes_a_bit(make_fit: FitMaker, small: tuple[str, str], posterior: xarray.Dataset) -> None:
    again = identify(make_fit(small), options=RunOptions("cpu", workers=1))
    xarray.testing.assert_equal(again, posterior)


def test_an_interrupt_keeps_the_draws(
    make_fit: FitMaker, small: tuple[str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[None] = []

    def interrupted(fit: Fit, *given: Any, **options: Any) -> object:
        calls.append(None)
        if len(calls) > 40:
            raise KeyboardInterrupt
        return evaluate(fit, *given, **options)

    evaluate = identifying.evaluate
    monkeypatch.setattr(identifying, "evaluate", interrupted)
    posterior = identify(make_fit(small, ("effective = 60", "effective = 60000")), options=CPU)
    assert posterior.attrs["interrupted"]
    assert posterior.sizes["draw"] == 100
    assert "NOT CONVERGED: it was interrupted" in text_of(posterior_view(posterior))


def test_figures_are_drawn(posterior: xarray.Dataset, tmp_path: Path) -> None:
    assert len(pairs_figure(posterior).axes) == 10
    assert len(hits_figure(posterior).axes) == 2
    files.write(posterior, tmp_path / "posterior.nc")
    xarray.testing.assert_equal(files.read(tmp_path / "posterior.nc", POSTERIOR).to_dataset(), posterior)
    assert [len(figure.axes) for _, figure, _ in gallery.pictures_of_fit(tmp_path / "posterior.nc")] == [2, 10]


def test_draws_are_a_file_of_hits(make_fit: FitMaker, posterior: xarray.Dataset, tmp_path: Path) -> None:
    draws = material_draws(make_fit(), posterior)
    assert list(draws) == ["resistance", "shear_coefficient"]
    draws.to_csv(tmp_path / "draws.csv", index=False)
    listed = Hits(count=4, file=tmp_path / "draws.csv").listed
    assert listed is not None
    np.testing.assert_array_equal(listed["resistance"], posterior["resistance"].values)


@pytest.mark.usefixtures("in_tmp_path")
def test_the_command(text: str, small: tuple[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Path("fit.toml").write_text(text.replace(*small), encoding="utf-8")
    assert main(["identify", "fit.toml", "--device", "cpu"]) == 0
    shown = capsys.readouterr()
    assert "written to fit.nc" in shown.out
    assert shown.err.startswith("warpimpact: computes at most 1024 sets of parameters, ")
    assert sorted(path.name for path in tmp_path.glob("fit*.*")) == [
        *("fit.csv", "fit.nc", "fit.toml", "fit_hits.png", "fit_pairs.png"),
    ]
    assert main(["report", "fit.nc"]) == 0
    page = Path("fit.html").read_text(encoding="utf-8")
    assert page.count("data:image/png;base64,") == 2
    assert "resistance [GPa]" in page
    capsys.readouterr()
    assert main(["identify", "fit.toml", "--device", "cpu"]) == 2
    assert "exists already" in capsys.readouterr().err
