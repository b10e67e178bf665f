"""Symmetry: mirror images and shifts that change neither the plate nor the shot."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from .exclusions import HOLED_LAYERS, TURNED
from .model import Array
from .plate import Plate
from .scatter import Scatter
from .shots import Hits, Impact
from .target import Layer, layer_name

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
    """The common symmetries of plate and shot, in the order of SYMMETRIES."""
    return tuple(s for s in SYMMETRIES if s == IDENTITY or (_of_shot(s, impact) and of_plate(s, plate)))


def _of_shot(symmetry: Symmetry, impact: Impact) -> bool:
    """Whether the image of the shot is the shot itself, except for its hit point."""
    across = math.sin(impact.obliquity)
    of_y = across * math.cos(impact.azimuth), impact.yaw
    of_z = across * math.sin(impact.azimuth), impact.pitch
    turned = [*(of_y if symmetry.along_y < 0 else ()), *(of_z if symmetry.along_z < 0 else ())]
    keeps_spin = symmetry.along_y * symmetry.along_z > 0  # spin is an axial vector along the core
    return all(abs(value) < _ROUNDING for value in turned) and (keeps_spin or impact.spin == 0.0)


def of_plate(symmetry: Symmetry, plate: Plate) -> bool:
    """Whether the image of the plate is the plate itself."""
    if plate.size is not None and symmetry.centred:
        return False  # a rim removes the centring
    return plate.pattern.is_symmetric(symmetry.along_y, symmetry.along_z, centred=symmetry.centred)


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
