"""Estimates of measures, gathered over shots: intervals, and the shift by the numerics."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Unpack

import numpy as np

from warpimpact.results import attributes as attr
from warpimpact.results.dataset import is_choice
from warpimpact.results.measures import Measure
from warpimpact.results.per_hit import Array
from warpimpact.statistics.intervals import Dealt, Estimate, Estimating, estimate_of
from warpimpact.statistics.shifts import shift_of_mean, shift_of_quantile, shift_of_share, shift_of_yes
from warpimpact.statistics.tails import has_interval

if TYPE_CHECKING:
    from warpimpact.results.table import Result


class Tally:
    """Gathers a measure over shots, in the order of their numbers.

    Means and probabilities keep a few numbers in all. A quantile and a worst tenth keep one number per shot. How shots
    are dealt is as in `Dealt`.
    """

    def __init__(self, measure: Measure, **dealt: Unpack[Estimating]) -> None:
        kind = "share" if measure.is_binary else measure.kind
        self.measure, self._arguments = measure, dealt
        self._kept: list[Array] = []
        self._dealt = Dealt(kind, share=measure.share, **dealt)

    def add(self, dataset: Result) -> None:
        """Add the next shots."""
        values = self.measure.values(dataset)
        if self.measure.kind in ("mean", "quantile", "probability", "share"):
            self._dealt.add(values)
        else:
            self._kept.append(values)

    def estimate(self) -> Estimate:
        """The estimate from the shots so far."""
        if not self._kept:
            return self._dealt.estimate().within(self.measure.least, self.measure.most)
        return estimate_from(self.measure, np.concatenate(self._kept), **self._arguments)


def estimate_from(measure: Measure, values: Array, **dealt: Unpack[Estimating]) -> Estimate:
    """A measure with its interval, from the values of all shots. A worst point and a number of the target have none."""
    known = values[~np.isnan(values)]
    if not measure.has_interval or not len(known):
        worst = measure.worse * float(np.max(measure.worse * known)) if len(known) else math.nan
        return Estimate(worst, math.nan, math.nan, len(known), math.nan)
    kind = "share" if measure.is_binary else "quantile" if measure.kind == "quantile" else "mean"
    estimate = estimate_of(kind, measure.averaged(values), share=measure.share, **dealt)
    if measure.kind == "worst_tenth" and not has_interval(estimate.count):
        estimate = replace(estimate, low=math.nan, high=math.nan)
    return estimate.within(measure.least, measure.most)


def shift_of(measure: Measure, levels: tuple[Result, Result] | None, confidence: float = 0.95) -> float | None:
    """Upper estimate of the shift of a measure by the numerics, from hits at two levels (`finer_pair`); None without
    them."""
    if levels is None or not measure.has_interval:
        return None
    dealt: Estimating = {"confidence": confidence}
    coarse, fine = (measure.by_hit(level) for level in levels)
    match measure.kind:
        case "quantile":
            return shift_of_quantile(coarse, fine, measure.share, **dealt)
        case "probability":
            return shift_of_share(measure.margin(coarse), measure.margin(fine), **dealt)
        case "share":
            margin = measure.quantity.margin
            if margin is None:
                return shift_of_yes(coarse, fine, **dealt)
            return shift_of_share(margin(levels[0]), margin(levels[1]), **dealt)
    averaged = (measure.averaged(measure.counted(numbers)) for numbers in (coarse, fine))
    return shift_of_mean(*averaged, **dealt)


def dealing(dataset: Result) -> Estimating:
    """Arguments of `Dealt` for the sampling of a result. Chosen hits are no longer in the order of the replicates."""
    return {"replicates": 1 if is_choice(dataset) else int(dataset.attrs.get(attr.REPLICATES, 1))}
