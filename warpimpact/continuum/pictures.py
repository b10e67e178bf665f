"""Pictures of a hit: what lies where in a plane through the line of flight, at five instants."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from warpimpact.continuum.bullet_mesh import FILLER
from warpimpact.continuum.one_hit import OneHit
from warpimpact.kernels.continuum.fields import CORE
from warpimpact.kernels.status import RUNNING, WAITING
from warpimpact.records.variables import INSTANTS, PICTURE_VARIABLES, PictureLabel, picture_axes
from warpimpact.scene import Core
from warpimpact.scene.model import Array
from warpimpact.scene.rigid import axis_of

MOST_FRAMES, FRAME_BYTES = 12, 13
"""Frames of a hit in memory, beside that of its end; bytes of a node in each of them."""
LEAST_TURN = 0.035
"""Sine of the angle that a core turns at least where its axis gives the plane of its pictures."""
TETRAHEDRA = (0, 1, 2, 6), (0, 1, 5, 6), (0, 3, 2, 6), (0, 3, 7, 6), (0, 4, 5, 6), (0, 4, 7, 6)
"""That an element consists of, by its corners."""
OUTSIDE = 1e-6
"""How far a place on a face may be outside, as a share of a tetrahedron."""


class Picture(NamedTuple):
    """The pictures of a hit.

    Attributes:
        label: codes of `PictureLabel`, shape [instants, across, along].
        time: since the impact [s], shape [instants].
        place: middle of each picture from the hit point [m], shape [instants, 3].
        across: unit vector across the line of flight.
    """

    label: NDArray[np.int8]
    time: Array
    place: Array
    across: Array


def picture_columns(pictures: Sequence[Picture]) -> dict[str, NDArray[Any]]:
    """Pictures of hits as columns."""
    columns = zip(PICTURE_VARIABLES, map(np.array, zip(*pictures, strict=True)), strict=True)
    return {str(name): column for name, column in columns}


class Frame(NamedTuple):
    """A hit at an instant: its time [s], centre of mass [m] and axis of its core, places of its nodes [m], and which of
    its elements are left."""

    time: float
    centre: Array
    axis: Array
    position: NDArray[np.float32]
    alive: NDArray[np.bool_]


class Frames:
    """Frames of a hit at even times. When they are too many, every second one goes."""

    def __init__(self) -> None:
        self._frames, self._due, self._interval = list[Frame](), 0.0, 0.0

    def take(self, hit: OneHit) -> None:
        """Take in the hit as it is, before it marches and after each launch. It is not changed."""
        flight = hit.flight
        if not self._frames:
            self._hit = hit
            self._interval = float(hit.core.length / (MOST_FRAMES * np.linalg.norm(hit.start.velocity)))
        if flight["time"] < self._due and flight["status"] in (RUNNING, WAITING):
            return
        state, position = flight["state"], hit.mesh.position.numpy().astype(np.float32).reshape(3, -1)
        centre, axis = np.array(state["position"]), axis_of(np.array(state["attitude"]))
        self._frames.append(Frame(float(flight["time"]), centre, axis, position, hit.mesh.alive.numpy() > 0.0))
        if len(self._frames) > MOST_FRAMES and flight["status"] in (RUNNING, WAITING):
            self._frames, self._interval = self._frames[::2], 2.0 * self._interval
        self._due = self._frames[-1].time + self._interval

    def picture(self, core: Core) -> Picture:
        """The pictures at INSTANTS of the march, in the plane in which the core has turned at its end."""
        velocity = self._hit.start.velocity
        flight, times = velocity / np.linalg.norm(velocity), np.array([frame.time for frame in self._frames])
        across = across_of(flight, self._frames[-1].axis)
        basis = np.stack([flight, across, np.cross(flight, across)])
        chosen = [self._frames[np.argmin(np.abs(times - share * times[-1]))] for share in INSTANTS]
        places = [frame.centre - (frame.centre @ basis[2]) * basis[2] for frame in chosen]
        labels = [_labels(self._hit, core, *one, basis) for one in zip(chosen, places, strict=True)]
        return Picture(np.array(labels), np.array([one.time for one in chosen]), np.array(places), across)


def across_of(flight: Array, axis: Array) -> Array:
    """The direction across a flight in which the axis of a core has turned; else that of the plane of incidence, and at
    normal incidence z. Along y and z, its larger component is positive."""
    for towards, least in ((axis, LEAST_TURN), (np.array([1.0, 0.0, 0.0]), LEAST_TURN), (np.array([0.0, 0.0, 1.0]), 0)):
        across = towards - (towards @ flight) * flight
        if np.linalg.norm(across) > least:
            break
    sign = np.sign(across[1 + np.argmax(np.abs(across[1:]))])
    return np.asarray(sign * across / np.linalg.norm(across))


def _labels(hit: OneHit, core: Core, frame: Frame, place: Array, basis: Array) -> NDArray[np.int8]:
    """The labels of a picture, shape [across, along].

    Args:
        place: middle of the picture [m].
        basis: unit vectors along and across the flight, and out of the picture, as rows.
    """
    across, along = picture_axes(core)
    labels, cell = np.zeros((len(across), len(along)), dtype=np.int8), along[1] - along[0]
    # Places in cells, from the middle of the first one.
    middle = basis @ place + np.array([along[0], across[0], 0.0])
    for number, (mesh, first) in enumerate(zip(hit.meshes, hit.firsts, strict=True)):
        held, is_new = slice(first, first + mesh.nodes), first >= len(frame.alive)
        nodes = mesh.position.reshape(3, -1) if is_new else frame.position[:, held]
        places = (basis @ nodes - middle[:, None]) / cell
        elements = np.flatnonzero(mesh.present.ravel() & (is_new or frame.alive[held]))
        corners = mesh.corners(elements)
        depth = places[2][corners]
        cut = (depth.min(axis=1) <= 0.0) & (depth.max(axis=1) >= 0.0)
        materials = np.broadcast_to(mesh.material, mesh.present.shape).ravel()[elements[cut]]
        paint(labels, places[:, corners[cut]], _codes(hit, number, materials))
    if all(body.kind != CORE for body in hit.bullet):
        labels[_in_rigid_core(core, hit.start.body.centre_of_mass, frame, place, basis)] = PictureLabel.CORE
    return labels


def _codes(hit: OneHit, body: int, materials: NDArray[np.int8]) -> NDArray[np.int8]:
    """Codes of elements of a body, by the numbers of their materials."""
    bodies = len(hit.bullet)
    if body < bodies and hit.bullet[body].kind != CORE:
        return np.where(materials == FILLER, PictureLabel.FILLER, PictureLabel.JACKET).astype(np.int8)
    code = PictureLabel.CORE if body < bodies else PictureLabel.PLATE if body == bodies else PictureLabel.LAYER
    return np.full(len(materials), code, dtype=np.int8)


def paint(labels: NDArray[np.int8], places: Array, codes: NDArray[np.int8]) -> None:
    """Give the cells whose middles lie in elements the codes of these.

    Args:
        labels: shape [rows, columns], which is changed.
        places: column, row and depth of the corners of the elements, in cells, shape [3, elements, 8].
        codes: shape [elements].
    """
    corners = places[:, :, TETRAHEDRA].reshape(3, -1, 4)
    edges = np.moveaxis(corners[..., 1:] - corners[..., :1], 0, -1)
    faces = np.cross(edges[:, [1, 2, 0]], edges[:, [2, 0, 1]])
    volume = np.einsum("ti,ti->t", edges[:, 0], faces[:, 0])
    # Between low and high: rows and columns of the cells in the box of each tetrahedron that the plane cuts.
    size = np.array(labels.shape[::-1])[:, None]
    low = np.clip(np.ceil(corners[:2].min(axis=-1)), 0, size).astype(int)
    high = np.clip(np.floor(corners[:2].max(axis=-1)) + 1, low, size).astype(int)
    wide, tall = high - low
    is_cut = (corners[2].min(axis=-1) <= 0.0) & (corners[2].max(axis=-1) >= 0.0) & (np.abs(volume) > 1e-9)
    count = np.where(is_cut, wide * tall, 0)
    which = np.repeat(np.arange(len(count)), count)
    within = np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count)
    column, row = low[0][which] + within % wide[which], low[1][which] + within // wide[which]
    # A place has a share of each corner, none of which is negative inside.
    slope = np.divide(faces, volume[:, None, None], out=np.zeros_like(faces), where=is_cut[:, None, None])
    base = np.einsum("tki,it->tk", slope, corners[..., 0])
    share = [slope[which, k, 0] * column + slope[which, k, 1] * row - base[which, k] for k in range(3)]
    inside = (np.minimum.reduce(share) >= -OUTSIDE) & (sum(share) <= 1.0 + OUTSIDE)
    labels[row[inside], column[inside]] = np.repeat(codes, len(TETRAHEDRA))[which[inside]]


def _in_rigid_core(core: Core, centre_of_mass: float, frame: Frame, place: Array, basis: Array) -> NDArray[np.bool_]:
    """Which cells of a picture are in a core that keeps its shape."""
    across, along = picture_axes(core)
    away = along[:, None] * basis[0] + across[:, None, None] * basis[1] + place - frame.centre
    ahead = away @ frame.axis
    station = centre_of_mass - ahead
    radius = np.asarray(core.radius(np.clip(station, 0.0, core.length)))
    inside = (station >= 0.0) & (station <= core.length)
    return np.asarray(inside & ((away**2).sum(axis=-1) - ahead**2 <= radius**2))
