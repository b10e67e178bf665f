"""The fragments of a core of elements: live elements that share faces."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from warpimpact.scene.model import Array

SPLINTER, PART = 0.01, 0.1
"""Share of the mass of a core below which a fragment does not count, and from which one more means that it broke."""


class CoreElements(NamedTuple):
    """Elements of a core at an instant; arrays of shape [planes, rows, columns].

    Attributes:
        alive: whether they are.
        mass: at rest [kg].
        forward: velocity along the flight [m/s].
    """

    alive: NDArray[np.bool_]
    mass: Array
    forward: Array

    def labels(self) -> tuple[NDArray[np.int32], Array]:
        """Numbers of the fragments that elements belong to, 0 of none, and their masses [kg]. The first one, which
        leads, has the most momentum along the flight among those of a tenth of the core and more: as a rule it is the
        largest, but none that the plate holds. Without such it is the largest."""
        labels, count = ndimage.label(self.alive)
        every = np.arange(1, count + 1)
        masses = np.asarray(ndimage.sum_labels(self.mass, labels, every), dtype=float)
        momenta = np.asarray(ndimage.sum_labels(self.mass * self.forward, labels, every))
        order = np.lexsort((-masses, -np.where(masses >= PART * self.mass.sum(), momenta, -np.inf)))
        numbers = np.zeros(count + 1, dtype=np.int32)
        numbers[1 + order] = every
        return numbers[labels], masses[order]


class Fragments(NamedTuple):
    """What is left of a core.

    Attributes:
        number: of fragments of a hundredth of its mass and more.
        mass, share: of the one that leads [kg], and over that of the core.
        front, rear: ends of the stretch of the core that it has, behind the nose [m].
        eroded: mass of what failed, and of smaller fragments [kg].
        section: where the largest other fragment has parted from it, behind the nose [m]; NaN where none has a tenth of
            the mass of the core.
        energy: kinetic energy of all fragments [J].
        lost: energy that the core had on impact and that the leading fragment has no more [J].
    """

    number: int
    mass: float
    share: float
    front: float
    rear: float
    eroded: float
    section: float
    energy: float
    lost: float

    @property
    def broken(self) -> bool:
        """Whether the core is in two parts or more."""
        return not math.isnan(self.section)

    @classmethod
    def of(cls, core: CoreElements, station: Array, energy: float, lost: float) -> Fragments:
        """The fragments of a core.

        Args:
            station: of the planes of elements, behind the nose [m].
            energy, lost: as the attributes.
        """
        labels, masses = core.labels()
        total, section = float(core.mass.sum()), math.nan
        other = 2 + int(np.argmax(masses[1:])) if len(masses) > 1 else 0
        if other and masses[other - 1] >= PART * total:
            ends = (station[(labels == number).any(axis=(1, 2))] for number in (1, other))
            ahead, behind = sorted(ends, key=np.mean)
            section = 0.5 * float(ahead.max() + behind.min())
        planes = core.mass.sum(axis=(1, 2))
        of_plane = np.divide((core.mass * (labels == 1)).sum(axis=(1, 2)), planes, where=planes > 0.0, out=0.0 * planes)
        own, half = station[of_plane >= 0.5 * of_plane.max()], 0.5 * abs(float(station[1] - station[0]))
        has_tip = own.min() == station[planes > 0.0].min()
        front, rear = 0.0 if has_tip else float(own.min()) - half, float(own.max()) + half
        counted, leading = masses[masses >= SPLINTER * total], float(masses[:1].sum())
        eroded = total - float(counted.sum())
        share = round(leading / total, 9)  # of a whole core, 1
        return cls(len(counted), leading, share, front, rear, eroded, section, energy, lost)
