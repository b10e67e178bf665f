"""Whether the better of two plates is also better for the true parameters, where shots draw their parameters from a
posterior.

The interval of a difference describes the mean over all draws, and narrows with the number of hits. The true parameters
are one draw, so what counts is for how many draws the difference has the same sign (statistics/random_effects.py). Shot
k
has the same draw at every plate of a comparison, and the differences shot by shot are grouped by draw.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.results.per_hit import Array
from warpimpact.results.tallies import dealing
from warpimpact.statistics.intervals import Estimate
from warpimpact.statistics.random_effects import FEWEST_GROUPS, interval_of_means, positive_share
from warpimpact.statistics.tails import OrderWeights, pseudo_values

if TYPE_CHECKING:
    import xarray

    from warpimpact.results.table import Result


@dataclass(frozen=True)
class Survival:
    """Probability that a difference has its sign for the true parameters; NaN where unknown.

    Attributes:
        probability: share of the posterior's draws for which it has this sign.
        at_least: lower end of the one-sided interval of `probability` by the hits.
        needed: probability from which a verdict survives, and confidence of `at_least`.
        reason: why it is unknown; empty where it is known.
        interval: interval of the difference for the true parameters.
    """

    probability: float
    at_least: float
    needed: float
    reason: str = ""
    interval: tuple[float, float] = (math.nan, math.nan)

    @property
    def survives(self) -> bool | None:
        """Whether the verdict survives the uncertainty of the parameters; None if the hits do not decide."""
        if math.isnan(self.probability) or self.at_least < self.needed <= self.probability:
            return None
        return self.at_least >= self.needed


def by_draws(dataset: Result, values: Array, weights: OrderWeights) -> Array:
    """Numbers of shots whose mean over the shots of a draw is the worst tenth, or the quantile, of this draw, from
    values of the first shots, shape [shots]."""
    if v.POSTERIOR_DRAW not in dataset:
        return values
    draws = np.asarray(dataset[v.POSTERIOR_DRAW].values)[: len(values)]
    return pseudo_values(values, draws, weights, images=dealing(dataset)["images"])


def over_draws(dataset: Result, estimate: Estimate, numbers: Array, *, units: str = "") -> Estimate:
    """An estimate with its interval by the parameters, where shots draw these from a posterior.

    Args:
        numbers: numbers of all shots, whose mean over the shots of a draw is the estimated number for this draw, shape
            [hits].
        units: units of the numbers. If the result asks to count a discrepancy in these units, it adds to every draw.
    """
    if v.POSTERIOR_DRAW not in dataset:
        return estimate
    counted = dataset.attrs.get(attr.DISCREPANCY_COUNTS, 0)
    beside = json.loads(dataset.attrs.get(attr.DISCREPANCY, "{}")).get(units, 0.0) if counted else 0.0
    finite = np.where(np.isinf(numbers), np.nan, numbers)
    draws = np.asarray(dataset[v.POSTERIOR_DRAW].values)
    low, high = interval_of_means(finite, draws, images=dealing(dataset)["images"], beside=float(beside))
    return replace(estimate, parameters=_no_less((low, high), (estimate.low, estimate.high)))


def _no_less(by_parameters: tuple[float, float], by_hits: tuple[float, float]) -> tuple[float, float]:
    """An interval by the parameters that is at least as wide as that by the hits, which also bound the number of a
    draw."""
    if math.isnan(sum(by_hits)):
        return by_parameters
    return min(by_parameters[0], by_hits[0]), max(by_parameters[1], by_hits[1])


def draws_note(dataset: Result) -> str:
    """A note on the two intervals of a result with a posterior, and on the discrepancy in them; else empty."""
    if v.POSTERIOR_DRAW not in dataset:
        return ""
    shown = {"m s-1": " m/s", "degree": "°"}
    sizes = json.loads(dataset.attrs.get(attr.DISCREPANCY, "{}"))
    sizes_text = " and ".join(f"{size:.2g}{shown[unit]}" for unit, size in sizes.items())
    counts = "counts in them" if dataset.attrs.get(attr.DISCREPANCY_COUNTS) else "does not count in them"
    discrepancy = f"that the fit found, {sizes_text}, {counts}" if sizes_text else "of the fit is not known"
    asking = " (warpimpact inspect --discrepancy counts it)" if sizes_text and "not" in counts else ""
    return (
        "Intervals by hits are of the mean over all draws of the posterior; those by parameters contain the number for "
        f"95 % of the draws, of which the true material is one. The discrepancy {discrepancy}{asking}."
    )


def survival_of(
    datasets: tuple[xarray.Dataset, xarray.Dataset],
    numbers: tuple[Array, Array],
    by_hits: tuple[float, float, float],
    *,
    reason: str,
    confidence: tuple[float, float],
) -> Survival | None:
    """Whether the sign of a difference survives; None if no result draws its parameters from a posterior.

    Args:
        numbers: numbers of the shots of both plates, whose means over the shots of a draw are compared, shape [hits]
            each.
        by_hits: difference of the means over all shots, with its interval by the hits.
        reason: why the numbers are not compared by draws; empty if they are.
        confidence: confidence of the sign, and of the interval of the difference.
    """
    drawn = [dataset[v.POSTERIOR_DRAW].values for dataset in datasets if v.POSTERIOR_DRAW in dataset]
    if not drawn:
        return None
    common = min(map(len, numbers))
    if len(drawn) < 2:
        reason = "only one of the plates draws its parameters from a posterior"
    elif not reason and not np.array_equal(drawn[0][:common], drawn[1][:common]):
        reason = "their shots have different draws"
    if reason:
        return Survival(math.nan, math.nan, confidence[0], reason)
    apart = numbers[0][:common] - numbers[1][:common]
    images, draws = dealing(datasets[0])["images"], drawn[0][:common]
    positive = positive_share(math.copysign(1.0, by_hits[0]) * apart, draws, images=images, confidence=confidence[0])
    if positive is None:
        return Survival(
            math.nan, math.nan, confidence[0], f"fewer than {FEWEST_GROUPS} draws have the shots that it takes"
        )
    interval = interval_of_means(apart, draws, images=images, confidence=confidence[1])
    return Survival(positive.share, positive.at_least, confidence[0], interval=_no_less(interval, by_hits[1:]))


def survival_text(survival: Survival | None) -> str:
    """Words to append to a verdict."""
    if survival is None:
        return ""
    if survival.reason:
        return f"; whether this survives the uncertainty of the parameters is not known: {survival.reason}"
    verdict = {
        True: "survives",
        False: "does not survive",
        None: "these hits do not tell whether it survives",
    }[survival.survives]
    probability, at_least = _floored(survival.probability), _floored(survival.at_least)
    return f"; {verdict} the uncertainty of the parameters (P = {probability}, at least {at_least})"


def _floored(probability: float) -> str:
    """Two decimals, not rounded up over the limit of the comparison."""
    return f"{math.floor(100.0 * probability + 1e-9) / 100.0:.2f}"
