"""A bench of contact laws: a law is fitted to the continuum's hits of some plates, and predicts those of others.

    python -m tests.validation.laws [LAW …] [--fit slotted,thin] [--plates slotted,thin,thick,oblique,solid_12]

A law gives the normal stress of a surface element from what is near: faces and edges, along the normal and at all, and
its closing speed. `march` is a small rigid body that has nothing but the law, friction and a narrow onset: no
weakening. So a law takes some lines, and a hit a few milliseconds. With a constant stress it agrees with the package at
β = 1 (`--check`). The rows are those of tests/benchmarks/continuum_trade.py; what was found is in
tests/benchmarks/NOTES.md.
"""

from __future__ import annotations

import argparse
import math
import sys
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import warp as wp
from numpy.typing import NDArray
from scipy.optimize import minimize

BENCHMARKS = Path(__file__).resolve().parents[1] / "benchmarks"
sys.path.insert(0, str(BENCHMARKS))

from bench import launch_state, tilt_behind  # noqa: E402
from continuum_cases import CASES, measured, written  # noqa: E402

from warpimpact import Core, Numerics, Scene, simulate  # noqa: E402

Array = NDArray[np.float64]
real = wp.float64
FAR = 0.02
"""Where no edge is nearer along the normal [m]."""
ONSET, STEADY = 0.01, 0.5
"""Onset of contact as a share of the speed; and of what a wall of 2 GPa does to the core in a step."""
EDGE, SPACING = 5e-5, 5e-5
"""Over which a hole's edge is blurred, and the spacing of the distances to it [m]."""
SCALES = np.array([5.0, 5.0, 10.0])
"""Of the misfit: m/s, ° at 50 mm, ° at 130 mm. Those of a solid plate's velocities are three times as large."""
ROUNDS = 70
"""Evaluations of a fit for each parameter."""


@wp.struct
class Near:
    """What is near a surface element. Lengths are in metres.

    Attributes:
        face, edge: distance along the normal to a face of the plate, and to the edge of a hole.
        nearest_face, nearest_edge: the same, at all.
        radius, widest: of the core there, and at most.
        thickness: of the plate.
        closing: speed of the element along its normal [m/s].
    """

    face: real
    edge: real
    nearest_face: real
    nearest_edge: real
    radius: real
    widest: real
    thickness: real
    closing: real


@wp.func
def distance_at(tile: wp.array2d(dtype=real), cell: wp.vec2d, y: real, z: real):
    """Distance from the nearest edge at a point [m], negative in a hole; bilinear in a periodic tile."""
    across, along = y / cell[0], z / cell[1]
    row, column = wp.floor(across), wp.floor(along)
    b, c = across - row, along - column
    rows, columns = tile.shape[0], tile.shape[1]
    i, j = ((wp.int32(row) % rows) + rows) % rows, ((wp.int32(column) % columns) + columns) % columns
    k, m = (i + 1) % rows, (j + 1) % columns
    one = real(1.0)
    return (one - b) * ((one - c) * tile[i, j] + c * tile[i, m]) + b * ((one - c) * tile[k, j] + c * tile[k, m])


@wp.func
def edge_along(tile: wp.array2d(dtype=real), cell: wp.vec2d, y: real, z: real, unit_y: real, unit_z: real):
    """Distance in the plane of the plate from a point to an edge in a direction [m], at most FAR."""
    way = wp.max(distance_at(tile, cell, y, z), real(0.0))
    left = real(1.0) * way
    tries = int(0)
    while tries < 16 and way < real(FAR) and left > real(2e-5):
        left = distance_at(tile, cell, y + way * unit_y, z + way * unit_z)
        way += wp.max(left, real(2e-5))
        tries += 1
    return wp.where(left > real(2e-5), real(FAR), wp.min(way, real(FAR)))


