"""Whether the better of two plates is better for the true parameters, too, where shots draw theirs from a posterior.

The interval of a difference describes the mean over all draws, and narrows with the number of hits. The true parameters
are one draw: what counts is for how many draws the difference has the same sign (statistics/random_effects.py). Shot k
has the same draw at every plate of a comparison, and the differences shot by shot are grouped by it.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.results.measures import Array, dealing
from warpimpact.statistics.intervals import Estimate
from warpimpact.statistics.random_effects import FEWEST, interval_of_means, positive_share

if TYPE_CHECKING:
    import xarray

    from warpimpact.results.table import Result


@dataclass(frozen=True)
class Survival:
    """Probability that a difference has its sign for the true parameters; NaN where it is not known.

    Attributes:
        probability: share of the posterior's draws for which it has that sign.
        at_least: lower end of the one-sided interval of that, as the hits leave it.
        needed: probability from which a verdict survives, and confidence of `at_least`.
        reason: why it is not known; empty where it is.
    """

    probability: float
    at_least: float
    needed: float
    reason: str = ""

    @property
    def survives(self) -> bool | None:
        """Whether the verdict survives the uncertainty of the parameters; None if the hits do not tell."""
        if math.isnan(self.probability) or self.at_least < self.needed <= self.probability:
            return None
        return self.at_least >= self.needed


def over_draws(dataset: Result, estimate: Estimate, numbers: Array, *, units: str = "", kind: str = "mean") -> Estimate:
    """An estimate with its interval by the parameters, where shots draw these from a posterior.

    Args:
        numbers: of all shots, whose mean moves with the draw as the estimate does, shape [hits].
        units: of the numbers; with units of a discrepancy that the result asks to count, this adds to every draw.
        kind: of the estimate; a "quantile" moves as the mean of the numbers.
    """
    if v.POSTERIOR_DRAW not in dataset:
        return estimate
    counted = dataset.attrs.get(attr.DISCREPANCY_COUNTS, 0)
    beside = json.loads(dataset.attrs.get(attr.DISCREPANCY, "{}")).get(units, 0.0) if counted else 0.0
    finite = np.where(np.isinf(numbers), np.nan, numbers)
    draws = np.asarray(dataset[v.POSTERIOR_DRAW].values)
    low, high = interval_of_means(finite, draws, images=dealing(dataset)["images"], beside=float(beside))
    shift = estimate.value - float(np.nanmean(finite)) if kind == "quantile" and np.isfinite(finite).any() else 0.0
    if not math.isnan(estimate.low + estimate.high):  # the hits leave the number of one draw no more certain than that
        low, high = min(low, estimate.low - shift), max(high, estimate.high - shift)
    return replace(estimate, parameters=(low + shift, high + shift))


def draws_note(dataset: Result) -> str:
    """What the two intervals of a result with a posterior are, and whether they count the discrepancy; else empty."""
    if v.POSTERIOR_DRAW not in dataset:
        return ""
    shown = {"m s-1": " m/s", "degree": "°"}
    sizes = json.loads(dataset.attrs.get(attr.DISCREPANCY, "{}"))
    told = " and ".join(f"{size:.2g}{shown[unit]}" for unit, size in sizes.items())
    counts = "counts in them" if dataset.attrs.get(attr.DISCREPANCY_COUNTS) else "does not count in them"
    found = f"that the fit found, {told}, {counts}" if told else "of the fit is not known"
    asking = " (warpimpact inspect --discrepancy counts it)" if told and "not" in counts else ""
    return (
        "Intervals by hits are of the mean over all draws of the posterior; those by parameters contain the number for "
        f"95 % of the draws, of which the true material is one. The discrepancy {found}{asking}."
    )


def survival_of(
    datasets: tuple[xarray.Dataset, xarray.Dataset],
    numbers: tuple[Array, Array],
    value: float,
    *,
    reason: str,
    confidence: float,
) -> Survival | None:
    """Whether the sign of a difference survives; None where no result draws its parameters from a posterior.

    Args:
        numbers: of the shots of both plates, whose means are compared, shape [hits] each.
        value: the difference of the means.
        reason: why the numbers are not compared by draws, if so.
    """
    drawn = [dataset[v.POSTERIOR_DRAW].values for dataset in datasets if v.POSTERIOR_DRAW in dataset]
    if not drawn:
        return None
    common = min(map(len, numbers))
    if len(drawn) < 2:
        reason = "only one of the plates draws its parameters from a posterior"
    elif not reason and not np.array_equal(drawn[0][:common], drawn[1][:common]):
        reason = "their shots have different draws"
    if not reason:
        apart = math.copysign(1.0, value) * (numbers[0][:common] - numbers[1][:common])
        images = dealing(datasets[0])["images"]
        found = positive_share(apart, drawn[0][:common], images=images, confidence=confidence)
        if found is not None:
            return Survival(found.share, found.at_least, confidence)
        reason = f"fewer than {FEWEST} draws have two shots that count"
    return Survival(math.nan, math.nan, confidence, reason)


def why_not_by_draws(measure: str, numbers: tuple[Array, Array], *, independent: str, by_ratio: bool) -> str:
    """Why the numbers of two plates do not tell the difference for each draw; empty where they do.

    Args:
        independent: why the plates are compared as independent, if so.
        by_ratio: the numbers are those of ratios to the solid plate.
    """
    if independent:
        return independent
    if measure.endswith("_worst_tenth"):
        return "the worst tenth is that of all draws together"
    if by_ratio and len(numbers[0]) != len(numbers[1]):
        return "a ratio to the solid plate needs as many hits of both plates"
    return ""


def survival_text(survival: Survival | None) -> str:
    """What to append to a verdict."""
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
    """Two decimals, not rounded up over the limit that it was compared with."""
    return f"{math.floor(100.0 * probability + 1e-9) / 100.0:.2f}"
