"""How deep contact is remembered: the laminates of a target, and the planes of their fields (docs/model.md §4.8)."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Sequence

    from warpimpact.scene import Plate, Target
    from warpimpact.solver.materials import Materials
    from warpimpact.solver.resolution import Resolution

FEWEST_PLANES, PLANES = 3, 1.6
"""Per degradation depth: at least, and times the square root of its steps, as planes err by the fourth order of their
distance and steps by the second of theirs. Twice as many change no answer by a tenth of its error (oblique, slots)."""
SPARE = 4
"""Planes beyond those within a laminate: one on each side, the one behind the last whole spacing, and its neighbour."""


ROUNDING = 1e-9
"""Of a thickness, which may be a sum."""


class Planes(NamedTuple):
    """Planes of a window through the thickness: their number, the `spacing` between two [m], and how many of them a
    degradation depth has. One stands for the whole thickness."""

    number: int = 1
    spacing: float = math.inf
    reach: int = 0


WHOLE = Planes()


def laminates_of(target: Target, materials: Sequence[Materials]) -> list[int]:
    """For every layer, the first one of its laminate: of layers that weaken, touch each other and remember alike. A
    laminate of one material is the plate of its thickness."""
    first = [0]
    for k, (before, layer) in enumerate(pairwise(target.layers), start=1):
        both = materials[k - 1].weakens and materials[k].weakens and materials[k - 1].by_path == materials[k].by_path
        touching = target.gaps[k] == 0.0 and _memory(before) == _memory(layer)
        first.append(first[-1] if both and touching else k)
    return first


def thicknesses_of(laminates: Sequence[int], materials: Sequence[Materials]) -> list[float]:
    """For every layer, the largest thickness of its laminate in any shot [m]; 0 where it does not weaken."""
    rear = {k: material.front + material.thickness for k, material in zip(laminates, materials, strict=True)}
    return [float((rear[k] - materials[k].front).max()) if materials[k].weakens else 0.0 for k in laminates]


def is_deep(target: Target, thicknesses: Sequence[float]) -> bool:
    """Whether a laminate is thicker than the depth over which it weakens together."""
    most = 1.0 + ROUNDING
    return any(h > most * layer.degradation_depth for h, layer in zip(thicknesses, target.layers, strict=True))


def planes_of(target: Target, thicknesses: Sequence[float], resolution: Resolution) -> list[Planes]:
    """The planes of all layers, which the step refines; one plane each where none is deep."""
    if not is_deep(target, thicknesses):
        return [WHOLE] * len(thicknesses)
    planes = []
    for layer, thickness in zip(target.layers, thicknesses, strict=True):
        depth = layer.degradation_depth
        way = resolution.travel * float(resolution.passage(thickness or layer.thickness, layer, weakens=True))
        reach = max(FEWEST_PLANES, math.ceil(PLANES * math.sqrt(depth / way)))
        planes.append(Planes(math.floor(thickness * reach / depth) + SPARE, depth / reach, reach))
    return planes


def _memory(plate: Plate) -> tuple[float, float]:
    return plate.degradation_length, plate.degradation_depth
