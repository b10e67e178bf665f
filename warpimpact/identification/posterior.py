"""The posterior of a fit as a Dataset: draws along `draw`, what the shots say of each parameter, and its view."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations
from typing import Any, Self

import numpy as np
import pandas as pd
import xarray
from scipy import stats

from warpimpact.analysis.numbers import View
from warpimpact.identification.fit import Fit, columns_of
from warpimpact.identification.likelihood import Scores
from warpimpact.results import attributes as attr
from warpimpact.results import posterior_file as p
from warpimpact.results.kinds import POSTERIOR
from warpimpact.results.variables import HIT_Y, HIT_Z
from warpimpact.scene.model import Array
from warpimpact.scene.quantities import QUANTITIES
from warpimpact.scene.units import STORED

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


@dataclass(frozen=True)
class Chains:
    """Chains without their first third.

    Attributes:
        points: standard normal numbers, shape [steps, walkers, parameters].
        blobs: what the density gave beside its logarithm, shape [steps, walkers, columns]; None if nothing.
        effective, r_hat: effective sample size and R-hat of each parameter. R-hat compares four groups of walkers
            (C. C. Margossian and others, "Nested R-hat", 2022).
    """

    points: Array
    blobs: Any
    effective: Array
    r_hat: Array
    interrupted: bool

    @classmethod
    def of(cls, sampler: Any, *, interrupted: bool) -> Self:
        """The chains of an emcee sampler."""
        from arviz_stats.base import array_stats

        done = int(sampler.iteration)
        points = sampler.get_chain(discard=done // 3)
        group = np.arange(points.shape[1]) % _GROUPS_OF_WALKERS
        of_each = [column.T for column in np.moveaxis(points, 2, 0)]
        effective = np.array([float(array_stats.ess(of, chain_axis=0, draw_axis=1)) for of in of_each])
        r_hat = [float(array_stats.rhat_nested(of, group, chain_axis=0, draw_axis=1)) for of in of_each]
        return cls(points, sampler.get_blobs(discard=done // 3), effective, np.array(r_hat), interrupted)

    def is_converged(self, effective: int) -> bool:
        """Whether all parameters have this effective sample size and a small R-hat."""
        return bool(self.effective.min() >= effective and self.r_hat.max() <= LARGEST_R_HAT)


def to_dataset(fit: Fit, chains: Chains, scores: Scores, made_by: Mapping[str, str]) -> xarray.Dataset:
    """Gather a posterior, in the units of the Datasets."""
    steps, walkers, _ = chains.points.shape
    rng = np.random.default_rng([fit.file.sampling.seed, 2])
    which = rng.choice(steps * walkers, fit.file.sampling.draws, replace=steps * walkers < fit.file.sampling.draws)
    scores = Scores(*(of.reshape(steps * walkers, -1) for of in scores))
    over = ("draw", "shot")
    columns: dict[str, Any] = {
        str(HIT_Y): (over, scores.hit_y[which], {"units": "m", "long_name": HIT_Y.long_name}),
        HIT_Z: (over, scores.hit_z[which], {"units": "m", "long_name": HIT_Z.long_name}),
        p.LOG_LIKELIHOOD: (over, scores.log_likelihood[which], {"long_name": "logarithm of the likelihood"}),
        p.MISFIT: (over, scores.misfit[which], {"long_name": "smallest sum of squares over the uncertainties"}),
    }
    for column, parameter in enumerate(fit.parameters):
        normal = chains.points[..., column].ravel()
        factor = np.degrees(1.0) if parameter.quantity.unit == "rad" else 1.0
        described = {
            "units": parameter.quantity.display.stored,
            p.PATH: parameter.place,
            p.R_HAT: chains.r_hat[column],
            p.EFFECTIVE: chains.effective[column],
            p.VERDICT: verdict(normal),
            p.PRIOR: factor * parameter.prior.quantile(np.linspace(0.0025, 0.9975, 200)),
        }
        columns[parameter.name] = ("draw", factor * parameter.at(normal[which]), described)
    noise = float(np.sqrt((scores.noise**2).sum(axis=1).mean()))
    converged = chains.is_converged(fit.file.sampling.effective) and noise <= LARGEST_NOISE and not chains.interrupted
    attributes = {
        attr.KIND: POSTERIOR.mark,
        attr.TITLE: fit.file.title,
        attr.HISTORY: attr.history_line("identify"),
        p.FIT_TEXT: fit.text,
        **made_by,
        attr.SEED: fit.file.sampling.seed,
        p.EFFECTIVE: chains.effective.min(),
        p.WANTED: fit.file.sampling.effective,
        p.R_HAT: chains.r_hat.max(),
        p.HIT_NOISE: noise,
        p.CONVERGED: int(converged),
        p.INTERRUPTED: int(chains.interrupted),
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
    return [str(name) for name, array in posterior.data_vars.items() if p.PATH in array.attrs]


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
        first, last = unit.factor * np.quantile(array.attrs[p.PRIOR], [0.025, 0.975])
        rows[f"{name} [{unit.shown}]" if unit.shown else name] = {
            "median": f"{middle:.3g}",
            "95 % interval": f"{low:.3g} to {high:.3g}",
            "95 % of the prior": f"{first:.3g} to {last:.3g}",
            "R-hat": f"{array.attrs[p.R_HAT]:.3f}",
            "ESS": f"{array.attrs[p.EFFECTIVE]:.0f}",
            "verdict": array.attrs[p.VERDICT],
        }
    ranks = posterior[names].to_dataframe().corr("spearman").to_numpy()
    correlations = [
        f"{one} and {other} are determined together more than each alone: their correlation is {value:+.2f}"
        for (i, one), (k, other) in combinations(enumerate(names), 2)
        if abs(value := float(ranks[i, k])) > REPORTED_CORRELATION
    ]
    table = pd.DataFrame.from_dict(rows, orient="index").rename_axis("parameter")
    effective, r_hat, noise = (float(attributes[name]) for name in (p.EFFECTIVE, p.R_HAT, p.HIT_NOISE))
    quality = [
        f"{attributes[p.SETS]} sets of parameters, smallest misfit {posterior[p.MISFIT].values.sum(axis=1).min():.3g}; "
        f"effective sample size {effective:.0f}, R-hat {r_hat:.3f}; the hits leave ±{noise:.2g} in ln L"
    ]
    causes = {
        "it was interrupted": attributes[p.INTERRUPTED],
        f"the effective sample size is below {attributes[p.WANTED]}: give more sets": effective < attributes[p.WANTED],
        f"R-hat is above {LARGEST_R_HAT}: give more sets": r_hat > LARGEST_R_HAT,
        f"the hits leave more than ±{LARGEST_NOISE} in ln L: give more hits": noise > LARGEST_NOISE,
    }
    if not attributes[p.CONVERGED]:
        quality.append("NOT CONVERGED: " + "; ".join(text for text, applies in causes.items() if applies))
    return {str(attributes[attr.TITLE]): [table, *correlations], "quality": quality}
