"""Scrambled Sobol points by number, without scipy.stats, which takes 0.7 s to import.

The first TOGETHER dimensions are those of scipy.stats.qmc.Sobol, which scrambles dimensions together. Each further
dimension has its own scrambling, so that another one changes no earlier dimension.

Direction numbers: S. Joe and F. Y. Kuo, "Constructing Sobol sequences with better two-dimensional projections", SIAM J.
Sci. Comput. 30 (2008), in joe_kuo.txt. Scrambling: J. Matoušek's linear matrix and a digital shift.
"""

from __future__ import annotations

from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .model import Array

Integers = NDArray[np.uint32]

TOGETHER = 13
"""Dimensions that are scrambled together: the hit and the first eleven quantities that scatter."""
_SINGLE = 7
"""Part of the key of a dimension that is scrambled alone."""
BITS = 30
"""Binary digits of a coordinate; a sequence has 2^BITS points."""
_WEIGHTS = 1 << np.arange(BITS - 1, -1, -1, dtype=np.uint32)
"""Value of each digit, the most significant first."""
_STARTS = Path(__file__).with_name("joe_kuo.txt").read_text(encoding="ascii").splitlines()
"""Primitive polynomial and first numbers m of every dimension after the first."""
MOST_DIMENSIONS = 1 + len(_STARTS)


class Sobol:
    """One scrambled sequence; its points can be read in any order.

    Raises:
        ValueError: more than MOST_DIMENSIONS dimensions.
    """

    def __init__(self, dimensions: int, seed: np.random.SeedSequence) -> None:
        if dimensions > MOST_DIMENSIONS:
            raise ValueError(
                f"got {dimensions} quantities that differ from shot to shot; {MOST_DIMENSIONS} are allowed"
            )
        self.dimensions, self._seed = dimensions, seed

    def points(self, first: int, count: int) -> Array:
        """Points of the unit cube from number `first` on, shape [count, dimensions].

        Raises:
            ValueError: the sequence has no such point.
        """
        if first + count > 1 << BITS:
            raise ValueError(
                f"got point {first + count - 1}, but a Sobol sequence of {BITS} bits has {1 << BITS} points"
            )
        shift, directions = self._scrambled
        number = np.arange(first, first + count, dtype=np.uint32)
        gray = number ^ (number >> np.uint32(1))
        points = np.repeat(shift[None], count, axis=0)
        for digit in range((first + count - 1).bit_length()):
            odd = (gray >> np.uint32(digit)) & np.uint32(1)
            points ^= odd[:, None] * directions[:, digit]
        return points / float(1 << BITS)

    @cached_property
    def _scrambled(self) -> tuple[Integers, Integers]:
        """Digital shift, shape [dimensions], and scrambled direction numbers, shape [dimensions, BITS]."""
        directions, key = _directions(self.dimensions), self._seed.spawn_key
        draw = np.random.default_rng(np.random.SeedSequence(self._seed.entropy, spawn_key=key)).spawn(1)[0]  # as scipy
        parts = [_scramble(directions[:TOGETHER], draw)]
        for place in range(TOGETHER, self.dimensions):
            seed = np.random.SeedSequence(self._seed.entropy, spawn_key=(*key, _SINGLE, place))
            parts.append(_scramble(directions[place : place + 1], np.random.default_rng(seed)))
        shift, scrambled = zip(*parts, strict=True)
        return np.concatenate(shift), np.concatenate(scrambled)


def _scramble(directions: Integers, draw: np.random.Generator) -> tuple[Integers, Integers]:
    """Digital shift, shape [dimensions], and scrambled direction numbers, shape [dimensions, BITS]."""
    dimensions = len(directions)
    shift = draw.integers(2, size=(dimensions, BITS), dtype=np.uint32) @ _WEIGHTS[::-1]
    matrix = np.tril(draw.integers(2, size=(dimensions, BITS, BITS), dtype=np.uint32))
    matrix[:, range(BITS), range(BITS)] = 1
    digits = (directions[:, None, :] & _WEIGHTS[:, None]) > 0
    scrambled = (matrix @ digits) & np.uint32(1)
    return shift, (scrambled * _WEIGHTS[:, None]).sum(axis=1, dtype=np.uint32)


def _directions(dimensions: int) -> Integers:
    """Direction numbers, shape [dimensions, BITS]. The first dimension is the van der Corput sequence."""
    rows = [[1] * BITS, *(_recurrence(*map(int, start.split())) for start in _STARTS[: dimensions - 1])]
    return np.array(rows, dtype=np.uint32) * _WEIGHTS


def _recurrence(polynomial: int, *start: int) -> list[int]:
    """The numbers m of one dimension, by the recurrence of its primitive polynomial."""
    numbers, degree = list(start), len(start)
    for j in range(degree, BITS):
        number = numbers[j - degree]
        for i in range(1, degree + 1):
            if polynomial >> (degree - i) & 1:
                number ^= numbers[j - i] << i
        numbers.append(number)
    return numbers
