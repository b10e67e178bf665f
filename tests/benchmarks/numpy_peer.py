"""The paper's literal scheme (its eqs. 1 to 6; docs/model.md §4) in NumPy, vectorised over points and hits.

The core has 36 × 36 points. Each point in the slab has the load Y (−n + η t), t the meridian tangent. The nearest node
of a 10 µm grid weakens by β once per step in which it is touched. Touches are counted per node, so the plate itself is
stored once, and a core uses only the pages of memory that it touches. float64.
"""

from __future__ import annotations

import math

import numpy as np
from bench import Array, launch_state, tilt_behind
from numpy.typing import NDArray

from warpimpact.scene import Core, Plate, Shots
from warpimpact.scene.core import MassProperties

AXIAL, AROUND, SPACING, STEP = 36, 36, 1.0e-5, 1.0e-6
BATCH = 16
"""Hits marched together: the fastest of 1, 4, 16, 32 and 64 on the slotted plate."""


class Peer:
    """A scene, ready to march; NumPy computes on one core.

    The literal law can push energy into a core. warpimpact limits a step that would raise the kinetic energy.
    `restrained` does so, too, for the comparison.
    """

    def __init__(self, core: Core, plate: Plate, *, batch: int = BATCH, restrained: bool = False) -> None:
        self.core, self.plate, self.batch, self.restrained = core, plate, batch, restrained
        self.station, self.radius, area, self.axial, self.outward = points_of(core)
        self.pressed_area = plate.resistance * area
        azimuth = (np.arange(AROUND) + 0.5) * (2.0 * np.pi / AROUND)
        self.cosine, self.sine = np.cos(azimuth), np.sin(azimuth)
        self.period = plate.pattern.period
        self.cells = [math.ceil(extent / SPACING - 1e-9) for extent in self.period]
        self.width = np.array([extent / n for extent, n in zip(self.period, self.cells, strict=True)])
        y, z = ((np.arange(n) + 0.5) * width for n, width in zip(self.cells, self.width, strict=True))
        self.solid = ~plate.pattern.is_hole(y[:, None], z).reshape(-1)
        self.weakened = plate.degradation ** np.arange(256.0)
        self.side = int(2.0 * core.bounding_radius / self.width.min())  # of the window that counts touches

    def __call__(self, shots: Shots, standoff: float) -> tuple[Array, Array]:
        """Residual velocity [m/s] and tilt [rad] at a stand-off [m], each of shape [shots]; all must perforate."""
        starts = range(0, len(shots), self.batch)
        parts = [self._march(shots[first : first + self.batch], standoff) for first in starts]
        residual, tilt = (np.concatenate(column) for column in zip(*parts, strict=True))
        return residual, tilt

    def _march(self, shots: Shots, standoff: float) -> tuple[Array, Array]:
        flight, axis, position = launch_state(self.core, shots)
        body, count = self.core.mass_properties, len(shots)
        velocity = shots.velocity[:, None] * flight
        momentum = body.inertia_axial * shots.spin[:, None] * axis
        frame = frame_of(axis)
        hit = np.stack([shots.hit_y, shots.hit_z], axis=1)
        home = np.floor(hit / self.width).astype(np.int64)
        offset = (home + 0.5) * self.width - hit  # of the centre of the home cell from the hit
        touches = np.zeros(count * self.side**2, dtype=np.uint8)
        final = [np.empty((count, 3)) for _ in range(4)]
        hits = np.arange(count)  # those still in the plate
        drift = 0.5 * STEP
        while len(hits):
            position = position + drift * velocity
            frame = turned(frame, momentum, body, drift)
            drift = STEP
            force, moment, rear = self._load(position, frame, hits, offset, home, touches)
            gone = (rear > self.plate.thickness) & (velocity[:, 0] > 0.0)
            if gone.any():
                for kept, values in zip(final, (position, frame[:, 0], velocity, momentum), strict=True):
                    kept[hits[gone]] = values[gone]
            if self.restrained:
                share = restraint(body, frame[:, 0], velocity, momentum, force, moment)
                force, moment = share * force, share * moment
            velocity = velocity + STEP / body.mass * force
            momentum = momentum + STEP * moment
            if gone.any():
                stays = ~gone
                hits, position, frame = hits[stays], position[stays], frame[stays]
                velocity, momentum, offset, home = velocity[stays], momentum[stays], offset[stays], home[stays]
        tilt = tilt_behind(self.core, self.plate.thickness, standoff, flight, (final[0], final[1], final[2], final[3]))
        return np.linalg.norm(final[2], axis=1), tilt

    def _load(
        self,
        position: Array,
        frame: Array,
        hits: NDArray[np.int64],
        offset: Array,
        home: NDArray[np.int64],
        touches: NDArray[np.uint8],
    ) -> tuple[Array, Array, Array]:
        """Force [N] and moment [N m] on every core, shape [hits, 3], and its rearmost point along x [m]."""
        axis, right, up = frame[:, 0], frame[:, 1], frame[:, 2]
        outward_x = right[:, :1] * self.cosine + up[:, :1] * self.sine
        middle = position[:, :1] + self.station * axis[:, :1]
        x = middle[:, :, None] + self.radius[:, None] * outward_x[:, None, :]
        rear = x.min(axis=(1, 2))
        which = np.flatnonzero((x >= 0.0) & (x <= self.plate.thickness))
        own, point = np.divmod(which, AXIAL * AROUND)
        ring, azimuth = np.divmod(point, AROUND)
        outward = right[own] * self.cosine[azimuth, None] + up[own] * self.sine[azimuth, None]
        along = axis[own]
        arm = self.station[ring, None] * along + self.radius[ring, None] * outward
        cell = np.floor((position[own, 1:] + arm[:, 1:] - offset[own]) / self.width + 0.5).astype(np.int64)
        row, column = cell.T % self.side
        node = (hits[own] * self.side + row) * self.side + column
        row, column = (cell + home[own]).T % np.array(self.cells)[:, None]
        stress = self.solid[row * self.cells[1] + column] * self.weakened[touches[node]]
        touches[node] += np.uint8(1)  # once per node, however many points share it
        pressed = stress * self.pressed_area[ring]
        na, no = self.axial[ring], self.outward[ring]
        eta = self.plate.shear_coefficient
        force = (pressed * (-na - eta * no))[:, None] * along + (pressed * (eta * na - no))[:, None] * outward
        moment = np.cross(arm, force)
        total = [np.bincount(own, weights, len(hits)) for weights in (*force.T, *moment.T)]
        return np.stack(total[:3], axis=1), np.stack(total[3:], axis=1), rear


