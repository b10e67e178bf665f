"""The posterior of a fit as a tree of Datasets, and the numbers that measure its accuracy."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
import xarray
from numpy.typing import NDArray

from warpimpact.identification.fit import Fit
from warpimpact.identification.likelihood import KEPT_HITS, ShotScore
from warpimpact.identification.scoring import data_of, discrepancies
from warpimpact.results import attributes as attr
from warpimpact.results import posterior_file
from warpimpact.results.kinds import POSTERIOR
from warpimpact.results.variables import HIT_Y, HIT_Z
from warpimpact.scene.display import UNITS
from warpimpact.scene.model import Array
from warpimpact.scene.quantities import QUANTITIES
from warpimpact.solver.columns import columns_of
from warpimpact.statistics.importance import LARGEST_K, Weights, resampled

LARGEST_NOISE = 0.5
"""Largest standard error of ln L, over all shots, at which the hits count as integrated out."""
ALIKE = 0.15
"""Largest distance between the distribution functions of prior and posterior at which they count as equal."""
WIDE = 0.6
"""Share of the prior within the posterior's 90 % interval (0.9 if nothing was learnt) above which little was learnt."""
STRONG = 0.7
"""Correlation above which two parameters are reported as a combination."""
_DENSITY_DRAWS = 400
"""Number of predicted rows whose probability is compared with that of the measured row."""


@dataclass(frozen=True)
class Sampled:
    """Sets of parameters with their scores and weights.

    Attributes:
        points: standard normal numbers, shape [sets, parameters].
        scores: one per shot.
        block: number of consecutive sets that differ in the scales of discrepancy alone.
    """

    points: Array
    scores: list[ShotScore]
    weights: Weights
    block: int = 1

    @property
    def effective(self) -> float:
        return self.weights.effective(self.block)


def to_datatree(fit: Fit, sampled: Sampled, made: Mapping[str, str]) -> xarray.DataTree:
    """Gather a posterior, in the units of the Datasets."""
    rng = np.random.default_rng(np.random.SeedSequence(fit.sampling.seed, spawn_key=(2,)))
    which = resampled(sampled.weights.values, fit.sampling.draws, rng)
    kept = rng.integers(KEPT_HITS, size=len(which))
    hits = np.stack([score.fitted_hit[which, kept] for score in sampled.scores], axis=1)
    likelihood = np.stack([score.log_likelihood for score in sampled.scores], axis=-1)
    noise = np.sqrt(sum(score.noise[which] ** 2 for score in sampled.scores))
    groups: dict[str, xarray.Dataset] = {
        "posterior": _parameters(fit, sampled.points[which], "draw").assign(
            {name: (("draw", "shot"), hits[..., axis], _place(name)) for axis, name in enumerate(posterior_file.HITS)}
        ),
        "prior": _parameters(fit, rng.standard_normal((fit.sampling.draws, len(fit.parameters))), "draw"),
        "sample_stats": xarray.Dataset(
            {
                "lp": ("draw", likelihood[which].sum(axis=1), {"long_name": "logarithm of the likelihood"}),
                "hit_noise": ("draw", noise, {"long_name": "its standard error, by the number of hit points"}),
                "set": ("draw", which, {"long_name": "place in the group sets"}),
            }
        ),
        "log_likelihood": xarray.Dataset({posterior_file.MEASURED: (("draw", "shot"), likelihood[which])}),
        "observed_data": _observed(fit),
        "posterior_predictive": _computed(fit, sampled, which, kept),
    }
    for name, group in groups.items():
        if "draw" in group.dims:
            groups[name] = group.expand_dims(chain=[0]).assign_coords(draw=np.arange(group.sizes["draw"]))
    groups["sets"] = _parameters(fit, sampled.points, "set").assign(
        weight=("set", sampled.weights.values, {"long_name": "normalised importance weight"}),
        log_likelihood=(("set", "shot"), likelihood),
        misfit=(("set", "shot"), np.stack([score.misfit for score in sampled.scores], axis=-1)),
    )
    groups["best"] = _best(fit, sampled)
    shots = {"shot": _names(fit)}
    groups = {name: group.assign_coords(shots) if "shot" in group.dims else group for name, group in groups.items()}
    return xarray.DataTree.from_dict({"/": xarray.Dataset(attrs=_attributes(fit, sampled, made, noise)), **groups})


def _names(fit: Fit) -> list[str]:
    """Names of the shots; equal names get a number."""
    names = [shot.name for shot in fit.shots]
    return [name if names.count(name) == 1 else f"{name} [{place}]" for place, name in enumerate(names)]


def _place(name: str) -> dict[str, str]:
    return {"units": "m", "long_name": {"hit_y": HIT_Y, "hit_z": HIT_Z}[name].long_name}


