"""The report of a laboratory on a test: V50, spread, and an interval of V50."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from warpimpact.firing.fire import Firings
from warpimpact.firing.procedures import MilStd662F, Procedure, within_span
from warpimpact.scene.model import Array, Model
from warpimpact.scene.units import Number
from warpimpact.statistics.quantal import fit_quantal, likelihood_interval, wald_interval


class Estimator(Model):
    """How V50 and spread follow from the shots.

    Attributes:
        name: "probit" or "logit" regression of all shots; "mean" of the stops and perforations that MIL-STD-662F takes,
            or of all levels; "dixon_mood", the sums of the up-and-down method. The default is "mean" for mil_std_662f,
            "probit" for all else.
        interval: of a regression, by the "likelihood" ratio or by Fisher's information ("wald"), or "none".
        confidence: of the interval.
    """

    name: Literal["probit", "logit", "mean", "dixon_mood"] | None = None
    interval: Literal["likelihood", "wald", "none"] = "likelihood"
    confidence: Annotated[Number, Field(gt=0, lt=1)] = 0.95

    @property
    def without_interval(self) -> Estimator:
        """The same estimator without an interval, for V50 and spread alone."""
        return self.model_copy(update={"interval": "none"})


@dataclass(frozen=True)
class Reports:
    """Reports of all tests [m/s]; arrays of shape [tests], NaN where a test reports none.

    Attributes:
        v50: reported V50.
        spread: reported standard deviation; for "mean" the zone of mixed results, from the slowest perforation up to
            the fastest stop, 0 where there is none.
        low, high: interval of V50; an end is infinite where the shots do not bound it.
        shots: number of shots of the test.
    """

    v50: Array
    spread: Array
    low: Array
    high: Array
    shots: NDArray[np.int64]


_LOGISTIC = np.pi / np.sqrt(3.0)
"""Standard deviation of the logistic distribution of scale 1."""


def reported(firings: Firings, procedure: Procedure, estimator: Estimator) -> Reports:
    """Compute the report of every test."""
    velocity, perforated, used = firings.velocity, firings.perforated, firings.used
    name = estimator.name or ("mean" if isinstance(procedure, MilStd662F) else "probit")
    shots, none = used.sum(axis=1), np.full(len(velocity), np.nan)
    if name in ("probit", "logit"):
        fit = fit_quantal(velocity, perforated, used, name)
        ends, confidence = (none, none), estimator.confidence
        if estimator.interval == "likelihood":
            ends = likelihood_interval(velocity, perforated, used, fit, confidence=confidence, link=name)
        elif estimator.interval == "wald":
            ends = wald_interval(velocity, used, fit, confidence=confidence, link=name)
        return Reports(fit.location, fit.scale * (_LOGISTIC if name == "logit" else 1.0), *ends, shots)
    guess = _dixon_mood(firings) if name == "dixon_mood" else _means(firings, procedure)
    return Reports(*guess, none, none, shots)


def _means(firings: Firings, procedure: Procedure) -> tuple[Array, Array]:
    """Means of the stops and perforations that the standard takes, and the zone of mixed results."""
    v50, zone = np.full((2, len(firings.used)), np.nan)
    for test, used in enumerate(firings.used):
        velocity, perforated = firings.velocity[test, used], firings.perforated[test, used]
        stops, perforations = sorted(velocity[~perforated].tolist()), sorted(velocity[perforated].tolist())
        if isinstance(procedure, MilStd662F):
            chosen = within_span(stops, perforations, procedure.pairs, procedure.span)
        else:
            chosen = velocity.tolist()
        if chosen and stops and perforations:
            v50[test], zone[test] = np.mean(chosen), max(0.0, stops[-1] - perforations[0])
    return v50, zone


def _dixon_mood(firings: Firings) -> tuple[Array, Array]:
    """The sums of Dixon and Mood (1948) over the rarer answer: the mean of its levels, half a step towards the others,
    and 1.62 steps times their variance in steps² and 0.029."""
    used, perforated, level = firings.used, firings.perforated, firings.aimed
    step = np.abs(np.diff(level, axis=1)).max(axis=1)
    rare_perforations = (used & perforated).sum(axis=1) <= (used & ~perforated).sum(axis=1)
    rarer = used & (perforated == rare_perforations[:, None])
    count = rarer.sum(axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = np.where(rarer, level, 0.0).sum(axis=1) / count
        variance = np.where(rarer, (level - mean[:, None]) ** 2, 0.0).sum(axis=1) / count
        location = mean + np.where(rare_perforations, -0.5, 0.5) * step
        return location, np.where(count > 0, 1.62 * step * (variance / step**2 + 0.029), np.nan)
