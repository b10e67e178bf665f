"""The history of an image of a replayed hit (scene/symmetry.py)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from warpimpact.scene import Symmetry
from warpimpact.solver.replay import Deformed, Replay, Weakened


def image_of(replay: Replay, symmetry: Symmetry, *, home: tuple[float, float], image: tuple[float, float]) -> Replay:
    """The history of a replayed shot, transformed to an image of its hit.

    Args:
        home: hit point (y, z) of the replayed shot [m].
        image: hit point (y, z) of its image [m].
    """
    history, polar, axial = replay.history, symmetry.polar, symmetry.axial
    signs = symmetry.along_y, symmetry.along_z

    def turned(layer: Weakened) -> Weakened:
        y, z = (
            (sign * along + (to - sign * at))[::sign]  # increasing again
            for along, sign, at, to in zip((layer.cell_y, layer.cell_z), signs, home, image, strict=True)
        )
        fields = (field[..., :: signs[0], :: signs[1]] for field in (layer.material, layer.share))
        return Weakened(y, z, *fields)

    return replace(
        replay,
        outcomes=replay.outcomes.unfolded([symmetry]),
        history=replace(
            history,
            position=history.position * polar,
            attitude=history.attitude * [*axial, 1.0],  # the axis of a turn is an axial vector
            core_axis=history.core_axis * polar,
            velocity=history.velocity * polar,
            angular_velocity=history.angular_velocity * axial,
            force=history.force * polar,
            moment=history.moment * axial,
        ),
        plate=turned(replay.plate),
        behind={number: turned(layer) for number, layer in replay.behind.items()},
        deformed=replay.deformed and _mirrored(replay.deformed, symmetry),
    )


def _mirrored(deformed: Deformed, symmetry: Symmetry) -> Deformed:
    """Finite elements at the places of an image; a reflection exchanges their lower and upper corners."""
    reflects = float(np.prod(symmetry.polar)) < 0.0
    return deformed._replace(
        position=(deformed.position * symmetry.polar).astype(np.float32),
        corners=deformed.corners[:, [4, 5, 6, 7, 0, 1, 2, 3]] if reflects else deformed.corners,
    )
