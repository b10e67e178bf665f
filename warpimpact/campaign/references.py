"""Shots at the references of a target: a solid add-on as heavy as its own before the same base, and the base alone."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from ..scene import Sampler, Shots, Target
from ..scene.quantities import BY_LAYER


class ReferenceSampler(Sampler):
    """The shots of another sampler, as they are at a reference."""

    def __init__(self, of: Sampler, changed: Callable[[Shots], Shots]) -> None:
        self._of, self._changed, self.cell = of, changed, of.cell

    def __len__(self) -> int:
        return len(self._of)

    def shots(self, first: int, count: int) -> Shots:
        return self._changed(self._of.shots(first, count))


def at_solid(target: Target, solid: Target, shots: Shots) -> Shots:
    """Shots at a solid reference, whose add-on is as heavy as that of each shot."""
    columns: dict[str, Any] = {}
    for name in ("thickness", "resistance"):
        if (column := shots.columns.get(name)) is not None:
            pairs = zip(target.layers, solid.layers, strict=True)
            values = [(getattr(old, name), getattr(new, name)) for old, new in pairs]
            ratios = [1.0 if old == new else new / old for old, new in values]
            columns[name] = column * np.array(ratios[: column.shape[1]])
    return replace(shots, **columns)


def at_base_alone(target: Target, shots: Shots) -> Shots:
    """Shots at the same places of the face of the base alone."""
    last = len(target.layers) - 1
    columns: dict[str, Any] = {
        name: shots.columns[name][:, last] if shots.varies(name, last) else None for name in BY_LAYER
    }
    columns |= dict.fromkeys(("offset_y", "offset_z", "degradation_length"))
    return replace(shots, **columns)
