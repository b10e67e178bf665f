"""A bench of contact laws: a law is fitted to the continuum's hits of some plates, and predicts those of others.

    python -m tests.validation.laws [LAW …] [--fit slotted,thin,solid_12] [--plates slotted,thin,…,kept_a] [--every 2]

A law gives the normal stress of a surface element from what is near: the material ahead, what the core has pushed
ahead, the thickness, and the closing speed (law_march.py). With a constant stress the march agrees with the
package at β = 1 (test_laws.py). The rows are those of tests/benchmarks/continuum_trade.py; what was found is in
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
from scipy.optimize import minimize

BENCHMARKS = Path(__file__).resolve().parents[1] / "benchmarks"
sys.path.insert(0, str(BENCHMARKS))

from bench import launch_state, tilt_behind  # noqa: E402
from continuum_cases import PLATES, measured, written  # noqa: E402

from .law_march import FAR, Array, Near, built, real, rings_of  # noqa: E402

STEADY = 0.5
"""What a wall of 2 GPa may do to the core in a step, as a share of its speed across the onset."""
SPACING = 5e-5
"""Of the distances to the edges of holes [m]."""
SCALES = np.array([5.0, 5.0, 10.0])
"""Of the misfit: m/s, ° at 50 mm, ° at 130 mm. Those of a solid plate's velocities are three times as large."""
ROUNDS = 45
"""Evaluations of a fit for each free parameter."""


class Plate:
    """The hits of a plate: what the continuum says of those that perforate, and what a law does."""

    def __init__(self, name: str, rows: list[dict[str, str]], every: int = 1) -> None:
        known = measured(rows, name, "continuum")
        self.name, self.case, self.hits = name, PLATES[name], np.array(sorted(known))[::every]
        self.truth = np.array([known[hit] for hit in self.hits])
        self.solid = self.case.layers[0].open_area == 0.0
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
def linear(p: wp.array(dtype=real), near: Near):
    """A constant and a stress of the speed."""
    return p[1] * real(1e9) + p[2] * of_speed(p[1], near)


@wp.func
def of_speed(strength: real, near: Near):
    """√(ρ P) v of steel [Pa]: the middle term of spherical cavity expansion."""
    return wp.sqrt(strength * real(1e9) * real(7850.0)) * near.closing


@wp.func
def confined(p: wp.array(dtype=real), near: Near):
    """The logarithm of the thickness over the radius there, and a stress of the speed."""
    return p[1] * real(1e9) * wp.log(real(1.0) + near.thickness / near.radius) + p[2] * of_speed(p[1], near)


@wp.func
def bounded(p: wp.array(dtype=real), near: Near):
    """A share of the stress deep inside that grows with the thickness over the radius there, and a stress of the
    speed."""
    deep = near.thickness / (near.thickness + near.radius)
    return p[1] * real(1e9) * deep + p[2] * of_speed(p[1], near)


@wp.func
def covered(p: wp.array(dtype=real), near: Near):
    """As `bounded`, times a share that grows with the material ahead and with what the core has pushed ahead of it,
    which presses in a hole, too."""
    cover = near.ahead + wp.max(p[4] * near.carried - p[5] * near.gap, real(0.0))
    return bounded(p, near) * (real(1.0) - wp.exp(-p[3] * cover / near.radius))


@wp.func
def swept(p: wp.array(dtype=real), near: Near):
    """As `covered`, with a stress of the angle of attack and the inertia of steel in the place of a stress of the
    speed."""
    cover = near.ahead + wp.max(p[4] * near.carried - p[5] * near.gap, real(0.0))
    deep = near.thickness / (near.thickness + near.radius)
    inertia = p[6] * real(7850.0) * near.closing * near.closing
    pressure = p[1] * real(1e9) * (deep + p[2] * near.attack) + inertia
    return pressure * (real(1.0) - wp.exp(-p[3] * cover / near.radius))


class Law(NamedTuple):
    """A law, the parameters from which a fit begins, those that it does not change, and whether material that the core
    has pushed into a hole presses."""

    stress: Any
    begin: tuple[float, ...]
    held: tuple[int, ...] = ()
    pushes: bool = False
    lip: float = 0.0


LAWS = {
    "constant": Law(constant, (0.05, 1.8)),
    "constant_smooth": Law(constant, (0.0, 2.2), (0,)),
    "linear": Law(linear, (0.0, 1.1, 4.0), (0,)),
    "confined": Law(confined, (0.0, 1.3, 2.5), (0,)),
    "bounded": Law(bounded, (0.0, 2.8, 1.0), (0, 2)),
    "covered": Law(covered, (0.0, 2.5, 1.8, 1.2, 0.5, 0.05), (0, 5), True),
    "swept_only": Law(swept, (0.0, 2.5, 2.0, 1.2, 0.5, 0.05, 0.0), (0, 5, 6), True),
    "swept": Law(swept, (0.0, 2.8, 2.0, 1.2, 0.5, 0.05, 1.0), (0, 5, 6), True),
    "covered_bulging": Law(covered, (0.0, 2.5, 1.8, 0.9, 0.5, 0.05), (0, 5), True, 0.4),
    "swept_bulging": Law(swept, (0.0, 2.8, 1.5, 1.0, 0.5, 0.05, 1.0), (0, 5, 6), True, 0.4),
}


def fitted(law: Law, march: Any, plates: list[Plate]) -> Array:
    """The parameters that miss the plates least, each plate alike; none is negative."""
    begin = np.array(law.begin)
    free = np.setdiff1d(np.arange(len(begin)), law.held)

    def parameters(factors: Array) -> Array:
        found = begin.copy()
        found[free] *= np.abs(factors)
        return found

    def misfit(factors: Array) -> float:
        return sum(plate.misfit(march, parameters(factors)) for plate in plates)

    simplex = np.ones((len(free) + 1, len(free))) + np.vstack([np.zeros(len(free)), 0.3 * np.eye(len(free))])
    options = {"maxfev": ROUNDS * len(free), "xatol": 0.01, "fatol": 0.005, "initial_simplex": simplex}
    return parameters(minimize(misfit, simplex[0], method="Nelder-Mead", options=options).x)


def main() -> None:
    """Fit laws to some plates, and print what each gives at all of them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("laws", nargs="*", metavar="LAW", help=f"of {', '.join(LAWS)} (default: all)")
    parser.add_argument("--fit", default="slotted,thin,solid_12")
    parser.add_argument("--plates", default="slotted,thin,solid_12,thick,oblique", help="any of PLATES")
    parser.add_argument("--every", type=int, default=1, help="fit to every such hit (default: 1)")
    given = parser.parse_args()
    wp.config.quiet = True
    results = BENCHMARKS / "results"
    rows = [row for name in ("trade", "kept", "front") for row in written(results / f"continuum_{name}.csv")]
    plates = [Plate(name, rows) for name in given.plates.split(",")]
    inside = given.fit.split(",")
    for name in given.laws or LAWS:
        law = LAWS[name]
        march = built(law.stress, law.pushes, law.lip)
        parameters = fitted(law, march, [Plate(name, rows, given.every) for name in inside])
        print(f"{name}: {parameters.round(3)}")
        for plate in plates:
            print(f"   {'in ' if plate.name in inside else 'out'} {plate.line(march, parameters)}", flush=True)


if __name__ == "__main__":
    main()
