"""Realistic scenes drawn from a seed: error, cost and promise of settings of the numerics on each.

A scene is a hardened core of 5 to 11 mm with an ogive, a cone or the paper's nose, with or without a shank, shot at a
perforated steel plate of 0.5 to 1.5 calibres, straight or obliquely, yawed or not. The answer that a setting is held
against comes from two fine levels, each extrapolated in the time step; the change between them is its uncertainty.
The answer to a limit velocity is that of level LIMIT_ANSWER, of plates that weaken by path. Answers and outcomes are
kept in a cache, so that a run goes on where it ended. Run it as a script:
python tests/benchmarks/random_scenes.py --seed 1 --scenes 24 --cache FOLDER
"""

from __future__ import annotations

import argparse
import hashlib
import json
import math
import platform
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib.pyplot as plt
import numpy as np
from bench import spent
from matplotlib.figure import Figure
from numpy.typing import NDArray

from warpimpact.kernels.status import Status
from warpimpact.scene import (
    PRESETS,
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
from warpimpact.scene.interaction import NEAR_EDGES
from warpimpact.solver.accuracy import PILOT_LIMITS, pilot_size
from warpimpact.solver.device import Worker
from warpimpact.solver.limit import HIGHEST_VELOCITY, VELOCITY_TOLERANCE, LimitSpec, limit_velocity, pilot_of_limits
from warpimpact.solver.resolution import Level
from warpimpact.solver.simulate import pilot_of, simulate

Array = NDArray[np.float64]

STEEL = 7850.0
STANDOFF = 0.13
"""Where tilt is compared [m]."""
FINE = (Level(96, 96, 8.0, 0.05), Level(136, 136, 11.0, 0.035))
"""Levels behind the answer; each is extrapolated from its step and twice its step, of second order."""
LIMIT_ANSWER, LIMIT_HITS = 7, 16
"""Level behind the answer of a limit velocity, and hits; the change from the level before is its uncertainty."""
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
        return make_shots(self.impact, Hits(count=count, seed=seed), self.scene.target.layers[0])

    @property
    def key(self) -> str:
        """The same for the same scene."""
        text = "".join(model.model_dump_json(exclude_none=True) for model in (self.scene, self.impact))
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
    angles = rng.uniform(0.0, [30.0, 360.0, 3.0, 360.0])
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
        pitch=angles[2] * math.sin(math.radians(angles[3])) if yawed else 0.0,
        yaw=angles[2] * math.cos(math.radians(angles[3])) if yawed else 0.0,
    )
    way = ("oblique" if oblique else "normal") + (" yawed" if yawed else "")
    scene = Scene(core=core, target=Target(layers=(plate,)), record=Record(standoffs=(STANDOFF,)))
    return Case(f"{kind}, {holes}, {way}", scene, impact)


def near_edges(case: Case) -> Case:
    """The case under the law with free surfaces, without weakening."""
    plates = tuple(plate.model_copy(update={"degradation": 1.0}) for plate in case.scene.target.layers)
    scene = case.scene.model_copy(update={"target": Target(layers=plates), "interaction": NEAR_EDGES})
    return replace(case, name=f"{case.name}, edges", scene=scene)


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

    def run(self, case: Case, setting: Numerics, folder: Path | None = None) -> tuple[Answer, float]:
        """The answer of a setting and its cost, processor time of one core per hit [s]."""
        text = f"{setting!r} {self.hits}"
        path = (folder or self.folder) / f"{case.key}-{hashlib.sha256(text.encode()).hexdigest()[:12]}.npz"
        if not path.exists():
            part = path.with_suffix(".part.npz")  # what was cut off is no answer
            np.savez(part, **_computed(case, setting, self.hits))
            part.replace(path)
        with np.load(path) as stored:
            return Answer(stored["status"], stored["velocity"], stored["tilt"]), float(stored["cost"])

    def converged(self, case: Case) -> tuple[Answer, Answer]:
        """The answer on the finest level, and the one on the level before it."""
        coarse, fine = (self._extrapolated(case, level) for level in FINE)
        return fine, coarse

    def _extrapolated(self, case: Case, level: Level) -> Answer:
        """Without the step's error of second order, from runs with twice the step and once."""
        steps = (stepped(level, factor * level.travel, case.scene.target.layers[0]) for factor in (2.0, 1.0))
        double, single = (self.run(case, setting, self.converged_folder)[0] for setting in steps)
        return extrapolated(double, single)


