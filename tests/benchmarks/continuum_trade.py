"""The fast law against the continuum: the same hits of several plates by both, a table of rows and one of errors.

    python tests/benchmarks/continuum_trade.py rows ROWS.csv [--hits 24] [--plates slotted,thin]
    python tests/benchmarks/continuum_trade.py table ROWS.csv
    python tests/benchmarks/continuum_trade.py refine ROWS.csv FINER_ROWS.csv

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
    name: str, hits: int, settings: dict[str, float | str], done: set[tuple[str, ...]]
) -> Iterator[dict[str, object]]:
    case, friction = CASES[name], settings["friction"]
    shots = case.shots(hits)
    for model in ("fast", "continuum"):
        for k in range(hits):
            if (name, f"{friction:g}", model, str(k)) in done:
                continue
            begin, shot = time.process_time(), shots[k : k + 1]
            if model == "fast":
                outcome = simulate(case.scene, shot, numerics=Numerics(fidelity="standard"), device="cpu", threads=1)
            else:
                continuum = Continuum(flows=tuple(flow_entry(name).flow for name in case.flows), **settings)
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


def write_rows(path: Path, plates: list[str], hits: int, settings: dict[str, float | str]) -> None:
    for name in plates:
        done = {(row["plate"], row["friction"], row["model"], row["hit"]) for row in written(path)}
        for row in rows_of(name, hits, settings, done):
            new = not path.exists()
            with path.open("a", newline="", encoding="utf-8") as file:
                writer = csv.DictWriter(file, FIELDS)
                if new:
                    writer.writeheader()
                writer.writerow(row)


MEASURES = {"velocity": "m/s", "tilt_50": "°", "tilt_130": "°"}
SCALES = np.array([5.0, 5.0, 10.0])
"""What the continuum's own numerics leave open of each measure, about: misfits count in these."""
FEWEST = 8
"""Sound hits of a plate for a row of the table."""
LEVEL = Numerics(level=2)
SHARES = np.arange(0.4, 1.45, 0.1)
FRICTIONS, WEAKENINGS = (0.0, 0.03, 0.05, 0.08, 0.12), (0.7, 0.8, 0.9, 1.0)
"""Shares of the resistance, shear coefficients and degradations that a fit tries."""
SHOTS = {"through a hole": (714.0, 24.3, 83.2), "between holes": (753.0, 16.0, 32.2)}
"""The paper's two shots: residual velocity, spatial tilt at 50 and 130 mm."""


def measured(rows: list[dict[str, str]], plate: str, model: str) -> dict[int, np.ndarray]:
    """The measures of the sound hits of a plate by their numbers."""
    chosen = (row for row in rows if row["plate"] == plate and row["model"] == model and row["status"] == "0")
    return {int(row["hit"]): np.array([float(row[name]) for name in MEASURES]) for row in chosen}


def fast_law(case: Case, shots: Shots, share: float, friction: float, degradation: float) -> np.ndarray:
    """Measures of the fast law with other parameters, shape [hits, 3]."""
    layers = tuple(
        layer.model_copy(
            update={
                "resistance": share * layer.resistance,
                "shear_coefficient": friction,
                "degradation": degradation if layer.degradation < 1.0 else 1.0,
            }
        )
        for layer in case.layers
    )
    scene = Scene(core=CORE, target=layers, record=Record(standoffs=(0.05, 0.13)))
    outcomes = simulate(scene, shots, numerics=LEVEL, device="cpu", threads=1)
    return np.column_stack([outcomes.residual_velocity, np.degrees(outcomes.tilt)])


def fitted(case: Case, shots: Shots, truth: np.ndarray) -> tuple[float, float, float]:
    """Share of the resistance, shear coefficient and degradation that miss the continuum least."""
    weakenings = WEAKENINGS if case.layers[0].degradation < 1.0 else (1.0,)
    tried = [(share, eta, beta) for share in SHARES for eta in FRICTIONS for beta in weakenings]
    misfits = [float(np.nanmean(((fast_law(case, shots, *one) - truth) / SCALES) ** 2)) for one in tried]
    return tried[int(np.argmin(misfits))]


def ranked(one: np.ndarray, other: np.ndarray) -> float:
    """Spearman's correlation."""
    ranks = [np.argsort(np.argsort(values)) for values in (one, other)]
    return float(np.corrcoef(*ranks)[0, 1])


