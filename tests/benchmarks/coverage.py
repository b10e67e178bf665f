"""How often the intervals of drawn states hold, plate by plate, beside regressions of the measures themselves.

    python tests/benchmarks/coverage.py             # writes results/coverage.csv, and prints the table

Each stored plate is judged with the law's error of all others. Some of its hits by elements are given, in random
splits, and the measures of all its hits are asked for.
"""

from __future__ import annotations

import argparse
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from law_error import StoredPlate, stored_plates

from warpimpact.scene.exit_state import states, tilts
from warpimpact.statistics.correction import FEWEST_ACCURATE, correct, corrected_mean, corrected_share
from warpimpact.statistics.drawing import draw_states
from warpimpact.statistics.intervals import Array, estimate_of, worst_tenth
from warpimpact.statistics.law_error import LawErrors, learn_errors

RESULT = Path(__file__).resolve().parent / "results" / "coverage.csv"
STANDOFFS = np.array([0.05, 0.13])
COUNTS = (0, 5, 8, 12, 24)
DRAWS = 256
MOST = 0.6
"""Largest share of a plate's hits that are given."""


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
    "perforated": Measure("velocity", limit=0.0),
}
Interval = tuple[float, float, float]
"""Value and ends of a measure."""


def numbers_of(features: Array, plate: StoredPlate) -> Numbers:
    """Velocities [m/s] and tilts [°] of maps, from features of shape [count, hits, 7]."""
    count, hits = features.shape[:2]
    moves = features[..., 0] > 0.0
    exits = states(
        np.nan_to_num(features.reshape(-1, 7), neginf=0.0),
        np.tile(plate.fire, (count, 1)),
        np.tile(plate.velocity, count),
        plate.length,
    )
    angles = tilts(exits, np.tile(plate.fire, (count, 1)), STANDOFFS - 0.5 * plate.length).reshape(count, hits, 2)
    angles = np.where(moves[..., None], np.degrees(angles), np.nan)
    speed = np.linalg.norm(exits.velocity, axis=1).reshape(count, hits)
    return Numbers(speed, angles[..., 0], angles[..., 1])


def by_states(plate: StoredPlate, at: Array, errors: LawErrors, seed: int) -> dict[str, Interval]:
    """Measures by draws of states."""
    law, second, elements = plate.states
    drawn = draw_states(law, second, elements[at], at, count=DRAWS, seed=seed, error=errors)
    return quantiles(numbers_of(drawn, plate))


def by_scalars(plate: StoredPlate, at: Array, errors: LawErrors, seed: int) -> dict[str, Interval]:
    """Measures by draws of velocities and tilts, each regressed on those of both laws; residuals of a hit together."""
    numbers = np.random.default_rng(seed)
    law, second, truth = (np.concatenate(numbers_of(one[None], plate)) for one in plate.states)
    rows = numbers.integers(len(at), size=(DRAWS, len(plate.fire)))
    drawn = []
    for column in range(len(truth)):
        design = np.column_stack([np.ones(len(plate.fire)), law[column], second[column]])
        inverse = np.linalg.pinv(design[at].T @ design[at])
        weights = inverse @ design[at].T @ truth[column, at]
        leverage = np.minimum(np.einsum("ni,ij,nj->n", design[at], inverse, design[at]), 0.99)
        residuals = (truth[column, at] - design[at] @ weights) / np.sqrt(1.0 - leverage)
        freedom = len(at) - 3
        scale = np.sqrt(np.mean(residuals**2) * freedom / numbers.chisquare(freedom, DRAWS))
        values, axes = np.linalg.eigh(inverse)  # the laws may follow from each other
        root = axes * np.sqrt(np.maximum(values, 0.0))
        own = weights + scale[:, None] * (numbers.standard_normal((DRAWS, 3)) @ root.T)
        relative = scale / np.sqrt(np.mean(residuals**2))
        drawn.append(np.maximum(own @ design.T + relative[:, None] * residuals[rows], 0.0))
        drawn[-1][:, at] = truth[column, at]
    return quantiles(Numbers(*drawn))


