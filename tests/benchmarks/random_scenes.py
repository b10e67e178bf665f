"""Realistic scenes drawn from a seed: error, cost and promise of settings of the numerics on each.

A scene is a hardened core of 5 to 11 mm with an ogive, a cone or the paper's nose, with or without a shank, shot at a
perforated steel plate of 0.5 to 1.5 calibres, straight or obliquely, yawed or not. The answer that a setting is held
against comes from two fine levels, each extrapolated in the time step; the change between them is its uncertainty.
Answers and outcomes are kept in a cache, so that a run goes on where it ended. Run it as a script:
python tests/benchmarks/random_scenes.py --seed 1 --scenes 24 --cache FOLDER
"""

from __future__ import annotations

import argparse
import hashlib
import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from warpimpact.kernels.status import Status
from warpimpact.scene import (
    CirclePattern,
    ConeCore,
    Core,
    Hits,
    Impact,
    Numerics,
    OgiveCore,
    Pattern,
    Plate,
    PolynomialCore,
    Record,
    Scene,
    Shots,
    SlotPattern,
    SquarePattern,
    Target,
    TrianglePattern,
    make_shots,
)
from warpimpact.solver.resolution import Fidelity
from warpimpact.solver.simulate import simulate

Array = NDArray[np.float64]

STEEL = 7850.0
STANDOFF = 0.13
"""Where tilt is compared [m]."""
FINE = (Fidelity(96, 96, 8.0, 0.05), Fidelity(136, 136, 11.0, 0.035))
"""Levels behind the answer; each is extrapolated from half and twice... its step: error of second order in the step."""
LONG = 0.1
"""Processor time [s] from which on a run is timed as it is, once."""
PAPER = {"coefficients": (3.0e-4, 0.24, -5.29), "length": 27.86e-3, "diameter": 6.044e-3}


@dataclass(frozen=True)
class Case:
    """A scene, how its cores arrive, and a name that tells its features."""

    name: str
    scene: Scene
    impact: Impact

    def shots(self, count: int, seed: int = 0) -> Shots:
        """Hits spread evenly over the cell; the same for every count that holds them."""
        return make_shots(self.impact, Hits(count=count, seed=seed), self.scene.target.plate)

    @property
    def key(self) -> str:
        """The same for the same scene."""
        text = self.scene.model_dump_json() + self.impact.model_dump_json()
        return hashlib.sha256(text.encode()).hexdigest()[:12]


class Answer(NamedTuple):
    """Of every hit: status, residual velocity [m/s] and tilt [rad], each of shape [hits]."""

    status: NDArray[np.int8]
    velocity: Array
    tilt: Array


def draw(seed: int, index: int) -> Case:
    """The case of an index, a function of (seed, index) alone."""
    rng = np.random.default_rng([seed, index])
    diameter = rng.uniform(5e-3, 11e-3)
    core, kind = _core(rng, diameter)
    pattern, holes = _pattern(rng, diameter)
    thickness = rng.uniform(0.5, 1.5) * diameter
    shear, lasting = rng.uniform(0.0, 0.15), rng.uniform(0.7, 1.0)
    length = rng.uniform(0.3e-3, 0.8e-3)
    velocity = rng.uniform(500.0, 950.0)
    # A solid plate without friction takes Y h π R² of the core's energy: at most a third of it here.
    energy = 0.5 * core.mass_properties.mass * velocity**2
    strongest = 0.33 * energy / (thickness * math.pi * core.max_radius**2)
    resistance = min(rng.uniform(1e9, 4e9), max(strongest, 1e9))
    oblique, yawed = rng.random(2) < 0.5
    angles = np.radians(rng.uniform(0.0, [30.0, 360.0, 3.0, 360.0]))
    plate = Plate(
        thickness=thickness,
        resistance=resistance,
        shear_coefficient=shear,
        degradation=lasting,
        degradation_length=length,
        pattern=pattern,
    )
    impact = Impact(
        velocity=velocity,
        obliquity=angles[0] if oblique else 0.0,
        azimuth=angles[1] if oblique else 0.0,
        pitch=angles[2] * math.sin(angles[3]) if yawed else 0.0,
        yaw=angles[2] * math.cos(angles[3]) if yawed else 0.0,
    )
    way = ("oblique" if oblique else "normal") + (" yawed" if yawed else "")
    scene = Scene(core=core, target=Target(plate=plate), record=Record(standoffs=(STANDOFF,)))
    return Case(f"{kind}, {holes}, {way}", scene, impact)