def print_table(path: Path) -> None:
    rows = written(path)
    heads = " | ".join(f"{name.replace('_', ' at ')}, {unit}" for name, unit in MEASURES.items())
    print(f"Bias, root mean square and rank correlation:\n\n| plate | hits | fast law | {heads} |")
    print("|---|---|---|---|---|---|")
    for plate, case in CASES.items():
        truth, fast = measured(rows, plate, "continuum"), measured(rows, plate, "fast")
        hits = sorted({*truth} & {*fast})
        if len(hits) < FEWEST:
            continue
        shots = case.shots(max(hits) + 1)
        told = [("paper" if case.layers[0].degradation < 1.0 else "given", hits, np.array([fast[k] for k in hits]))]
        inside, outside = hits[::2], hits[1::2]
        one = fitted(case, shots[np.array(inside)], np.array([truth[k] for k in inside]))
        words = f"{one[0] * case.layers[0].resistance / 1e9:.2g} GPa, η {one[1]:g}, β {one[2]:g}"
        for name, those in (("in the fit", inside), ("out of it", outside)):
            told.append((f"{words}, {name}", those, fast_law(case, shots[np.array(those)], *one)))
        for name, those, values in told:
            apart = values - np.array([truth[k] for k in those])
            cells = []
            for k in range(len(MEASURES)):
                known = ~np.isnan(apart[:, k])
                rank = ranked(values[known, k], np.array([truth[h][k] for h in those])[known])
                bias, rms = apart[known, k].mean(), np.sqrt((apart[known, k] ** 2).mean())
                cells.append(f"{bias:+.2g}, {rms:.2g}, {rank:.2f}")
            print(f"| {plate} | {len(those)} | {name} | {' | '.join(cells)} |")
    print("\n| plate | hits | failed | seconds of a core per hit |\n|---|---|---|---|")
    for plate in CASES:
        chosen = [row for row in rows if row["plate"] == plate and row["model"] == "continuum"]
        if chosen:
            failed = sum(row["status"] not in ("0", "1", "2", "3") for row in chosen)
            seconds = np.median([float(row["seconds"]) for row in chosen])
            print(f"| {plate} | {len(chosen)} | {failed} | {seconds:.3g} |")
    print("\n| shot | model | nearest hit (mm) | m/s | ° at 50 mm | ° at 130 mm |\n|---|---|---|---|---|---|")
    for shot, values in SHOTS.items():
        for model in ("continuum", "fast"):
            found = measured(rows, "slotted", model)
            if not found:
                continue
            best = min(found, key=lambda k: float((((found[k] - values) / SCALES) ** 2).sum()))
            place = next(row for row in rows if row["plate"] == "slotted" and row["hit"] == str(best))
            at = f"({1e3 * float(place['hit_y']):.2f}, {1e3 * float(place['hit_z']):.2f})"
            print(f"| {shot} | {model} | {at} | " + " | ".join(f"{value:.0f}" for value in found[best]) + " |")


def print_refinement(coarse: Path, fine: Path) -> None:
    """What hits of one file differ by from the same hits of another, by plate: root mean squares."""
    print("| plate | hits | velocity, m/s | tilt at 50 mm, ° | tilt at 130 mm, ° | seconds of a core per hit |")
    print("|---|---|---|---|---|---|")
    rows = written(coarse), written(fine)
    for plate in CASES:
        one, other = (measured(of, plate, "continuum") for of in rows)
        hits = sorted({*one} & {*other})
        if hits:
            apart = np.array([one[k] - other[k] for k in hits])
            seconds = [
                float(row["seconds"]) for row in rows[1] if row["plate"] == plate and row["model"] == "continuum"
            ]
            words = " | ".join(f"{value:.2g}" for value in np.sqrt((apart**2).mean(axis=0)))
            print(f"| {plate} | {len(hits)} | {words} | {np.median(seconds):.3g} |")


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("what", choices=("rows", "table", "refine"))
    parser.add_argument("file", type=Path, nargs="+")
    parser.add_argument("--hits", type=int, default=24)
    parser.add_argument("--friction", type=float, default=0.0)
    parser.add_argument("--fidelity", default="draft")
    parser.add_argument("--plates", default=",".join(CASES))
    arguments = parser.parse_args()
    if arguments.what == "rows":
        chosen = {"friction": arguments.friction, "fidelity": arguments.fidelity}
        write_rows(arguments.file[0], arguments.plates.split(","), arguments.hits, chosen)
    elif arguments.what == "table":
        print_table(arguments.file[0])
    else:
        print_refinement(*arguments.file)
