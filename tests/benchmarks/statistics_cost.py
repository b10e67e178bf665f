"""What an answer within ± x costs: processor time to a half width, for several ways to draw and to combine hits.

Random points, Sobol points with replicates, those of the irreducible part of the cell, and two levels: many hits at
draft, and the change to standard over few of them. A half width is that of the 95 % interval from 16 replicates (of
random points: Student's over the hits), as root mean square over seeds. The cost to a stated half width is interpolated
between the counts. Run it as a script:
python tests/benchmarks/statistics_cost.py [CAMPAIGN.toml ...] [--seeds N] [--hits N] [--output FILE.json]
"""

import argparse
import json
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from bench import CHECKOUT, machine
from numpy.typing import NDArray

from warpimpact import Campaign, make_shots
from warpimpact.scene import Hits, Numerics, Shots
from warpimpact.scene.symmetry import symmetries_used
from warpimpact.solver.simulate import simulate
from warpimpact.statistics.intervals import _student, estimate_of
from warpimpact.statistics.tails import worst_tenth

Array = NDArray[np.float64]

CAMPAIGNS = [CHECKOUT / "campaigns" / f"{name}.toml" for name in ("slotted_plate", "round_holes", "oblique_shot")]
REPLICATES = 16
FEWEST = 8
"""Fewest hits of a replicate at which a half width is looked at."""
RATIOS = (2, 4, 8, 16, 32)
"""Hits at draft per hit at standard."""


def mean_velocity(answers: Array) -> Array:
    return answers[0]


def tilted(answers: Array) -> Array:
    return (answers[1] > 30.0).astype(float)


def fastest_tenth(answers: Array) -> Array:
    return worst_tenth(answers[0])


QUESTIONS: dict[str, tuple[Callable[[Array], Array], float, bool]] = {
    "mean residual velocity ± 0.5 m/s": (mean_velocity, 0.5, False),
    "P(tilt at 130 mm > 30°) ± 1 %": (tilted, 0.01, False),
    "fastest tenth ± 1 %": (fastest_tenth, 0.01, True),
}
"""What is averaged, its half width, and whether that is relative."""


class Hitting:
    """Outcomes of the shots of one campaign on the first levels of draft and of standard."""

    def __init__(self, campaign: Campaign, count: int, seed: int, *, sampling: str, irreducible: bool = False) -> None:
        hits = Hits(
            sampling=sampling,
            count=count,
            seed=seed,
            irreducible=irreducible,
            replicates=REPLICATES if sampling == "sobol" else None,
        )
        self.images = len(symmetries_used(campaign.impact, hits, campaign.plate))
        shots = make_shots(campaign.impact, hits, campaign.plate)[:: self.images]
        self.count = len(shots)
        self.standard, self.cost_standard = self._answers(campaign, shots, 2)
        self.draft, self.cost_draft = self._answers(campaign, shots, 0)

    @staticmethod
    def _answers(campaign: Campaign, shots: Shots, level: int) -> tuple[Array, float]:
        """Residual velocity [m/s] and last tilt [degree], shape [2, hits], and processor time per hit [s]."""
        begin = time.process_time()
        outcomes = simulate(campaign.scene, shots, numerics=Numerics(level=level), device="cpu", threads=1)
        cost = (time.process_time() - begin) / len(shots)
        return np.array([outcomes.residual_velocity, np.degrees(outcomes.tilt[:, -1])]), cost


def counts(total: int) -> Iterator[int]:
    """Powers of two, as many hits of every replicate."""
    count = REPLICATES * FEWEST
    while count <= total:
        yield count
        count *= 2


def one_level(hitting: Hitting, question: Callable[[Array], Array], replicates: int) -> dict[int, tuple[float, float]]:
    """Cost [s] and half width by count."""
    found = {}
    for count in counts(hitting.count):
        values = question(hitting.standard[:, :count])
        half = estimate_of("mean", values, replicates=replicates).half_width
        found[count] = count * hitting.cost_standard, half
    return found


