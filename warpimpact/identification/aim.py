"""The points over which a measured shot is integrated, which every set of parameters shares."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from warpimpact.identification.fit import MeasuredShot, Sampling
from warpimpact.identification.hits import CLASSES, Place
from warpimpact.scene import Core, Hits, Plate, Sampler, Shots, Symmetry, symmetries_used
from warpimpact.scene.model import Array

REPLICATES = 8
"""Independent scramblings of the hit points: their spread tells how well the hits are integrated out."""


@dataclass(frozen=True)
class Aim:
    """The points over which one shot is integrated, at one scene.

    Attributes:
        shots: with all images, shape [points].
        group: symmetries, by which the images of a shot follow each other; `computed` are the first of each group.
        weight: 1 where a point is of the shot's class, else 0, shape [points].
        replicates: the computed shots are dealt out to so many independent scramblings in turn.
    """

    shots: Shots
    group: tuple[Symmetry, ...]
    weight: Array
    replicates: int

    @property
    def computed(self) -> Shots:
        return self.shots[:: len(self.group)]

    def of(self, hit: str | Place, plate: Plate, core: Core) -> Aim:
        """The same points for another class."""
        inside = CLASSES[hit](plate, core, self.shots.hit_y, self.shots.hit_z) if isinstance(hit, str) else None
        weight = np.ones(len(self.shots)) if inside is None else inside.astype(np.float64)
        return replace(self, weight=weight)


def aim(shot: MeasuredShot, plate: Plate, core: Core, sampling: Sampling) -> Aim:
    """Points for a shot: the same numbers at every set of parameters, spread over the cell of the plate."""
    placed = isinstance(shot.hit, Place)
    turned = any(name != "velocity" for name, _ in shot.scatter.given)
    solid = plate.open_area == 0.0 and plate.size is None
    alone = not shot.scatter.given and (solid or (isinstance(shot.hit, Place) and shot.hit.is_exact))
    count = 1 if alone else sampling.hits
    replicates = 1 if alone else REPLICATES
    hits = Hits(count=count, seed=sampling.seed, irreducible=not (placed or turned or alone), replicates=replicates)
    group = symmetries_used(shot.impact, hits, plate)
    hits = hits.model_copy(update={"count": count * len(group)})
    sampler = Sampler(shot.impact, hits, plate, shot.scatter, replicates)
    shots = sampler.shots(0, len(sampler))
    if isinstance(shot.hit, Place):
        shares = (at / side + 0.5 for at, side in zip((shots.hit_y, shots.hit_z), plate.sampled_cell, strict=True))
        hit_y, hit_z = shot.hit.at(*shares)
        shots = replace(shots, hit_y=hit_y, hit_z=hit_z)
    return Aim(shots, group, np.ones(len(shots)), replicates).of(shot.hit, plate, core)
