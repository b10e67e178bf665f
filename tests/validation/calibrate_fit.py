"""Simulation-based calibration of `warpimpact identify`: are its posteriors right on data whose parameters are known?

Parameters are drawn from the prior, shots are simulated with them, and their posterior is computed. Over many such data
sets the share of the posterior below the true value is uniform, if and only if posteriors are right on average (Talts,
Betancourt, Simpson, Vehtari and Gelman, "Validating Bayesian inference algorithms with simulation-based calibration",
2018). All data sets share one library of runs at sets from the prior, which the likelihood weighs anew each time.

As a script it fits 300 data sets and writes ranks, coverage and recovery as JSON and as a figure to
tests/validation/results. It takes some minutes of one core: python tests/validation/calibrate_fit.py
"""

import json
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.stats import chisquare

from warpimpact.identification.between import with_images
from warpimpact.identification.fit import Fit
from warpimpact.identification.fit_file import fit_from
from warpimpact.identification.likelihood import Compared, Data
from warpimpact.identification.scoring import benches, computed, data_of, discrepancies, evaluate
from warpimpact.solver.worker import Worker
from warpimpact.statistics.importance import ImportanceSampler, Weights

Array = NDArray[np.float64]

HERE = Path(__file__).parent
BINS, DATA_SETS, LIBRARY = 10, 300, 2048
FIT = (HERE / "calibration.toml").read_text(encoding="utf-8")


@dataclass(frozen=True)
class Calibration:
    """What was found over the data sets.

    Attributes:
        names: of the parameters.
        ranks: share of the posterior below the true value, shape [data sets, parameters].
        truth, mean: standard normal numbers of the true values and of the posteriors' means, likewise.
        effective, pareto_k: of the weights, shape [data sets].
    """

    names: tuple[str, ...]
    ranks: Array
    truth: Array
    mean: Array
    effective: Array
    pareto_k: Array

    @property
    def uniformity(self) -> Array:
        """Probability of counts in BINS bins as uneven as those of the ranks, if they are uniform (χ² test), shape
        [parameters]."""
        counts = [np.histogram(column, bins=BINS, range=(0.0, 1.0))[0] for column in self.ranks.T]
        return np.array([chisquare(one).pvalue for one in counts])

    @property
    def coverage(self) -> Array:
        """Share of the data sets whose 90 % interval contains the true value, shape [parameters]."""
        return np.asarray(((self.ranks >= 0.05) & (self.ranks <= 0.95)).mean(axis=0))

    @property
    def recovery(self) -> Array:
        """Correlation of true values and posterior means, on the scale where the prior is normal, shape
        [parameters]."""
        return np.array([np.corrcoef(a, b)[0, 1] for a, b in zip(self.truth.T, self.mean.T, strict=True)])


def calibrate(fit: Fit, *, data_sets: int, library: int, device: str = "auto") -> Calibration:
    """Fit data sets of known parameters, in the place of what was measured.

    Args:
        fit: its shots say what is measured and how precisely; the measured values do not count.
        data_sets: how many.
        library: sets of parameters from the prior that all data sets share.
    """
    dimensions = len(fit.parameters)
    shared = [(sum(not one.is_column for one in fit.parameters), fit.sampling.shared)]
    points = ImportanceSampler(dimensions, shared, fit.sampling.seed).propose(library)
    rng = np.random.default_rng(np.random.SeedSequence(fit.sampling.seed, spawn_key=(4,)))
    truth = rng.standard_normal((data_sets, dimensions))
    measured = _measured(fit, truth, device)
    log_likelihood = np.zeros((data_sets, library))
    scales = discrepancies(fit, points)
    for bench in benches(fit):
        for run, outcomes in computed(fit, bench, points, Worker(device)):
            (which,), unfolded = run.which.T, with_images(outcomes, run.aim.group)
            some = {kind: scale[which] for kind, scale in scales.items()}
            for place in bench.which:
                shot = fit.shots[place]
                own = run.aim.of(shot.hit, run.scene.target.layers[0], run.scene.core)
                known = None  # between the hits, which all data sets share
                for row, values in enumerate(measured[place]):
                    compared = Compared.of(_replaced(data_of(fit, shot), values), own, unfolded, known)
                    log_likelihood[row, which] += compared.score(some, rng).log_likelihood
                    known = compared.changes
    weights = [Weights.of(row) for row in log_likelihood]
    return Calibration(
        names=tuple(one.name for one in fit.parameters),
        ranks=np.array([one.values @ (points < true) for one, true in zip(weights, truth, strict=True)]),
        truth=truth,
        mean=np.array([one.values @ points for one in weights]),
        effective=np.array([one.effective() for one in weights]),
        pareto_k=np.array([one.pareto_k for one in weights]),
    )


