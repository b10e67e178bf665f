"""Acceptance by attributes: n shots of which at most k may perforate (exact binomial distribution).

The plans of fewest shots are those of C. J. Clopper and E. S. Pearson, Biometrika 26 (1934) 404.
"""

from __future__ import annotations

import numpy as np
from scipy import special

from warpimpact.statistics.intervals import Array

_LONGEST_PROOF = 100_000


def acceptance(shots: int, allowed: int, perforation: Array | float) -> Array:
    """Probability that at most `allowed` of `shots` independent shots perforate, each with probability `perforation`.

    Where all shots of a test hit one random place, the probability of acceptance is the mean of this over the places.
    """
    return np.asarray(special.bdtr(float(allowed), shots, np.asarray(perforation, dtype=float)))


def fewest_shots(allowed: int, stop_probability: float, confidence: float) -> int:
    """Fewest shots that show P(stop) ≥ `stop_probability` at this confidence if at most `allowed` perforate.

    Raises:
        ValueError: more than 100 000 shots are needed.
    """
    counts = np.arange(allowed + 1, _LONGEST_PROOF)
    enough = special.bdtr(float(allowed), counts, 1.0 - stop_probability) <= 1.0 - confidence
    if not enough.any():
        raise ValueError(f"got P(stop) >= {stop_probability:g}, which needs more than {_LONGEST_PROOF} shots")
    return int(counts[enough.argmax()])


def shown_stop_probability(shots: int, perforations: int, confidence: float) -> float:
    """Largest lower bound of P(stop) at this confidence after this number of perforations."""
    if perforations >= shots:
        return 0.0
    return 1.0 - float(special.betaincinv(perforations + 1.0, shots - perforations, confidence))
