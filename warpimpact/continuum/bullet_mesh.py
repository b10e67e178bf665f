"""The mesh of jacket and filler: rings of elements about a core."""

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
    placed = (
        Rotation.from_quat(attitude).apply(own.reshape(3, -1).T).T.reshape(own.shape) + position[:, None, None, None]
    )
    width = PIECE * (columns // PIECE + 1)  # whole pieces, so that no run reaches into the next row
    padded = np.pad(placed, ((0, 0), (0, 0), (0, 0), (0, width - columns - 1)), mode="edge")
    present, material = np.zeros(padded.shape[1:], dtype=bool), np.zeros(padded.shape[1:], dtype=np.int8)
    present[:, :rows, :columns] = True
    material[:, filler_rows:] = JACKET
    return BodyMesh(padded, present, fineness * ALONG, material=material, is_ring=True)


def with_its_mass(bullet: Bullet, core: Core, mesh: BodyMesh, volume: Array) -> Bullet:
    """A bullet with densities by which a mesh has its mass, as chords are shorter than arcs.

    Args:
        volume: of the elements at rest [m³], shape [nodes].
    """
    densities = np.array([flow.density for flow in bullet.flows])
    masses = float((densities[mesh.material.ravel()] * volume).sum())
    return bullet.scaled((bullet.mass - core.mass_properties.mass) / masses)
