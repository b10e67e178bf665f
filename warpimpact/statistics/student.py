"""Quantiles of Student's distribution without scipy.special, which takes 0.2 s to import."""

from __future__ import annotations

import math
from functools import lru_cache
from statistics import NormalDist

import numpy as np

_LARGE = 1000
"""Degrees of freedom above which the expansion about the normal distribution is exact to rounding."""


@lru_cache(maxsize=256)
def student_quantile(share: float, freedom: int) -> float:
    """The value that exceeds this share of Student's distribution.

    Args:
        share: at least 1/2 and below 1.
        freedom: degrees of freedom, at least 1.

    Source: M. Abramowitz, I. A. Stegun, Handbook of Mathematical Functions, 26.7.3, 26.7.4 and 26.7.5.
    """
    if freedom >= _LARGE:
        return _expanded(NormalDist().inv_cdf(share), freedom)
    low, high = 0.0, 1.0
    while _within(high, freedom) < 2.0 * share - 1.0:
        low, high = high, 2.0 * high
    while low < (middle := 0.5 * (low + high)) < high:
        low, high = (middle, high) if _within(middle, freedom) < 2.0 * share - 1.0 else (low, middle)
    return middle


def _expanded(z: float, freedom: int) -> float:
    """Expansion of the quantile in powers of 1 / freedom about the normal quantile z."""
    terms = (
        z,
        (z**3 + z) / 4.0,
        (5.0 * z**5 + 16.0 * z**3 + 3.0 * z) / 96.0,
        (3.0 * z**7 + 19.0 * z**5 + 17.0 * z**3 - 15.0 * z) / 384.0,
        (79.0 * z**9 + 776.0 * z**7 + 1482.0 * z**5 - 1920.0 * z**3 - 945.0 * z) / 92160.0,
    )
    return math.fsum(term / float(freedom) ** power for power, term in enumerate(terms))


def _within(value: float, freedom: int) -> float:
    """Probability of the range from −value to value."""
    angle = math.atan2(value, math.sqrt(freedom))
    sine, cosine = math.sin(angle), math.cos(angle)
    odd = freedom % 2
    factors = np.arange(1 + odd, freedom - 2, 2) / np.arange(2 + odd, freedom - 1, 2)
    powers = np.cumprod(np.concatenate([[1.0], factors * cosine**2]))
    if not odd:
        return float(sine * powers.sum())
    return 2.0 / math.pi * (angle + (sine * cosine * float(powers.sum()) if freedom > 1 else 0.0))