def two_levels(hitting: Hitting, question: Callable[[Array], Array], ratio: int) -> dict[int, tuple[float, float]]:
    """Cost [s] and half width by count of hits at draft; one of `ratio` is computed at standard, too."""
    found = {}
    for count in counts(hitting.count):
        few = count // ratio
        if few < REPLICATES * FEWEST // 4:
            continue
        draft = question(hitting.draft[:, :count]).reshape(-1, REPLICATES).mean(axis=0)
        change = question(hitting.standard[:, :few]) - question(hitting.draft[:, :few])
        answers = draft + change.reshape(-1, REPLICATES).mean(axis=0)
        half = _student(0.95, REPLICATES) * float(np.std(answers, ddof=1))
        found[count] = count * hitting.cost_draft + few * hitting.cost_standard, half
    return found


def cost_to(curves: list[dict[int, tuple[float, float]]], target: float) -> float:
    """Cost [s] at which the half width (root mean square of all curves) is down to the target: between the counts, or
    beyond them as the last ones go."""
    points = np.array([[curve[count] for count in curves[0]] for curve in curves])
    cost, half = np.log(points[..., 0].mean(axis=0)), 0.5 * np.log((points[..., 1] ** 2).mean(axis=0))
    slope = min(np.polyfit(cost, half, 1)[0], -0.25) if len(cost) > 1 else -0.5
    below = np.flatnonzero(half <= np.log(target))
    if not len(below):
        return float(np.exp(cost[-1] + (np.log(target) - half[-1]) / slope))
    first = below[0]
    if first == 0:
        return float(np.exp(cost[0] + min(0.0, (np.log(target) - half[0]) / slope)))
    share = (half[first - 1] - np.log(target)) / (half[first - 1] - half[first])
    return float(np.exp(cost[first - 1] + share * (cost[first] - cost[first - 1])))


def measured(campaign: Campaign, seeds: int, hits: int) -> dict[str, dict[str, float]]:
    """Cost [s] of every way, by question."""
    simulate(campaign.scene, make_shots(campaign.impact, Hits(count=1), campaign.plate), device="cpu")  # builds kernels
    ways: dict[str, list[Hitting]] = {
        "random": [Hitting(campaign, hits, seed, sampling="random") for seed in range(seeds)],
        "sobol": [Hitting(campaign, hits, seed, sampling="sobol") for seed in range(seeds)],
    }
    whole = ways["sobol"][0]
    group = symmetries_used(campaign.impact, Hits(count=8, irreducible=True), campaign.plate)
    if len(group) > 1:
        ways[f"irreducible (1 of {len(group)})"] = [
            Hitting(campaign, hits * len(group), seed, sampling="sobol", irreducible=True) for seed in range(seeds)
        ]
    table: dict[str, dict[str, float]] = {}
    for name, (question, target, relative) in QUESTIONS.items():
        goal = target * float(question(whole.standard).mean()) if relative else target
        row = {}
        for way, drawn in ways.items():
            replicates = 1 if way == "random" else REPLICATES
            row[way] = cost_to([one_level(one, question, replicates) for one in drawn], goal)
            if way != "random":
                two = {ratio: cost_to([two_levels(one, question, ratio) for one in drawn], goal) for ratio in RATIOS}
                best = min(two, key=lambda ratio: two[ratio])
                row[f"{way}, two levels"] = two[best]
                row[f"{way}, draft hits per standard one"] = best
        table[name] = row
    return table


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("campaigns", nargs="*", default=CAMPAIGNS)
    parser.add_argument("--seeds", type=int, default=6)
    parser.add_argument("--hits", type=int, default=4096)
    parser.add_argument("--output", type=Path)
    asked = parser.parse_args()
    tables: dict[str, Any] = {}
    for path in asked.campaigns:
        campaign = Campaign.from_toml(path)
        tables[campaign.title] = measured(campaign, asked.seeds, asked.hits)
        print(campaign.title)
        for question, row in tables[campaign.title].items():
            print(f"  {question}")
            for way, cost in row.items():
                unit = "" if "per" in way else " ms of processor time"
                print(f"    {way:45} {cost if not unit else 1e3 * cost:9.4g}{unit}")
    if asked.output:
        about = {"machine": machine(), "seeds": asked.seeds, "hits": asked.hits}
        asked.output.write_text(
            json.dumps(about | {"cost": tables}, indent=1, ensure_ascii=False) + "\n", encoding="utf-8"
        )


if __name__ == "__main__":
    main()
