"""Constraints of a design that are checked before anything is computed."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from warpimpact.campaign.campaign import Campaign
from warpimpact.campaign.tested import Standing, standings_of
from warpimpact.campaign.text import CampaignError
from warpimpact.catalogue.catalogue import Catalogue
from warpimpact.catalogue.entries import Material
from warpimpact.optimisation.design import Design
from warpimpact.optimisation.evaluate import campaign_of
from warpimpact.optimisation.judged import weights_of
from warpimpact.results.vocabulary import WEIGHTS
from warpimpact.scene import EllipsePattern, Plate
from warpimpact.scene.patterns.lattice import LatticePattern
from warpimpact.solver.limit import check_arrests

INVALID = "a campaign that is valid"
NOT_TESTED = "within what was tested, as search.allow_untested is not true"


_OF_PLATES = ("holes", "thickness", "resistance", "the kind of material")
"""Subjects of published tests that a design decides."""


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
    limits, target = design.constraints, campaign.target
    for measure, density in weights_of(target).items():
        what = WEIGHTS[measure].label
        smallest, largest = (f"{end}_{measure}" for end in ("smallest", "largest"))
        yield from _least(smallest, density, getattr(limits, smallest), what, "kg/m²")
        yield from _most(largest, density, getattr(limits, largest), what, "kg/m²")
    if not design.search.allow_untested:
        yield from (Violation(NOT_TESTED, 1.0, standing.sentence) for standing in untested(campaign))
    for name, plate in target.named:
        if plate.open_area > 0.0:
            for of_hole in _of_holes(design, plate):
                yield of_hole._replace(text=f"{name}: {of_hole.text}")


def untested(campaign: Campaign) -> list[Standing]:
    """The properties of a campaign's plates that lie beyond every published test."""
    standings = standings_of(campaign, Catalogue.of(campaign.catalogue).all(Material))
    return [standing for standing in standings if standing.subject in _OF_PLATES]


def _of_holes(design: Design, plate: Plate) -> Iterator[Violation]:
    limits, mm = design.constraints, 1e3
    yield from _least("smallest_open_area", plate.open_area, limits.smallest_open_area, "open area", "")
    yield from _most("largest_open_area", plate.open_area, limits.largest_open_area, "open area", "")
    if (least := limits.smallest_ligament) is not None:
        yield from _least("smallest_ligament", mm * plate.ligament, mm * least, "ligament", "mm")
    if limits.smallest_hole is not None or limits.largest_hole is not None:
        narrow, wide = hole_sizes(plate)
        yield from _least("smallest_hole", mm * narrow, _times(mm, limits.smallest_hole), "hole", "mm")
        yield from _most("largest_hole", mm * wide, _times(mm, limits.largest_hole), "hole", "mm")
    if (least := limits.smallest_corner_radius) is not None:
        yield from _least("smallest_corner_radius", mm * corner_radius(plate), mm * least, "corner radius", "mm")


def _times(factor: float, value: float | None) -> float | None:
    return None if value is None else factor * value


def _least(key: str, value: float, least: float | None, what: str, unit: str) -> Iterator[Violation]:
    if least is not None and value < least * (1.0 - 1e-9):
        text = f"{what} of {value:.4g} {unit}, but it must be at least {least:.4g} {unit}"
        yield Violation(key, (least - value) / least, " ".join(text.split()))


def _most(key: str, value: float, most: float | None, what: str, unit: str) -> Iterator[Violation]:
    if most is not None and value > most * (1.0 + 1e-9):
        text = f"{what} of {value:.4g} {unit}, but it must be at most {most:.4g} {unit}"
        yield Violation(key, (value - most) / most, " ".join(text.split()))


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
