"""From a fit to draws of its posterior, by Markov chains of emcee.

The walkers of an ensemble (D. Foreman-Mackey, D. W. Hogg, D. Lang, J. Goodman, Publications of the Astronomical Society
of the Pacific 125 (2013) 306) move to draws of a kernel density of the others. So a step needs the likelihood of half
of them at once, which fills all cores, and few steps are enough. They start at sets from the prior, chosen by their
likelihood.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from importlib.util import find_spec
from typing import Any, NamedTuple

import numpy as np
import xarray

from warpimpact.identification.fit import Fit
from warpimpact.identification.likelihood import Scores, evaluate
from warpimpact.identification.parameters import FitError
from warpimpact.identification.posterior import Chains, to_dataset
from warpimpact.results.posterior_file import SETS
from warpimpact.runs.executor import Executor, Job, completed, opened
from warpimpact.scene.model import Array
from warpimpact.solver.worker import Worker

MOST_WALKERS, WALKERS_PER_PARAMETER = 128, 8
"""Most walkers, and fewest of each parameter."""
FROM_PRIOR = 4
"""Sets from the prior per walker, among which the walkers start."""
BATCH = 16
"""Fewest sets of a job, unless there are fewer. Smaller jobs spend their time in being prepared."""
LOOK_EVERY = 5
"""Steps between two checks of the effective sample size."""
FARTHEST = 5.0
"""Largest distance of a shot from the nearest set of the prior, in standard deviations with the discrepancy."""


class FitProgress(NamedTuple):
    """The progress of a fit.

    Attributes:
        done, total: sets of parameters; `total` is an upper bound.
        effective: effective sample size so far; NaN before the first check.
        misfit: smallest sum over shots of Σ (miss/σ)² so far.
    """

    done: int
    total: int
    effective: float
    misfit: float


Follow = Callable[[FitProgress], object]


def identify(fit: Fit, *, device: str | Executor = "auto", progress: Follow = lambda now: None) -> xarray.Dataset:
    """The posterior of a fit (posterior.py). An interrupt ends the sampling, and the draws so far are the result.

    Raises:
        FitError: the priors exclude what was measured, or emcee is not installed.
        KeyboardInterrupt: the user interrupted before there were draws.
    """
    if missing := [name for name in ("emcee", "arviz_stats") if find_spec(name) is None]:
        raise FitError(f"identify needs {missing[0]}: pip install 'warpimpact[identify]'")
    with opened(device) as executor:
        density = _Density(fit, executor, progress)
        start = prior_points(fit, FROM_PRIOR * walkers_of(fit))
        scored = density(start)
        check_reach(fit, density.scores(scored))
        chains = sampled(density, start, scored, fit)
        posterior = to_dataset(fit, chains, density.scores(chains.blobs), executor.made_by)
        return posterior.assign_attrs({SETS: density.progress.done})


def walkers_of(fit: Fit) -> int:
    """Number of walkers, a multiple of 4."""
    fewest = max(8, WALKERS_PER_PARAMETER * len(fit.parameters))
    return int(np.clip(fit.sampling.sets // 64 // 4 * 4, fewest, max(fewest, MOST_WALKERS)))


def prior_points(fit: Fit, count: int) -> Array:
    """Scrambled Sobol points of the prior as standard normal numbers, shape [count, parameters]."""
    from scipy.special import ndtri
    from scipy.stats.qmc import Sobol

    uniform = Sobol(len(fit.parameters), rng=np.random.default_rng(fit.sampling.seed)).random(count)
    return np.asarray(ndtri(np.clip(uniform, 2.0**-31, 1.0 - 2.0**-31)))


class _Density:
    """ln (prior · likelihood) of sets of parameters, followed by their scores, in jobs of an executor."""

    def __init__(self, fit: Fit, executor: Executor, follow: Follow) -> None:
        self._fit, self._executor, self._follow = fit, executor, follow
        self._calls = 0
        self.progress = FitProgress(0, fit.sampling.sets, np.nan, np.inf)

    def __call__(self, points: Array) -> Array:
        """Shape [sets, 1 + scores · shots]."""
        shots = len(self._fit.shots)
        uniform = np.random.default_rng([self._fit.sampling.seed, self._calls]).random((len(points), 2 + shots))
        self._calls += 1
        batches = np.array_split(np.arange(len(points)), min(-(-len(points) // BATCH), self._executor.width()))
        jobs = ((k, Job(_scored, (self._fit, points[rows], uniform[rows]))) for k, rows in enumerate(batches))
        found: dict[int, Scores] = {}
        before = self.progress
        with closing(completed(self._executor, jobs, lambda: None)) as results:
            for k, scores in results:
                found[k] = scores
                misfit = min(self.progress.misfit, float(scores.misfit.sum(axis=1).min()))
                done = before.done + sum(len(batches[place]) for place in found)
                self.report(self.progress._replace(done=done, misfit=misfit))
        columns = np.concatenate([np.concatenate(found[k], axis=1) for k in range(len(batches))])
        log = columns[:, :shots].sum(axis=1) - 0.5 * (points**2).sum(axis=1)
        return np.concatenate([log[:, None], columns], axis=1)

    def report(self, now: FitProgress) -> None:
        """Keep and tell the progress."""
        self.progress = now
        self._follow(now)

    def scores(self, columns: Array) -> Scores:
        """The scores in the last columns of an array, shape [..., columns]."""
        shots = len(self._fit.shots)
        kept = columns[..., -shots * len(Scores._fields) :]
        return Scores(*np.moveaxis(kept.reshape(*kept.shape[:-1], len(Scores._fields), shots), -2, 0))


def _scored(fit: Fit, points: Array, uniform: Array, *, worker: Worker, report: Callable[[float], object]) -> Scores:
    return evaluate(fit, points, uniform, worker)


def sampled(density: Any, start: Array, scored: Array, fit: Fit) -> Chains:
    """Chains of an ensemble until the effective sample size is reached, or all sets are computed.

    Args:
        density: function of points that gives ln (prior · likelihood) in the first column.
        start: sets from the prior; `scored` is their density.
    """
    import emcee

    walkers, (count, dimensions) = walkers_of(fit), start.shape
    rng = np.random.default_rng([fit.sampling.seed, 1])
    log_likelihood = scored[:, 0] + 0.5 * (start**2).sum(axis=1)
    chosen = np.argsort(log_likelihood + rng.gumbel(size=count))[-walkers:]  # without replacement, by likelihood
    state = emcee.State(
        start[chosen],
        log_prob=scored[chosen, 0],
        blobs=scored[chosen, 1:],
        random_state=np.random.RandomState(fit.sampling.seed % 2**32).get_state(),
    )
    sampler = emcee.EnsembleSampler(walkers, dimensions, density, moves=emcee.moves.KDEMove(), vectorize=True)
    steps = max(3 * LOOK_EVERY, (fit.sampling.sets - count) // walkers)
    interrupted = False
    try:
        for step, _ in enumerate(sampler.sample(state, iterations=steps), start=1):
            if step % LOOK_EVERY or step < 3 * LOOK_EVERY:
                continue
            chains = Chains.of(sampler, interrupted=False)
            if isinstance(density, _Density):
                density.report(density.progress._replace(effective=chains.effective.min()))
            if chains.is_converged(fit.sampling.effective):
                break
    except KeyboardInterrupt:
        if sampler.iteration < 3 * LOOK_EVERY:
            raise
        interrupted = True
    return Chains.of(sampler, interrupted=interrupted)


def check_reach(fit: Fit, scores: Scores) -> None:
    """Refuse priors all of whose sets are far from the measurements.

    Raises:
        FitError: the message names the shot and how far the nearest set is.
    """
    for shot, misfit in zip(fit.shots, scores.misfit.T, strict=True):
        if not np.isfinite(misfit).any():
            raise FitError(
                f'the priors exclude shot "{shot.name}": in {len(misfit)} sets of parameters no core ended as it did'
            )
        widened = [
            number.std / np.hypot(number.std, fit.largest_discrepancy(number.kind)) for number in shot.observations
        ]
        nearest = float(np.sqrt(misfit.min())) * max(widened, default=0.0)
        if nearest > FARTHEST * np.sqrt(len(shot.observations)):
            raise FitError(
                f'the priors exclude shot "{shot.name}": the nearest of {len(misfit)} sets of parameters is '
                f"{nearest:.3g} standard deviations off. Widen the priors."
            )
