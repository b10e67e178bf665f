"""The proxy of a core's depth in what follows, beside the limit thickness that it stands for."""

from __future__ import annotations

import json
from typing import NamedTuple

import numpy as np
import xarray
from numpy.typing import NDArray
from pydantic import TypeAdapter

from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.scene import AnyCore, Core

Array = NDArray[np.float64]


class Proxy(NamedTuple):
    """The proxy of every hit, shape [hits].

    Attributes:
        inclination: angle between the axis and the line of fire on impact [degree].
        depth: kinetic energy over the presented area and the resistance [m].
        ratio: `depth` over the limit thickness.
    """

    inclination: Array
    depth: Array
    ratio: Array


def proxy(dataset: xarray.Dataset) -> Proxy | None:
    """The proxy for hits with known limit thickness; None where the target is not one solid plate."""
    attributes = dataset.attrs
    needed = {attr.CORE, attr.MATERIAL, attr.OPEN_AREA}
    if not needed <= attributes.keys() or attributes[attr.OPEN_AREA] > 0.0 or v.LAYER_STATUS in dataset:
        return None
    core: Core = TypeAdapter[Core](AnyCore).validate_json(attributes[attr.CORE])
    resistance = dataset.get(v.RESISTANCE, json.loads(attributes[attr.MATERIAL])["resistance"])
    mass = dataset.get(v.MASS, core.mass_properties.mass)
    tilt = inclination(dataset)
    energy = 0.5 * np.asarray(mass) * dataset[v.IMPACT_VELOCITY].values ** 2
    depth = energy / (core.presented_area(tilt) * np.asarray(resistance, dtype=np.float64))
    return Proxy(np.degrees(tilt), depth, depth / dataset[v.LIMITS["thickness"].value].values)


def inclination(dataset: xarray.Dataset) -> Array:
    """Angle between the axis and the line of fire [rad]. The projected angles of the axis add to those of the line."""
    names = (v.OBLIQUITY, v.AZIMUTH, v.IMPACT_PITCH, v.IMPACT_YAW)
    obliquity, azimuth, pitch, yaw = (np.radians(dataset[name].values) for name in names)
    along_y, along_z = np.tan(obliquity) * np.cos(azimuth), np.tan(obliquity) * np.sin(azimuth)
    ones = np.ones_like(obliquity)
    flight = np.stack([ones, along_y, along_z], axis=-1)
    axis = np.stack([ones, np.tan(np.arctan(along_y) + yaw), np.tan(np.arctan(along_z) + pitch)], axis=-1)
    across = np.linalg.norm(np.cross(axis, flight), axis=-1)
    return np.asarray(np.arctan2(across, (axis * flight).sum(axis=-1)))