def _replaced(data: Data, values: Array) -> Data:
    """The same shot with other measured numbers."""
    told = (replace(one, value=float(value)) for one, value in zip(data.observations, values, strict=True))
    return replace(data, observations=tuple(told))


def _measured(fit: Fit, truth: Array, device: str) -> list[Array]:
    """Numbers that would be measured of every shot at true parameters, each of shape [data sets, observations].

    The shots hit at other points than those of the library.
    """
    elsewhere = replace(fit, sampling=fit.sampling.model_copy(update={"seed": fit.sampling.seed + 1}))
    return [one.predicted[:, 0] for one in evaluate(elsewhere, truth, Worker(device), seed=0)]


def told(found: Calibration) -> dict[str, object]:
    return {
        "data_sets": len(found.ranks),
        "library": LIBRARY,
        "effective_sample_size": {"median": float(np.median(found.effective)), "least": float(found.effective.min())},
        "pareto_k_above_0.7": int((found.pareto_k > 0.7).sum()),
        "parameters": {
            name: {
                "p_of_uniform_ranks": round(float(p), 4),
                "coverage_of_90_percent": round(float(covered), 4),
                "recovery": round(float(recovered), 3),
                "counts": np.histogram(column, bins=BINS, range=(0.0, 1.0))[0].tolist(),
            }
            for name, p, covered, recovered, column in zip(
                found.names, found.uniformity, found.coverage, found.recovery, found.ranks.T, strict=True
            )
        },
    }


def drawn(found: Calibration) -> Figure:
    figure = Figure(figsize=(3.4 * len(found.names), 6.4), layout="constrained")
    figure.suptitle(f"Calibration on {len(found.ranks)} data sets of known parameters")
    above, below = figure.subplots(2, len(found.names))
    expected = len(found.ranks) / BINS
    band = 1.96 * np.sqrt(expected * (1.0 - 1.0 / BINS))
    for place, name in enumerate(found.names):
        axes = above[place]
        axes.axhspan(expected - band, expected + band, color="0.85", label="95 % of uniform counts")
        axes.hist(found.ranks[:, place], bins=BINS, range=(0.0, 1.0), color="#0072B2", alpha=0.8)
        axes.set(title=f"{name}\nP(as uneven) = {found.uniformity[place]:.2f}", xlabel="posterior below the true value")
        axes.set_ylabel("data sets" if not place else "")
        axes = below[place]
        axes.scatter(found.truth[:, place], found.mean[:, place], s=6, color="#0072B2", alpha=0.6, lw=0)
        axes.axline((0.0, 0.0), slope=1.0, color="0.6", lw=1.0)
        axes.set(xlabel="true value (normal scale)", ylabel="posterior mean" if not place else "")
        axes.set_title(f"90 % intervals cover {found.coverage[place]:.1%}", fontsize="medium")
    return figure


def main() -> None:
    found = calibrate(fit_from(FIT, "calibration.toml", HERE), data_sets=DATA_SETS, library=LIBRARY)
    results = HERE / "results"
    results.mkdir(exist_ok=True)
    (results / "calibration.json").write_text(json.dumps(told(found), indent=1) + "\n", encoding="utf-8")
    drawn(found).savefig(results / "calibration.png", dpi=120)
    print(json.dumps(told(found), indent=1))


if __name__ == "__main__":
    main()