def built(law: Any) -> Any:
    """The march under a law, a function of the parameters and of what is near."""

    @wp.kernel(module="unique")
    def march(
        start: wp.array2d(dtype=real),
        hits: wp.array2d(dtype=real),
        rings: wp.array2d(dtype=real),
        around: wp.int32,
        tile: wp.array2d(dtype=real),
        cell: wp.vec2d,
        body: wp.array(dtype=real),
        parameters: wp.array(dtype=real),
        ends: wp.array2d(dtype=real),
    ):
        i = wp.tid()
        zero, half, one = real(0.0), real(0.5), real(1.0)
        mass, axial, transverse, thickness = body[0], body[1], body[2], body[3]
        place = wp.vec3d(start[i, 0], start[i, 1], start[i, 2])
        axis = wp.vec3d(start[i, 3], start[i, 4], start[i, 5])
        velocity = wp.vec3d(start[i, 6], start[i, 7], start[i, 8])
        momentum = wp.vec3d()
        first = wp.length(velocity)
        dt = body[4] / first
        sector = real(2.0 * math.pi) / real(around)
        status = int(-1)
        steps = int(0)
        drift = half * dt
        while status < 0 and steps < 4000:
            steps += 1
            place = place + drift * velocity
            size = wp.length(momentum)
            if size > real(1e-12):
                angle, about = size / transverse * drift, momentum / size
                along = wp.dot(about, axis) * about
                axis = wp.normalize(along + wp.cos(angle) * (axis - along) + wp.sin(angle) * wp.cross(about, axis))
            drift = dt
            aside = wp.where(wp.abs(axis[2]) < real(0.9), wp.vec3d(zero, zero, one), wp.vec3d(zero, one, zero))
            right = wp.normalize(wp.cross(axis, aside))
            up = wp.cross(axis, right)
            spin = momentum / transverse + (wp.dot(momentum, axis) * (one / axial - one / transverse)) * axis
            speed = wp.length(velocity)
            onset = wp.max(real(ONSET) * speed, body[6] * dt)
            force = wp.vec3d()
            moment = wp.vec3d()
            rear = real(1.0)
            front = real(-1.0)
            for k in range(rings.shape[0]):
                station, radius, length = rings[k, 0], rings[k, 1], rings[k, 5]
                middle = place[0] + station * axis[0]
                extent = radius * wp.sqrt(wp.max(zero, one - axis[0] * axis[0])) + length
                rear, front = wp.min(rear, middle - extent), wp.max(front, middle + extent)
                if middle + extent > zero and middle - extent < thickness:
                    for j in range(around):
                        azimuth = (real(j) + half) * sector
                        outward = wp.cos(azimuth) * right + wp.sin(azimuth) * up
                        arm = station * axis + radius * outward
                        x = place + arm
                        normal = rings[k, 2] * axis + rings[k, 3] * outward
                        moving = velocity + wp.cross(spin, arm)
                        closing = wp.dot(moving, normal)
                        share = wp.clamp(closing / onset, zero, one)
                        share *= wp.clamp(half + half * x[0] / length, zero, one)
                        share *= wp.clamp(half + half * (thickness - x[0]) / length, zero, one)
                        y, z = x[1] + hits[i, 0], x[2] + hits[i, 1]
                        if share > zero:
                            inside = distance_at(tile, cell, y, z)
                            share *= wp.clamp(inside / real(EDGE) + half, zero, one)
                            depth = wp.clamp(x[0], zero, thickness)
                            steep = wp.max(wp.abs(normal[0]), real(1e-3))
                            flat = wp.max(wp.sqrt(normal[1] * normal[1] + normal[2] * normal[2]), real(1e-3))
                            near = Near()
                            near.face = wp.where(normal[0] > zero, thickness - depth, depth) / steep
                            near.edge = edge_along(tile, cell, y, z, normal[1] / flat, normal[2] / flat) / flat
                            near.nearest_face = wp.min(depth, thickness - depth)
                            near.nearest_edge = wp.max(inside, zero)
                            near.radius = radius
                            near.widest = body[5]
                            near.thickness = thickness
                            near.closing = closing
                            sliding = moving - closing * normal
                            rubbing = parameters[0] / wp.max(wp.length(sliding), real(1e-5) * speed)
                            pressing = law(parameters, near) * share * rings[k, 4]
                            part = -pressing * (normal + rubbing * sliding)
                            force += part
                            moment += wp.cross(arm, part)
            if rear > thickness and velocity[0] > zero:
                status = 0
            elif (front < zero and velocity[0] < zero) or speed < real(0.01) * first:
                status = 1
            velocity = velocity + dt / mass * force
            momentum = momentum + dt * moment
        ends[i, 0] = real(status)
        for m in range(3):
            ends[i, 1 + m] = place[m]
            ends[i, 4 + m] = axis[m]
            ends[i, 7 + m] = velocity[m]
            ends[i, 10 + m] = momentum[m]

    return march


