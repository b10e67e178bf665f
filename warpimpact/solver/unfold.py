"""Unfolding: from hits in the irreducible part of a unit cell to hits in the whole cell (scene/symmetry.py)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace

import numpy as np
from numpy.typing import NDArray

from warpimpact.scene import Symmetry
from warpimpact.solver.layering import Weakened
from warpimpact.solver.simulate import LayeredOutcomes, Outcomes, Replay

Array = NDArray[np.float64]


def unfolded(outcomes: Outcomes, group: Sequence[Symmetry]) -> Outcomes:
    """Outcomes of all images of the shots under a group, shape [shots · group]; the images of a shot follow each other.

    A projected angle changes its sign with its axis. The angular velocity is an axial vector, the other vectors are
    polar. Other outcomes stay.
    """
    every = _repeated(outcomes, len(group))
    signs = np.tile([s.polar for s in group], (len(outcomes.status), 1))
    axial = np.tile([s.axial for s in group], (len(outcomes.status), 1))
    if isinstance(every, LayeredOutcomes):
        along_y, along_z = signs[:, 1, None, None], signs[:, 2, None, None]
        every = replace(
            every,
            layer_standoff_yaw=every.layer_standoff_yaw * along_y,
            layer_standoff_pitch=every.layer_standoff_pitch * along_z,
        )
    return replace(
        every,
        angular_velocity=every.angular_velocity * axial,
        yaw=every.yaw * signs[:, 1:2],
        pitch=every.pitch * signs[:, 2:3],
        exit_velocity=every.exit_velocity * signs,
        exit_axis=every.exit_axis * signs,
        exit_position=every.exit_position * signs,
    )


def image_of(replay: Replay, symmetry: Symmetry, *, home: tuple[float, float], image: tuple[float, float]) -> Replay:
    """The history of a replayed shot, transformed to an image of its hit.

    Args:
        home: hit point (y, z) of the replayed shot [m].
        image: that of its image [m].
    """
    history, polar, axial = replay.history, symmetry.polar, symmetry.axial
    signs = symmetry.along_y, symmetry.along_z

    def moved(cells: tuple[Array, Array]) -> list[Array]:
        return [
            (sign * along + (to - sign * at))[::sign]  # increasing again
            for along, sign, at, to in zip(cells, signs, home, image, strict=True)
        ]

    def turned(layer: Weakened) -> Weakened:
        y, z = moved((layer.cell_y, layer.cell_z))
        fields = (field[..., :: signs[0], :: signs[1]] for field in (layer.material, layer.share))
        return Weakened(y, z, *fields)

    cells = moved((replay.cell_y, replay.cell_z))
    return replace(
        replay,
        outcomes=unfolded(replay.outcomes, [symmetry]),
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
        resistance_share=replay.resistance_share[:, :: signs[0], :: signs[1]],
        cell_y=cells[0],
        cell_z=cells[1],
        behind={number: turned(layer) for number, layer in replay.behind.items()},
    )


def _repeated(outcomes: Outcomes, times: int) -> Outcomes:
    """Every row, `times` times in a row."""
    return replace(outcomes, **{f.name: np.repeat(getattr(outcomes, f.name), times, axis=0) for f in fields(outcomes)})
