"""A rigid body of revolution on the host, as kernels/rigid_body.py and kernels/target.py have it on the device."""

import math
from typing import Any

import numpy as np

from .core import MassProperties
from .model import Array


def line_of_flight(obliquity: Any, azimuth: Any) -> Array:
    """Unit vectors along lines of fire, along the last axis."""
    across = np.sin(obliquity)
    return np.stack([np.cos(obliquity), across * np.cos(azimuth), across * np.sin(azimuth)], axis=-1)


def axis_on_impact(flight: Array, pitch: float, yaw: float) -> Array:
    """Axis of a core; its projected angles are those of the line of fire, plus pitch and yaw [rad]."""
    turned = math.atan2(flight[1], flight[0]) + yaw, math.atan2(flight[2], flight[0]) + pitch
    axis = np.array([1.0, math.tan(turned[0]), math.tan(turned[1])])
    return np.asarray(axis / np.linalg.norm(axis))


def axis_of(attitude: Any) -> Array:
    """The axis of a core, from its base to its nose; the quaternion is the last axis of an array."""
    x, y, z, w = np.moveaxis(np.asarray(attitude, dtype=np.float64), -1, 0)
    return np.stack([1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + z * w), 2.0 * (x * z - y * w)], axis=-1)


def attitudes(axes: Array) -> Array:
    """Attitudes whose axes these are, shape [cores, 4]: the smallest turns from the plate's normal."""
    turns = np.column_stack([np.zeros(len(axes)), -axes[:, 2], axes[:, 1], 1.0 + axes[:, 0]])
    turns[turns[:, 3] <= 0.0] = 0.0, 0.0, 1.0, 0.0  # half a turn
    return np.asarray(turns / np.linalg.norm(turns, axis=1, keepdims=True))


def angle_between(one: Array, other: Array) -> Array:
    """Angles between vectors along the last axis [rad]."""
    return np.asarray(np.arctan2(np.linalg.norm(np.cross(one, other), axis=-1), np.sum(one * other, axis=-1)))


def energies(body: MassProperties, speed_squared: Any, along: Any, across_squared: Any) -> tuple[Any, Any]:
    """Energies of translation and rotation [J], from the angular momentum along the axis, and its square across."""
    rotational = 0.5 * (along**2 / body.inertia_axial + across_squared / body.inertia_transverse)
    return 0.5 * body.mass * speed_squared, rotational
