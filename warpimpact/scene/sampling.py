"""Sampling: shot k depends on the seed and k alone, not on batch, thread, worker or order."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from .distributions import EDGE
from .exclusions import IRREDUCIBLE, check_together
from .model import Array
from .plate import Plate
from .quantities import drawn_column, drawn_columns
from .scatter import Scatter
from .shots import Hits, Impact, Shots
from .sobol import Sobol
from .symmetry import irreducible_part, symmetries_used, unsymmetric

_HIT_COLUMNS, _ROWS = 2, 2**20
"""Columns of uniform numbers for y and z of the hit, before those of the quantities; column that chooses the rows of
`Hits.file`."""


class Sampler:
    """The shots of a campaign; any part of them can be drawn at any time.

    Hits cover one unit cell of the plate, or the whole plate (`Hits.area`); with hits.irreducible, the part of it from
    which `symmetries_used` give the rest. The impact has velocity and attitude unless hits or scatter give them.

    Attributes:
        cell: extent along y and z [m] of the whole cell or plate, centred on the origin.

    Raises:
        ValueError: scatter that removes the symmetry of hits.irreducible; hits on the whole of an unbounded plate.
    """

    def __init__(
        self, impact: Impact, hits: Hits, plate: Plate, scatter: Scatter | None = None, replicates: int = 1
    ) -> None:
        check_together({IRREDUCIBLE: hits.irreducible} | unsymmetric(scatter or Scatter()))
        self._impact, self._hits, self.cell = impact, hits, hits.covered(plate)
        (low_y, high_y), (low_z, high_z) = irreducible_part(symmetries_used(impact, hits, plate))
        self._extent = self.cell[0] * (high_y - low_y), self.cell[1] * (high_z - low_z)
        self._middle = 0.5 * self.cell[0] * (high_y + low_y), 0.5 * self.cell[1] * (high_z + low_z)
        scatter = scatter or Scatter()
        self._scatter = scatter.given
        dimensions = _HIT_COLUMNS + (drawn_columns(scatter.layers) if self._scatter else 0)
        self._sobol = [_sequence(dimensions, hits.seed, replicate) for replicate in range(replicates)]

    def __len__(self) -> int:
        return self._hits.total(self._extent)

    def shots(self, first: int, count: int) -> Shots:
        """`count` shots from number `first` on, fewer at the end of the campaign."""
        count = min(count, len(self) - first)
        columns = [_HIT_COLUMNS + drawn_column(name, layer) for name, layer in self._scatter]
        hit_y, hit_z, *uniform = self._uniform([0, 1, *columns], first, count)
        shots = Shots(
            hit_y=(hit_y - 0.5) * self._extent[0] + self._middle[0],
            hit_z=(hit_z - 0.5) * self._extent[1] + self._middle[1],
            **{name: np.full(count, value) for name, value in self._impact},
        )
        for ((name, layer), distribution), share in zip(self._scatter.items(), uniform, strict=True):
            shots = shots.with_own({name: distribution.quantile(np.clip(share, EDGE, 1.0 - EDGE))}, layer)
        if self._hits.listed is not None:
            listed, length = self._hits.sampling == "list", len(next(iter(self._hits.listed.values())))
            uniform_rows = stream(self._hits.seed, (_ROWS,), first, count) * length
            rows = np.arange(first, first + count) % length if listed else uniform_rows.astype(np.int64)
            shots = shots.with_own({name: column[rows] for name, column in self._hits.listed.items()})
        return shots

    def _uniform(self, columns: list[int], first: int, count: int) -> list[Array]:
        """Uniform numbers in [0, 1) of these columns, shape [count] each."""
        if self._hits.sampling == "sobol":
            points = self._net(first, count)
            return [points[:, column] for column in columns]
        hits = self._grid(first, count) if self._hits.sampling == "grid" else _pairs(self._hits.seed, first, count)
        return [*hits, *(stream(self._hits.seed, (column,), first, count) for column in columns[_HIT_COLUMNS:])]

    def _grid(self, first: int, count: int) -> tuple[Array, Array]:
        """Cell centres, row by row."""
        along_y, along_z = self._hits.grid(self._extent)
        cell = np.arange(first, first + count) % (along_y * along_z)
        return (cell // along_z + 0.5) / along_y, (cell % along_z + 0.5) / along_z

    def _net(self, first: int, count: int) -> Array:
        """Sobol points, shape [count, dimensions]; the replicates give one point in turn."""
        replicates, last = len(self._sobol), first + count
        points = np.empty((count, self._sobol[0].dimensions))
        for offset, sobol in enumerate(self._sobol):
            start, stop = (-((offset - end) // replicates) for end in (first, last))  # points of this replicate
            if stop > start:
                points[start * replicates + offset - first :: replicates] = sobol.points(start, stop - start)
        return points


def make_shots(impact: Impact, hits: Hits, plate: Plate, scatter: Scatter | None = None) -> Shots:
    """All shots at once. Hit points cover one unit cell of the plate, or the whole plate (`Hits.area`).

    A `Sampler` gives the shots of a large campaign in parts.
    """
    sampler = Sampler(impact, hits, plate, scatter, hits.scramblings)
    return sampler.shots(0, len(sampler))


@lru_cache(maxsize=128)
def _sequence(dimensions: int, seed: int, replicate: int) -> Sobol:
    """A scrambled sequence; it is cached because its scrambling takes as long as a hundred hits of a small plate."""
    return Sobol(dimensions, _seed(seed, replicate))


def _seed(seed: int, replicate: int) -> np.random.SeedSequence:
    return np.random.SeedSequence(seed, spawn_key=(replicate,) if replicate else ())


def _pairs(seed: int, first: int, count: int) -> tuple[Array, Array]:
    """Two arrays of independent uniform numbers, shape [count] each: shot k has the draws 2k and 2k + 1."""
    pairs = _draws(np.random.Philox(seed), 2 * first, 2 * count)
    return pairs[::2], pairs[1::2]


def stream(seed: int, key: tuple[int, ...], first: int, count: int) -> Array:
    """Independent uniform numbers of one key, such as a column, shape [count]: shot k has draw k."""
    return _draws(np.random.Philox(np.random.SeedSequence(seed, spawn_key=key)), first, count)


def _draws(generator: np.random.Philox, first: int, count: int) -> NDArray[np.float64]:
    """Draws from number `first` on. Philox counts in blocks of four and can start at any block."""
    block, within = divmod(first, 4)
    return np.random.Generator(generator.advance(block)).random(within + count)[within:]