def rings_of(core: Core, axial: int, around: int) -> Array:
    """Station ahead of the centre of mass and radius [m], normal along the axis and outwards, area of an element [m²],
    half its length [m]; shape [rings, 6]."""
    stations = np.linspace(0.0, core.length, 4001)
    widest = stations[core.radius(stations).argmax()]
    fore = max(1, round(axial * widest / core.length))
    behind = np.linspace(widest, core.length, max(1, axial - fore) + 1)[1:]
    edges = np.append(np.linspace(0.0, widest, fore + 1), behind)
    edges = edges[np.append(True, np.diff(edges) > 1e-9)]
    radii, middle, half = core.radius(edges), 0.5 * (edges[1:] + edges[:-1]), 0.5 * np.diff(edges)
    forward = 0.5 * np.diff(radii**2)
    outward = (radii[1:] + radii[:-1] + 4.0 * core.radius(middle)) / 6.0 * np.diff(edges)
    middle, radius = np.append(0.0, middle), np.append(2.0 / 3.0 * radii[0], core.radius(middle))
    forward, outward, half = np.append(0.5 * radii[0] ** 2, forward), np.append(0.0, outward), np.append(2e-5, half)
    kept = np.hypot(forward, outward) > 0.0
    area = np.hypot(forward, outward)[kept]
    columns = (core.mass_properties.centre_of_mass - middle[kept], radius[kept])
    normal = (forward[kept] / area, outward[kept] / area)
    return np.stack([*columns, *normal, 2.0 * np.pi / around * area, np.maximum(0.9 * half[kept], 2e-5)], axis=1)


