"""Acceptance by attributes: n shots of which at most k may perforate (exact binomial distribution).

The plans of fewest shots are those of C. J. Clopper and E. S. Pearson, Biometrika 26 (1934) 404.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import special

Array = NDArray[np.float64]

_MOST_SHOTS = 100_000


def acceptance(shots: int, allowed: int, perforation: Array | float) -> Array:
    """Probability that at most `allowed` of `shots` independent shots perforate, each with this probability."""
    return np.asarray(special.bdtr(float(allowed), shots, np.asarray(perforation, dtype=float)))


def fewest_shots(allowed: int, stop_probability: float, confidence: float) -> int:
    """The fewest shots that show P(stop) ≥ `stop_probability` at this confidence, if at most `allowed` perforate.

    Raises:
        ValueError: no plan of up to 100 000 shots does.
    """
    counts = np.arange(allowed + 1, _MOST_SHOTS)
    enough = special.bdtr(float(allowed), counts, 1.0 - stop_probability) <= 1.0 - confidence
    if not enough.any():
        raise ValueError(f"got P(stop) >= {stop_probability:g}, which needs more than {_MOST_SHOTS} shots")
    return int(counts[enough.argmax()])


def shown_stop_probability(shots: int, perforations: int, confidence: float) -> float:
    """The greatest lower bound of P(stop) at this confidence, when so many of the shots have perforated."""
    if perforations >= shots:
        return 0.0
    return 1.0 - float(special.betaincinv(perforations + 1.0, shots - perforations, confidence))


def clustered_acceptance(shots: int, allowed: int, by_place: Array) -> Array:
    """Probability of acceptance when all shots of a test hit the same place, and that place is any one.

    Args:
        by_place: probability of perforation of a shot at every place, shape [..., places].

    Returns:
        The mean over the places, shape [...].
    """
    return np.asarray(acceptance(shots, allowed, by_place).mean(axis=-1))
