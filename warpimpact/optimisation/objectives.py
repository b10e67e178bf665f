"""Objectives, bounds and constraints of designs.

Constraints are checked before anything is computed; objectives and bounds are means of the numbers of hits. Hit k of
every design lies at the same place of its irreducible part (common random numbers), so designs are compared shot by
shot.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache, partial
from typing import Any, NamedTuple

import numpy as np
import shapely

from warpimpact.campaign.campaign import Campaign
from warpimpact.optimisation.design import Bound, Constraints, Design, Objective
from warpimpact.results import attributes as attr
from warpimpact.results.vocabulary import WEIGHTS
from warpimpact.scene import EllipsePattern, Plate, Target
from warpimpact.scene.model import Array
from warpimpact.scene.patterns.pattern import LatticePattern
from warpimpact.solver.limit import check_arrests
from warpimpact.statistics.comparisons import ROUNDED
from warpimpact.statistics.intervals import Estimate, estimate_of
from warpimpact.statistics.tails import pseudo_values

INVALID = "a campaign that is valid"
SCRAMBLINGS = 16
"""Number of scramblings of the hits of a search: hit k belongs to scrambling k modulo this number."""


@dataclass(frozen=True)
class Candidate:
    """A target, before or after its hits are computed.

    Attributes:
        point: values of the variables, shape [variables]; empty for a reference.
        tables: tables of its campaign.
        weights: masses per area [kg/m²], by the names of the measures (results/measures.py).
        levels: numerics for every threat, as JSON.
        results: objectives and bounds, shape [goals]; NaN where no hit counts.
    """

    point: Array
    tables: dict[str, Any]
    weights: Mapping[str, float]
    levels: tuple[str, ...] = ()
    results: Array = field(default_factory=lambda: np.zeros(0))


def weights_of(target: Target) -> dict[str, float]:
    """Masses per area of a target, by the names of the measures."""
    weights = target.weights
    return {attr.AREAL_DENSITY: target.areal_density, attr.ADD_ON_DENSITY: weights.get("add-on", target.areal_density)}


def results_of(design: Design, weights: Mapping[str, float], columns: Array) -> Array:
    """Objectives and bounds, shape [goals]; NaN where no hit counts.

    Args:
        columns: numbers of every hit by each threat, shape [threats, columns, hits].
    """
    return np.array([_mean(_numbers(design, weights, columns, goal)) for goal in design.goals])


def _numbers(design: Design, weights: Mapping[str, float], columns: Array, goal: Objective | Bound) -> Array:
    """Numbers of the hits whose mean is an objective or a bound, shape [hits]: those of the worst threat, or averages
    over the threats."""
    measure = goal.spec
    if measure.kind == "target":
        return np.array([weights[measure.name]])
    numbers = columns[:, design.columns.index(measure.column)]
    if measure.kind == "quantile":  # of Harrell and Davis, a smooth function of the hits (statistics/tails.py)
        numbers = np.array([pseudo_values(of_hits, measure.share) for of_hits in numbers])
    elif not measure.is_binary:
        numbers = np.array([measure.averaged(measure.counted(of_hits)) for of_hits in numbers])
    if goal.threats == "mean":
        of_threats = np.array([threat.weight for threat in design.threats])
        return np.asarray(of_threats @ numbers / of_threats.sum())
    signed = goal.sign * np.array([_mean(of_hits) for of_hits in numbers])
    return np.asarray(numbers[int(np.argmax(np.nan_to_num(signed, nan=np.inf)))])


def _mean(numbers: Array) -> float:
    known = numbers[~np.isnan(numbers)]
    return float(known.mean()) if len(known) else float("nan")


def estimate(design: Design, weights: Mapping[str, float], columns: Array, goal: Objective | Bound) -> Estimate:
    """An objective or a bound with its interval."""
    numbers = _numbers(design, weights, columns, goal)
    if goal.spec.kind == "target":
        return Estimate(numbers[0], numbers[0], numbers[0], columns.shape[2], 0.0)
    averaged = goal.threats == "mean" and len(design.threats) > 1
    is_share = goal.spec.is_binary and not averaged
    return estimate_of("share" if is_share else "mean", numbers, replicates=SCRAMBLINGS)


def to_minimise(design: Design, results: Array) -> Array:
    """Objectives, signed such that they are to be minimised; infinite where no hit counts."""
    signs = np.array([objective.sign for objective in design.objectives])
    return np.nan_to_num(signs * results[: len(signs)], nan=np.inf, posinf=np.inf, neginf=-np.inf)


def excesses(design: Design, results: Array) -> Array:
    """Violation of each bound as a share of its limit; 0 where it is kept to rounding, 1 where no hit counts."""
    bounded = zip(design.bounds, results[len(design.objectives) :], strict=True)
    over = [bound.sign * (value - bound.limit) / (abs(bound.limit) or 1.0) for bound, value in bounded]
    shares = np.nan_to_num(np.array(over), nan=1.0)
    return np.where(shares > ROUNDED, shares, 0.0)


class Violation(NamedTuple):
    """A constraint that a design breaks.

    Attributes:
        constraint: its key in [constraints], or INVALID.
        share: relative size of the violation.
        text: found value and allowed range in words.
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
    return campaign, tuple(_violations(design, campaign))


