"""From a fit to draws of its posterior, by Markov chains of emcee; its Dataset and its view.

The walkers of an ensemble (D. Foreman-Mackey, D. W. Hogg, D. Lang, J. Goodman, Publications of the Astronomical Society
of the Pacific 125 (2013) 306) move to draws of a kernel density of the others. So a step needs the likelihood of half
of them at once, which fills all cores, and few steps are enough. They start at sets from the prior, chosen by their
likelihood.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib.util import find_spec
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray
from scipy import stats
from scipy.special import ndtri

from warpimpact.analysis.numbers import View
from warpimpact.errors import CampaignError
from warpimpact.identification.fit import Fit, columns_of, read_fit
from warpimpact.identification.likelihood import evaluate
from warpimpact.records import attributes as attr
from warpimpact.records.kinds import POSTERIOR
from warpimpact.records.variables import HIT_Y, HIT_Z
from warpimpact.results.dataset import joined
from warpimpact.runs.computer import Computer
from warpimpact.runs.options import RunOptions, RunProgress
from warpimpact.scene.model import Array
from warpimpact.scene.quantities import QUANTITIES
from warpimpact.scene.sampling import read_points, sobol
from warpimpact.scene.units import STORED, count_text

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


def identify(fit: Fit | str | Path, *, options: RunOptions = RunOptions()) -> xarray.Dataset:
    """The posterior of a fit (`to_dataset`). An interrupt ends the sampling, and the draws so far are the result.

    Args:
        fit: the fit, or its file.
        options: where to compute; the progress counts sets of parameters.

    Raises:
        CampaignError: the priors exclude what was measured, or emcee is not installed.
        KeyboardInterrupt: the user interrupted before there were draws.
    """
    if missing := [name for name in ("emcee", "arviz_stats") if find_spec(name) is None]:
        raise CampaignError(f"identify needs {missing[0]}: pip install 'warpimpact[identify]'")
    fit = fit if isinstance(fit, Fit) else read_fit(fit)
    with options.computer() as computer:
        density = _Density(fit, computer, options)
        start = prior_points(fit, PRIOR_SETS_PER_WALKER * walkers_of(fit))
        log_density = density(start)
        check_reach(fit, density.scores_at(start)["misfit"].values)
        chains = sample_chains(density, start, log_density, fit, density.report)
        scores = density.scores_at(chains["point"].values.reshape(-1, len(fit.parameters)))
        return to_dataset(fit, chains, scores, computer.made_by).assign_attrs({"computed_sets": density.done})


def walkers_of(fit: Fit) -> int:
    """Number of walkers, a multiple of 4."""
    fewest = max(8, WALKERS_PER_PARAMETER * len(fit.parameters))
    return int(np.clip(fit.file.sampling.sets // 64 // 4 * 4, fewest, max(fewest, MOST_WALKERS)))


def most_sets(fit: Fit) -> int:
    """The most sets that are computed: as the fit says, but no fewer than the first look at the chains needs."""
    return max(fit.file.sampling.sets, (PRIOR_SETS_PER_WALKER + 3 * CHECK_STEPS) * walkers_of(fit))


def prior_points(fit: Fit, count: int) -> Array:
    """Scrambled Sobol points of the prior as standard normal numbers, shape [count, parameters]."""
    sequence = sobol(len(fit.parameters), rng=np.random.default_rng(fit.file.sampling.seed))
    uniform = read_points(sequence, 0, count)
    return np.asarray(ndtri(np.clip(uniform, 2.0**-31, 1.0 - 2.0**-31)))


class _Density:
    """ln (prior · likelihood) of sets of parameters, whose scores it keeps."""

    def __init__(self, fit: Fit, computer: Computer, options: RunOptions) -> None:
        self._fit, self._computer, self._options = fit, computer, options
        self._scores, self._rows, self.done, self._misfit = list[xarray.Dataset](), dict[bytes, int](), 0, np.inf

    def __call__(self, points: Array) -> Array:
        """Shape [sets]."""
        shots, seed = len(self._fit.shots), self._fit.file.sampling.seed
        uniform = np.random.default_rng([seed, len(self._scores)]).random((len(points), 2 + shots))
        batches = [slice(first, first + BATCH) for first in range(0, len(points), BATCH)]
        tasks = ((k, (self._fit, points[rows], uniform[rows])) for k, rows in enumerate(batches))
        parts = dict[int, xarray.Dataset]()
        for k, scores in self._computer.map(evaluate, tasks, per_core=True):
            parts[k] = scores
            self.done += scores.sizes["set"]
            self._misfit = min(self._misfit, float(scores["misfit"].values.sum(axis=1).min()))
            self.report("")
        together = joined((parts[k] for k in range(len(batches))), "set")
        self._scores.append(together)
        self._rows |= {point.tobytes(): row for row, point in enumerate(points, start=self.done - len(points))}
        return np.asarray(together["log_likelihood"].values.sum(axis=1) - 0.5 * (points**2).sum(axis=1))

    def report(self, text: str) -> None:
        """Report the progress; `text` follows the misfit."""
        words = f"smallest misfit {self._misfit:.3g}{text}"
        self._options.progress(RunProgress(self.done, most_sets(self._fit), text=words))

    def scores_at(self, points: Array) -> xarray.Dataset:
        """The scores of computed sets of parameters (`evaluate`)."""
        return joined(self._scores, "set").isel(set=[self._rows[point.tobytes()] for point in points])


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
    return chains_of(sampler).assign_attrs({"interrupted": int(interrupted)})


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
                f'the priors exclude shot "{shot.name}": the nearest set of parameters, of {len(misfit)}, {what}. '
                "Widen the priors."
            )


LARGEST_NOISE = 1.7
"""Largest standard error of ln L by the hits. Chains whose noise is larger hardly move (A. Doucet and others,
Biometrika 102 (2015) 295: 1 to 1.7 is best)."""
LARGEST_R_HAT = 1.05
UNCHANGED_DISTANCE = 0.15
"""Largest distance between the distribution functions of prior and posterior at which they count as equal."""
HARDLY_DETERMINED = 0.65
"""Share of the prior within the posterior's 95 % interval above which little was learnt; 0.95 if nothing was."""
REPORTED_CORRELATION = 0.7
"""Rank correlation above which two parameters are reported as a combination."""
_GROUPS_OF_WALKERS = 4


