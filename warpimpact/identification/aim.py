"""The hit points over which a measured shot is integrated. Each set of parameters has points of its own."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from warpimpact.identification.fit import MeasuredShot, Sampling
from warpimpact.identification.hit_places import CLASSES, HitPlace
from warpimpact.scene import Core, Hits, Plate, Sampler, Shots, Symmetry, symmetries_used
from warpimpact.scene.model import Array
from warpimpact.scene.symmetry import irreducible_part

HIT_REPLICATES = 8
"""Parts of the hit points, every eighth point each. Their spread shows how exactly the hits are integrated out."""
POINT_STEPS = 0.7548776662466927, 0.5698402909980532
"""Steps from one point to the next along y and z, as shares of the part of the cell, modulo 1. They are the powers of
the root of x³ = x + 1, whose points leave no wide gaps (M. Roberts, "The unreasonable effectiveness of quasirandom
sequences", 2018)."""


@dataclass(frozen=True)
class HitPoints:
    """The hit points over which one shot is integrated at some sets of parameters, at one scene.

    Attributes:
        shots: shots with all images, set after set, shape [sets · points].
        group: symmetries; the images of a shot follow each other, and `computed` are the first of each group.
        weight: 1 where a point is of the shot's class, else 0, shape [sets, points].
        replicates: number of parts to which the computed shots of a set are dealt in turn.
        part: extent along y and z [m] of the part of the unit cell that the computed points cover evenly, and of the
            whole cell; None if they do not cover it evenly, or if shots differ in more than their place.
    """

    shots: Shots
    group: tuple[Symmetry, ...]
    weight: Array
    replicates: int
    part: tuple[Array, Array] | None = None

    @property
    def computed(self) -> Shots:
        return self.shots[:: len(self.group)]

    @property
    def hits(self) -> Array:
        """Places of the points [m], shape [sets, points, 2]."""
        return np.stack([self.shots.hit_y, self.shots.hit_z], axis=-1).reshape(*self.weight.shape, 2)

    def of(self, hit: str | HitPlace, plate: Plate, core: Core) -> HitPoints:
        """The same points, weighted for another class of hits."""
        inside = CLASSES[hit](plate, core, self.shots.hit_y, self.shots.hit_z) if isinstance(hit, str) else None
        weight = np.ones_like(self.weight) if inside is None else inside.reshape(self.weight.shape).astype(np.float64)
        return replace(self, weight=weight)


def aim(shot: MeasuredShot, plate: Plate, core: Core, sampling: Sampling, shifts: Array) -> HitPoints:
    """Points for a shot at some sets of parameters, spread over the cell of the plate.

    Args:
        shifts: uniform numbers that move the points of each set, shape [sets, 2]. The error of a finite number of
            points then differs from set to set, and is part of the spread of the weights.
    """
    placed = isinstance(shot.hit, HitPlace)
    turned = any(name != "velocity" for name, _ in shot.scatter.given)
    solid = plate.open_area == 0.0 and plate.size is None
    alone = not shot.scatter.given and (solid or (isinstance(shot.hit, HitPlace) and shot.hit.is_exact))
    count = 1 if alone else sampling.hits
    replicates = 1 if alone else HIT_REPLICATES
    alike = Hits(count=count, seed=sampling.seed, irreducible=not (placed or turned or alone))
    group, cell = symmetries_used(shot.impact, alike, plate), np.array(plate.sampled_cell)
    numbers = alike.model_copy(update={"irreducible": False})  # images share the scattered quantities
    shots = Sampler(shot.impact, numbers, plate, shot.scatter).shots(0, count)
    shares = np.mod(shifts[:, None] + np.arange(count)[:, None] * POINT_STEPS, 1.0).reshape(-1, 2).T
    if isinstance(shot.hit, HitPlace):
        hit_y, hit_z = shot.hit.at(*shares)
    else:
        (low_y, high_y), (low_z, high_z) = irreducible_part(group)
        y, z = cell[0] * (low_y + (high_y - low_y) * shares[0]), cell[1] * (low_z + (high_z - low_z) * shares[1])
        images = np.array([symmetry.image(y, z, (cell[0], cell[1])) for symmetry in group])
        hit_y, hit_z = images.transpose(1, 2, 0).reshape(2, -1)
    point_of = np.tile(np.repeat(np.arange(count), len(group)), len(shifts))
    shots = replace(shots[point_of], hit_y=hit_y, hit_z=hit_z)
    even = not (placed or shot.scatter.given or plate.size is not None or alone)
    part = (np.array([high_y - low_y, high_z - low_z]) * cell, cell) if even else None
    weight = np.ones((len(shifts), count * len(group)))
    return HitPoints(shots, group, weight, replicates, part).of(shot.hit, plate, core)
