"""Sampling: shot k depends on the seed and k alone; symmetries leave a part of the cell to sample."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from .exclusions import HOLED_LAYERS, IRREDUCIBLE, TURNED, check_together
from .model import Array
from .quantities import drawn_column, drawn_columns
from .scatter import EDGE, Scatter
from .shots import Hits, Impact, Shots
from .target import Layer, Plate, layer_name

_ROUNDING = 1e-12
"""Components of the unit vector along the line of flight, and angles [rad], count as 0 below it: cos 90° is 6e-17."""


@dataclass(frozen=True)
class Symmetry:
    """The map (y, z) → (along_y·y, along_z·z) of the plate plane, then half a unit cell along both if `centred`.

    Attributes:
        along_y, along_z: 1, or −1 for a mirror image; both −1 are a half turn about the plate normal.
        centred: whether the centring translation of the lattice follows.
    """

    along_y: int
    along_z: int
    centred: bool

    def __str__(self) -> str:
        """Such as "(-y, z)" or "(y, z) + centring"."""
        signs = {1: "", -1: "-"}
        return f"({signs[self.along_y]}y, {signs[self.along_z]}z)" + (" + centring" if self.centred else "")

    def image(self, y: Array, z: Array, cell: tuple[float, float]) -> tuple[Array, Array]:
        """Images of points y, z [m] of a unit cell of this extent [m], centred on the origin, in the same cell."""
        y, z = self.along_y * y, self.along_z * z
        return (y - np.copysign(0.5 * cell[0], y), z - np.copysign(0.5 * cell[1], z)) if self.centred else (y, z)


SYMMETRIES = tuple(Symmetry(y, z, centred) for y, z, centred in product((1, -1), (1, -1), (False, True)))
"""All symmetries that a scene may have; the first one is the identity. The symmetries of a scene form a group."""
IDENTITY = SYMMETRIES[0]


def symmetries_used(impact: Impact, hits: Hits, plate: Plate) -> tuple[Symmetry, ...]:
    """Symmetries that give the rest of the cell; the identity alone without `hits.irreducible`."""
    return symmetries(plate, impact) if hits.irreducible else (IDENTITY,)


def unsymmetric(scatter: Scatter, layers: Sequence[Layer] = ()) -> dict[str, str | bool]:
    """Options that remove a symmetry of the plate, as arguments of `check_together`."""
    turned = [name for name in ("obliquity", "azimuth", "pitch", "yaw", "spin") if getattr(scatter, name) is not None]
    holed = [k for k, layer in enumerate(layers) if layer.open_area > 0.0 or layer.size is not None]
    return {
        TURNED: bool(turned) and f"a distribution of impact.{turned[0]}",
        HOLED_LAYERS: bool(holed) and f"{layer_name(holed[0] + 1)} with a pattern or a rim",
    }


def symmetries(plate: Plate, impact: Impact) -> tuple[Symmetry, ...]:
    """The maps that change neither plate nor shot except for its hit point, in the order of SYMMETRIES."""
    across = math.sin(impact.obliquity)
    turned_y = max(abs(across * math.cos(impact.azimuth)), abs(impact.yaw)) >= _ROUNDING
    turned_z = max(abs(across * math.sin(impact.azimuth)), abs(impact.pitch)) >= _ROUNDING

    def keeps(s: Symmetry) -> bool:
        if (turned_y and s.along_y < 0) or (turned_z and s.along_z < 0):
            return False
        if (impact.spin and s.along_y != s.along_z) or (plate.size is not None and s.centred):
            return False  # spin is an axial vector along the core; a rim removes the centring
        return plate.pattern.is_symmetric(s.along_y, s.along_z, centred=s.centred)

    return tuple(s for s in SYMMETRIES if s == IDENTITY or keeps(s))


def irreducible_part(group: Sequence[Symmetry]) -> tuple[tuple[float, float], tuple[float, float]]:
    """Part of the unit cell whose images under a group cover the cell exactly once: ((low, high) along y, along z).

    The limits are shares of the extent of the cell, from its middle. The actions of the group on y divide the cell
    along y; a mirror image in z alone divides it along z.
    """
    actions_y = {(s.along_y, s.centred) for s in group}
    mirrored_z = any((s.along_y, s.along_z, s.centred) == (1, -1, False) for s in group)
    share = 1.0 / len(actions_y)
    about_a_quarter = actions_y == {(1, False), (-1, True)}  # y → ½ − y does not move ±¼
    low = -0.5 if share == 1.0 else -0.25 if about_a_quarter else 0.0
    return (low, low + share), (0.0, 0.5) if mirrored_z else (-0.5, 0.5)


_HIT_COLUMNS, _ROWS = 2, 2**20
"""Columns of uniform numbers for y and z of the hit, before those of the quantities; column that chooses the rows of
`Hits.file`."""
_TOGETHER, _SINGLE = 13, 7
"""Dimensions that are scrambled together, the hit and the first eleven quantities that scatter; part of the key of a
further one."""
_BITS = 30
"""Binary digits of a Sobol coordinate."""


class Sampler:
    """The shots of a campaign; any part of them can be drawn at any time.

    Hits cover one unit cell of the plate, or the whole plate (`Hits.area`); with hits.irreducible, the part of it from
    which `symmetries_used` give the rest. The impact has velocity and attitude unless hits or scatter give them.

    Attributes:
        cell: extent along y and z [m] of the whole cell or plate, centred on the origin.
    """

    def __init__(self, impact: Impact, hits: Hits, plate: Plate, scatter: Scatter | None = None) -> None:
        scatter = scatter or Scatter()
        check_together({IRREDUCIBLE: hits.irreducible} | unsymmetric(scatter))
        self._impact, self._hits, self.cell = impact, hits, hits.covered(plate)
        low, high = np.array(irreducible_part(symmetries_used(impact, hits, plate))).T
        self._extent, self._middle = np.multiply(self.cell, high - low), 0.5 * np.array(self.cell) * (high + low)
        self._scatter = scatter.given
        self._dimensions = _HIT_COLUMNS + (drawn_columns(scatter.layers) if self._scatter else 0)

    def __len__(self) -> int:
        if self._hits.sampling == "list" and self._hits.listed is not None:
            return len(self._hits.listed["hit_y"])
        return math.prod(self._grid) if self._hits.sampling == "grid" else self._hits.count or 0

    @property
    def _grid(self) -> tuple[int, int]:
        """Cells of a grid along y and z, nearly square and at most `hits.count`."""
        count = self._hits.count or 0
        along_y = min(count, max(1, round(math.sqrt(count * self._extent[0] / self._extent[1]))))
        return along_y, count // along_y

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
            shots = shots.assign({name: distribution.quantile(np.clip(share, EDGE, 1.0 - EDGE))}, layer)
        if self._hits.listed is not None:
            rows = np.arange(first, first + count)
            if self._hits.sampling != "list":
                length = len(next(iter(self._hits.listed.values())))
                rows = (stream(self._hits.seed, (_ROWS,), first, count) * length).astype(np.int64)
            shots = shots.assign({name: column[rows] for name, column in self._hits.listed.items()})
        return shots

    def _uniform(self, columns: list[int], first: int, count: int) -> list[Array]:
        """Uniform numbers in [0, 1) of these columns, shape [count] each."""
        if self._hits.sampling == "sobol":
            return list(self._net(columns, first, count))
        if self._hits.sampling == "grid":  # centres of cells, row by row
            along_y, along_z = self._grid
            cell = np.arange(first, first + count)
            hits = [(cell // along_z + 0.5) / along_y, (cell % along_z + 0.5) / along_z]
        else:  # shot k has the draws 2k and 2k + 1
            pairs = _draws(np.random.Philox(self._hits.seed), 2 * first, 2 * count)
            hits = [pairs[::2], pairs[1::2]]
        return [*hits, *(stream(self._hits.seed, (column,), first, count) for column in columns[_HIT_COLUMNS:])]

    def _net(self, columns: list[int], first: int, count: int) -> Array:
        """Sobol coordinates, shape [columns, count]; the replicates give one point in turn."""
        every, points = self._hits.scramblings, np.empty((len(columns), count))
        for offset in range(every):
            start, stop = (-((offset - end) // every) for end in (first, first + count))  # points of this replicate
            if stop > start:
                sobol = _sequence(self._dimensions, self._hits.seed, offset)
                points[:, start * every + offset - first :: every] = sobol.points(columns, start, stop - start)
        return points


def make_shots(impact: Impact, hits: Hits, plate: Plate, scatter: Scatter | None = None) -> Shots:
    """All shots at once; a `Sampler` gives those of a large campaign in parts."""
    sampler = Sampler(impact, hits, plate, scatter)
    return sampler.shots(0, len(sampler))


def sobol(dimensions: int, **options: Any) -> qmc.Sobol:
    """A sequence of SciPy, which ignores a Ctrl-C while it reads its tables; all its points are then the same."""
    if not qmc.Sobol(1, scramble=False).random(2).any():
        raise KeyboardInterrupt
    return qmc.Sobol(dimensions, **options)


class _Sobol:
    """A scrambled Sobol sequence; its points can be read in any order.

    SciPy scrambles the first dimensions together. Each further one is scrambled alone, so that another one changes no
    earlier dimension.
    """

    def __init__(self, dimensions: int, seed: int, replicate: int) -> None:
        self._seed, self._key, self._lock = seed, (replicate,) if replicate else (), Lock()
        self._scrambled = sobol(min(dimensions, _TOGETHER), rng=self._draws())
        self._plain = sobol(dimensions, scramble=False)

    def points(self, columns: list[int], first: int, count: int) -> Array:
        """Coordinates of points from number `first` on, shape [columns, count]."""
        further = [column for column in columns if column >= _TOGETHER]
        with self._lock:
            points = dict(enumerate(read_points(self._scrambled, first, count).T))
            plain = read_points(self._plain, first, count) if further else np.empty(0)
        points |= {column: self._alone(plain[:, column], column) for column in further}
        return np.array([points[column] for column in columns])

    def _alone(self, points: Array, column: int) -> Array:
        """A coordinate scrambled by J. Matoušek's linear matrix and a digital shift."""
        draws, weights = self._draws(_SINGLE, column), 1 << np.arange(_BITS, dtype=np.uint32)[::-1]
        shift = draws.integers(2, size=_BITS, dtype=np.uint32) @ weights[::-1]
        matrix = np.tril(draws.integers(2, size=(_BITS, _BITS), dtype=np.uint32))
        np.fill_diagonal(matrix, 1)
        number = np.ldexp(points, _BITS).astype(np.uint32)
        odd = np.bitwise_count(number[:, None] & (matrix @ weights)) & 1
        return np.asarray(np.ldexp((odd @ weights) ^ shift, -_BITS))

    def _draws(self, *key: int) -> np.random.Generator:
        return np.random.default_rng(np.random.SeedSequence(self._seed, spawn_key=(*self._key, *key)))


_sequence = lru_cache(maxsize=128)(_Sobol)
"""Scrambling takes as long as a hundred hits of a small plate."""


def read_points(sequence: qmc.Sobol, first: int, count: int) -> Array:
    """Points from number `first` on, shape [count, dimensions], fastest where the last reading ended."""
    if first < sequence.num_generated:
        sequence.reset()
    if first > sequence.num_generated:
        sequence.fast_forward(first - sequence.num_generated)
    # A first reading of a single point: SciPy warns if the first one is no power of two.
    return np.concatenate([sequence.random(1), sequence.random(count - 1)])


def stream(seed: int, key: tuple[int, ...], first: int, count: int) -> Array:
    """Independent uniform numbers of one key, such as a column, shape [count]: shot k has draw k."""
    return _draws(np.random.Philox(np.random.SeedSequence(seed, spawn_key=key)), first, count)


def _draws(generator: np.random.Philox, first: int, count: int) -> NDArray[np.float64]:
    """Draws from number `first` on. Philox counts in blocks of four and can start at any block."""
    block, within = divmod(first, 4)
    return np.random.Generator(generator.advance(block)).random(within + count)[within:]