def chains_of(sampler: Any) -> xarray.Dataset:
    """The chains of an emcee sampler without their first third.

    Returns:
        `point`: standard normal numbers along step, walker and parameter; `effective` and `r_hat` of each parameter.
        R-hat compares four groups of walkers (C. C. Margossian and others, "Nested R-hat", 2022).
    """
    from arviz_stats.base import array_stats

    points = sampler.get_chain(discard=int(sampler.iteration) // 3)
    group = np.arange(points.shape[1]) % _GROUPS_OF_WALKERS
    of_each = [column.T for column in np.moveaxis(points, 2, 0)]
    effective = [float(array_stats.ess(of, chain_axis=0, draw_axis=1)) for of in of_each]
    r_hat = [float(array_stats.rhat_nested(of, group, chain_axis=0, draw_axis=1)) for of in of_each]
    chains = {"point": (("step", "walker", "parameter"), points)}
    return xarray.Dataset(chains | {"effective": ("parameter", effective), "r_hat": ("parameter", r_hat)})


def is_converged(chains: xarray.Dataset, effective: int) -> bool:
    """Whether all parameters have this effective sample size and a small R-hat."""
    return bool(chains["effective"].min() >= effective and chains["r_hat"].max() <= LARGEST_R_HAT)


def to_dataset(fit: Fit, chains: xarray.Dataset, scores: xarray.Dataset, made_by: Mapping[str, str]) -> xarray.Dataset:
    """Gather a posterior, in the units of the Datasets.

    Args:
        scores: of the points of the chains, step by step, as `evaluate` gives them.
    """
    points, wanted = chains["point"].values.reshape(-1, len(fit.parameters)), fit.file.sampling
    rng = np.random.default_rng([wanted.seed, 2])
    which = rng.choice(len(points), wanted.draws, replace=len(points) < wanted.draws)
    meanings = {
        str(HIT_Y): {"units": "m", "long_name": HIT_Y.long_name},
        str(HIT_Z): {"units": "m", "long_name": HIT_Z.long_name},
        "log_likelihood": {"long_name": "logarithm of the likelihood"},
        "misfit": {"long_name": "smallest sum of squares over the uncertainties"},
    }
    columns: dict[str, Any] = {
        name: (("draw", "shot"), scores[name].values[which], meaning) for name, meaning in meanings.items()
    }
    for column, parameter in enumerate(fit.parameters):
        normal, quality = points[:, column], chains.isel(parameter=column)
        factor = np.degrees(1.0) if parameter.quantity.unit == "rad" else 1.0
        described = {
            "units": parameter.quantity.display.stored,
            "path": parameter.place,
            "r_hat": float(quality["r_hat"]),
            "effective_sample_size": float(quality["effective"]),
            "verdict": verdict(normal),
            "prior": factor * parameter.prior.quantile(np.linspace(0.0025, 0.9975, 200)),
        }
        columns[parameter.name] = ("draw", factor * parameter.at(normal[which]), described)
    noise, interrupted = float(np.sqrt((scores["noise"].values ** 2).sum(axis=1).mean())), chains.attrs["interrupted"]
    converged = is_converged(chains, wanted.effective) and noise <= LARGEST_NOISE and not interrupted
    attributes = {
        attr.KIND: POSTERIOR.mark,
        attr.TITLE: fit.file.title,
        attr.HISTORY: attr.history_line("identify"),
        "fit": fit.text,
        **made_by,
        attr.SEED: wanted.seed,
        "effective_sample_size": float(chains["effective"].min()),
        "wanted_sample_size": wanted.effective,
        "r_hat": float(chains["r_hat"].max()),
        "hit_noise": noise,
        "converged": int(converged),
        "interrupted": interrupted,
    }
    names = [shot.name for shot in fit.shots]
    numbered = [name if names.count(name) == 1 else f"{name} [{place}]" for place, name in enumerate(names)]
    return xarray.Dataset(columns, {"shot": numbered, "draw": np.arange(len(which))}, attributes)


def verdict(normal: Array) -> str:
    """What the shots say of a parameter, from its posterior on the scale where the prior is standard normal."""
    if stats.ks_1samp(normal, stats.norm.cdf, method="asymp").statistic < UNCHANGED_DISTANCE:
        return "not determined by these shots"
    low, high = stats.norm.cdf(np.quantile(normal, [0.025, 0.975]))
    return "hardly determined" if high - low > HARDLY_DETERMINED else "determined"


def parameters_of(posterior: xarray.Dataset) -> list[str]:
    """Names of the parameters of a posterior."""
    return [str(name) for name, array in posterior.data_vars.items() if "path" in array.attrs]


def material_draws(fit: Fit, posterior: xarray.Dataset) -> pd.DataFrame:
    """Draws of the material, a column for each quantity that `hits.file` takes."""
    values = {parameter.place: posterior[parameter.name].values for parameter in fit.scene_parameters}
    columns = columns_of(values, fit.scene_of(fit.shots[0]).target.layers[0])
    return pd.DataFrame(
        {name: column for name, column in columns.items() if name != "thickness" and QUANTITIES[name].table != "core"}
    )


def posterior_view(posterior: xarray.Dataset) -> View:
    """What the shots say of each parameter, and how good the computation is."""
    names, attributes, rows = parameters_of(posterior), posterior.attrs, dict[str, dict[str, str]]()
    for name in names:
        array = posterior[name]
        unit = STORED[array.attrs["units"]]
        low, middle, high = unit.factor * np.quantile(array.values, [0.025, 0.5, 0.975])
        first, last = unit.factor * np.quantile(array.attrs["prior"], [0.025, 0.975])
        rows[f"{name} [{unit.shown}]" if unit.shown else name] = {
            "median": f"{middle:.3g}",
            "95 % interval": f"{low:.3g} to {high:.3g}",
            "95 % of the prior": f"{first:.3g} to {last:.3g}",
            "R-hat": f"{array.r_hat:.3f}",
            "ESS": f"{array.effective_sample_size:.0f}",
            "verdict": array.attrs["verdict"],
        }
    ranks = posterior[names].to_dataframe().corr("spearman").to_numpy()
    correlations = [
        f"{one} and {other} are determined together more than each alone: their correlation is {value:+.2f}"
        for (i, one), (k, other) in combinations(enumerate(names), 2)
        if abs(value := float(ranks[i, k])) > REPORTED_CORRELATION
    ]
    table = pd.DataFrame.from_dict(rows, orient="index").rename_axis("parameter")
    effective, r_hat, noise = (float(attributes[name]) for name in ("effective_sample_size", "r_hat", "hit_noise"))
    wanted, smallest = attributes["wanted_sample_size"], posterior.misfit.values.sum(axis=1).min()
    quality = [
        f"{count_text(posterior.computed_sets, 'set')} of parameters, smallest misfit {smallest:.3g}; "
        f"effective sample size {effective:.0f}, R-hat {r_hat:.3f}; the hits leave ±{noise:.2g} in ln L"
    ]
    causes = {
        "it was interrupted": attributes["interrupted"],
        f"the effective sample size is below {wanted}: give more sets": effective < wanted,
        f"R-hat is above {LARGEST_R_HAT}: give more sets": r_hat > LARGEST_R_HAT,
        f"the hits leave more than ±{LARGEST_NOISE} in ln L: give more hits": noise > LARGEST_NOISE,
    }
    if not attributes["converged"]:
        quality.append("NOT CONVERGED: " + "; ".join(text for text, applies in causes.items() if applies))
    return {str(attributes[attr.TITLE]): [table, *correlations], "quality": quality}
