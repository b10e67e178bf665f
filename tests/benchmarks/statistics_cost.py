"""What an answer within ± x costs: processor time to a half width, for several ways to draw and to combine hits.

Random points, Sobol points with replicates, those of the irreducible part of the cell, and two levels: many hits at
draft, and the change to standard over few of them. A half width is that of the 95 % interval from 16 replicates (of
random points: Student's over the hits), as root mean square over seeds. The cost to a stated half width is interpolated
between the counts. Run it as a script:
python tests/benchmarks/statistics_cost.py          # writes results/statistics_cost.json
"""

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np
from bench import campaign_of, machine, spent, store
from numpy.typing import NDArray

from warpimpact import Campaign, make_shots
from warpimpact.scene import Hits, Numerics, Shots
from warpimpact.scene.symmetry import symmetries_used
from warpimpact.solver.simulate import simulate
from warpimpact.statistics.intervals import _student, estimate_of
from warpimpact.statistics.tails import worst_tenth

Array = NDArray[np.float64]

CAMPAIGNS = ("slotted_plate", "round_holes", "oblique_shot")
REPLICATES, SEEDS, HITS = 16, 4, 2048
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
        shots = make_shots(campaign.impact, hits, campaign.plate)
        self.count = len(shots)
        self.standard, self.cost_standard = self._answers(campaign, shots, 2)
        self.draft, self.cost_draft = self._answers(campaign, shots, 0)

    @staticmethod
    def _answers(campaign: Campaign, shots: Shots, level: int) -> tuple[Array, float]:
        """Residual velocity [m/s] and last tilt [degree], shape [2, hits], and processor time per hit [s]."""
        march = partial(simulate, campaign.scene, shots, numerics=Numerics(level=level), device="cpu", threads=1)
        outcomes, took = spent(march)
        return np.array([outcomes.residual_velocity, np.degrees(outcomes.tilt[:, -1])]), took / len(shots)


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


def measured(campaign: Campaign) -> dict[str, dict[str, float]]:
    """Cost [s] of every way, by question."""
    simulate(campaign.scene, make_shots(campaign.impact, Hits(count=1), campaign.plate), device="cpu")  # builds kernels
    ways: dict[str, list[Hitting]] = {
        way: [Hitting(campaign, HITS, seed, sampling=way) for seed in range(SEEDS)] for way in ("random", "sobol")
    }
    whole = ways["sobol"][0]
    group = symmetries_used(campaign.impact, Hits(count=8, irreducible=True), campaign.plate)
    if len(group) > 1:
        ways[f"irreducible (1 of {len(group)})"] = [
            Hitting(campaign, HITS, seed, sampling="sobol", irreducible=True) for seed in range(SEEDS)
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
    tables: dict[str, Any] = {}
    for campaign in map(campaign_of, CAMPAIGNS):
        tables[campaign.title] = measured(campaign)
        print(campaign.title, tables[campaign.title], flush=True)
    store("statistics_cost", {"machine": machine(), "seeds": SEEDS, "hits": HITS, "cost": tables})


if __name__ == "__main__":
    main()