def _violations(design: Design, campaign: Campaign) -> Iterator[Violation]:
    target = campaign.target
    for measure, density in weights_of(target).items():
        for key in (f"smallest_{measure}", f"largest_{measure}"):
            yield from _broken(design.constraints, key, partial(float, density), WEIGHTS[measure].label, "kg/m²")
    for name, plate in target.named:
        if plate.open_area > 0.0:
            for key, value, what, unit in _of_holes(plate):
                for of_hole in _broken(design.constraints, key, value, what, unit):
                    yield of_hole._replace(text=f"{name}: {of_hole.text}")


def _of_holes(plate: Plate) -> tuple[tuple[str, Callable[[], float], str, str], ...]:
    """Constraints of the holes of a plate: key, the bounded number in SI, and its name and unit in a sentence."""
    sizes = cache(lambda: hole_sizes(plate))
    return (
        ("smallest_open_area", lambda: plate.open_area, "open area", ""),
        ("largest_open_area", lambda: plate.open_area, "open area", ""),
        ("smallest_ligament", lambda: plate.ligament, "ligament", "mm"),
        ("smallest_hole", lambda: sizes()[0], "hole", "mm"),
        ("largest_hole", lambda: sizes()[1], "hole", "mm"),
        ("smallest_corner_radius", lambda: corner_radius(plate), "corner radius", "mm"),
    )


def _broken(
    constraints: Constraints, key: str, number: Callable[[], float], what: str, unit: str
) -> Iterator[Violation]:
    """The violation of a constraint by a number, which is computed only if the constraint is given."""
    if (given := getattr(constraints, key)) is None:
        return
    scale = 1e3 if unit == "mm" else 1.0
    value, limit, sign = scale * number(), scale * given, 1.0 if key.startswith("smallest") else -1.0
    if sign * value < sign * limit * (1.0 - sign * 1e-9):
        end = "least" if sign > 0.0 else "most"
        text = f"{what} of {value:.4g} {unit}, but it must be at {end} {limit:.4g} {unit}"
        yield Violation(key, sign * (limit - value) / limit, " ".join(text.split()))


def hole_sizes(plate: Plate) -> tuple[float, float]:
    """Diameter of the largest circle in the narrowest hole, and greatest extent of the widest hole [m]; within a
    thousandth of the extent where the pattern is no lattice."""
    if isinstance(plate.pattern, LatticePattern):
        return plate.pattern.hole_size
    narrow, wide = math.inf, 0.0
    for outline in plate.pattern.outlines(*((-0.5 * side, 0.5 * side) for side in plate.pattern.unit_cell)):
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
