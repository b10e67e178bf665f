"""Error, cost and promise of the named fidelities on realistic scenes that are drawn from a seed (random_cases.py).

The answer that a setting is held against comes from two fine levels, each extrapolated in the time step; the change
between them is its uncertainty. The answer to a limit velocity is that of level LIMIT_ANSWER, of plates that weaken by
path. Answers and rows are kept in a cache, so that a run goes on where it ended.

    python tests/benchmarks/random_scenes.py --seed 1 --scenes 24 --cache FOLDER
    python tests/benchmarks/random_scenes.py --seed 2 --scenes 16 --hits 512 --cache FOLDER --addons
"""

from __future__ import annotations

import argparse
import hashlib
import json
import math
import platform
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib.pyplot as plt
import numpy as np
from bench import spent
from matplotlib.figure import Figure
from numpy.typing import NDArray
from random_cases import Case, draw, draw_addon

from warpimpact.kernels.status import Status
from warpimpact.records.variables import has_passed
from warpimpact.scene import Shots, Target
from warpimpact.solver.accuracy import PILOT_LIMITS, pilot_of, pilot_size
from warpimpact.solver.device import Worker
from warpimpact.solver.fast_law import FastLaw
from warpimpact.solver.limit import LimitSpec, limits, pilot_of_limits
from warpimpact.solver.resolution import Level
from warpimpact.solver.settings import BASE_ACCURACY, PRESETS
from warpimpact.solver.simulate import simulate

Array = NDArray[np.float64]

FINE = (Level(96, 96, 8.0, 0.05), Level(136, 136, 11.0, 0.035))
"""Levels behind the answer; each is extrapolated from its step and twice its step, of second order."""
LIMIT_ANSWER, LIMIT_HITS = 7, 16
"""Level behind the answer of a limit velocity, and hits; the change from the level before is its uncertainty."""
BASE_LEVEL = 6
"""Level behind the answer of an add-on before a base."""
LONG = 0.1
"""Processor time [s] from which on a run is timed as it is, once."""
NAMES = ("draft", "standard", "reference")
LIMIT_NAMES = ("draft", "standard")


class Answer(NamedTuple):
    """Of every hit: status, residual velocity [m/s] and tilt [rad], each of shape [hits]."""

    status: NDArray[np.int8]
    velocity: Array
    tilt: Array


def computed(case: Case, setting: FastLaw, hits: int) -> tuple[Answer, float]:
    """The answer of a setting and its cost, processor time of one core per hit [s]."""

    def run(shots: Shots) -> Any:
        return simulate(case.scene, shots, method=setting, device="cpu", threads=1)

    shots = case.shots(hits)
    run(shots[:1])  # builds what is kept: kernels and the tile
    outcomes, seconds = spent(lambda: run(shots))
    if seconds < LONG:  # the set-up, and the machine's other work, are no part of the cost
        more = Shots.joined([shots] * 8)
        few, many = (min(spent(lambda some=some: run(some))[1] for _ in range(3)) for some in (shots, more))
        seconds = (many - few) / 7
    return Answer(outcomes.status, outcomes.residual_velocity, outcomes.tilt[:, 0]), seconds / hits


def converged(case: Case, hits: int, cache: Path) -> tuple[Answer, Answer]:
    """The answer on the finest level, and the one on the level before it; kept in the cache."""
    scene = "".join(model.model_dump_json(exclude_none=True) for model in (case.scene, case.impact))
    answers = []
    for level in FINE:
        path = cache / f"{hashlib.sha256(f'{scene} {level} {hits}'.encode()).hexdigest()[:16]}.npz"
        if not path.exists():
            np.savez(part := path.with_suffix(".part.npz"), *_extrapolated(case, level, hits))
            part.replace(path)  # what was cut off is no answer
        with np.load(path) as stored:
            answers.append(Answer(*stored.values()))
    return answers[1], answers[0]


def _extrapolated(case: Case, level: Level, hits: int) -> Answer:
    """Without the step's error of second order, from runs with twice the step and once."""
    settings = FastLaw(
        patches_axial=level.patches_axial,
        patches_around=level.patches_around,
        grid_spacing=case.scene.target.layers[0].degradation_length / level.cells_per_length,
    )
    double, single = (
        computed(case, settings.model_copy(update={"travel": factor * level.travel}), hits)[0] for factor in (2.0, 1.0)
    )
    velocity = single.velocity + (single.velocity - double.velocity) / 3.0
    tilt = single.tilt + (single.tilt - double.tilt) / 3.0
    return Answer(single.status, np.maximum(velocity, 0.0), np.abs(tilt))


def errors(answer: Answer, truth: Answer) -> list[float]:
    """Nearest-rank 90th percentiles of the errors of residual velocity [m/s] and tilt [degree]; infinite where the
    status of a hit differs, 0 where it has no value."""
    same = answer.status == truth.status
    pairs = ((answer.velocity, truth.velocity), (np.degrees(answer.tilt), np.degrees(truth.tilt)))
    return [p90(np.where(same, np.nan_to_num(np.abs(a - b)), np.inf)) for a, b in pairs]