def by_regression(plate: StoredPlate, at: Array, errors: LawErrors, seed: int) -> dict[str, Interval]:
    """Measures by the regression of each measure, as it was before states were drawn."""
    law, second, truth = (numbers_of(one[None], plate) for one in plate.states)
    narrower, intervals = float(np.sqrt(1.0 - len(at) / len(plate.fire))), {}
    for name, measure in MEASURES.items():
        if measure.tenth:
            continue
        values, *controls = (getattr(one, measure.column)[0] for one in (truth, law, second))
        # A map has many hits, so its own sample leaves nothing open.
        fit = correct(values[at], np.column_stack(controls)[at], np.tile(np.column_stack(controls), (50, 1)))
        if measure.limit is None:
            mean = corrected_mean(fit)
        else:
            mean = corrected_share(fit, measure.limit, above=measure.column == "velocity")
        ends = (mean.value + narrower * (end - mean.value) for end in (mean.low, mean.high))
        intervals[name] = (mean.value, *ends)
    return intervals


def quantiles(numbers: Numbers) -> dict[str, Interval]:
    """Means over draws of each measure, and quantiles of 2.5 and 97.5 %."""
    intervals = {}
    for name, measure in MEASURES.items():
        values = measure.of(numbers)
        values = values[~np.isnan(values)]
        low, high = np.quantile(values, [0.025, 0.975]) if len(values) else (np.nan, np.nan)
        intervals[name] = (float(values.mean()) if len(values) else np.nan, float(low), float(high))
    return intervals


METHODS: dict[str, Callable[..., dict[str, Interval]]] = {
    "states": by_states,
    "scalars": by_scalars,
    "regression": by_regression,
}


def judged(name: str, plates: dict[str, StoredPlate], splits: int, methods: list[str]) -> Iterator[dict[str, Any]]:
    """Rows of a plate: method, hits given, measure, error and width of an interval, and whether it holds."""
    plate = plates[name]
    errors = learn_errors([one.states for other, one in plates.items() if other != name])
    truth = numbers_of(plate.states.elements[None], plate)
    all_pass = all(np.all(one[:, 0] > 0.0) for one in plate.states)
    for count in (count for count in COUNTS if count <= MOST * len(plate.fire)):
        for split in range(splits if count else 1):
            draw = np.random.default_rng([count, split, zlib.crc32(name.encode())])
            at = np.sort(draw.choice(len(plate.fire), count, replace=False))
            for method in methods:
                if method != "states" and not (all_pass and count >= FEWEST_ACCURATE):
                    continue
                for measure, (value, low, high) in METHODS[method](plate, at, errors, split).items():
                    right = float(MEASURES[measure].of(truth)[0])
                    if measure == "perforated" and right == 1.0 and all_pass:
                        continue
                    yield {
                        "method": method,
                        "plate": name,
                        "elements": count,
                        "measure": measure,
                        "error": value - right,
                        "width": high - low,
                        "alone": width_alone(MEASURES[measure], truth, at),
                        "holds": low - 1e-9 <= right <= high + 1e-9,
                    }


def width_alone(measure: Measure, truth: Numbers, at: Array) -> float:
    """Width of the interval of a measure by the hits by elements alone."""
    values = measure.each(Numbers(*(one[:, at] for one in truth)))[0]
    kind = "mean" if measure.limit is None else "share"
    narrower = np.sqrt(1.0 - len(at) / truth.velocity.shape[1])
    return float(2.0 * narrower * estimate_of(kind, values).half_width)


def summary(rows: pd.DataFrame) -> pd.DataFrame:
    """By method, plate, hits given and measure: share of intervals that hold, error, width and width alone."""
    grouped = rows.groupby(["method", "plate", "elements", "measure"], sort=False)
    return grouped.agg(
        holds=("holds", "mean"),
        rms=("error", lambda error: float(np.sqrt(np.mean(error**2)))),
        width=("width", "mean"),
        alone=("alone", "mean"),
        splits=("holds", "size"),
    ).reset_index()


def table(summaries: pd.DataFrame) -> str:
    """Means over plates, by method, measure and hits given."""
    mean = summaries.groupby(["method", "measure", "elements"], sort=False)[["holds", "rms", "width", "alone"]].mean()
    return str(mean.unstack("elements").round(3).to_string())


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--splits", type=int, default=40)
    parser.add_argument("--methods", default=",".join(METHODS))
    parser.add_argument("--output", type=Path, default=RESULT)
    arguments = parser.parse_args()
    stored, chosen = stored_plates(), arguments.methods.split(",")
    every = [row for name in stored for row in judged(name, stored, arguments.splits, chosen)]
    summaries = summary(pd.DataFrame(every))
    summaries.round(4).to_csv(arguments.output, index=False)
    print(table(summaries))
