"""From a fit to draws of its posterior, by Markov chains of emcee.

The walkers of an ensemble (D. Foreman-Mackey, D. W. Hogg, D. Lang, J. Goodman, Publications of the Astronomical Society
of the Pacific 125 (2013) 306) move to draws of a kernel density of the others. So a step needs the likelihood of half
of them at once, which fills all cores, and few steps are enough. They start at sets from the prior, chosen by their
likelihood.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec

import numpy as np
import xarray
from scipy.special import ndtri
from scipy.stats.qmc import Sobol

from warpimpact.campaign.text import CampaignError
from warpimpact.identification.fit import Fit
from warpimpact.identification.likelihood import evaluate
from warpimpact.identification.posterior import chains_of, is_converged, to_dataset
from warpimpact.results.posterior_file import INTERRUPTED, SETS
from warpimpact.runs.computer import Computer, computer
from warpimpact.scene.model import Array

MOST_WALKERS, WALKERS_PER_PARAMETER = 128, 8
"""Most walkers, and fewest of each parameter."""
PRIOR_SETS_PER_WALKER = 4
"""Sets from the prior per walker, among which the walkers start."""
BATCH = 16
"""Sets of a task. Smaller ones spend their time in being prepared."""
CHECK_STEPS = 5
"""Steps between two checks of the effective sample size."""
LARGEST_PRIOR_DISTANCE = 5.0
"""Largest distance of a shot from the nearest set of the prior, in standard deviations with the discrepancy."""
Progress = Callable[[int, int, str], object]
"""Called with the number of computed sets, the most that are computed, and words on the quality so far."""


def identify(
    fit: Fit, *, device: str | Computer = "auto", progress: Progress = lambda done, total, text: None
) -> xarray.Dataset:
    """The posterior of a fit (posterior.py). An interrupt ends the sampling, and the draws so far are the result.

    Raises:
        CampaignError: the priors exclude what was measured, or emcee is not installed.
        KeyboardInterrupt: the user interrupted before there were draws.
    """
    if missing := [name for name in ("emcee", "arviz_stats") if find_spec(name) is None]:
        raise CampaignError(f"identify needs {missing[0]}: pip install 'warpimpact[identify]'")
    with computer(device) as machine:
        density = _Density(fit, machine, progress)
        start = prior_points(fit, PRIOR_SETS_PER_WALKER * walkers_of(fit))
        log_density = density(start)
        check_reach(fit, density.scores_at(start)["misfit"].values)
        chains = sample_chains(density, start, log_density, fit, density.report)
        scores = density.scores_at(chains["point"].values.reshape(-1, len(fit.parameters)))
        return to_dataset(fit, chains, scores, machine.made_by).assign_attrs({SETS: density.done})


def walkers_of(fit: Fit) -> int:
    """Number of walkers, a multiple of 4."""
    fewest = max(8, WALKERS_PER_PARAMETER * len(fit.parameters))
    return int(np.clip(fit.file.sampling.sets // 64 // 4 * 4, fewest, max(fewest, MOST_WALKERS)))


def most_sets(fit: Fit) -> int:
    """The most sets that are computed: as the fit says, but no fewer than the first look at the chains needs."""
    return max(fit.file.sampling.sets, (PRIOR_SETS_PER_WALKER + 3 * CHECK_STEPS) * walkers_of(fit))


def prior_points(fit: Fit, count: int) -> Array:
    """Scrambled Sobol points of the prior as standard normal numbers, shape [count, parameters]."""
    uniform = Sobol(len(fit.parameters), rng=np.random.default_rng(fit.file.sampling.seed)).random(count)
    return np.asarray(ndtri(np.clip(uniform, 2.0**-31, 1.0 - 2.0**-31)))


class _Density:
    """ln (prior · likelihood) of sets of parameters, whose scores it keeps."""

    def __init__(self, fit: Fit, machine: Computer, progress: Progress) -> None:
        self._fit, self._machine, self._progress = fit, machine, progress
        self._scores, self._rows, self.done, self._misfit = list[xarray.Dataset](), dict[bytes, int](), 0, np.inf

    def __call__(self, points: Array) -> Array:
        """Shape [sets]."""
        shots, seed = len(self._fit.shots), self._fit.file.sampling.seed
        uniform = np.random.default_rng([seed, len(self._scores)]).random((len(points), 2 + shots))
        batches = [slice(first, first + BATCH) for first in range(0, len(points), BATCH)]
        tasks = ((k, (self._fit, points[rows], uniform[rows])) for k, rows in enumerate(batches))
        parts = dict[int, xarray.Dataset]()
        for k, scores in self._machine.map(evaluate, tasks, per_core=True):
            parts[k] = scores
            self.done += scores.sizes["set"]
            self._misfit = min(self._misfit, float(scores["misfit"].values.sum(axis=1).min()))
            self.report("")
        together = xarray.concat([parts[k] for k in range(len(batches))], "set")
        self._scores.append(together)
        self._rows |= {point.tobytes(): row for row, point in enumerate(points, start=len(self._rows))}
        return np.asarray(together["log_likelihood"].values.sum(axis=1) - 0.5 * (points**2).sum(axis=1))

    def report(self, text: str) -> None:
        """Report the progress; `text` follows the misfit."""
        self._progress(self.done, most_sets(self._fit), f"smallest misfit {self._misfit:.3g}{text}")

    def scores_at(self, points: Array) -> xarray.Dataset:
        """The scores of computed sets of parameters (`evaluate`)."""
        return xarray.concat(self._scores, "set").isel(set=[self._rows[point.tobytes()] for point in points])


def sample_chains(
    density: Callable[[Array], Array],
    start: Array,
    log_density: Array,
    fit: Fit,
    report: Callable[[str], object] = lambda text: None,
) -> xarray.Dataset:
    """Chains of an ensemble (`chains_of`) until the effective sample size is reached, or all sets are computed.

    Args:
        density: function of points that gives ln (prior · likelihood).
        start: sets from the prior; `log_density` is that of them.
        report: called with words on the effective sample size.
    """
    import emcee

    walkers, (count, dimensions), sampling = walkers_of(fit), start.shape, fit.file.sampling
    log_likelihood = log_density + 0.5 * (start**2).sum(axis=1)
    gumbel = np.random.default_rng([sampling.seed, 1]).gumbel(size=count)
    chosen = np.argsort(log_likelihood + gumbel)[-walkers:]  # without replacement, by likelihood
    random_state = np.random.RandomState(sampling.seed % 2**32).get_state()
    state = emcee.State(start[chosen], log_prob=log_density[chosen], random_state=random_state)
    sampler = emcee.EnsembleSampler(walkers, dimensions, density, moves=emcee.moves.KDEMove(), vectorize=True)
    steps, interrupted = (most_sets(fit) - count) // walkers, False
    try:
        for step, _ in enumerate(sampler.sample(state, iterations=steps), start=1):
            if step % CHECK_STEPS == 0 and step >= 3 * CHECK_STEPS:
                chains = chains_of(sampler)
                report(f", effective sample size {chains['effective'].values.min():.0f}")
                if is_converged(chains, sampling.effective):
                    break
    except KeyboardInterrupt:
        if sampler.iteration < 3 * CHECK_STEPS:
            raise
        interrupted = True
    return chains_of(sampler).assign_attrs({INTERRUPTED: int(interrupted)})


def check_reach(fit: Fit, misfits: Array) -> None:
    """Refuse priors all of whose sets are far from the measurements.

    Args:
        misfits: of sets from the prior, shape [sets, shots].

    Raises:
        CampaignError: the message names the shot and how far the nearest set is.
    """
    scales = fit.discrepancies(np.full((1, len(fit.parameters)), ndtri(0.99)))
    for shot, misfit in zip(fit.shots, misfits.T, strict=True):
        widened = [number.std / np.hypot(number.std, *scales[number.kind]) for number in shot.observations]
        nearest = float(np.sqrt(misfit.min())) * max(widened, default=1.0)
        if nearest > LARGEST_PRIOR_DISTANCE * np.sqrt(max(1, len(shot.observations))):
            what = f"is {nearest:.3g} standard deviations off" if np.isfinite(nearest) else "ended otherwise"
            raise CampaignError(
                f'the priors exclude shot "{shot.name}": the nearest of {len(misfit)} sets of parameters {what}. Widen '
                "the priors."
            )
