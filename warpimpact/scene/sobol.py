"""Scrambled Sobol points by their number: the points of scipy.stats.qmc.Sobol, without a second of imports.

Direction numbers: S. Joe and F. Y. Kuo, "Constructing Sobol sequences with better two-dimensional projections", SIAM J.
Sci. Comput. 30 (2008). Scrambling: J. Matoušek's linear matrix and a digital shift.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from .model import Array

Integers = NDArray[np.uint32]

BITS = 30
"""Binary digits of a coordinate; a sequence has 2^BITS points."""
_WEIGHTS = 1 << np.arange(BITS - 1, -1, -1, dtype=np.uint32)
"""Value of each digit, the most significant first."""


class Sobol:
    """One scrambled sequence. Any of its points can be read at any time.

    Args:
        dimensions: of the unit cube, at most MOST_DIMENSIONS.
        seed: of the scrambling.

    Raises:
        ValueError: more dimensions than there are direction numbers here.
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
        draw = np.random.default_rng(self._seed).spawn(1)[0]  # as scipy does
        shift = draw.integers(2, size=(self.dimensions, BITS), dtype=np.uint32) @ _WEIGHTS[::-1]
        matrix = np.tril(draw.integers(2, size=(self.dimensions, BITS, BITS), dtype=np.uint32))
        matrix[:, range(BITS), range(BITS)] = 1
        digits = (_directions(self.dimensions)[:, None, :] & _WEIGHTS[:, None]) > 0
        scrambled = (matrix @ digits) & np.uint32(1)
        return shift, (scrambled * _WEIGHTS[:, None]).sum(axis=1, dtype=np.uint32)


def _directions(dimensions: int) -> Integers:
    """Direction numbers, shape [dimensions, BITS]. The first dimension is the van der Corput sequence."""
    rows = [[1] * BITS, *(_recurrence(*start) for start in _JOE_KUO[: dimensions - 1])]
    return np.array(rows, dtype=np.uint32) * _WEIGHTS


def _recurrence(polynomial: int, start: tuple[int, ...]) -> list[int]:
    """The numbers m of one dimension, by the recurrence of its primitive polynomial."""
    numbers, degree = list(start), len(start)
    for j in range(degree, BITS):
        found = numbers[j - degree]
        for i in range(1, degree + 1):
            if polynomial >> (degree - i) & 1:
                found ^= numbers[j - i] << i
        numbers.append(found)
    return numbers


_JOE_KUO: tuple[tuple[int, tuple[int, ...]], ...] = (
    (3, (1,)),
    (7, (1, 3)),
    (11, (1, 3, 1)),
    (13, (1, 1, 1)),
    (19, (1, 1, 3, 3)),
    (25, (1, 3, 5, 13)),
    (37, (1, 1, 5, 5, 17)),
    (41, (1, 1, 5, 5, 5)),
    (47, (1, 1, 7, 11, 19)),
    (55, (1, 1, 5, 1, 1)),
    (59, (1, 1, 1, 3, 11)),
    (61, (1, 3, 5, 5, 31)),
    (67, (1, 3, 3, 9, 7, 49)),
    (91, (1, 1, 1, 15, 21, 21)),
    (97, (1, 3, 1, 13, 27, 49)),
    (103, (1, 1, 1, 15, 7, 5)),
    (109, (1, 3, 1, 15, 13, 25)),
    (115, (1, 1, 5, 5, 19, 61)),
    (131, (1, 3, 7, 11, 23, 15, 103)),
    (137, (1, 3, 7, 13, 13, 15, 69)),
    (143, (1, 1, 3, 13, 7, 35, 63)),
    (145, (1, 3, 5, 9, 1, 25, 53)),
    (157, (1, 3, 1, 13, 9, 35, 107)),
    (167, (1, 3, 1, 5, 27, 61, 31)),
    (171, (1, 1, 5, 11, 19, 41, 61)),
    (185, (1, 3, 5, 3, 3, 13, 69)),
    (191, (1, 1, 7, 13, 1, 19, 1)),
    (193, (1, 3, 7, 5, 13, 19, 59)),
    (203, (1, 1, 3, 9, 25, 29, 41)),
    (211, (1, 3, 5, 13, 23, 1, 55)),
    (213, (1, 3, 7, 3, 13, 59, 17)),
    (229, (1, 3, 1, 3, 5, 53, 69)),
    (239, (1, 1, 5, 5, 23, 33, 13)),
    (241, (1, 1, 7, 7, 1, 61, 123)),
    (247, (1, 1, 7, 9, 13, 61, 49)),
    (253, (1, 3, 3, 5, 3, 55, 33)),
    (285, (1, 3, 1, 15, 31, 13, 49, 245)),
    (299, (1, 3, 5, 15, 31, 59, 63, 97)),
    (301, (1, 3, 1, 11, 11, 11, 77, 249)),
    (333, (1, 3, 1, 11, 27, 43, 71, 9)),
    (351, (1, 1, 7, 15, 21, 11, 81, 45)),
    (355, (1, 3, 7, 3, 25, 31, 65, 79)),
    (357, (1, 3, 1, 1, 19, 11, 3, 205)),
    (361, (1, 1, 5, 9, 19, 21, 29, 157)),
    (369, (1, 3, 7, 11, 1, 33, 89, 185)),
    (391, (1, 3, 3, 3, 15, 9, 79, 71)),
    (397, (1, 3, 7, 11, 15, 39, 119, 27)),
    (425, (1, 1, 3, 1, 11, 31, 97, 225)),
    (451, (1, 1, 1, 3, 23, 43, 57, 177)),
    (463, (1, 3, 7, 7, 17, 17, 37, 71)),
    (487, (1, 3, 1, 5, 27, 63, 123, 213)),
    (501, (1, 1, 3, 5, 11, 43, 53, 133)),
    (529, (1, 3, 5, 5, 29, 17, 47, 173, 479)),
    (539, (1, 3, 3, 11, 3, 1, 109, 9, 69)),
    (545, (1, 1, 1, 5, 17, 39, 23, 5, 343)),
    (557, (1, 3, 1, 5, 25, 15, 31, 103, 499)),
    (563, (1, 1, 1, 11, 11, 17, 63, 105, 183)),
    (601, (1, 1, 5, 11, 9, 29, 97, 231, 363)),
    (607, (1, 1, 5, 15, 19, 45, 41, 7, 383)),
    (617, (1, 3, 7, 7, 31, 19, 83, 137, 221)),
    (623, (1, 1, 1, 3, 23, 15, 111, 223, 83)),
    (631, (1, 1, 5, 13, 31, 15, 55, 25, 161)),
    (637, (1, 1, 3, 13, 25, 47, 39, 87, 257)),
)
"""Primitive polynomial and first numbers m of every dimension after the first."""

MOST_DIMENSIONS = 1 + len(_JOE_KUO)