def _core(rng: np.random.Generator, diameter: float) -> tuple[Core, str]:
    kind = rng.choice(["ogive", "cone", "paper"], p=[0.5, 0.25, 0.25])
    shank = rng.uniform(0.5, 2.5) * diameter * (rng.random() < 0.6)
    sharpness = rng.random()
    if kind == "paper":
        scale = diameter / PAPER["diameter"]
        coefficients = tuple(c * scale ** (1 - power) for power, c in enumerate(PAPER["coefficients"]))
        return PolynomialCore(coefficients=coefficients, length=scale * PAPER["length"], density=STEEL), "paper"
    if kind == "ogive":
        crh = 2.0 + 3.0 * sharpness
        length = diameter * math.sqrt(crh - 0.25) + shank
        core: Core = OgiveCore(diameter=diameter, crh=crh, length=length, density=STEEL)
    else:
        nose = (1.2 + 1.3 * sharpness) * diameter
        core = ConeCore(diameter=diameter, cone_length=nose, length=nose + shank, density=STEEL)
    return core, f"{kind} + shank" if shank else str(kind)


def _pattern(rng: np.random.Generator, diameter: float) -> tuple[Pattern, str]:
    shape = rng.choice(["slot", "circle", "triangle", "square"])
    width, ligament = rng.uniform([0.5, 0.3], 1.0) * diameter
    longer, staggered = rng.uniform(2.0, 3.5), bool(rng.random() < 0.5)
    across = {"slot": longer * width, "triangle": 1.5 * width}.get(shape, width)
    spacing = ((width if shape == "slot" else across) + ligament, across + ligament)
    lattice: dict[str, Any] = {"spacing": spacing, "staggered": staggered}
    if shape == "slot":
        return SlotPattern(length=across, width=width, **lattice), "slots"
    if shape == "circle":
        return CirclePattern(diameter=width, **lattice), "circles"
    if shape == "triangle":
        return TrianglePattern(side=across, **lattice), "triangles"
    return SquarePattern(side=width, **lattice), "squares"


class Bench:
    """Answers of settings on scenes, kept in a folder; converged ones in one of their own, as they outlive a change of
    the numerics."""

    def __init__(self, cache: Path, hits: int, version: str = "") -> None:
        self.hits, self.converged_folder, self.folder = hits, cache / "converged", cache / f"settings{version}"
        for folder in (self.folder, self.converged_folder):
            folder.mkdir(parents=True, exist_ok=True)

    def run(self, case: Case, setting: Fidelity | Numerics, folder: Path | None = None) -> tuple[Answer, float]:
        """The answer of a setting and its cost, processor time of one core per hit [s]."""
        text = f"{setting!r} {self.hits}"
        path = (folder or self.folder) / f"{case.key}-{hashlib.sha256(text.encode()).hexdigest()[:12]}.npz"
        if not path.exists():
            np.savez(path, **_computed(case, setting, self.hits))
        with np.load(path) as found:
            return Answer(found["status"], found["velocity"], found["tilt"]), float(found["cost"])

    def converged(self, case: Case) -> tuple[Answer, Answer]:
        """The answer on the finest level, and the one on the level before it."""
        coarse, fine = (self._extrapolated(case, level) for level in FINE)
        return fine, coarse

    def _extrapolated(self, case: Case, level: Fidelity) -> Answer:
        """Without the step's error of second order, from runs with twice the step and once."""
        steps = (stepped(level, factor * level.travel) for factor in (2.0, 1.0))
        double, single = (self.run(case, setting, self.converged_folder)[0] for setting in steps)
        return extrapolated(double, single)