class Plate:
    """The hits of a plate: what the continuum says of those that perforate, and what a law does."""

    def __init__(self, name: str, rows: list[dict[str, str]]) -> None:
        known = measured(rows, name, "continuum")
        self.name, self.case, self.hits = name, CASES[name], np.array(sorted(known))
        self.truth = np.array([known[hit] for hit in self.hits])
        self.solid = name.startswith("solid")
        self.plate, core = self.case.layers[0], self.case.core
        self.shots = self.case.shots(int(self.hits.max()) + 1)[self.hits]
        self.flight, axis, place = launch_state(core, self.shots)
        velocity = self.shots.velocity[:, None] * self.flight
        self.around, travel = 32, 1e-4 if self.solid else 2.5e-4
        body, wall = core.mass_properties, 2.0 * core.max_radius * min(self.plate.thickness, core.length)
        inertia = [body.mass, body.inertia_axial, body.inertia_transverse]
        numbers = [*inertia, self.plate.thickness, travel, core.max_radius, STEADY * 2e9 * wall / body.mass]
        tile, cell = self._distances()
        self.arrays = [
            wp.array(np.concatenate([place, axis, velocity], axis=1), dtype=real),
            wp.array(np.stack([self.shots.hit_y, self.shots.hit_z], axis=1), dtype=real),
            wp.array(rings_of(core, 40 if self.solid else 28, self.around), dtype=real),
            self.around,
            wp.array(tile, dtype=real),
            wp.vec2d(*cell),
            wp.array(numbers, dtype=real),
        ]

    def _distances(self) -> tuple[Array, tuple[float, float]]:
        """Distances from the nearest edge in a period [m], and the spacings [m]."""
        if self.solid:
            return np.full((2, 2), 2.0 * FAR), (1.0, 1.0)
        period = self.plate.pattern.period
        counts = [math.ceil(extent / SPACING) for extent in period]
        y, z = (np.arange(count) * extent / count for count, extent in zip(counts, period, strict=True))
        return self.plate.edge_distance(y[:, None], z[None, :]), (period[0] / counts[0], period[1] / counts[1])

    def __call__(self, march: Any, parameters: Array) -> Array:
        """Velocity [m/s], tilt at 50 and 130 mm [°] under a law, shape [hits, 3]; NaN where a core does not pass."""
        ends = wp.zeros((len(self.hits), 13), dtype=real, device="cpu")
        given = wp.array(np.asarray(parameters, dtype=float), dtype=real)
        wp.launch(march, len(self.hits), [*self.arrays, given], [ends], device="cpu")
        found = ends.numpy()
        state = (found[:, 1:4], found[:, 4:7], found[:, 7:10], found[:, 10:13])
        with np.errstate(all="ignore"):
            at = (tilt_behind(self.case.core, self.plate.thickness, far, self.flight, state) for far in (0.05, 0.13))
            numbers = np.column_stack([np.linalg.norm(state[2], axis=1), *map(np.degrees, at)])
        return np.where(found[:, :1] == 0.0, numbers, np.nan)

    def misfit(self, march: Any, parameters: Array) -> float:
        """Mean square over the hits of what is missed, in SCALES; a core that stops misses by twenty of them."""
        missed = (self(march, parameters) - self.truth) / SCALES * ([1.0 / 3.0, 1.0, 1.0] if self.solid else 1.0)
        return float(np.square(np.clip(np.nan_to_num(missed, nan=20.0), -20.0, 20.0)).sum(axis=1).mean())

    def line(self, march: Any, parameters: Array) -> str:
        """Errors of a law, as text."""
        found = self(march, parameters)
        rms = np.sqrt(np.nanmean((found - self.truth) ** 2, axis=0))
        lost, truly = (np.nanmean(self.shots.velocity**2 - numbers[:, 0] ** 2) for numbers in (found, self.truth))
        largest = f"{np.nanmax(found[:, 2]):.0f} of {self.truth[:, 2].max():.0f}°"
        rms_text = f"rms {rms[0]:5.1f} m/s {rms[1]:5.1f}° {rms[2]:5.1f}°"
        return f"{self.name:10} {rms_text}, energy {100.0 * (lost / truly - 1.0):+.0f} %, largest tilt {largest}"


# --- The laws: η, then the parameters of each. Stresses are in GPa, lengths in radii of the core. ---


@wp.func
def constant(p: wp.array(dtype=real), near: Near):
    return p[1] * real(1e9)


@wp.func
def inertial(p: wp.array(dtype=real), near: Near):
    """A stress of the speed: of what is pushed aside, as if it were steel."""
    return p[1] * real(1e9) + p[2] * real(7850.0) * near.closing * near.closing


@wp.func
def thicker(p: wp.array(dtype=real), near: Near):
    """A power of thickness over calibre."""
    return p[1] * real(1e9) * wp.pow(near.thickness / (real(2.0) * near.widest), p[2])


@wp.func
def cavity(p: wp.array(dtype=real), near: Near):
    """Hill's spherical cavity in steel of a flow stress, with a free surface along the normal."""
    flow = p[1] * real(1e9)
    end = wp.pow(real(140e9) / flow, real(1.0 / 3.0))
    free = real(1.0) + wp.min(near.face, near.edge) / (wp.abs(p[2]) * near.radius)
    deep = real(2.0 / 3.0) * (real(3.0) * wp.log(end) + real(1.0) - wp.pow(end / free, real(3.0)))
    return flow * wp.where(free > end, deep, real(2.0) * wp.log(free))


@wp.func
def near_edges(p: wp.array(dtype=real), near: Near):
    """Less stress near an edge along the normal."""
    return p[1] * real(1e9) * (real(1.0) - wp.exp(-near.edge / (wp.abs(p[2]) * near.radius) - wp.abs(p[3])))


