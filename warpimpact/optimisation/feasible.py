"""Constraints of a design that are checked before anything is computed."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from functools import cache, partial
from typing import Any, NamedTuple

import numpy as np

from warpimpact.campaign.campaign import Campaign
from warpimpact.campaign.text import CampaignError
from warpimpact.optimisation.design import Constraints, Design
from warpimpact.optimisation.evaluate import campaign_of
from warpimpact.optimisation.judged import weights_of
from warpimpact.results.vocabulary import WEIGHTS
from warpimpact.scene import EllipsePattern, Plate
from warpimpact.scene.patterns.lattice import LatticePattern
from warpimpact.solver.limit import check_arrests

INVALID = "a campaign that is valid"


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


class Checked(NamedTuple):
    """A design before anything is computed.

    Attributes:
        campaign: campaign of its first threat; None if it is not valid.
        violations: violated constraints; empty if the design is feasible.
    """

    campaign: Campaign | None
    violations: tuple[Violation, ...]

    @property
    def excess(self) -> float:
        """Sum of the violations; 0 if the design is feasible."""
        return sum(violation.share for violation in self.violations)


def checked(design: Design, tables: Mapping[str, Any]) -> Checked:
    """Check the tables of a design against its constraints."""
    try:
        campaign = campaign_of(design, tables, design.threats[0])
    except CampaignError as error:
        text = str(error).removeprefix(f"{design.name}: ")
        return Checked(None, (Violation(INVALID, 1.0, text),))
    try:
        if any(key.is_limit for key in design.keys):
            check_arrests(campaign.scene)
    except ValueError as error:
        return Checked(campaign, (Violation(INVALID, 1.0, str(error)),))
    return Checked(campaign, tuple(_violations(design, campaign)))


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
    import shapely

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
