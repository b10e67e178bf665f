"""Median and spread of a threshold from yes-or-no answers at known levels: probit of many tests at once.

A test has levels x and answers y. P(y = 1 | x) = Φ((x − location) / scale). The log likelihood is concave in
location/scale and 1/scale. It has a maximum at a finite slope if the answers overlap: one 0 at a higher level than one
1 (M. J. Silvapulle, Journal of the Royal Statistical Society B 43 (1981) 310). Newton's method finds it. Tests are rows
of all arrays; `used` marks the levels that count.

Acceptance by attributes: n shots, at most k complete penetrations (exact binomial distribution). The plans of fewest
shots are those of C. J. Clopper and E. S. Pearson, Biometrika 26 (1934) 404.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import optimize, special

from warpimpact.statistics.intervals import Array

Flags = NDArray[np.bool_]


@dataclass(frozen=True)
class QuantalFit:
    """Maximum of the likelihood of every test; all arrays have the shape [tests].

    Attributes:
        location: level of equal odds; without overlap the middle of the gap; NaN if all answers are the same or the
            odds fall with the level.
        scale: standard deviation; NaN without overlap, which does not determine it.
        log_likelihood: maximum.
        overlap: whether the maximum is at a finite slope.
    """

    location: Array
    scale: Array
    log_likelihood: Array
    overlap: Flags


def fit_quantal(levels: Array, answers: Flags, used: Flags) -> QuantalFit:
    """Fit of maximum likelihood of every test, from arrays of shape [tests, shots]."""
    below, above = _ends(levels, answers, used)
    overlap = below > above
    separate = np.isfinite(below) & np.isfinite(above) & ~overlap
    location, scale = np.full((2, len(levels)), np.nan)
    location[separate] = 0.5 * (below + above)[separate]
    meeting = used & (levels == below[:, None]) & (below == above)[:, None]  # elsewhere a step explains the answers
    count, ones = meeting.sum(axis=1), (meeting & answers).sum(axis=1)
    share = ones / np.maximum(count, 1)
    of_a_step = special.xlogy(ones, share) + special.xlogy(count - ones, 1.0 - share)
    likelihood = np.where(separate, of_a_step, np.nan)
    if overlap.any():
        maximum = _newton(levels[overlap], answers[overlap], used[overlap])
        location[overlap], scale[overlap], likelihood[overlap] = maximum
    return QuantalFit(location, scale, likelihood, overlap & np.isfinite(location))


def _ends(levels: Array, answers: Flags, used: Flags) -> tuple[Array, Array]:
    """Highest level with answer 0 and lowest with answer 1, shape [tests] each; infinite if there is no such answer."""
    below = np.where(used & ~answers, levels, -np.inf).max(axis=1, initial=-np.inf)
    above = np.where(used & answers, levels, np.inf).min(axis=1, initial=np.inf)
    return below, above


def _newton(levels: Array, answers: Flags, used: Flags) -> tuple[Array, Array, Array]:
    """Location, scale and log likelihood of tests whose answers overlap, shape [tests] each."""
    count = used.sum(axis=1)
    centre = np.where(used, levels, 0.0).sum(axis=1) / count
    from_centre = np.where(used, levels - centre[:, None], 0.0)  # F takes at + slope · u, u in standard deviations
    width = np.sqrt((from_centre**2).sum(axis=1) / count)
    u, sign = from_centre / width[:, None], np.where(answers, 1.0, -1.0)
    at, slope = np.zeros(len(u)), np.ones(len(u))
    value, rate, curve = _terms(sign * (at[:, None] + slope[:, None] * u), used)
    best = value.sum(axis=1)
    for _ in range(60):
        toward = sign * rate
        g0, g1 = toward.sum(axis=1), (toward * u).sum(axis=1)
        h00, h01, h11 = curve.sum(axis=1), (curve * u).sum(axis=1), (curve * u * u).sum(axis=1)
        determinant = np.maximum(h00 * h11 - h01 * h01, 1e-300)
        step0, step1 = (h11 * g0 - h01 * g1) / determinant, (h00 * g1 - h01 * g0) / determinant
        share = np.ones(len(u))
        for _ in range(40):  # halve steps that lose likelihood
            new0, new1 = at + share * step0, slope + share * step1
            value, rate, curve = _terms(sign * (new0[:, None] + new1[:, None] * u), used)
            total = value.sum(axis=1)
            worse = ~(total >= best - 1e-12 * np.abs(best))
            if not worse.any():
                break
            share = np.where(worse, 0.5 * share, share)
        moved = np.abs(new0 - at) + np.abs(new1 - slope)
        at, slope, best = new0, new1, total
        if (moved <= 1e-10 * (1.0 + np.abs(at) + np.abs(slope))).all():
            break
    rising = slope > 1e-9
    with np.errstate(divide="ignore", invalid="ignore"):
        location = np.where(rising, centre - width * at / slope, np.nan)
        scale = np.where(rising, width / slope, np.nan)
    return location, scale, best


def _terms(t: Array, used: Flags) -> tuple[Array, Array, Array]:
    """ln F(t), its derivative and minus its second derivative; 0 where `used` is false."""
    t = np.clip(np.where(used, t, 0.0), -1e7, 1e7)
    value = special.log_ndtr(t)
    rate = np.exp(-0.5 * (t * t + math.log(2.0 * math.pi)) - value)
    curve = rate * (rate + t)
    return np.where(used, value, 0.0), np.where(used, rate, 0.0), np.where(used, np.maximum(curve, 0.0), 0.0)


def likelihood_interval(
    levels: Array, answers: Flags, used: Flags, fit: QuantalFit, *, confidence: float = 0.95
) -> tuple[Array, Array]:
    """Interval of the location by the likelihood ratio (B. T. Neyer, Analysis of sensitivity tests, MLM-3736, 1992).

    It has all locations whose profile likelihood, the maximum over the scales, lies less than half a quantile of χ²
    with one degree of freedom below the maximum. It exists without overlap, too. An end is infinite if no location on
    its side is excluded, and NaN if `fit.location` is.
    """
    drop = 0.5 * float(special.chdtri(1, 1.0 - confidence))
    known = np.flatnonzero(np.isfinite(fit.location))
    low, high = np.full((2, len(levels)), np.nan)
    if len(known):
        tests = levels[known], answers[known], used[known]
        floor = fit.log_likelihood[known] - drop
        start, scale = fit.location[known], fit.scale[known]
        low[known] = _profile_end(tests, floor, start, scale, -1.0)
        high[known] = _profile_end(tests, floor, start, scale, 1.0)
    return low, high


def _profile_end(tests: tuple[Array, Flags, Flags], floor: Array, start: Array, scale: Array, side: float) -> Array:
    """Location on one side of `start` at which the profile likelihood falls to `floor`, by bisection; shape [tests]."""
    levels, _, used = tests
    reach = np.ptp(np.where(used, levels, start[:, None]), axis=1)
    reach = np.where(reach > 0.0, reach, 1.0)
    inside, outside = np.zeros(len(start)), np.full(len(start), np.inf)  # distances from start
    steep = np.where(scale > 0.0, 1.0 / np.maximum(scale, 1e-12), 1.0 / reach)
    trial = 0.25 * reach
    for _ in range(44):
        likelihood, steep = _profile(tests, start + side * trial, steep)
        beyond = likelihood < floor
        outside, inside = np.where(beyond, trial, outside), np.where(beyond, inside, trial)
        trial = np.where(np.isinf(outside), 2.0 * inside, 0.5 * (inside + np.where(np.isinf(outside), 0.0, outside)))
        if ((outside - inside <= 1e-7 * reach) | (inside > 1e4 * reach)).all():
            break
    return np.where(np.isinf(outside) | (outside > 1e3 * reach), side * np.inf, start + side * 0.5 * (inside + outside))


def _profile(tests: tuple[Array, Flags, Flags], location: Array, steep: Array) -> tuple[Array, Array]:
    """Maximum of the log likelihood over all slopes ≥ 0 at a location, and the slope from which the next search starts;
    shape [tests] each."""
    levels, answers, used = tests
    z = np.where(used, np.where(answers, 1.0, -1.0) * (levels - location[:, None]), 0.0)
    step_fits = (z >= 0.0).all(axis=1)  # a scale of 0
    flat = ~step_fits & (z.sum(axis=1) <= 0.0)  # an infinite scale: the likelihood is concave in the slope
    slope = steep.copy()
    for _ in range(30):
        _, rate, curve = _terms(slope[:, None] * z, used)
        gain, bend = (rate * z).sum(axis=1), (curve * z * z).sum(axis=1)
        step = gain / np.maximum(bend, 1e-30 * np.abs(gain) + 1e-300)
        new = np.clip(slope + np.clip(step, -slope, 4.0 * slope), 0.2 * slope, None)
        close = np.abs(new - slope) <= 1e-9 * slope
        slope = new
        if (close | step_fits | flat).all():
            break
    value = _terms(slope[:, None] * z, used)[0].sum(axis=1)
    none = -math.log(2.0) * used.sum(axis=1)
    value = np.where(step_fits, -math.log(2.0) * (used & (z == 0.0)).sum(axis=1), np.where(flat, none, value))
    return value, np.where(step_fits | flat, steep, slope)


def scale_interval(levels: Array, answers: Flags, fit: QuantalFit, *, confidence: float = 0.95) -> tuple[float, float]:
    """Interval of the scale of one test by the likelihood ratio, from arrays of shape [shots].

    Without overlap it begins at 0. It is infinite above if no scale is excluded, and NaN if `fit.location` is.
    """
    if not np.isfinite(fit.location[0]):
        return math.nan, math.nan
    floor = float(fit.log_likelihood[0]) - 0.5 * float(special.chdtri(1, 1.0 - confidence))
    sign, reach = np.where(answers, 1.0, -1.0), float(np.ptp(levels))

    def above_floor(log_scale: float) -> float:
        scale = math.exp(log_scale) * reach
        ends = (float(levels.min()) - 6.0 * scale, float(levels.max()) + 6.0 * scale)
        lost = optimize.minimize_scalar(
            lambda at: -float(special.log_ndtr(sign * (levels - at) / scale).sum()), bounds=ends, method="bounded"
        )
        return -float(lost.fun) - floor

    narrow, wide = math.log(1e-4), math.log(1e4)
    middle = math.log(float(fit.scale[0]) / reach) if fit.overlap[0] else narrow
    low = reach * math.exp(optimize.brentq(above_floor, narrow, middle)) if fit.overlap[0] else 0.0
    high = math.inf if above_floor(wide) > 0.0 else reach * math.exp(optimize.brentq(above_floor, middle, wide))
    return low, high


_LONGEST_PROOF = 100_000


def acceptance(shots: int, allowed: int, perforation: Array | float) -> Array:
    """Probability that at most `allowed` of `shots` independent cores pass, each with probability `perforation`.

    Where all shots of a test hit one random place, the probability of acceptance is the mean of this over the places.
    """
    return np.asarray(special.bdtr(float(allowed), shots, np.asarray(perforation, dtype=float)))


def fewest_shots(allowed: int, stop_probability: float, confidence: float) -> int:
    """Fewest shots that show P(stop) ≥ `stop_probability` at this confidence if at most `allowed` pass.

    Raises:
        ValueError: more than 100 000 shots are needed.
    """
    counts = np.arange(allowed + 1, _LONGEST_PROOF)
    enough = special.bdtr(float(allowed), counts, 1.0 - stop_probability) <= 1.0 - confidence
    if not enough.any():
        raise ValueError(f"got P(stop) >= {stop_probability:g}, which needs more than {_LONGEST_PROOF} shots")
    return int(counts[enough.argmax()])


def shown_stop_probability(shots: int, perforations: int, confidence: float) -> float:
    """Largest lower bound of P(stop) at this confidence after this number of complete penetrations."""
    if perforations >= shots:
        return 0.0
    return 1.0 - float(special.betaincinv(perforations + 1.0, shots - perforations, confidence))