def points_of(core: Core) -> tuple[Array, Array, Array, Array, Array]:
    """Per ring of points: station ahead of the centre of mass and radius [m], area of one [m²], its normal along the
    axis and outwards. The profile is evenly divided; nose and base have no points of their own."""
    edges = np.linspace(0.0, core.length, AXIAL + 1)
    middle = 0.5 * (edges[1:] + edges[:-1])
    r, radius = core.radius(edges), core.radius(middle)
    sector = 2.0 * np.pi / AROUND
    axial = sector * 0.5 * np.diff(r**2)
    lateral = 2.0 * math.sin(0.5 * sector) * (r[1:] + r[:-1] + 4.0 * radius) / 6.0 * np.diff(edges)
    area = np.hypot(axial, lateral)
    return core.mass_properties.centre_of_mass - middle, radius, area, axial / area, lateral / area


def frame_of(axis: Array) -> Array:
    """Body axes in the plate frame, shape [hits, 3 axes, 3]: the shortest turn of the plate frame that takes x to the
    core's axis."""
    a, b, c = axis.T
    scale = 1.0 / (1.0 + a)
    right = np.stack([-b, 1.0 - scale * b * b, -scale * b * c], axis=1)
    up = np.stack([-c, -scale * b * c, 1.0 - scale * c * c], axis=1)
    return np.stack([axis, right, up], axis=1)


def restraint(
    body: MassProperties, axis: Array, velocity: Array, momentum: Array, force: Array, moment: Array
) -> Array:
    """Share of a step's force and moment that leaves the least kinetic energy, if all of it raises it; [hits, 1]."""

    def rate(about: Array) -> Array:
        along = (about * axis).sum(axis=1, keepdims=True) * axis
        return along / body.inertia_axial + (about - along) / body.inertia_transverse

    slope = STEP * (force * velocity + moment * rate(momentum)).sum(axis=1, keepdims=True)
    curvature = STEP**2 * (force * force / body.mass + moment * rate(moment)).sum(axis=1, keepdims=True)
    least = np.maximum(0.0, -slope / np.maximum(curvature, 1e-300))
    return np.where(slope + curvature > 0.0, least, 1.0)


def turned(frame: Array, momentum: Array, body: MassProperties, time: float) -> Array:
    """Body axes after torque-free motion over a time [s]: a roll about the axis, then the precession about L."""
    axial, transverse = body.inertia_axial, body.inertia_transverse
    own = (momentum * frame[:, 0]).sum(axis=1) * (1.0 / axial - 1.0 / transverse)
    frame = _rotated(frame, own[:, None] * frame[:, 0] * time)
    return _rotated(frame, momentum * (time / transverse))


def _rotated(frame: Array, by: Array) -> Array:
    """Vectors, shape [hits, 3, 3], turned by the rotation vectors `by`, shape [hits, 3] (Rodrigues)."""
    angle = np.linalg.norm(by, axis=1)[:, None, None]
    unit = by[:, None, :] / np.maximum(angle, 1e-300)
    along = (unit * frame).sum(axis=2, keepdims=True) * unit
    return along + np.cos(angle) * (frame - along) + np.sin(angle) * np.cross(unit, frame)