def stepped(level: Fidelity, travel: float) -> Fidelity:
    """The same patches and grid with another step."""
    return Fidelity(level.patches_axial, level.patches_around, level.cells_per_length, travel, level.double)


def extrapolated(double: Answer, single: Answer) -> Answer:
    return Answer(
        single.status,
        np.maximum(single.velocity + (single.velocity - double.velocity) / 3.0, 0.0),
        np.abs(single.tilt + (single.tilt - double.tilt) / 3.0),
    )


def _computed(case: Case, setting: Fidelity | Numerics, hits: int) -> dict[str, Any]:
    def run(shots: Shots) -> Any:
        return simulate(case.scene, shots, numerics=setting, device="cpu", threads=1)

    def seconds(shots: Shots) -> float:
        begin = time.process_time()
        run(shots)
        return time.process_time() - begin

    shots = case.shots(hits)
    run(shots[:1])  # builds what is kept: kernels and the tile
    begin = time.process_time()
    outcomes = run(shots)
    cost = (time.process_time() - begin) / hits
    if cost * hits < LONG:  # the set-up, and the machine's other work, are no part of the cost
        more = Shots.joined([shots] * 8)
        few, many = (min(seconds(some) for _ in range(3)) for some in (shots, more))
        cost = (many - few) / (7 * hits)
    return {
        "status": outcomes.status,
        "velocity": outcomes.residual_velocity,
        "tilt": outcomes.tilt[:, 0],
        "cost": cost,
    }


def off(answer: Answer, truth: Answer) -> tuple[Array, Array]:
    """Error of residual velocity [m/s] and of tilt [degree] of every hit; infinite where the status differs, 0 where
    there is no value."""
    same = answer.status == truth.status
    pairs = ((answer.velocity, truth.velocity), (np.degrees(answer.tilt), np.degrees(truth.tilt)))
    velocity, tilt = (np.where(same, np.nan_to_num(np.abs(a - b)), np.inf) for a, b in pairs)
    return velocity, tilt


def p90(errors: Array) -> float:
    """Nearest-rank 90th percentile."""
    return float(np.quantile(errors, 0.9, method="higher"))


SETTINGS: dict[str, Fidelity | Numerics] = {
    name: Numerics(fidelity=name) for name in ("draft", "standard", "reference")
}


def row(bench: Bench, case: Case, settings: Sequence[Fidelity | Numerics]) -> list[tuple[float, float, float]]:
    """(p90 of velocity, p90 of tilt, cost) of the answer's own uncertainty and of some settings."""
    truth, before = bench.converged(case)
    rows = [(*map(p90, off(before, truth)), math.nan)]
    for setting in settings:
        answer, cost = bench.run(case, setting)
        rows.append((*map(p90, off(answer, truth)), cost))
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--scenes", type=int, default=24)
    parser.add_argument("--hits", type=int, default=32)
    parser.add_argument("--cache", type=Path, required=True)
    given = parser.parse_args()
    bench = Bench(given.cache, given.hits)
    names = list(SETTINGS)
    print(f"{'scene':42}{'kept':>5}" + "".join(f"{name:>24}" for name in ("uncertain", *names)))
    table = []
    for index in range(given.scenes):
        case = draw(given.seed, index)
        table.append(row(bench, case, list(SETTINGS.values())))
        through = np.mean(bench.converged(case)[0].status == Status.PERFORATED)
        cells = "".join(f"{v:8.3f}{t:8.3f}{1e6 * c:8.0f}" for v, t, c in table[-1])
        print(f"{index:3} {case.name:38}{through:5.2f}{cells}", flush=True)
    values = np.array(table)
    for name, quantile in (("median", 0.5), ("worst tenth", 0.9)):
        cells = "".join(f"{v:8.3f}{t:8.3f}{1e6 * c:8.0f}" for v, t, c in np.quantile(values, quantile, axis=0))
        print(f"{name:47}{cells}")


if __name__ == "__main__":
    main()
