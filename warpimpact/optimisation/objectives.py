"""Objectives, bounds and constraints of designs.

Constraints are checked before anything is computed; objectives and bounds are means of the numbers of hits. Hit k of
every design lies at the same place of its irreducible part (common random numbers), so designs are compared shot by
shot.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
import shapely

from warpimpact.campaign.campaign import Campaign
from warpimpact.optimisation.design import Bound, Constraints, Design, Objective
from warpimpact.results import attributes as attr
from warpimpact.results.vocabulary import WEIGHTS
from warpimpact.scene import EllipsePattern, Plate, Target
from warpimpact.scene.model import Array
from warpimpact.scene.pattern import LatticePattern
from warpimpact.solver.limit import check_arrests
from warpimpact.statistics.comparisons import ROUNDED
from warpimpact.statistics.intervals import estimate_of, pseudo_values

INVALID = "a campaign that is valid"
SCRAMBLINGS = 16
"""Number of scramblings of the hits of a search: hit k belongs to scrambling k modulo this number."""


def weights_of(target: Target) -> dict[str, float]:
    """Masses per area of a target, by the names of the measures."""
    weights = target.weights
    return {attr.AREAL_DENSITY: target.areal_density, attr.ADD_ON_DENSITY: weights.get("add-on", target.areal_density)}


def goal_numbers(
    design: Design, weights: Mapping[str, float], columns: Array, goal: Objective | Bound
) -> tuple[Array, str]:
    """Numbers whose mean is a goal, shape [hits], and the threat that they are of; "" if of all threats, or of none.

    Args:
        weights: masses per area of the target.
        columns: numbers of every hit by each threat, shape [threats, columns, hits].
    """
    measure, threats = goal.spec, design.file.threats
    if measure.kind == "target":
        return np.array([weights[measure.name]]), ""
    numbers = columns[:, design.columns.index(measure.column)]
    if measure.kind == "quantile":  # of Harrell and Davis, a smooth function of the hits (statistics/intervals.py)
        numbers = np.array([pseudo_values(of_hits, measure.share) for of_hits in numbers])
    elif not measure.is_binary:
        numbers = np.array([measure.averaged(measure.counted(of_hits)) for of_hits in numbers])
    if goal.threats == "mean":
        shares = np.array([threat.weight for threat in threats])
        return np.asarray(shares @ numbers / shares.sum()), ""
    signed = goal.sign * np.array([mean_of(of_hits) for of_hits in numbers])
    worst = int(np.argmax(np.nan_to_num(signed, nan=np.inf)))
    return np.asarray(numbers[worst]), threats[worst].name


def mean_of(numbers: Array) -> float:
    """Mean of the numbers that count; NaN if none does."""
    known = numbers[~np.isnan(numbers)]
    return float(known.mean()) if len(known) else float("nan")


def interval_of(design: Design, goal: Objective | Bound, numbers: Array) -> tuple[float, float, float]:
    """A goal with the ends of its interval, from `goal_numbers`."""
    if goal.spec.kind == "target":
        return (float(numbers[0]),) * 3
    is_share = goal.spec.is_binary and (goal.threats == "worst" or len(design.file.threats) == 1)
    estimate = estimate_of("share" if is_share else "mean", numbers, replicates=SCRAMBLINGS)
    return estimate.value, estimate.low, estimate.high


def to_minimise(design: Design, results: Array) -> Array:
    """Objectives, signed such that they are to be minimised; infinite where no hit counts."""
    signs = np.array([objective.sign for objective in design.file.objectives])
    return np.nan_to_num(signs * results[: len(signs)], nan=np.inf, posinf=np.inf, neginf=-np.inf)


def excesses(design: Design, results: Array) -> Array:
    """Violation of each bound as a share of its limit; 0 where it is kept to rounding, 1 where no hit counts."""
    bounded = zip(design.file.bounds, results[len(design.file.objectives) :], strict=True)
    over = [bound.sign * (value - bound.limit) / (abs(bound.limit) or 1.0) for bound, value in bounded]
    shares = np.nan_to_num(np.array(over), nan=1.0)
    return np.where(shares > ROUNDED, shares, 0.0)


class Violation(NamedTuple):
    """A constraint that a design breaks.

    Attributes:
        constraint: its key in [constraints], or INVALID.
        share: relative size of the violation.
        text: value and allowed range in words.
    """

    constraint: str
    share: float
    text: str


def violations(design: Design, tables: Mapping[str, Any]) -> tuple[Campaign | None, tuple[Violation, ...]]:
    """The campaign of a design with its first threat, None if it is not valid, and the constraints that it breaks."""
    try:
        campaign = design.campaign(tables)
        if any(measure.is_limit for measure in design.columns):
            check_arrests(campaign.scene)
    except ValueError as error:  # a CampaignError is one, too
        return None, (Violation(INVALID, 1.0, str(error).removeprefix(f"{design.name}: ")),)
    return campaign, tuple(_violations(design.file.constraints, campaign.target))


def _violations(constraints: Constraints, target: Target) -> Iterator[Violation]:
    for key, limit in constraints:
        if limit is not None and (name := key.partition("_")[2]) in WEIGHTS:
            yield from _violation(key, limit, WEIGHTS[name].label, weights_of(target)[name], "kg/m²")
    for place, plate in target.named:
        for key, (unit, number_of) in _OF_HOLES.items():
            if plate.open_area > 0.0 and (limit := getattr(constraints, key)) is not None:
                what = f"{place}: {key.partition('_')[2].replace('_', ' ')}"
                yield from _violation(key, limit, what, number_of(plate), unit)


def _violation(key: str, limit: float, what: str, value: float, unit: str) -> Iterator[Violation]:
    sign, scale = 1.0 if key.startswith("smallest") else -1.0, 1e3 if unit == "mm" else 1.0
    value, limit = scale * value, scale * limit
    if sign * value < sign * limit * (1.0 - sign * 1e-9):
        end = "least" if sign > 0.0 else "most"
        text = f"{what} of {value:.4g} {unit}, but it must be at {end} {limit:.4g} {unit}"
        yield Violation(key, sign * (limit - value) / limit, " ".join(text.split()))


def hole_sizes(plate: Plate) -> tuple[float, float]:
    """Diameter of the largest circle in the narrowest hole, and greatest extent of the widest hole [m].

    Within a thousandth of the extent where the pattern is no lattice.
    """
    if isinstance(plate.pattern, LatticePattern):
        return plate.pattern.hole_size
    narrow, wide = math.inf, 0.0
    for outline in plate.pattern.outlines(*((-0.5 * side, 0.5 * side) for side in plate.pattern.period)):
        hull = np.asarray(shapely.get_coordinates(shapely.convex_hull(shapely.multipoints(outline))))
        extent = float(np.linalg.norm(hull[:, None] - hull[None], axis=-1).max())
        radius = shapely.length(shapely.maximum_inscribed_circle(shapely.polygons(outline), 0.25e-3 * extent))
        narrow, wide = min(narrow, 2.0 * float(radius)), max(wide, extent)
    return narrow, wide


def corner_radius(plate: Plate) -> float:
    """Least radius of the corners of the holes [m]; infinite where their outline is unknown."""
    pattern = plate.pattern
    if isinstance(pattern, EllipsePattern):
        return float(pattern.width**2 / (2.0 * pattern.length))
    return float(pattern.rounding) if isinstance(pattern, LatticePattern) else math.inf


_OF_HOLES: dict[str, tuple[str, Callable[[Plate], float]]] = {
    "smallest_open_area": ("", lambda plate: plate.open_area),
    "largest_open_area": ("", lambda plate: plate.open_area),
    "smallest_ligament": ("mm", lambda plate: plate.ligament),
    "smallest_hole": ("mm", lambda plate: hole_sizes(plate)[0]),
    "largest_hole": ("mm", lambda plate: hole_sizes(plate)[1]),
    "smallest_corner_radius": ("mm", corner_radius),
}
"""Constraints of the holes of a plate: unit in a sentence, and the bounded number in SI."""