def _parameters(fit: Fit, points: Array, dim: str) -> xarray.Dataset:
    """Values of the parameters at standard normal numbers."""
    columns = {}
    for column, parameter in enumerate(fit.parameters):
        values = parameter.at(points[:, column])
        described = {
            "units": UNITS[parameter.unit].stored,
            posterior_file.PATH: json.dumps(parameter.path),
            "prior": parameter.prior.model_dump_json(),
        }
        columns[parameter.name] = (dim, np.degrees(values) if parameter.unit == "rad" else values, described)
    return xarray.Dataset(columns)


def _along_observations(fit: Fit) -> dict[str, Any]:
    measured = [
        (name, number) for name, shot in zip(_names(fit), fit.shots, strict=True) for number in shot.observations
    ]
    return {
        "observation": [f"{shot}: {number.label}" for shot, number in measured],
        posterior_file.SHOT_OF: ("observation", [shot for shot, _ in measured]),
        posterior_file.UNITS_OF: ("observation", [number.units for _, number in measured]),
    }


def _observed(fit: Fit) -> xarray.Dataset:
    columns = {
        name: _numbers(fit, [np.array([getattr(number, of) for number in shot.observations]) for shot in fit.shots])
        for name, of in ((posterior_file.MEASURED, "value"), (posterior_file.STD, "std"))
    }
    return xarray.Dataset(
        {name: ("observation", numbers) for name, numbers in columns.items()}, _along_observations(fit)
    )


def _numbers(fit: Fit, of_shots: Sequence[Array]) -> Array:
    """Numbers of all observations side by side, in the units of the Dataset.

    Args:
        of_shots: numbers of the observations of each shot, along the last axis, SI.
    """
    shown = [
        observation.shown(numbers[..., [index]])
        for shot, numbers in zip(fit.shots, of_shots, strict=True)
        for index, observation in enumerate(shot.observations)
    ]
    return np.concatenate([of_shots[0][..., :0], *shown], axis=-1)


def _computed(fit: Fit, sampled: Sampled, which: NDArray[np.int64], kept: NDArray[np.int64]) -> xarray.Dataset:
    """What another shot like each would show, and what each draw computes at its hit."""
    scores, over = sampled.scores, ("draw", "observation")
    predicted = _numbers(fit, [score.predicted[which, kept] for score in scores])
    fitted = _numbers(fit, [score.fitted[which, kept] for score in scores])
    return xarray.Dataset(
        {
            posterior_file.MEASURED: (over, predicted, {"long_name": "of another such shot, measured"}),
            posterior_file.FITTED: (over, fitted, {"long_name": "computed for this shot, at its hit"}),
        },
        _along_observations(fit),
    )


def _best(fit: Fit, sampled: Sampled) -> xarray.Dataset:
    """The set with the smallest sum of the shots' misfits at their best hits."""
    misfit = np.stack([score.misfit for score in sampled.scores], axis=-1)
    best = int(misfit.sum(axis=1).argmin())
    dataset = _parameters(fit, sampled.points[[best]], "set").isel(set=0)
    hits = np.stack([score.best_hit[best] for score in sampled.scores])
    return dataset.assign(
        misfit=("shot", misfit[best], {"long_name": "sum of (computed − measured)² over the squared uncertainty"}),
        hit_y=("shot", hits[:, 0], _place("hit_y")),
        hit_z=("shot", hits[:, 1], _place("hit_z")),
        measured=("observation", _numbers(fit, [score.best[best] for score in sampled.scores])),
    ).assign_coords(_along_observations(fit))


def _attributes(fit: Fit, sampled: Sampled, made: Mapping[str, str], noise: Array) -> dict[str, Any]:
    weights = sampled.weights
    hit_noise = float(np.sqrt(np.mean(noise**2)))
    rows = {
        name: row_probability(fit, place, sampled)
        for place, name in enumerate(_names(fit))
        if fit.shots[place].observations
    }
    return {
        attr.KIND: POSTERIOR.mark,
        attr.TITLE: fit.title,
        attr.HISTORY: attr.history_line("identify"),
        posterior_file.FIT_TEXT: fit.text,
        **made,
        attr.SEED: fit.sampling.seed,
        posterior_file.EFFECTIVE: sampled.effective,
        posterior_file.PARETO_K: weights.pareto_k,
        posterior_file.HIT_NOISE: hit_noise,
        posterior_file.CONVERGED: int(is_converged(fit, sampled, hit_noise)),
        posterior_file.EVIDENCE: weights.log_evidence,
        posterior_file.WANTED: fit.sampling.effective,
        posterior_file.SETS: len(sampled.points) // sampled.block,
        "hits": fit.sampling.hits,
        "observations": fit.observed,
        posterior_file.ROW_PROBABILITY: json.dumps(rows),
    }


