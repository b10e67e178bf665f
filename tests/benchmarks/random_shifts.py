"""Scenes drawn from a seed: do the numerics shift measures by more than a result says?

A pilot finds the level for standard. Its hits at that level and at the finer one say by how
much the numerics may shift the mean residual velocity, the mean last tilt and the share of the cores whose last tilt is
beyond 30°: this is "numerics ±". Other hits show the shift: they are computed at that level and at level 7. They are
few, so what they show has an interval of its own. A shift is more than was promised where this interval begins beyond
the promise.

    python tests/benchmarks/random_shifts.py --seed 1 --scenes 16            # single plates
    python tests/benchmarks/random_shifts.py --seed 1 --scenes 8 --layers    # several layers
"""

from __future__ import annotations

import argparse
import math
import time
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from random_cases import Case, draw, draw_layers

from warpimpact.kernels.status import Status
from warpimpact.records.outcomes import Outcomes
from warpimpact.scene import PRESETS, Numerics, Shots
from warpimpact.solver.accuracy import pilot_size
from warpimpact.solver.device import Worker
from warpimpact.solver.simulate import pilot_of, simulate
from warpimpact.statistics.comparisons import change_of_mean, shift_of_mean, shift_of_share
from warpimpact.statistics.intervals import estimate_of

Array = NDArray[np.float64]
ANSWER = 7
"""Level of LADDER behind the answer."""
TILTED = 30.0
"""Last tilt [degree] beyond which cores are counted."""


class Shift(NamedTuple):
    """Of a measure: what is promised, what other hits show, and half the width of the interval of that."""

    name: str
    promised: float
    shown: float
    unsure: float


def columns(outcomes: Outcomes) -> dict[str, Array]:
    """Residual velocities [m/s] and last tilts [degree] of the cores that passed, NaN of others."""
    passed = np.isin(outcomes.status, [Status.PERFORATED, Status.UNTOUCHED])
    values = {"velocity": outcomes.residual_velocity, "tilt": np.degrees(outcomes.tilt[:, -1])}
    return {name: np.where(passed, column, np.nan) for name, column in values.items()}


def shifts(pilot: tuple[Outcomes, Outcomes], others: tuple[Outcomes, Outcomes]) -> list[Shift]:
    """Those of all measures, by a pilot and by other hits at two levels each."""
    rows, (before, after) = [], ([columns(one) for one in pair] for pair in (pilot, others))
    for name in ("velocity", "tilt"):
        change = change_of_mean(*(one[name] for one in after))
        promised = shift_of_mean(*(one[name] for one in before))
        rows.append(Shift(name, promised, change.value, change.half_width))
    coarse, fine = (np.where(np.isnan(one["tilt"]), np.nan, one["tilt"] > TILTED) for one in after)
    change = estimate_of("difference", fine - coarse)
    promised = shift_of_share(*(one["tilt"] - TILTED for one in before))
    return [*rows, Shift("P(tilted)", promised, change.value, change.half_width)]


def is_more(one: Shift) -> bool:
    """Whether the hits show more than is promised."""
    return abs(one.shown) - one.unsure > one.promised


def measured(case: Case, hits: int) -> tuple[int, bool, list[Shift]]:
    """The level, whether the promise of single hits is kept there, and the shifts."""

    def at(level: int | None, shots: Shots) -> Outcomes:
        return simulate(case.scene, shots, numerics=Numerics(level=level), device="cpu", threads=1)

    pilot, others = case.shots(pilot_size(PRESETS["standard"]), seed=77), case.shots(hits)
    promise = pilot_of(case.scene, pilot, Numerics(), Worker("cpu", 1))
    level = promise.numerics.level
    assert promise.finer is not None
    pair = (at(level, pilot), promise.finer)
    return level or 0, promise.kept, shifts(pair, (at(level, others), at(ANSWER, others)))


def main() -> None:
    """Draw scenes, print a line for each, and how many shifts are more than promised."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--scenes", type=int, default=16)
    parser.add_argument("--hits", type=int, default=256, help="that show the shift (default: 256)")
    parser.add_argument("--layers", action="store_true", help="targets of several layers")
    given = parser.parse_args()
    measures: list[Shift] = []
    for index in range(given.scenes):
        case = (draw_layers if given.layers else draw)(given.seed, index)
        level, kept, rows = measured(case, given.hits)
        print(f"{index:3} {case.name:50} level {level}{'' if kept else ', promise not kept'}", end="")
        for one in rows:
            more = " MORE" if is_more(one) else ""
            print(f"  {one.name} ± {one.promised:.2g}, shown {one.shown:+.2g} ± {one.unsure:.1g}{more}", end="")
        print(flush=True)
        measures += [one for one in rows if not math.isnan(one.promised + one.shown)]
    ratios = [abs(one.shown) / one.promised for one in measures if one.promised > 0.0]
    print(
        f"{len(measures)} measures, {sum(map(is_more, measures))} shifted by more than promised; shown over "
        f"promised: median {np.median(ratios):.2f}, worst tenth {np.quantile(ratios, 0.9):.2f}; "
        f"{time.process_time():.0f} s of a core"
    )


if __name__ == "__main__":
    main()
