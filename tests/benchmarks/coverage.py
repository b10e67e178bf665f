"""How often the intervals of answers hold, plate by plate, beside those of hits by elements alone.

    python tests/benchmarks/coverage.py                     # writes results/coverage.csv, prints the table; an hour
    python tests/benchmarks/coverage.py --states whole      # whole bullets: results/whole_coverage.csv; minutes
    python tests/benchmarks/coverage.py --states breaking   # whole bullets whose cores break

Each stored plate is judged with the law's error of all others. Some of its hits by elements are given, in random
splits, and the measures of all its hits are asked for. Fresh plates judge the error that is shipped. Whole bullets with
rigid cores have the law's error of bare ones.
"""

from __future__ import annotations

import argparse
import zlib
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from itertools import repeat
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from continuum_cases import ALUMINIUM, FRESH
from law_error import AS_FIRED, STATES, StoredPlate, is_of_catalogue, learnt_without, stored_plates
from numpy.typing import NDArray

from warpimpact import Layer
from warpimpact.continuum.handover import march_on
from warpimpact.measures.draws import COUNT, ends_of_draws
from warpimpact.records.variables import has_passed
from warpimpact.runs.draws import BEHIND, exits_behind
from warpimpact.scene import Target
from warpimpact.scene.exit_state import states, tilts
from warpimpact.solver.device import Worker
from warpimpact.statistics.drawing import draw_states
from warpimpact.statistics.intervals import Array, estimate_of, worst_tenth
from warpimpact.statistics.law_error import LawErrors

RESULTS = Path(__file__).resolve().parent / "results"
STANDOFFS = np.array([0.05, 0.13])
COUNTS = (0, 5, 8, 12, 24)
DRAWS = COUNT
MOST = 0.6
"""Largest share of a plate's hits that are given."""
PERFORATED, BASE = "perforated", "base perforated"
BASE_EVERY = 8
"""One split of so many is marched through a base, too."""


class Numbers(NamedTuple):
    """What measures are made of: velocities, zero for stopped cores, and tilts, NaN for these; [count, hits] each."""

    velocity: Array
    tilt_50: Array
    tilt_130: Array


class Measure(NamedTuple):
    """A number of a map: a mean over hits of some numbers, or of the fastest tenth; a share if it has a limit."""

    column: str
    limit: float | None = None
    tenth: bool = False

    def each(self, numbers: Numbers) -> Array:
        """Numbers of which the measure is the mean, [count, hits]; NaN where a hit does not count."""
        values = getattr(numbers, self.column)
        if self.limit is not None:
            return (values < self.limit).astype(float) if self.column != "velocity" else (values > self.limit) * 1.0
        return np.apply_along_axis(worst_tenth, 1, values) if self.tenth else values

    def of(self, numbers: Numbers) -> Array:
        """The measure of each map, [count]; NaN if no hit counts."""
        each = self.each(numbers)
        counted = ~np.isnan(each)
        with np.errstate(invalid="ignore"):
            return np.sum(np.where(counted, each, 0.0), axis=1) / counted.sum(axis=1)


MEASURES = {
    "velocity": Measure("velocity"),
    "fastest tenth": Measure("velocity", tenth=True),
    "tilt at 50 mm": Measure("tilt_50"),
    "tilt at 130 mm": Measure("tilt_130"),
    "tilt at 130 mm < 15°": Measure("tilt_130", limit=15.0),
    "tilt at 130 mm < 30°": Measure("tilt_130", limit=30.0),
    "tilt at 50 mm < 20°": Measure("tilt_50", limit=20.0),
    PERFORATED: Measure("velocity", limit=0.0),
}
Interval = tuple[float, float, float]
"""Value and ends of a measure."""


def numbers_of(features: Array, plate: StoredPlate) -> Numbers:
    """Velocities [m/s] and tilts [°] of maps, from features of shape [count, hits, 7]."""
    count, hits = features.shape[:2]
    moves = features[..., 0] > 0.0
    exits = states(
        np.nan_to_num(features.reshape(-1, 7)),
        np.tile(plate.fire, (count, 1)),
        np.tile(plate.velocity, count),
        plate.length,
    )
    angles = tilts(exits, np.tile(plate.fire, (count, 1)), STANDOFFS - 0.5 * plate.length).reshape(count, hits, 2)
    angles = np.where(moves[..., None], np.degrees(angles), np.nan)
    speed = np.linalg.norm(exits.velocity, axis=1).reshape(count, hits)
    return Numbers(speed, angles[..., 0], angles[..., 1])


def drawn_maps(plate: StoredPlate, at: NDArray[np.int64], errors: LawErrors, seed: int) -> Array:
    """Draws of the features of all hits, as answers have them: without elements, from the first law alone."""
    law, second, elements = plate.states
    controls = (law, second if len(at) else None)
    return draw_states(*controls, elements[at], at, count=DRAWS, seed=seed, error=errors)


