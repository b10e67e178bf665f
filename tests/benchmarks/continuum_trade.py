"""The fast law against the continuum: the same hits of several plates by both, a table of rows and one of errors.

    python tests/benchmarks/continuum_trade.py rows ROWS.csv [--hits 24] [--plates slotted,thin]
    python tests/benchmarks/continuum_trade.py table ROWS.csv

`rows` appends what is not in the file, hit by hit, so that it may be ended at any time. `table` prints, by plate and
measure, bias, rms and rank correlation of the fast law at the paper's parameters, and at those that fit the first half
of the hits best, on the other half. It is a comparison of models: no shot was fired at these hits but the paper's two.
"""

from __future__ import annotations

import argparse
import csv
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from warpimpact import (
    CirclePattern,
    Continuum,
    Hits,
    Impact,
    Layer,
    Numerics,
    Plate,
    PolynomialCore,
    Record,
    Scene,
    Shots,
    SlotPattern,
    make_shots,
    simulate,
    simulate_continuum,
)
from warpimpact.catalogue.flow_entries import flow_entry

CORE = PolynomialCore(coefficients=(3.0e-4, 0.24, -5.29), length=27.86e-3, mass=4.0e-3)
PAPER = {"resistance": 2.6e9, "shear_coefficient": 0.05, "degradation": 0.8, "degradation_interval": 1e-6}
ALUMINIUM = {"resistance": 1.1e9, "shear_coefficient": 0.05, "density": 2700.0}
SLOTS = SlotPattern(length=12e-3, width=4e-3, spacing=(8e-3, 16e-3), staggered=True)
FIELDS = ("plate", "friction", "model", "hit", "hit_y", "hit_z", "status", "velocity", "tilt_50", "tilt_130", "seconds")


def round_holes(diameter: float, pitch: float) -> CirclePattern:
    """On a hexagonal lattice."""
    return CirclePattern(diameter=diameter, spacing=(0.5 * pitch * 3**0.5, pitch), staggered=True)


class Case(NamedTuple):
    """A target, the materials of its layers, and how the core arrives."""

    layers: tuple[Plate, ...]
    flows: tuple[str, ...]
    impact: Impact = Impact(velocity=825.0)

    @property
    def scene(self) -> Scene:
        return Scene(core=CORE, target=self.layers, record=Record(standoffs=(0.05, 0.13)))

    def shots(self, count: int) -> Shots:
        return make_shots(self.impact, Hits(count=count, seed=1), self.layers[0])


STEEL = "ARMOX560T"
CASES = {
    "slotted": Case((Plate(thickness=4e-3, pattern=SLOTS, **PAPER),), (STEEL,)),
    "thin": Case((Plate(thickness=1.25e-3, pattern=round_holes(5.75e-3, 7.25e-3), **PAPER),), (STEEL,)),
    "thick": Case((Plate(thickness=6e-3, pattern=round_holes(5e-3, 8e-3), **PAPER),), (STEEL,)),
    "oblique": Case((Plate(thickness=4e-3, pattern=SLOTS, **PAPER),), (STEEL,), Impact(velocity=825.0, obliquity=30.0)),
    "aluminium": Case((Plate(thickness=8e-3, pattern=round_holes(5e-3, 8e-3), **ALUMINIUM),), ("AA6082-T6",)),
    "based": Case(
        (
            Plate(thickness=1.25e-3, pattern=round_holes(5.75e-3, 7.25e-3), **PAPER),
            Layer(thickness=6e-3, gap=50e-3, **ALUMINIUM),
        ),
        (STEEL, "AA6082-T6"),
    ),
}


def written(path: Path) -> list[dict[str, str]]:
    """The rows that are there."""
    return list(csv.DictReader(path.open(encoding="utf-8"))) if path.exists() else []


def rows_of(
    name: str, case: Case, hits: int, friction: float, done: set[tuple[str, ...]]
) -> Iterator[dict[str, object]]:
    shots = case.shots(hits)
    for model in ("fast", "continuum"):
        for k in range(hits):
            if (name, f"{friction:g}", model, str(k)) in done:
                continue
            begin, shot = time.process_time(), shots[k : k + 1]
            if model == "fast":
                outcome = simulate(case.scene, shot, numerics=Numerics(fidelity="standard"), device="cpu", threads=1)
            else:
                continuum = Continuum(flows=tuple(flow_entry(name).flow for name in case.flows), friction=friction)
                outcome = simulate_continuum(case.scene, shot, continuum, threads=1)
            tilts = np.degrees(outcome.tilt[0])
            yield {
                "plate": name,
                "friction": f"{friction:g}",
                "model": model,
                "hit": k,
                "hit_y": f"{shot.hit_y[0]:.6g}",
                "hit_z": f"{shot.hit_z[0]:.6g}",
                "status": int(outcome.status[0]),
                "velocity": f"{outcome.residual_velocity[0]:.2f}",
                "tilt_50": f"{tilts[0]:.2f}",
                "tilt_130": f"{tilts[1]:.2f}",
                "seconds": f"{time.process_time() - begin:.3f}",
            }


def write_rows(path: Path, plates: list[str], hits: int, friction: float) -> None:
    for name in plates:
        done = {(row["plate"], row["friction"], row["model"], row["hit"]) for row in written(path)}
        for row in rows_of(name, CASES[name], hits, friction, done):
            new = not path.exists()
            with path.open("a", newline="", encoding="utf-8") as file:
                writer = csv.DictWriter(file, FIELDS)
                if new:
                    writer.writeheader()
                writer.writerow(row)


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("what", choices=("rows",))
    parser.add_argument("file", type=Path)
    parser.add_argument("--hits", type=int, default=24)
    parser.add_argument("--friction", type=float, default=0.0)
    parser.add_argument("--plates", default=",".join(CASES))
    arguments = parser.parse_args()
    write_rows(arguments.file, arguments.plates.split(","), arguments.hits, arguments.friction)