@wp.func
def near_any(p: wp.array(dtype=real), near: Near):
    """Less stress near an edge or a face along the normal."""
    way = wp.min(near.face, near.edge)
    return p[1] * real(1e9) * (real(1.0) - wp.exp(-way / (wp.abs(p[2]) * near.radius) - wp.abs(p[3])))


@wp.func
def nearest(p: wp.array(dtype=real), near: Near):
    """Less stress near an edge or a face, in any direction."""
    way = wp.min(near.nearest_face, near.nearest_edge)
    return p[1] * real(1e9) * (real(1.0) - wp.exp(-way / (wp.abs(p[2]) * near.radius) - wp.abs(p[3])))


class Law(NamedTuple):
    """A law and the parameters from which a fit begins."""

    stress: Any
    begin: tuple[float, ...]


LAWS = {
    "constant": Law(constant, (0.05, 1.8)),
    "inertial": Law(inertial, (0.05, 1.6, 0.3)),
    "thicker": Law(thicker, (0.05, 1.8, 0.3)),
    "cavity": Law(cavity, (0.05, 0.5, 0.2)),
    "near_edges": Law(near_edges, (0.05, 2.2, 0.3, 0.3)),
    "near_any": Law(near_any, (0.05, 2.5, 0.4, 0.3)),
    "nearest": Law(nearest, (0.05, 2.5, 0.2, 0.3)),
}


def fitted(law: Law, march: Any, plates: list[Plate]) -> Array:
    """The parameters that miss the plates least, each plate alike; none is negative."""
    begin, count = np.array(law.begin), len(law.begin)

    def misfit(factors: Array) -> float:
        missed = sum(plate.misfit(march, factors * begin) for plate in plates)
        return missed + 1e3 * float(np.maximum(-factors, 0.0).sum())

    simplex = np.ones((count + 1, count)) + np.vstack([np.zeros(count), np.diag([0.5] + [0.25] * (count - 1))])
    options = {"maxfev": ROUNDS * count, "xatol": 0.01, "fatol": 0.005, "initial_simplex": simplex}
    return np.asarray(minimize(misfit, simplex[0], method="Nelder-Mead", options=options).x * begin)


def check(plates: list[Plate]) -> None:
    """Print how far the march is from the package, with a constant stress and no weakening."""
    march = built(constant)
    for plate in plates:
        given = plate.plate.model_copy(
            update={"resistance": 1.8e9 if not plate.solid else 4e9, "shear_coefficient": 0.05, "degradation": 1.0}
        )
        scene = Scene(core=plate.case.core, target=(given,), record=plate.case.scene.record)
        outcomes = simulate(scene, plate.shots, numerics=Numerics(level=5), device="cpu")
        truth = np.column_stack([outcomes.residual_velocity, np.degrees(outcomes.tilt)])
        apart = plate(march, np.array([0.05, given.resistance / 1e9])) - np.where(
            outcomes.status[:, None] == 0, truth, np.nan
        )
        print(plate.name, "rms", np.sqrt(np.nanmean(apart**2, axis=0)).round(2))


def main() -> None:
    """Fit laws to some plates, and print what each gives at all of them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("laws", nargs="*", metavar="LAW", help=f"of {', '.join(LAWS)} (default: all)")
    parser.add_argument("--fit", default="slotted,thin")
    parser.add_argument("--plates", default="slotted,thin,thick,oblique,solid_12")
    parser.add_argument("--check", action="store_true", help="compare the march with the package, and fit nothing")
    given = parser.parse_args()
    wp.config.quiet = True
    rows = written(BENCHMARKS / "results" / "continuum_trade.csv")
    plates = [Plate(name, rows) for name in given.plates.split(",")]
    if given.check:
        check(plates)
        return
    inside = given.fit.split(",")
    for name in given.laws or LAWS:
        law = LAWS[name]
        march = built(law.stress)
        parameters = fitted(law, march, [plate for plate in plates if plate.name in inside])
        print(f"{name}: {parameters.round(3)}")
        for plate in plates:
            print(f"   {'in ' if plate.name in inside else 'out'} {plate.line(march, parameters)}", flush=True)


if __name__ == "__main__":
    main()