class Base(NamedTuple):
    """A solid plate that cores go on through by the fast law, behind a perforated one."""

    plate: StoredPlate
    layer: Layer

    @classmethod
    def of(cls, plate: StoredPlate) -> Base | None:
        """The thickness of aluminium that most nearly stops half of the hits by elements; None if none stops a fifth
        and lets a fifth pass."""
        if plate.case.layers[0].open_area == 0.0:
            return None
        bases = [cls(plate, Layer(thickness=1e-3 * k, gap=50e-3, **ALUMINIUM)) for k in range(4, 44, 3)]
        shares = [float(base.passes(plate.states.elements[None]).mean()) for base in bases]
        place = int(np.argmin(np.abs(np.array(shares) - 0.5)))
        return bases[place] if 0.2 <= shares[place] <= 0.8 else None

    def passes(self, features: Array) -> Array:
        """Whether each core passes the base, 0 or 1, from features of shape [count, hits, 7]."""
        count, hits = features.shape[:2]
        scene = self.plate.case.scene.model_copy(
            update={"target": Target(layers=(self.plate.case.layers[0], self.layer))}
        )
        shots, touched = self.plate.shots[:hits], np.ones((hits, 1), dtype=bool)
        ends = exits_behind(scene, shots, np.nan_to_num(features), np.zeros((hits, 3)), touched)
        marched = march_on(scene, shots[np.tile(np.arange(hits), count)], ends, Worker("cpu"), BEHIND)
        return has_passed(marched.status).reshape(count, hits).astype(np.float64)


def intervals_of(numbers: Numbers) -> dict[str, Interval]:
    """Means over draws of each measure, and quantiles of 2.5 and 97.5 %."""
    return {name: quantiles(measure.of(numbers)) for name, measure in MEASURES.items()}


def quantiles(values: Array) -> Interval:
    """Mean over draws, and quantiles of 2.5 and 97.5 %."""
    known = values[~np.isnan(values)]
    if not len(known):
        return np.nan, np.nan, np.nan
    low, high = ends_of_draws(known)
    return float(known.mean()), float(low), float(high)


def judged(name: str, plate: StoredPlate, plates: dict[str, StoredPlate], splits: int) -> Iterator[dict[str, Any]]:
    """Rows of a plate: measure, error and width of an interval, and whether it holds."""
    errors = learnt_without({name}, plates, is_of_catalogue(name))
    truth = numbers_of(plate.states.elements[None], plate)
    base, elements = Base.of(plate), plate.states.elements
    all_pass = all(np.all(one[:, 0] > 0.0) for one in plate.states)
    passes = None if base is None else base.passes(elements[None])
    for count in (count for count in COUNTS if count <= MOST * len(plate.fire)):
        for split in range(splits if count else 1):
            draw = np.random.default_rng([count, split, zlib.crc32(name.encode())])
            at = np.sort(draw.choice(len(plate.fire), count, replace=False))
            drawn = drawn_maps(plate, at, errors, split)
            answers = {
                measure: (interval, float(MEASURES[measure].of(truth)[0]), width_alone(MEASURES[measure], truth, at))
                for measure, interval in intervals_of(numbers_of(drawn, plate)).items()
            }
            if answers[PERFORATED][1] == 1.0 and all_pass:
                del answers[PERFORATED]
            if base is not None and passes is not None and split % BASE_EVERY == 0:
                share = quantiles(base.passes(drawn).mean(axis=1))
                answers[BASE] = share, float(passes.mean()), alone("share", passes[0, at], len(elements))
            for measure, ((value, low, high), right, width) in answers.items():
                yield {
                    "plate": name,
                    "elements": count,
                    "measure": measure,
                    "error": value - right,
                    "width": high - low,
                    "alone": width,
                    "holds": low - 1e-9 <= right <= high + 1e-9,
                }


def alone(kind: str, values: Array, hits: int) -> float:
    """Width of an interval by some hits alone, of so many."""
    return float(2.0 * np.sqrt(1.0 - len(values) / hits) * estimate_of(kind, values).half_width)


def width_alone(measure: Measure, truth: Numbers, at: Array) -> float:
    """Width of the interval of a measure by the hits by elements alone."""
    values = measure.each(Numbers(*(one[:, at] for one in truth)))[0]
    return alone("mean" if measure.limit is None else "share", values, truth.velocity.shape[1])


def judge(name: str, plate: StoredPlate, plates: dict[str, StoredPlate], splits: int) -> list[dict[str, Any]]:
    """Rows of a plate, for a process."""
    return list(judged(name, plate, plates, splits))


def summary(rows: pd.DataFrame) -> pd.DataFrame:
    """By plate, hits given and measure: share of intervals that hold, error, width and width alone."""
    grouped = rows.groupby(["plate", "elements", "measure"], sort=False)
    return grouped.agg(
        holds=("holds", "mean"),
        rms=("error", lambda error: float(np.sqrt(np.mean(error**2)))),
        width=("width", "mean"),
        alone=("alone", "mean"),
        splits=("holds", "size"),
    ).reset_index()


def table(summaries: pd.DataFrame) -> str:
    """Means over plates, by measure and hits given."""
    mean = summaries.groupby(["measure", "elements"], sort=False)[["holds", "rms", "width", "alone"]].mean()
    return str(mean.unstack("elements").round(3).to_string())


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--splits", type=int, default=100)
    parser.add_argument("--states", choices=("whole", "breaking"))
    arguments = parser.parse_args()
    to_judge = stored_plates(RESULTS / f"{arguments.states}_states.csv" if arguments.states else STATES)
    stored = stored_plates(AS_FIRED if arguments.states == "breaking" else STATES)
    with ProcessPoolExecutor() as pool:
        rows = pool.map(judge, to_judge, to_judge.values(), repeat(stored), repeat(arguments.splits))
        summaries = summary(pd.DataFrame(row for of_plate in rows for row in of_plate))
    name = "_".join(filter(None, (arguments.states, "coverage.csv")))
    summaries.round(4).to_csv(RESULTS / name, index=False)
    is_fresh = summaries["plate"].isin(FRESH)
    for words, some in (("learnt plates, each left out", ~is_fresh), ("fresh plates", is_fresh)):
        if some.any():
            print(f"{words}:\n{table(summaries[some])}")
