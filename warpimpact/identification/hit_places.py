"""Where a measured shot hit: a place, a place with its uncertainty, a class of places, or unknown."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpimpact.identification.parameters import is_distribution, read_distribution
from warpimpact.scene import Core, Plate
from warpimpact.scene.distributions import EDGE, Distribution
from warpimpact.scene.model import Array
from warpimpact.scene.units import Length, quantity, quoted

_CIRCLE_POINTS = 24
"""Points on the core's largest circle by which it is checked whether the circle crosses the edge of a hole."""

BoolArray = NDArray[np.bool_]


def _everywhere(plate: Plate, core: Core, y: Array, z: Array) -> BoolArray:
    return np.ones(np.broadcast(y, z).shape, dtype=bool)


def _in_a_hole(plate: Plate, core: Core, y: Array, z: Array) -> BoolArray:
    return np.asarray(plate.pattern.is_hole(y, z))


def _on_material(plate: Plate, core: Core, y: Array, z: Array) -> BoolArray:
    return np.logical_not(_in_a_hole(plate, core, y, z))


def _on_an_edge(plate: Plate, core: Core, y: Array, z: Array) -> BoolArray:
    """Whether the core's largest circle about the hit crosses the edge of a hole."""
    angles = np.linspace(0.0, 2.0 * np.pi, _CIRCLE_POINTS, endpoint=False)
    around = [
        _in_a_hole(plate, core, y + core.max_radius * np.cos(angle), z + core.max_radius * np.sin(angle))
        for angle in angles
    ]
    holes = np.sum([*around, _in_a_hole(plate, core, y, z)], axis=0)
    return np.asarray((holes > 0) & (holes < len(around) + 1))


CLASSES: dict[str, Callable[[Plate, Core, Array, Array], BoolArray]] = {
    "unknown": _everywhere,
    "through a hole": _in_a_hole,
    "between holes": _on_material,
    "at an edge": _on_an_edge,
}
"""Classes of hit points: where the line of flight of the centre of mass crosses the front face. "at an edge" is where
the core's largest circle crosses the edge of a hole."""


@dataclass(frozen=True)
class HitPlace:
    """A measured hit point: each coordinate is a number [m] or a distribution."""

    y: float | Distribution
    z: float | Distribution

    @property
    def is_exact(self) -> bool:
        return isinstance(self.y, float) and isinstance(self.z, float)

    def at(self, share_y: Array, share_z: Array) -> tuple[Array, Array]:
        """Points at uniform numbers."""

        def along(value: float | Distribution, share: Array) -> Array:
            if isinstance(value, float):
                return np.full_like(share, value)
            return value.quantile(np.clip(share, EDGE, 1.0 - EDGE))

        return along(self.y, share_y), along(self.z, share_z)


def read_hit(given: Any) -> str | HitPlace:
    """Read the class or the place of a hit.

    Raises:
        ValueError: the message says what is allowed.
    """
    if isinstance(given, str):
        if given not in CLASSES:
            meant = get_close_matches(given, CLASSES, n=1)
            hint = f'; did you mean "{meant[0]}"?' if meant else ""
            allowed = ", ".join(f'"{name}"' for name in CLASSES)
            raise ValueError(f"got {quoted(given)}, but it must be {allowed}, or a table with y and z{hint}")
        return given
    if not isinstance(given, dict) or set(given) != {"y", "z"}:
        raise ValueError(f"got {quoted(given)}, but it must be the name of a class, or a table with y and z")
    return HitPlace(**{axis: _coordinate(value, axis) for axis, value in given.items()})


def _coordinate(value: Any, axis: str) -> float | Distribution:
    read = quantity(Length)
    if is_distribution(value):
        return read_distribution(read, value, axis)
    try:
        return float(read(value))
    except ValueError as error:
        raise ValueError(f"{axis}: {error}") from None