def p90(values: Array) -> float:
    return float(np.quantile(values, 0.9, method="higher"))


def named(case: Case, truth: Answer, name: str) -> dict[str, Any]:
    """What a name came to on a scene: level and promise by a pilot of other hits, errors of 90 % of the hits, stated
    and computed, errors of aggregates, and processor time of one core per hit [s]."""
    pilot = case.shots(pilot_size(PRESETS[name]), seed=77)
    promise = pilot_of(case.scene, pilot, FastLaw(fidelity=name), Worker("cpu"))
    answer, cost = computed(case, FastLaw(level=promise.level), len(truth.status))
    mean, worst_tenth, tilted = np.abs(_aggregates(answer) - _aggregates(truth)).tolist()
    return {
        "level": promise.level,
        "kept": promise.kept,
        "stated": [promise.errors["residual_velocity_error"], promise.errors["tilt_error"]],
        "error": errors(answer, truth),
        "mean": mean,
        "worst_tenth": worst_tenth,
        "tilted": tilted,
        "cost": cost,
    }


def _aggregates(answer: Answer) -> Array:
    """Means of the residual velocity and of its fastest tenth [m/s], and P(tilt > 30 degrees)."""
    passed = np.isfinite(answer.tilt)
    fastest = np.sort(answer.velocity[np.isfinite(answer.velocity)])[-max(1, len(answer.velocity) // 10) :]
    share = float((answer.tilt[passed] > math.radians(30.0)).mean()) if passed.any() else 0.0
    return np.array([np.nanmean(answer.velocity), fastest.mean(), share])


def limit_claims(case: Case) -> dict[str, Any]:
    """Whether the pilots of limits say that they keep a name, and whether other limits keep it."""
    (plate,) = case.scene.target.layers
    distance = case.impact.velocity * plate.degradation_interval  # a plate that weakens by time stops no core
    by_path = plate.model_copy(update={"degradation_interval": None, "degradation_distance": distance})
    case = replace(case, scene=case.scene.model_copy(update={"target": Target(layers=(by_path,))}))

    spec, claims = LimitSpec.of(case.scene), {}

    def at(level: int | None) -> Array:
        return limits(case.scene, case.shots(LIMIT_HITS), spec, FastLaw(level=level), Worker("cpu", 1)).value

    before, truth = at(LIMIT_ANSWER - 1), at(LIMIT_ANSWER)
    for name in LIMIT_NAMES:
        pilot = case.shots(pilot_size(PRESETS[name], PILOT_LIMITS), seed=77)
        promise = pilot_of_limits(case.scene, pilot, spec, FastLaw(fidelity=name), Worker("cpu", 1))
        actual = at(promise.level)
        error, uncertain = (p90(np.nan_to_num(np.abs(one - truth), nan=math.inf)) for one in (actual, before))
        is_true = bool(error <= PRESETS[name].limit * float(np.median(truth)) + uncertain)
        claims[name] = {"level": promise.level, "kept": promise.kept, "true": is_true, "error": error}
    return claims


def measured(case: Case, hits: int, cache: Path) -> dict[str, Any]:
    """All rows of a scene, what its answer is uncertain by, and the cost of the plain standard."""
    truth, before = converged(case, hits, cache)
    return {
        "scene": case.name,
        "uncertain": errors(before, truth),
        "perforated": float(np.mean(truth.status == Status.PERFORATED)),
        "plain_standard_cost": computed(case, FastLaw(level=2), hits)[1],
        **{name: named(case, truth, name) for name in NAMES},
        "limits": limit_claims(case),
    }


def addon_text(case: Case, hits: int) -> str:
    """A line of a table on an add-on; shares in percent.

    The share of the cores that pass; errors of other hits than those of a default pilot: of this share, of the mean
    residual velocity where a core that stops counts 0, and of the mean over the cores that pass, both over the impact
    velocity; the first two as the pilot states them; the level, with a star where it is beyond the tolerance.
    """
    pilot = pilot_of(case.scene, case.shots(pilot_size(BASE_ACCURACY), seed=77), FastLaw(), Worker("cpu", 1))
    levels = FastLaw(level=pilot.level), FastLaw(level=BASE_LEVEL)
    sums, right = (_base_sums(computed(case, level, hits)[0], case.impact.velocity) for level in levels)
    stated = pilot.errors["base_perforated_error"], pilot.errors["mean_velocity_error"]
    cells = "".join(f"{100.0 * value:7.2f}" for value in (right[0], *(sums - right), *stated))
    return f"{case.name:68}{cells} {pilot.level:3}{'' if pilot.kept else '*'}"


def _base_sums(answer: Answer, velocity: float) -> Array:
    """P(base perforated), and mean residual velocities over the impact velocity: of all cores, of those that pass."""
    passed, speeds = has_passed(answer.status), answer.velocity / velocity
    return np.array([passed.mean(), speeds.mean(), speeds[passed].mean() if passed.any() else 0.0])


def held(row: dict[str, Any], name: str, uncertain: Sequence[float]) -> bool:
    """Whether the errors found are within the promise, up to what the answer itself is uncertain by."""
    allowed = PRESETS[name]
    limits = (allowed.residual_velocity, math.degrees(allowed.tilt))
    return all(e <= limit + u for e, limit, u in zip(row["error"], limits, uncertain, strict=True))


def summed_up(scenes: Sequence[dict[str, Any]]) -> str:
    """What the promises came to over the scenes."""
    plain = np.array([scene["plain_standard_cost"] for scene in scenes])
    head = ("", "kept", "kept, but false", "median error", "worst tenth", "mean; tenth; P", "cost")
    lines = [f"{len(scenes)} scenes", ("{:20}" + "{:>18}" * 6).format(*head)]
    for name in NAMES:
        rows = [scene[name] for scene in scenes]
        kept = np.array([row["kept"] for row in rows])
        true = np.array([held(row, name, scene["uncertain"]) for row, scene in zip(rows, scenes, strict=True)])
        middle, worst = np.quantile([row["error"] for row in rows], [0.5, 0.9], axis=0)
        numbers = [np.median([row[key] for row in rows]) for key in ("mean", "worst_tenth", "tilted")]
        cost = np.median([row["cost"] for row in rows] / plain)
        cells = [f"{kept.mean():.0%}", f"{(kept & ~true).mean():.0%}"]
        cells += [f"{middle[0]:.2g}; {middle[1]:.2g}", f"{worst[0]:.2g}; {worst[1]:.2g}"]
        cells += ["{:.2g}; {:.2g}; {:.2g}".format(*numbers), f"{cost:.2f}"]
        lines.append(("{:20}" + "{:>18}" * 6).format(name, *cells))
    lines.append("errors in m/s; degree of tilt at 130 mm, 90 % of the hits; cost beside the plain standard, median")
    hits = [held(scene[name], name, scene["uncertain"]) for scene in scenes for name in NAMES if scene[name]["kept"]]
    limits = [one["true"] for scene in scenes for one in scene["limits"].values() if one["kept"]]
    for what, claims, most in (("hits", hits, len(NAMES)), ("limits", limits, len(LIMIT_NAMES))):
        true = f"{sum(claims)} of them true ({np.mean(claims):.1%})" if claims else "none"
        lines.append(f"claims for {what}: {len(claims)} of {most * len(scenes)} promises, {true}")
    return "\n".join(lines)


def drawn(scenes: Sequence[dict[str, Any]]) -> Figure:
    """Error against cost of every scene at every name, the promise as a line."""
    figure, axes = plt.subplots(1, 2, figsize=(11, 4.8), layout="constrained")
    for place, (axis, label) in enumerate(zip(axes, ("residual velocity [m/s]", "tilt at 130 mm [°]"), strict=True)):
        for colour, name in zip(("C1", "C0", "C2"), NAMES, strict=True):
            cost = [1e3 * scene[name]["cost"] for scene in scenes]
            error = [max(scene[name]["error"][place], 1e-3) for scene in scenes]
            kept = np.array([scene[name]["kept"] for scene in scenes])
            axis.scatter(cost, error, s=14, color=colour, alpha=np.where(kept, 0.9, 0.25), label=name)
            allowed = PRESETS[name]
            axis.axhline((allowed.residual_velocity, math.degrees(allowed.tilt))[place], color=colour, lw=0.8)
        axis.set(xscale="log", yscale="log", xlabel="processor time per hit [ms]", ylabel=f"error of {label}, 90 %")
    axes[0].legend(title="pale: promise not kept")
    return figure


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--scenes", type=int, default=24)
    parser.add_argument("--hits", type=int, default=32)
    parser.add_argument("--cache", type=Path, required=True)
    parser.add_argument("--addons", action="store_true", help="add-ons before a base in place of single plates")
    parser.add_argument("--output", type=Path, help="JSON file of the rows; a figure goes beside it")
    given = parser.parse_args()
    given.cache.mkdir(parents=True, exist_ok=True)
    if given.addons:
        for index in range(given.scenes):
            print(addon_text(draw_addon(given.seed, index), given.hits), flush=True)
        return
    scenes = []
    for index in range(given.scenes):
        path = given.cache / f"row-{given.seed}-{index}-{given.hits}.json"
        if not path.exists():
            path.write_text(json.dumps(measured(draw(given.seed, index), given.hits, given.cache)))
        scenes.append(json.loads(path.read_text()))
        cells = "".join(
            f"{row['level']:4.1f}{'' if row['kept'] else '*':1}{row['error'][0]:7.2f}{row['error'][1]:6.2f}"
            for row in (scenes[-1][name] for name in NAMES)
        )
        print(f"{index:3} {scenes[-1]['scene']:38}{cells}", flush=True)
    print(summed_up(scenes))
    if given.output:
        content = {"seed": given.seed, "hits": given.hits, "machine": platform.machine(), "scenes": scenes}
        given.output.write_text(json.dumps(content, indent=1) + "\n")
        drawn(scenes).savefig(given.output.with_suffix(".png"), dpi=110)


if __name__ == "__main__":
    main()
