"""From a fit to draws of its posterior, by Markov chains of emcee.

The walkers of an ensemble (D. Foreman-Mackey, D. W. Hogg, D. Lang, J. Goodman, Publications of the Astronomical Society
of the Pacific 125 (2013) 306) move to draws of a kernel density of the others. So a step needs the likelihood of half
of them at once, which fills all cores, and few steps are enough. They start at sets from the prior, chosen by their
likelihood.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from typing import Any

import numpy as np
import xarray
from scipy.special import ndtri
from scipy.stats.qmc import Sobol

from warpimpact.campaign.text import CampaignError
from warpimpact.identification.fit import Fit
from warpimpact.identification.likelihood import Scores, evaluate
from warpimpact.identification.posterior import Chains, to_dataset
from warpimpact.results.posterior_file import SETS
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
        scored = density(start)
        check_reach(fit, density.scores(scored))
        chains = sample_chains(density, start, scored, fit, density.report)
        posterior = to_dataset(fit, chains, density.scores(chains.blobs), machine.made_by)
        return posterior.assign_attrs({SETS: density.done})


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
    """ln (prior · likelihood) of sets of parameters, followed by their scores."""

    def __init__(self, fit: Fit, machine: Computer, progress: Progress) -> None:
        self._fit, self._machine, self._progress = fit, machine, progress
        self._calls, self.done, self._misfit = 0, 0, np.inf

    def __call__(self, points: Array) -> Array:
        """Shape [sets, 1 + scores · shots]."""
        shots, seed = len(self._fit.shots), self._fit.file.sampling.seed
        uniform = np.random.default_rng([seed, self._calls]).random((len(points), 2 + shots))
        self._calls += 1
        batches = [slice(first, first + BATCH) for first in range(0, len(points), BATCH)]
        tasks = ((k, (self._fit, points[rows], uniform[rows])) for k, rows in enumerate(batches))
        parts = dict[int, Scores]()
        for k, scores in self._machine.map(evaluate, tasks, per_core=True):
            parts[k] = scores
            self.done += len(scores.misfit)
            self._misfit = min(self._misfit, float(scores.misfit.sum(axis=1).min()))
            self.report("")
        columns = np.concatenate([np.concatenate(parts[k], axis=1) for k in range(len(batches))])
        log = columns[:, :shots].sum(axis=1) - 0.5 * (points**2).sum(axis=1)
        return np.concatenate([log[:, None], columns], axis=1)

    def report(self, text: str) -> None:
        """Report the progress; `text` follows the misfit."""
        self._progress(self.done, most_sets(self._fit), f"smallest misfit {self._misfit:.3g}{text}")

    def scores(self, columns: Array) -> Scores:
        """The scores in the last columns of an array, shape [..., columns]."""
        shots = len(self._fit.shots)
        kept = columns[..., -shots * len(Scores._fields) :]
        return Scores(*np.moveaxis(kept.reshape(*kept.shape[:-1], len(Scores._fields), shots), -2, 0))


def sample_chains(
    density: Any, start: Array, scored: Array, fit: Fit, report: Callable[[str], object] = lambda text: None
) -> Chains:
    """Chains of an ensemble until the effective sample size is reached, or all sets are computed.

    Args:
        density: function of points that gives ln (prior · likelihood) in the first column.
        start: sets from the prior; `scored` is their density.
        report: called with words on the effective sample size.
    """
    import emcee

    walkers, (count, dimensions), sampling = walkers_of(fit), start.shape, fit.file.sampling
    log_likelihood = scored[:, 0] + 0.5 * (start**2).sum(axis=1)
    gumbel = np.random.default_rng([sampling.seed, 1]).gumbel(size=count)
    chosen = np.argsort(log_likelihood + gumbel)[-walkers:]  # without replacement, by likelihood
    state = emcee.State(
        start[chosen],
        log_prob=scored[chosen, 0],
        blobs=scored[chosen, 1:],
        random_state=np.random.RandomState(sampling.seed % 2**32).get_state(),
    )
    sampler = emcee.EnsembleSampler(walkers, dimensions, density, moves=emcee.moves.KDEMove(), vectorize=True)
    steps, interrupted = (most_sets(fit) - count) // walkers, False
    try:
        for step, _ in enumerate(sampler.sample(state, iterations=steps), start=1):
            if step % CHECK_STEPS == 0 and step >= 3 * CHECK_STEPS:
                chains = Chains.of(sampler, interrupted=False)
                report(f", effective sample size {chains.effective.min():.0f}")
                if chains.is_converged(sampling.effective):
                    break
    except KeyboardInterrupt:
        if sampler.iteration < 3 * CHECK_STEPS:
            raise
        interrupted = True
    return Chains.of(sampler, interrupted=interrupted)


def check_reach(fit: Fit, scores: Scores) -> None:
    """Refuse priors all of whose sets are far from the measurements.

    Raises:
        CampaignError: the message names the shot and how far the nearest set is.
    """
    scales = fit.discrepancies(np.full((1, len(fit.parameters)), ndtri(0.99)))
    for shot, misfit in zip(fit.shots, scores.misfit.T, strict=True):
        widened = [number.std / np.hypot(number.std, *scales[number.kind]) for number in shot.observations]
        nearest = float(np.sqrt(misfit.min())) * max(widened, default=1.0)
        if nearest > LARGEST_PRIOR_DISTANCE * np.sqrt(max(1, len(shot.observations))):
            what = f"is {nearest:.3g} standard deviations off" if np.isfinite(nearest) else "ended otherwise"
            raise CampaignError(
                f'the priors exclude shot "{shot.name}": the nearest of {len(misfit)} sets of parameters {what}. Widen '
                "the priors."
            )
