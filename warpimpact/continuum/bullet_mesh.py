"""The meshes of a bullet: rings of elements of jacket and filler about a core, and that of the core."""

from __future__ import annotations

import math

import numpy as np
from scipy.spatial.transform import Rotation

from warpimpact.continuum.meshing import BodyMesh
from warpimpact.kernels.continuum.fields import PIECE
from warpimpact.scene import Core
from warpimpact.scene.bullet import Bullet
from warpimpact.scene.model import Array

AROUND, FILLER_ROWS, JACKET_ROWS, ALONG = 32, 2, 1, 0.6e-3
"""Elements of a draft around, of filler and jacket across; size along the axis [m]."""
FILLER, JACKET = 0, 1
"""Numbers of the materials."""
CORE_ACROSS, CORE_ALONG = 8, 1.0 / 6.0
"""Elements of a draft across a core; size along it, over its largest radius."""
TIP = 1.0 / 6.0
"""Radius at which the mesh of a core ends, over its largest one, as elements to the tip would be too thin."""
INNER_SQUARE = 0.8
"""Half the side of the square that a section would be near its middle, over its radius."""


def cells(bullet: Bullet, core: Core, fineness: float) -> tuple[int, int, int, int]:
    """Elements around, of the filler and of the jacket across, and along.

    Args:
        fineness: size of the elements over that of a draft.
    """
    along = round(bullet.length(core) / (fineness * ALONG))
    around, filler, jacket = (max(1, round(count / fineness)) for count in (AROUND, FILLER_ROWS, JACKET_ROWS))
    return around, filler, jacket, along


def bullet_nodes(bullet: Bullet, core: Core, fineness: float) -> int:
    """Nodes of its mesh."""
    around, filler, jacket, along = cells(bullet, core, fineness)
    return int(around * (filler + jacket + 1) * PIECE * (along // PIECE + 1))


def bullet_mesh(bullet: Bullet, core: Core, position: Array, attitude: Array, fineness: float) -> BodyMesh:
    """The mesh about a core: planes go round the axis, rows outwards, columns from nose to base.

    Args:
        position: centre of mass of the core [m].
        attitude: of the core, a quaternion.
        fineness: size of the elements over that of a draft.
    """
    around, filler_rows, jacket_rows, columns = cells(bullet, core, fineness)
    rows = filler_rows + jacket_rows
    station = np.linspace(0.0, bullet.length(core), columns + 1)
    inner, between, outer = bullet.radii(core, station)
    share = np.arange(rows + 1)[:, None]
    in_filler, in_jacket = share / filler_rows, (share - filler_rows) / jacket_rows
    radius = np.where(
        share < filler_rows,
        inner + in_filler * (between - inner),
        between + np.maximum(in_jacket, 0.0) * (outer - between),
    )
    angle = 2.0 * math.pi * np.arange(around)[:, None, None] / around
    ahead = core.mass_properties.centre_of_mass + bullet.core_place - station
    own = np.stack(np.broadcast_arrays(ahead, radius * np.cos(angle), radius * np.sin(angle)))
    placed = _placed(own, position, attitude)
    width = PIECE * (columns // PIECE + 1)  # whole pieces, so that no run reaches into the next row
    padded = np.pad(placed, ((0, 0), (0, 0), (0, 0), (0, width - columns - 1)), mode="edge")
    present, material = np.zeros(padded.shape[1:], dtype=bool), np.zeros(padded.shape[1:], dtype=np.int8)
    present[:, :rows, :columns] = True
    material[:, filler_rows:] = JACKET
    return BodyMesh(padded, present, fineness * ALONG, material=material, is_ring=True)


def _placed(own: Array, position: Array, attitude: Array) -> Array:
    """Points of the frame of a core [m], in that of the plate, shape [3, …] each."""
    turned = Rotation.from_quat(attitude).apply(own.reshape(3, -1).T).T.reshape(own.shape)
    return np.asarray(turned + position[:, None, None, None])


def core_stations(core: Core, fineness: float) -> Array:
    """Stations of the planes of nodes of a core, from its base to where its tip is cut [m].

    Args:
        fineness: size of the elements over that of a draft.
    """
    stations, radius = np.linspace(0.0, core.length, 2001), TIP * core.max_radius
    tip = float(stations[np.argmax(core.radius(stations) >= radius)])
    return np.linspace(core.length, tip, 1 + round((core.length - tip) / (fineness * CORE_ALONG * core.max_radius)))


def core_nodes(core: Core, fineness: float) -> int:
    """Nodes of its mesh."""
    return int(len(core_stations(core, fineness)) * (2 * round(0.5 * CORE_ACROSS / fineness) + 1) ** 2)


def section_of(across: int) -> Array:
    """Nodes of a section of the radius 1, shape [2, across + 1, across + 1]: squares about the middle, which become
    circles outwards. Its outline is a polygon with the area of the circle."""
    place = np.linspace(-1.0, 1.0, across + 1)
    y, z = np.meshgrid(place, place, indexing="ij")
    size = np.maximum(np.abs(y), np.abs(z))
    share = np.divide(np.stack([y, z]), size, out=np.zeros((2, *size.shape)), where=size > 0.0)
    angle = 0.25 * math.pi * share[0] * share[1]  # from −π/4 to π/4 along a side
    circle = np.where(
        np.abs(y) >= np.abs(z),
        [share[0] * np.cos(angle), share[0] * np.sin(angle)],
        [share[1] * np.sin(angle), share[1] * np.cos(angle)],
    )
    turn = 0.5 * math.pi / across
    outer = math.sqrt(turn / math.sin(turn))
    return np.asarray(size * ((1.0 - size) * INNER_SQUARE * share + size * outer * circle))


def core_mesh(core: Core, position: Array, attitude: Array, fineness: float) -> BodyMesh:
    """The mesh of a core: planes from base to tip, rows and columns across.

    Args:
        position: centre of mass of the core [m].
        attitude: of the core, a quaternion.
        fineness: size of the elements over that of a draft.
    """
    section, station = section_of(2 * round(0.5 * CORE_ACROSS / fineness)), core_stations(core, fineness)
    radius = np.asarray(core.radius(station))[:, None, None]
    ahead = (core.mass_properties.centre_of_mass - station)[:, None, None]
    own = np.stack(np.broadcast_arrays(ahead, radius * section[0], radius * section[1]))
    present = np.zeros(own.shape[1:], dtype=bool)
    present[:-1, :-1, :-1] = True
    return BodyMesh(_placed(own, position, attitude), present, fineness * CORE_ALONG * core.max_radius)


def with_its_mass(bullet: Bullet, core: Core, mesh: BodyMesh, volume: Array) -> Bullet:
    """A bullet with densities by which a mesh has its mass, as chords are shorter than arcs.

    Args:
        volume: of the elements at rest [m³], shape [nodes].
    """
    densities = np.array([flow.density for flow in bullet.flows])
    masses = float((densities[mesh.material.ravel()] * volume).sum())
    return bullet.scaled((bullet.mass - core.mass_properties.mass) / masses)