def material_draws(fit: Fit, tree: xarray.DataTree) -> pd.DataFrame:
    """Draws of the material, a column for each quantity that `hits.file` takes."""
    draws = tree["posterior"].to_dataset()
    values = {parameter.path: draws[parameter.name].values.ravel() for parameter in fit.scene_parameters}
    columns = columns_of(values, fit.scene_of(fit.shots[0]).target.layers[0])
    return pd.DataFrame(
        {name: column for name, column in columns.items() if name != "thickness" and QUANTITIES[name].table != "core"}
    )


def is_converged(fit: Fit, sampled: Sampled, noise: float) -> bool:
    """Whether the weights, and the integration over hits, are accurate enough."""
    trusted = sampled.weights.pareto_k <= LARGEST_K and noise <= LARGEST_NOISE
    return trusted and sampled.effective >= fit.sampling.effective


def row_probability(fit: Fit, place: int, sampled: Sampled) -> float:
    """Probability that another shot like it shows a row that is less probable than the measured one.

    The density of rows is a mixture of normal distributions about the numbers that some sets predict, by their weights.
    A row of a core that did not pass the plate counts as less probable.
    """
    shot, scored = fit.shots[place], sampled.scores[place]
    rng = np.random.default_rng(np.random.SeedSequence(fit.sampling.seed, spawn_key=(3, place)))
    which = resampled(sampled.weights.values, 2000, rng)
    rows = scored.predicted[which, rng.integers(KEPT_HITS, size=len(which))]
    data = data_of(fit, shot)
    spread = data.spread(discrepancies(fit, sampled.points[which]))
    there = ~np.isnan(rows).any(axis=1)
    if not there.any():
        return 0.0
    centres, widths = rows[there], np.sqrt(2.0) * spread[there]

    def density(row: Array) -> float:
        apart = centres - row
        for index, observation in enumerate(shot.observations):
            apart[:, index] = observation.miss(apart[:, index] + observation.value)
        return float(np.mean(np.exp(-0.5 * ((apart / widths) ** 2).sum(axis=1)) / widths.prod(axis=1)))

    measured = density(data.values)
    others = centres[:_DENSITY_DRAWS]
    less = np.mean([density(row) <= measured for row in others])
    return float(less * there.mean() + (1.0 - there.mean()))


@dataclass(frozen=True)
class Learnt:
    """What the shots say about one parameter.

    Attributes:
        distance: largest difference between the distribution functions of prior and posterior.
        kept: share of the prior within the posterior's 90 % interval; 0.9 if nothing was learnt.
        quantiles: 5, 50 and 95 % of the posterior, in the units of the file.
    """

    distance: float
    kept: float
    quantiles: tuple[float, float, float]
    prior: tuple[float, float, float]

    @property
    def verdict(self) -> str:
        if self.distance < ALIKE:
            return "not determined by these shots"
        return "hardly determined" if self.kept > WIDE else "determined"


def learnt(tree: xarray.DataTree) -> dict[str, Learnt]:
    """Comparison of prior and posterior, by parameter."""
    prior, posterior = (tree[name].to_dataset() for name in ("prior", "posterior"))
    by_name = {}
    for name in parameters_of(tree):
        before, after = (np.sort(dataset[str(name)].values.ravel()) for dataset in (prior, posterior))
        grid = np.concatenate([before, after])
        shares = [np.searchsorted(of, grid, side="right") / len(of) for of in (before, after)]
        (low, middle, high), (first, half, last) = (np.quantile(of, [0.05, 0.5, 0.95]) for of in (after, before))
        kept = np.searchsorted(before, high, side="right") - np.searchsorted(before, low)
        by_name[name] = Learnt(
            float(np.abs(shares[0] - shares[1]).max()),
            float(kept / len(before)),
            (float(low), float(middle), float(high)),
            (float(first), float(half), float(last)),
        )
    return by_name


def together(tree: xarray.DataTree) -> list[tuple[str, str, float]]:
    """Pairs of parameters whose combination the shots determine: names, and their rank correlation in the posterior
    where it is strong."""
    from scipy.stats import spearmanr

    posterior, names = tree["posterior"].to_dataset(), parameters_of(tree)
    pairs = [(name, other) for place, name in enumerate(names) for other in names[place + 1 :]]
    ranks = [
        (first, other, spearmanr(posterior[first].values.ravel(), posterior[other].values.ravel()))
        for first, other in pairs
    ]
    return [(first, other, float(rank.statistic)) for first, other, rank in ranks if abs(rank.statistic) > STRONG]


def parameters_of(tree: xarray.DataTree) -> Sequence[str]:
    """Names of the parameters of a posterior."""
    return [str(name) for name in tree["prior"].to_dataset().data_vars]
