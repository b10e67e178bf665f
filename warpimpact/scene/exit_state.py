"""The state of a core behind a plate as seven numbers that regressions can add (docs/continuum.md).

They are, for a core of length l that arrives with v₀ along the line of fire:

    0       energy (v / v₀)²; negative for a core that stops, by how much energy it lacks
    1, 2    direction of flight
    3, 4    axis of the core
    5, 6    rate l / v₀ · dα/dt of the axis, carried by the smallest rotation from the axis onto the line of fire

A direction is the angle from the line of fire [rad], to the side to which it points. The sides are y and z of the
plate, carried by the smallest rotation from its normal onto the line of fire. Spin about the axis is left out.

Arrays have numbers or vectors along their last axis. A line of fire may stand for many states (broadcasting).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .model import Array

FEATURES = 7
"""Numbers of a state."""


class ExitStates(NamedTuple):
    """States of cores in the plate frame.

    Attributes:
        velocity: [..., 3, m/s]; zero for a core that stops.
        axis: unit vectors from base to nose, [..., 3].
        angular_velocity: without spin, [..., 3, rad/s].
    """

    velocity: Array
    axis: Array
    angular_velocity: Array


def features(
    velocity: Array, axis: Array, angular_velocity: Array, fire: Array, impact_velocity: Array, length: float
) -> Array:
    """States of moving cores as features, shape [..., 7].

    Args:
        velocity: [..., 3, m/s].
        axis: unit vectors from base to nose, [..., 3].
        angular_velocity: [..., 3, rad/s].
        fire: unit vectors along the line of fire, [..., 3].
        impact_velocity: [..., m/s].
        length: of the core [m].
    """
    speed, sides = np.linalg.norm(velocity, axis=-1), _sides(fire)
    rate = (length / impact_velocity)[..., None] * _turned(np.cross(angular_velocity, axis), axis, fire)
    columns = (
        (speed / impact_velocity)[..., None] ** 2,
        _sideways(velocity / speed[..., None], fire, sides),
        _sideways(axis, fire, sides),
        _components(rate, sides),
    )
    return np.concatenate(columns, axis=-1)


def states(numbers: Array, fire: Array, impact_velocity: Array, length: float) -> ExitStates:
    """States from their features, the inverse of `features` but for spin.

    Args:
        numbers: [..., 7].
        fire: unit vectors along the line of fire, [..., 3].
        impact_velocity: [..., m/s].
        length: of the core [m].
    """
    speed, sides = impact_velocity * np.sqrt(np.maximum(numbers[..., 0], 0.0)), _sides(fire)
    axis = _pointed(numbers[..., 3:5], fire, sides)
    rate = (impact_velocity / length)[..., None] * _turned(_vectors(numbers[..., 5:7], sides), fire, axis)
    return ExitStates(speed[..., None] * _pointed(numbers[..., 1:3], fire, sides), axis, np.cross(axis, rate))


def tilts(exits: ExitStates, fire: Array, distances: Array) -> Array:
    """Angles between axes and line of fire after free flights [rad], shape [hits, distances].

    A symmetric top without spin turns about its angular velocity at that rate. NaN where a core does not move on.

    Args:
        fire: unit vectors along the line of fire, [hits, 3].
        distances: of the centre of mass along x, [distances] or [hits, distances, m].
    """
    forward = np.where(exits.velocity[:, :1] > 0.0, exits.velocity[:, :1], np.nan)
    rate = np.linalg.norm(exits.angular_velocity, axis=1, keepdims=True)
    angle = rate * distances / forward
    side = np.cross(exits.angular_velocity, exits.axis) / np.maximum(rate, np.finfo(float).tiny)
    then = np.cos(angle)[..., None] * exits.axis[:, None] + np.sin(angle)[..., None] * side[:, None]
    return np.asarray(_angle(then, fire[:, None]))


def flown(exits: ExitStates, distance: Array) -> ExitStates:
    """States after free flights over distances of the centre of mass along x, [hits, m]."""
    rate = np.linalg.norm(exits.angular_velocity, axis=1)
    angle = (rate * distance / exits.velocity[:, 0])[:, None]
    side = np.cross(exits.angular_velocity, exits.axis) / np.maximum(rate, np.finfo(float).tiny)[:, None]
    return exits._replace(axis=np.cos(angle) * exits.axis + np.sin(angle) * side)


def _angle(one: Array, other: Array) -> Array:
    """Angles between vectors [rad]."""
    across = np.linalg.norm(np.cross(one, other), axis=-1)
    return np.asarray(np.arctan2(across, np.sum(one * other, axis=-1)))


def _turned(vectors: Array, start: Array, end: Array) -> Array:
    """Vectors after the smallest rotation of unit vectors `start` onto `end`, all [..., 3].

    Between opposite vectors it is a half turn about a perpendicular one.
    """
    about, cosine = np.cross(start, end), np.sum(start * end, axis=-1, keepdims=True)
    once = np.cross(about, vectors)
    turned = vectors + once + np.cross(about, once) / np.maximum(1.0 + cosine, _OPPOSITE)
    if not (1.0 + cosine < _OPPOSITE).any():
        return np.asarray(turned)
    smallest = np.eye(3)[np.argmin(np.abs(start), axis=-1)]
    across = np.cross(start, smallest)
    across /= np.linalg.norm(across, axis=-1, keepdims=True)
    half_turned = 2.0 * np.sum(vectors * across, axis=-1, keepdims=True) * across - vectors
    return np.asarray(np.where(1.0 + cosine < _OPPOSITE, half_turned, turned))


_OPPOSITE = 1e-12
"""1 + cosine of the angle between unit vectors, below which they are opposite."""

_Sides = tuple[Array, Array]
"""Unit vectors across lines of fire, [..., 3] each."""


def _sides(fire: Array) -> _Sides:
    """The sides of lines of fire, [..., 3]."""
    normal, first, second = np.eye(3)
    return _turned(first, normal, fire), _turned(second, normal, fire)


def _components(vectors: Array, sides: _Sides) -> Array:
    """Components of vectors along the sides, [..., 2]."""
    return np.stack([np.sum(vectors * side, axis=-1) for side in sides], axis=-1)


def _vectors(components: Array, sides: _Sides) -> Array:
    """Vectors across lines of fire from their components, [..., 3]."""
    return np.asarray(components[..., :1] * sides[0] + components[..., 1:] * sides[1])


def _sideways(units: Array, fire: Array, sides: _Sides) -> Array:
    """Angles of unit vectors from lines of fire, to the side to which they point, [..., 2, rad]."""
    across = _components(units, sides)
    length = np.linalg.norm(across, axis=-1, keepdims=True)
    angle = np.arctan2(length, np.sum(units * fire, axis=-1, keepdims=True))
    side = np.where(length > 0.0, across / np.maximum(length, np.finfo(float).tiny), [1.0, 0.0])
    return np.asarray(angle * side)


def _pointed(angles: Array, fire: Array, sides: _Sides) -> Array:
    """Unit vectors at angles from lines of fire, the inverse of `_sideways`."""
    angle = np.linalg.norm(angles, axis=-1, keepdims=True)
    side = _vectors(angles / np.maximum(angle, np.finfo(float).tiny), sides)
    return np.asarray(np.cos(angle) * fire + np.sin(angle) * side)
