"""Layered targets drawn from a seed: do other hits keep the promise that a pilot makes?

A target is a plate of random_scenes.py with one to three layers behind it: laminated, close or far, thin or thick,
patterned or solid, weakening or not. Together they take up to all of the core's energy, so that some stop a part or all
of the hits. The answer comes from a level of LADDER that no promise takes; the change from the level before is its
uncertainty. Rows are kept in a folder, so that a run goes on where it ended. Run it as a script:
python tests/benchmarks/random_layers.py --seed 1 --scenes 24 --cache FOLDER
"""

from __future__ import annotations

import argparse
import json
import math
import time
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from random_scenes import Case, _pattern, draw, p90

from warpimpact.records.outcomes import Outcomes
from warpimpact.scene import (
    PRESETS,
    Interaction,
    Layer,
    NoPattern,
    Numerics,
    Pattern,
    Record,
    Scene,
    Shots,
    Target,
)
from warpimpact.solver.accuracy import ended_otherwise, hit_changes, pilot_size
from warpimpact.solver.simulate import pilot_of, simulate
from warpimpact.solver.worker import Worker

Array = NDArray[np.float64]

ANSWER = 8
"""Level of LADDER behind the answer."""
NAMES = ("draft", "standard")


def drawn(seed: int, index: int) -> Case:
    """The case of an index, a function of (seed, index) alone."""
    front, rng = draw(seed, index), np.random.default_rng([seed, index, 1])
    core, plate = front.scene.core, front.scene.target.layers[0]
    calibre, count = 2.0 * core.max_radius, int(rng.integers(1, 4))
    # A solid plate without friction takes Y h π R² of the core's energy.
    energy = 0.5 * core.mass_properties.mass * front.impact.velocity**2 * rng.uniform(0.2, 1.2)
    shares = rng.dirichlet(np.ones(count))
    layers = tuple(_layer(rng, calibre, share * energy / (math.pi * core.max_radius**2)) for share in shares)
    path = {"degradation_interval": None, "degradation_distance": rng.uniform(0.5e-3, 1e-3)}
    by_path: dict[str, Any] = path if rng.random() < 0.5 else {}
    target = Target(layers=(plate.model_copy(update=by_path), *layers))
    scene = Scene(core=core, target=target, interaction=Interaction(), record=Record(standoffs=(0.13,)))
    kinds = " + ".join("solid" if isinstance(one.pattern, NoPattern) else "holes" for one in layers)
    return Case(f"{front.name} | {kinds}", scene, front.impact)


def _layer(rng: np.random.Generator, calibre: float, work: float) -> Layer:
    """A layer that takes about this energy over the cross section of the core [J/m²]."""
    gap = float(rng.choice([0.0, rng.uniform(0.0, 0.02), rng.uniform(0.02, 0.15)]))
    thickness = float(rng.uniform(0.2, 2.5)) * calibre
    pattern: Pattern = _pattern(rng, calibre)[0] if rng.random() < 0.4 else NoPattern()
    weakens, by_path = rng.random(2) < 0.5
    return Layer(
        gap=gap,
        thickness=thickness,
        resistance=min(work / thickness, 6e9),
        shear_coefficient=float(rng.uniform(0.0, 0.15)),
        degradation=float(rng.uniform(0.7, 1.0)) if weakens else 1.0,
        degradation_length=float(rng.uniform(0.3e-3, 0.8e-3)),
        degradation_distance=0.8e-3 if by_path else None,
        pattern=pattern,
        offset=tuple(rng.uniform(-0.5, 0.5, 2) * calibre),
    )


def computed(case: Case, shots: Shots, numerics: Numerics) -> Outcomes:
    return simulate(case.scene, shots, numerics=numerics, device="cpu", threads=1)


def errors(found: Outcomes, truth: Outcomes, free: tuple[bool, ...], name: str) -> list[float]:
    """90th percentiles of the errors of velocity, tilt and depth over what the name allows, NaN of what no hit has;
    and the share of the hits that end otherwise, over the same."""
    changes, over = hit_changes(found, truth, PRESETS[name], free), []
    for column in ("residual_velocity_error", "tilt_error", "depth_error"):
        each = changes[column][1] if column in changes else np.array([])
        known = each[~np.isnan(each)]
        over.append(p90(known) if len(known) else math.nan)
    return [*over, float(ended_otherwise(found, truth).mean()) / PRESETS[name].status_share]


def measured(case: Case, hits: int) -> dict[str, Any]:
    """What the promises come to on a scene."""
    shots, free = case.shots(hits), case.scene.free_behind
    truth, before = (computed(case, shots, Numerics(level=level)) for level in (ANSWER, ANSWER - 1))
    row: dict[str, Any] = {"scene": case.name, "statuses": np.bincount(truth.status, minlength=4)[:4].tolist()}
    for name in NAMES:
        begin = time.process_time()
        pilot = case.shots(pilot_size(PRESETS[name]), seed=77)
        promise = pilot_of(case.scene, pilot, Numerics(fidelity=name), Worker("cpu"))
        seconds = time.process_time() - begin
        found = computed(case, shots, promise.numerics)
        over, uncertain = (np.array(errors(one, truth, free, name)) for one in (found, before))
        row[name] = {
            "seconds": seconds,
            "level": promise.numerics.level,
            "kept": promise.kept,
            "over": over.tolist(),
            "false": bool(promise.kept and (over > 1.0 + uncertain).any()),
        }
    return row


def summed_up(rows: list[dict[str, Any]]) -> str:
    """What the promises came to over the scenes."""
    lines = [f"{len(rows)} scenes"]
    for name in NAMES:
        some = [row[name] for row in rows]
        kept, false = (sum(one[key] for one in some) for key in ("kept", "false"))
        seconds = [one["seconds"] for one in some]
        lines.append(
            f"{name:10} kept {kept}, of these false {false}; {np.median(seconds):.2g} s of a core in the median, "
            f"{max(seconds):.2g} s at most"
        )
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--scenes", type=int, default=24)
    parser.add_argument("--hits", type=int, default=48)
    parser.add_argument("--cache", type=Path, required=True)
    given = parser.parse_args()
    given.cache.mkdir(parents=True, exist_ok=True)
    rows = []
    for index in range(given.scenes):
        path = given.cache / f"layers-{given.seed}-{index}-{given.hits}.json"
        if not path.exists():
            path.write_text(json.dumps(measured(drawn(given.seed, index), given.hits)))
        rows.append(json.loads(path.read_text()))
        print(f"{index:3} {rows[-1]['scene']:60} {rows[-1]['statuses']}")
        for name in NAMES:
            one = rows[-1][name]
            marks = f"level {one['level']} {'kept' if one['kept'] else 'NOT '} {'FALSE' if one['false'] else ''}"
            print(f"    {name:10} {marks} {' '.join(f'{over:8.3g}' for over in one['over'])}", flush=True)
    print(summed_up(rows))


if __name__ == "__main__":
    main()