def stepped(level: Level, travel: float, plate: Plate) -> Numerics:
    """The patches and the grid of a level with a step of their own."""
    return Numerics(
        patches_axial=level.patches_axial,
        patches_around=level.patches_around,
        grid_spacing=plate.degradation_length / level.cells_per_length,
        travel=travel,
    )


def extrapolated(double: Answer, single: Answer) -> Answer:
    return Answer(
        single.status,
        np.maximum(single.velocity + (single.velocity - double.velocity) / 3.0, 0.0),
        np.abs(single.tilt + (single.tilt - double.tilt) / 3.0),
    )


def _computed(case: Case, setting: Numerics, hits: int) -> dict[str, Any]:
    def run(shots: Shots) -> Any:
        return simulate(case.scene, shots, numerics=setting, device="cpu", threads=1)

    shots = case.shots(hits)
    run(shots[:1])  # builds what is kept: kernels and the tile
    outcomes, seconds = spent(lambda: run(shots))
    if seconds < LONG:  # the set-up, and the machine's other work, are no part of the cost
        more = Shots.joined([shots] * 8)
        few, many = (min(spent(lambda some=some: run(some))[1] for _ in range(3)) for some in (shots, more))
        seconds = (many - few) / 7
    return {
        "status": outcomes.status,
        "velocity": outcomes.residual_velocity,
        "tilt": outcomes.tilt[:, 0],
        "cost": seconds / hits,
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


@dataclass(frozen=True)
class Row:
    """What one name came to on one scene.

    Attributes:
        level: of LADDER.
        kept: whether the promise is kept by its own word.
        stated, error: errors of 90 % of the hits, stated and computed: residual velocity [m/s], tilt [degree].
        mean, worst_tenth: error of the mean residual velocity and of that of the fastest tenth [m/s].
        tilted: error of the share of the hits that are tilted by more than 30 degrees.
        cost: processor time of one core per hit [s].
    """

    level: float
    kept: bool
    stated: tuple[float, float]
    error: tuple[float, float]
    mean: float
    worst_tenth: float
    tilted: float
    cost: float


def named(bench: Bench, case: Case, truth: Answer, name: str) -> Row:
    """The promise of a name, found by a pilot of other hits."""
    pilot = case.shots(pilot_size(PRESETS[name]), seed=77)
    promise = pilot_of(case.scene, pilot, Numerics(fidelity=name), Worker("cpu"))
    answer, cost = bench.run(case, promise.numerics)
    velocity, tilt = off(answer, truth)
    stated = (promise.errors["residual_velocity_error"], promise.errors["tilt_error"])
    actual = (p90(velocity), p90(tilt))
    assert promise.numerics.level is not None
    return Row(promise.numerics.level, promise.kept, stated, actual, *aggregates(answer, truth), cost)


def aggregates(answer: Answer, truth: Answer) -> tuple[float, float, float]:
    """Errors of the mean and of the fastest tenth of the residual velocity, and of P(tilt > 30 degrees)."""

    def numbers(one: Answer) -> Array:
        passed = np.isfinite(one.tilt)
        fastest = np.sort(one.velocity[np.isfinite(one.velocity)])[-max(1, len(one.velocity) // 10) :]
        share = float((one.tilt[passed] > math.radians(30.0)).mean()) if passed.any() else 0.0
        return np.array([np.nanmean(one.velocity), fastest.mean(), share])

    mean, worst, tilted = np.abs(numbers(answer) - numbers(truth))
    return float(mean), float(worst), float(tilted)


def limits_of(case: Case, level: int, hits: int) -> Array:
    """Limit velocities of the hits at a level [m/s]."""
    return limit_velocity(case.scene, case.shots(hits), numerics=Numerics(level=level), device="cpu", threads=1).value


def limit_claim(case: Case, name: str, answers: tuple[Array, Array]) -> dict[str, Any]:
    """Whether the pilot of limits says that it keeps a name, and whether other limits keep it."""
    preset, (before, truth) = PRESETS[name], answers
    assert preset.limit is not None
    pilot = case.shots(pilot_size(preset, PILOT_LIMITS), seed=77)
    spec = LimitSpec("velocity", VELOCITY_TOLERANCE, HIGHEST_VELOCITY)
    promise = pilot_of_limits(case.scene, pilot, spec, Numerics(fidelity=name), Worker("cpu", 1))
    assert promise.numerics.level is not None
    actual = limits_of(case, promise.numerics.level, len(truth))
    error, uncertain = (p90(np.nan_to_num(np.abs(one - truth), nan=math.inf)) for one in (actual, before))
    true = error <= preset.limit * float(np.median(truth)) + uncertain
    return {"level": promise.numerics.level, "kept": promise.kept, "true": bool(true), "error": error}


NAMES = ("draft", "standard", "reference")
LIMIT_NAMES = ("draft", "standard")


def measured(bench: Bench, case: Case) -> dict[str, Any]:
    """All rows of a scene, what its answer is uncertain by, and the cost of the plain standard."""
    truth, before = bench.converged(case)
    rows = {name: named(bench, case, truth, name) for name in NAMES}
    return {
        "scene": case.name,
        "uncertain": [p90(errors) for errors in off(before, truth)],
        "perforated": float(np.mean(truth.status == Status.PERFORATED)),
        "plain_standard_cost": bench.run(case, Numerics(level=2))[1],
        **{name: asdict(row) for name, row in rows.items()},
        "limits": limit_claims(case),
    }


def limit_claims(case: Case) -> dict[str, Any]:
    """The claims of the pilots of limits, by name."""
    (plate,) = case.scene.target.layers
    distance = case.impact.velocity * plate.degradation_interval  # a plate that weakens by time stops no core
    by_path = {"degradation_interval": None, "degradation_distance": distance}
    target = Target(layers=(plate.model_copy(update=by_path),))
    case = replace(case, scene=case.scene.model_copy(update={"target": target}))
    answers = limits_of(case, LIMIT_ANSWER - 1, LIMIT_HITS), limits_of(case, LIMIT_ANSWER, LIMIT_HITS)
    return {name: limit_claim(case, name, answers) for name in LIMIT_NAMES}


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
        errors = np.array([row["error"] for row in rows])
        kept = np.array([row["kept"] for row in rows])
        true = np.array([held(row, name, scene["uncertain"]) for row, scene in zip(rows, scenes, strict=True)])
        cells = [f"{kept.mean():.0%}", f"{(kept & ~true).mean():.0%}"]
        middle, worst = np.quantile(errors, [0.5, 0.9], axis=0)
        numbers = [np.median([row[key] for row in rows]) for key in ("mean", "worst_tenth", "tilted")]
        cost = np.median([row["cost"] for row in rows] / plain)
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
    parser.add_argument("--edges", action="store_true", help="under the law with free surfaces, without weakening")
    parser.add_argument("--cache", type=Path, required=True)
    parser.add_argument("--output", type=Path, help="JSON file of the rows; a figure goes beside it")
    given = parser.parse_args()
    bench = Bench(given.cache, given.hits)
    scenes = []
    for index in range(given.scenes):
        path = given.cache / f"row-{given.seed}-{index}-{given.hits}{'-edges' * given.edges}.json"
        if not path.exists():
            case = draw(given.seed, index)
            path.write_text(json.dumps(measured(bench, near_edges(case) if given.edges else case)))
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
