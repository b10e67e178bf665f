"""A replayed hit in space: its layers as slabs, and the stress on the core's surface."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import xarray
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from warpimpact.records import attributes as attr
from warpimpact.records import variables as v

Array = NDArray[np.float64]

POINTS_AROUND = 72
"""Points around the core in every section of its profile."""
_SPENT = 1e-9  # share of the resistance below which it counts as none
_AT_REST = 1e-5  # share of the speed below which it is rounding: a wall that slides along itself does not close in


class Slab(NamedTuple):
    """One layer: its front and rear face [m], and whether it is solid at each point of the section."""

    front: float
    rear: float
    solid: NDArray[np.bool_]


def slabs(history: xarray.Dataset, view: str) -> list[Slab]:
    """The plate and the layers behind it, along y or z as `view` says, through the hit point."""
    if v.LAYER_FRONT not in history:
        return [Slab(0.0, history.attrs[attr.PLATE_THICKNESS], history[f"solid_along_{view}"].values == 1)]
    faces = zip(history[v.LAYER_FRONT].values.tolist(), history[v.LAYER_REAR].values.tolist(), strict=True)
    solid = history[f"layer_solid_along_{view}"].values == 1
    return [Slab(front, rear, here) for (front, rear), here in zip(faces, solid, strict=True)]


def runs_of(solid: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First and last places of the parts of a section that are solid."""
    edges = np.diff(np.concatenate([[0], solid.astype(int), [0]]))
    return list(zip(np.flatnonzero(edges == 1).tolist(), (np.flatnonzero(edges == -1) - 1).tolist(), strict=True))


class PressedSurface(NamedTuple):
    """A core's surface at an instant.

    Points in the plate [m] and outward normals have the shape [sections, around, 3]. Areas [m²] and the normal stress,
    as a share of that of the untouched plate at rest, have the shape [sections, around].
    """

    point: Array
    normal: Array
    area: Array
    stress: Array


def pressed(history: xarray.Dataset, step: int) -> PressedSurface:
    """The core's surface in a step of its history, with the normal stress of the paper's law (its eqs. 4 and 5).

    A point carries stress if it is in the plate and advances along its normal. The stress is the share of the
    resistance that is left there. For 48 hits on the slotted plate without friction, at their largest force, the sum of
    the stresses is 0.86 to 1.26 times the recorded force, and its direction is within 4° of it. The discs that close
    nose and base are left out.
    """
    arm, normal, area = _body(history)
    turn = Rotation.from_quat(history["attitude"].values[step]).as_matrix().T
    arm, normal = arm @ turn, normal @ turn
    point = history["plate_position"].values[step] + arm
    moving = history[["velocity", "angular_velocity"]].isel(time=slice(max(step - 1, 0), step + 1)).mean("time")
    velocity = moving["velocity"].values + np.cross(moving["angular_velocity"].values, arm)
    closing = np.sum(velocity * normal, axis=-1)
    inside = (point[..., 0] >= 0.0) & (point[..., 0] <= history.attrs[attr.PLATE_THICKNESS])
    touching = inside & (closing > _AT_REST * np.linalg.norm(velocity, axis=-1))
    # Between snapshots the logarithm is interpolated, because it is proportional to the exposure.
    share = history["resistance_share"]
    spent = xarray.apply_ufunc(np.log, share.where(share > _SPENT, _SPENT))
    cells = {f"cell_{axis}": (("section", "around"), point[..., k]) for k, axis in ((1, "y"), (2, "z"))}
    left = np.exp(spent.interp(snapshot=history["time"][step])).interp(cells).values  # NaN outside the cells
    return PressedSurface(point, normal, area, np.where(touching, np.nan_to_num(left), 0.0))


def largest_in_plate(history: xarray.Dataset) -> int:
    """The step of the largest force; with layers behind the plate, only among steps in which the core reaches none of
    them.

    A history contains the resistance left in the plate alone.
    """
    force = np.linalg.norm(history["force"], axis=1)
    if v.LAYER_FRONT in history:
        centre = history["plate_position"].values[:, 0]
        foremost = centre + np.abs(history["station"].values).max()
        force = np.where(foremost < float(history[v.LAYER_FRONT][1]), force, -1.0)
    return int(force.argmax())


def _body(history: xarray.Dataset) -> tuple[Array, Array, Array]:
    """Points relative to the centre of mass and normals in body axes, and areas; shapes as in `PressedSurface`."""
    station, radius = history["station"].values, history["core_radius"].values
    along, outward = -np.diff(station), np.diff(radius)  # from one section to the next, towards the base
    slant = np.hypot(along, outward)
    azimuth = (np.arange(POINTS_AROUND) + 0.5) * 2.0 * np.pi / POINTS_AROUND
    middle, wide = (station[1:] + station[:-1]) / 2, (radius[1:] + radius[:-1]) / 2

    def combined(axial: Array, radial: Array) -> Array:
        parts = (axial[:, None] + 0.0 * azimuth, np.outer(radial, np.cos(azimuth)), np.outer(radial, np.sin(azimuth)))
        return np.stack(parts, axis=-1)

    area = np.broadcast_to((slant * wide * 2.0 * np.pi / POINTS_AROUND)[:, None], (len(middle), POINTS_AROUND))
    return combined(middle, wide), combined(outward / slant, along / slant), area
