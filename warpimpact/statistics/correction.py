"""Numbers of fast models at many shots, corrected by an accurate model at some of them.

The accurate model is regressed on the fast ones at the shots that all computed. The fit corrects every shot. Means,
shares and quantiles then need far fewer accurate shots than without the fast models (control variates: B. Peherstorfer,
K. Willcox, M. Gunzburger, SIAM Review 60 (2018) 550).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import combinations
from typing import NamedTuple

import numpy as np

from warpimpact.statistics.intervals import ANY_NUMBER, Array, Estimate, ends_at_bound, student_quantile

FEWEST_ACCURATE = 5
"""Fewest accurate shots of a correction: a regression on two controls leaves two degrees of freedom."""
_SINGULAR = 1e-10
"""Determinant of a normal matrix over the product of its diagonal, below which its controls follow from each other."""
_DISTINCT = 2**12
"""Corrected numbers at even shares that stand for all of many shots in a quantile."""
_MOST_EXPLAINED = 0.8
"""Largest share of the variance of an event that a correction may claim: no dozen of shots shows that it is exact."""


class _Fit(NamedTuple):
    """A regression on some controls: the constant and their slopes, what each shot misses if it is left out, and the
    inverse of the normal matrix."""

    controls: tuple[int, ...]
    slopes: Array
    left_out: Array
    inverse: Array


@dataclass(frozen=True)
class Correction:
    """A fast model, corrected.

    Attributes:
        controls: columns of the fast models that the correction uses.
        coefficients: the constant, and the slope of each of these columns.
        values: corrected numbers of all shots, shape [shots].
        errors: standard errors of the prediction of one more accurate shot at each of them, shape [shots].
        accurate: numbers of the accurate model, shape [accurate shots].
        residuals: accurate numbers less what the correction without that shot predicts, shape [accurate shots].
        candidates: number of controls to choose from.
        leverage: variance of the mean over all shots, in variances of a residual.
    """

    controls: tuple[int, ...]
    coefficients: Array
    values: Array
    errors: Array
    accurate: Array
    residuals: Array
    candidates: int
    leverage: float

    @property
    def freedom(self) -> int:
        """Degrees of freedom, which count every control to choose from."""
        return len(self.accurate) - 1 - self.candidates

    @property
    def determination(self) -> float:
        """Share of the variance of the accurate numbers that the fast ones explain (R² by leave-one-out)."""
        total = float(np.sum((self.accurate - self.accurate.mean()) ** 2))
        return 1.0 - float(np.sum(self.residuals**2)) / total if total > 0.0 else math.nan


def correct(accurate: Array, fast_at: Array, fast_all: Array) -> Correction:
    """Correct fast models by regression on those of them that leave the least error, or on none.

    The errors are those of leaving one shot out and choosing the controls anew, so they count the choice.

    Args:
        accurate: numbers of the accurate model, shape [accurate shots].
        fast_at: numbers of the fast models at the same shots, shape [accurate shots, models].
        fast_all: numbers of the fast models at all shots, shape [shots, models].

    Raises:
        ValueError: fewer than `FEWEST_ACCURATE` accurate shots.
    """
    if len(accurate) < FEWEST_ACCURATE:
        raise ValueError(f"got accurate shots: {len(accurate)}, but a correction needs {FEWEST_ACCURATE}")
    middle, scale = fast_all.mean(axis=0), np.maximum(fast_all.std(axis=0), np.finfo(float).tiny)
    fast_at, fast_all = (fast_at - middle) / scale, (fast_all - middle) / scale
    fit = _chosen(accurate, fast_at)
    slopes = fit.slopes[1:] / scale[list(fit.controls)]
    design = _design(fast_all, fit.controls)
    residuals = np.empty(len(accurate))
    for shot in range(len(accurate)):
        others = _chosen(np.delete(accurate, shot), np.delete(fast_at, shot, axis=0))
        residuals[shot] = accurate[shot] - _design(fast_at[[shot]], others.controls)[0] @ others.slopes
    mean = design.mean(axis=0)
    spread = float(np.mean(residuals**2))
    errors = np.sqrt(spread * (1.0 + np.sum(design @ fit.inverse * design, axis=1)))
    return Correction(
        controls=fit.controls,
        coefficients=np.array([fit.slopes[0] - slopes @ middle[list(fit.controls)], *slopes]),
        values=design @ fit.slopes,
        errors=errors,
        accurate=accurate,
        residuals=residuals,
        candidates=fast_at.shape[1],
        leverage=float(mean @ fit.inverse @ mean),
    )


def _design(fast: Array, controls: tuple[int, ...]) -> Array:
    return np.column_stack([np.ones(len(fast)), fast[:, list(controls)]])


def _chosen(accurate: Array, fast: Array) -> _Fit:
    """The regression with the least error of leaving a shot out; the one on fewer controls if they are equal. Controls
    that are constant or follow from each other have none."""
    models, fits = range(fast.shape[1]), []
    for controls in (some for count in range(len(models) + 1) for some in combinations(models, count)):
        design = _design(fast, controls)
        normal = design.T @ design
        if not np.linalg.det(normal) > _SINGULAR * np.prod(np.diag(normal)):
            continue
        inverse = np.asarray(np.linalg.inv(normal), dtype=np.float64)
        slopes = inverse @ design.T @ accurate
        leverage = np.minimum(np.sum(design @ inverse * design, axis=1), 0.999)
        fits.append(_Fit(controls, slopes, (accurate - design @ slopes) / (1.0 - leverage), inverse))
    return min(fits, key=lambda fit: float(np.sum(fit.left_out**2)))


def corrected_mean(
    correction: Correction, confidence: float = 0.95, bounds: tuple[float, float] = ANY_NUMBER
) -> Estimate:
    """The mean of the corrected numbers, with Student's interval for the accurate shots and the sample of all shots.

    Accurate numbers that all are a bound have the interval of a share of none (`ends_at_bound`).
    """
    values, shots = correction.values, len(correction.values)
    variance = float(np.mean(correction.residuals**2)) * correction.leverage + float(values.var()) / shots
    half = student_quantile(confidence, max(correction.freedom, 1)) * math.sqrt(variance)
    value, ends = float(values.mean()), None
    if np.ptp(correction.accurate) == 0.0 and correction.accurate[0] in bounds:
        value, none = float(correction.accurate[0]), np.zeros(len(correction.accurate))
        ends = ends_at_bound(value, _share(correction, 0.0, none, none, none, confidence).high, bounds)
    return Estimate(value, *(ends or (value - half, value + half)), shots, float(values.std()))


def corrected_share(correction: Correction, limit: float, *, above: bool = True, confidence: float = 0.95) -> Estimate:
    """The share of the shots beyond a limit.

    Corrected numbers scatter as the residuals do (smearing: N. Duan, Journal of the American Statistical Association 78
    (1983) 605). Half of what that misses at the accurate shots is added: all of it would leave no bias, but more
    variance. The interval is Wilson's, for as many shots as would have the same variance.
    """
    side = 1.0 if above else -1.0
    residuals, limit = side * correction.residuals, side * limit
    of_each = 1.0 - np.searchsorted(np.sort(residuals), limit - side * correction.values, "right") / len(residuals)
    accurate = side * correction.accurate
    others = (np.delete(residuals, shot) for shot in range(len(accurate)))
    predicted = accurate - residuals
    expected = np.array([np.mean(one + scatter > limit) for one, scatter in zip(predicted, others, strict=True)])
    missed = (accurate > limit) - expected
    value = float(of_each.mean()) + 0.5 * float(missed.mean())
    return _share(correction, value, missed, expected, of_each, confidence)


def corrected_event(correction: Correction, confidence: float = 0.95) -> Estimate:
    """The share of the shots to which an event happens, of a correction of numbers 0 and 1."""
    expected = np.clip(correction.accurate - correction.residuals, 0.0, 1.0)
    value = float(correction.values.mean())
    return _share(correction, value, correction.residuals, expected, correction.values, confidence)


def corrected_quantile(correction: Correction, share: float, confidence: float = 0.95) -> Estimate:
    """The number below which a share of the shots lies; it has no end (NaN) where the shots cannot exclude any."""
    values, residuals = correction.values, correction.residuals
    few = values
    if len(values) > _DISTINCT:
        few = np.asarray(np.quantile(values, (np.arange(_DISTINCT) + 0.5) / _DISTINCT))
    numbers = np.quantile((few[:, None] + residuals[None, :]).ravel(), np.linspace(0.0, 1.0, 401))
    thinned = replace(correction, values=few)
    below = [corrected_share(thinned, number, above=False, confidence=confidence) for number in numbers]
    value = float(np.interp(share, np.maximum.accumulate([one.value for one in below]), numbers))
    low = max((number for number, one in zip(numbers, below, strict=True) if one.high < share), default=math.nan)
    high = min((number for number, one in zip(numbers, below, strict=True) if one.low > share), default=math.nan)
    return Estimate(value, float(low), float(high), len(values), float(values.std()))


def _share(
    correction: Correction, value: float, missed: Array, expected: Array, of_each: Array, confidence: float
) -> Estimate:
    """A share with Wilson's interval for as many shots as would have its variance, no fewer than the accurate ones."""
    count, shots = len(missed), len(of_each)
    value = min(max(value, 0.0), 1.0)
    padded = (count * value + 0.5) / (count + 1.0)
    own, explained = padded * (1.0 - padded), min(max(np.nan_to_num(correction.determination), 0.0), _MOST_EXPLAINED)
    spread = 0.5 * (float(np.sum(missed**2)) / max(correction.freedom, 1) + float(np.mean(expected * (1.0 - expected))))
    variance = max(spread, own * (1.0 - explained)) / count + float(of_each.var()) / shots
    effective = max(own / variance, float(count))
    quantile = student_quantile(confidence, max(correction.freedom, 1))
    padded_count = effective + quantile**2
    middle = (effective * value + 0.5 * quantile**2) / padded_count
    half = quantile * math.sqrt(effective * value * (1.0 - value) + 0.25 * quantile**2) / padded_count
    return Estimate(value, max(0.0, middle - half), min(1.0, middle + half), shots, math.sqrt(value * (1.0 - value)))
