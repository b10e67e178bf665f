"""The core of a replayed hit in drawings: its position, its attitude, and its outline in a view."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import xarray
from scipy.spatial import ConvexHull

from warpimpact.analysis.slabs import depth_of
from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.results.dataset import passed

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

INSTANTS = 5
"""Number of drawn poses of the core within the plate."""
_MM, _US = 1e3, 1e6
_FULL_TURN = np.linspace(0.0, 2.0 * np.pi, 73)


class Pose(NamedTuple):
    """Position of the centre of mass in the plate's frame [m], and unit vector towards the nose, both of shape [3]."""

    position: Array
    axis: Array


def poses_in_plate(dataset: xarray.Dataset) -> dict[str, Pose]:
    """Poses of the core at equal intervals of its passage through the plate, by time."""
    steps = np.linspace(0, dataset.sizes["time"] - 1, INSTANTS).round().astype(int)
    return {f"{float(dataset[v.TIME][step]) * _US:.0f} µs": pose_at_step(dataset, step) for step in steps}


def poses_behind(dataset: xarray.Dataset) -> dict[str, Pose]:
    """Poses of the core at the stand-offs, by distance: those behind layers that it reaches, and those behind the
    target, if it passes that."""
    standoffs = dataset[v.STANDOFF].values.tolist() if passed(dataset) else []
    return _poses_behind_layers(dataset) | {
        f"{standoff * _MM:g} mm": _pose_at(dataset, standoff) for standoff in standoffs
    }


def _poses_behind_layers(dataset: xarray.Dataset) -> dict[str, Pose]:
    """Poses at the stand-offs behind all layers but the last one. Free flight leads from step to step there."""
    if v.LAYER_STANDOFF not in dataset:
        return {}
    path, poses = dataset[v.PLATE_POSITION].values, {}
    for layer, rear in enumerate(dataset[v.LAYER_REAR].values[:-1]):
        for place, standoff in enumerate(dataset[v.LAYER_STANDOFF].values):
            angles = [float(dataset[name][layer, place]) for name in (v.LAYER_STANDOFF_YAW, v.LAYER_STANDOFF_PITCH)]
            if np.isfinite(angles).all():
                axis = _axis_of(*np.radians(angles))
                x = rear + standoff - _ahead(dataset) * axis[0]
                before = int(np.argmax(path[:, 0] > x)) - 1
                share = (x - path[before, 0]) / (path[before + 1, 0] - path[before, 0])
                position = path[before] + share * (path[before + 1] - path[before])
                poses[f"{standoff * _MM:g} mm behind\nlayer {layer}"] = Pose(position, axis)
    return poses


def silhouette(dataset: xarray.Dataset, pose: Pose, view: str) -> Array:
    """Outline of the core [m], shape [points, 2]: x, and y or z as `view` says.

    It is the convex hull of the rings; it does not show a groove.
    """
    _, _, (_, right, up) = np.linalg.svd(pose.axis[None, :])  # two directions at right angles to the axis
    station, radius = (dataset[name].values[:, None, None] for name in (v.STATION, v.CORE_RADIUS))
    ring = np.cos(_FULL_TURN)[:, None] * right + np.sin(_FULL_TURN)[:, None] * up
    points = (pose.position + station * pose.axis + radius * ring)[..., [0, "xyz".index(view)]].reshape(-1, 2)
    outline: Array = points[ConvexHull(points).vertices]
    return outline


def pose_at_step(dataset: xarray.Dataset, step: int) -> Pose:
    return Pose(dataset[v.PLATE_POSITION].values[step], dataset[v.CORE_AXIS].values[step])


def _pose_at(dataset: xarray.Dataset, standoff: float) -> Pose:
    """The core when it passes a stand-off [m]: the axis from the projected angles, the position from free flight."""
    there, end = dataset.sel(standoff=standoff), dataset.isel(time=-1)
    axis = _axis_of(*(np.radians(float(there[name])) for name in (v.YAW, v.PITCH)))
    position, velocity = end[v.PLATE_POSITION].values, end[v.VELOCITY].values
    x = depth_of(dataset) + standoff - _ahead(dataset) * axis[0]
    return Pose(position + velocity * ((x - position[0]) / velocity[0]), axis)


def _axis_of(yaw: float, pitch: float) -> Array:
    """The unit vector with these projected angles [rad]."""
    axis = np.sign(np.cos(yaw)) * np.array([1.0, np.tan(yaw), np.tan(pitch)])
    return np.asarray(axis / np.linalg.norm(axis))


def _ahead(dataset: xarray.Dataset) -> float:
    """Distance of the stand-off point ahead of the centre of mass [m]."""
    return float(dataset[v.STATION].max()) if dataset.attrs[attr.STANDOFF_POINT] == "nose" else 0.0
