"""Protection over all directions of fire: P(perforation) on a grid of azimuth and elevation, and its weighted mean.

The plate stands upright and its normal is horizontal. A threat at azimuth α, measured about the vertical from the
normal, and elevation ε above the horizon meets it at the obliquity θ with cos θ = cos α cos ε. More hits are computed
in the directions in which the share of perforations is neither 0 nor 1.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Annotated, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from warpimpact.campaign.campaign import Campaign
from warpimpact.campaign.evidence import evidence_of
from warpimpact.campaign.text import CampaignError
from warpimpact.kernels.status import Status
from warpimpact.records.group import failures
from warpimpact.runs.executor import Job
from warpimpact.runs.questions import Arrays, Question, Round, RoundProgress
from warpimpact.scene import Numerics, Scene, Shots
from warpimpact.scene.model import Array, Model
from warpimpact.scene.units import Angle, Number, PositiveSpeed
from warpimpact.solver.prepare import prepare
from warpimpact.solver.simulate import computed, numerics_for
from warpimpact.solver.worker import Worker
from warpimpact.statistics.intervals import Estimate, estimate_of
from warpimpact.statistics.student import student_quantile

Angles = Annotated[tuple[Angle, ...], Field(min_length=1, max_length=64)]

_LARGEST_OBLIQUITY = math.radians(89.0)


class Directions(Model):
    """Directions of fire.

    Attributes:
        azimuth: from the normal of the plate about the vertical, ascending [rad].
        elevation: of the threat above the horizon, ascending [rad].
        velocity: of the shots at the median [m/s]; by default that of the named requirement, else of the campaign.
        weight: weight of a direction in the mean: "solid_angle", or "area", the solid angle times the area that the
            plate presents in the direction.
        half_width: half width of the 95 % interval of P(perforation) in a direction, at which no more hits are
            computed.
        first_count, max_count: first and largest number of hits in a direction.
    """

    azimuth: Angles = tuple(math.radians(degrees) for degrees in (-60, -40, -20, 0, 20, 40, 60))
    elevation: Angles = tuple(math.radians(degrees) for degrees in (0, 15, 30))
    velocity: PositiveSpeed | None = None
    weight: Literal["solid_angle", "area"] = "area"
    half_width: Annotated[Number, Field(gt=0, lt=1)] = 0.05
    first_count: Annotated[int, Field(strict=True, ge=32, le=2**20)] = 64
    max_count: Annotated[int, Field(strict=True, ge=32, le=2**20)] = 512

    @model_validator(mode="after")
    def _meets_the_plate(self) -> Self:
        for name in ("azimuth", "elevation"):
            angles = np.degrees(getattr(self, name))
            if (np.diff(angles) <= 0.0).any():
                raise ValueError(f"got {name} = {[f'{angle:g}' for angle in angles]} deg, but it must ascend")
        steepest = float(self.obliquities().max())
        if steepest > _LARGEST_OBLIQUITY:
            raise ValueError(f"got {math.degrees(steepest):.3g} deg from the normal, but at most 89 deg is allowed")
        if self.first_count > self.max_count:
            raise ValueError(
                f"got first_count = {self.first_count}, but it must be at most max_count = {self.max_count}"
            )
        return self

    def weights(self) -> Array:
        """Weights of the directions, shape [azimuths, elevations], with the sum 1. A direction stands for the angles up
        to the middle between it and the next one; at the ends of the grid only for its inner half."""
        across, up = np.diff(_edges(self.azimuth)), _edges(self.elevation)
        solid = across[:, None] * (np.sin(up[1:]) - np.sin(up[:-1]))
        if self.weight == "area":
            solid = solid * np.cos(self.obliquities())
        return np.asarray(solid / solid.sum())

    def obliquities(self) -> Array:
        """Angles between line of fire and normal [rad], shape [azimuths, elevations]."""
        return np.array([[obliquity(az, el) for el in self.elevation] for az in self.azimuth])


def _edges(angles: tuple[float, ...]) -> Array:
    """Edges of the intervals that the angles stand for, one more than there are angles. The interval of a single angle
    has an arbitrary width."""
    if len(angles) == 1:
        return np.array([angles[0] - 0.01, angles[0] + 0.01])
    middles = 0.5 * (np.array(angles[1:]) + np.array(angles[:-1]))
    return np.concatenate([[angles[0]], middles, [angles[-1]]])


def obliquity(azimuth: float, elevation: float) -> float:
    """Angle between the line of fire and the normal of the plate [rad]."""
    return math.acos(min(1.0, math.cos(azimuth) * math.cos(elevation)))


def impact_azimuth(azimuth: float, elevation: float) -> float:
    """Direction of the obliquity in the plate, from +y towards +z [rad]: a threat to the side of +y flies towards −y,
    and one above flies towards −z."""
    return math.atan2(-math.sin(elevation), -math.sin(azimuth) * math.cos(elevation))


@dataclass(frozen=True)
class Sector:
    """Protection by direction; arrays of shape [azimuths, elevations].

    Attributes:
        share, low, high: P(perforation) and its 95 % interval.
        hits: number of computed hits.
        failed: number of hits that failed.
        mean: the weighted mean of P(perforation) with its 95 % interval.
        evidence: as in `Response`.
    """

    share: Array
    low: Array
    high: Array
    hits: NDArray[np.int64]
    failed: NDArray[np.int64]
    mean: Estimate
    evidence: str


def check_directions(campaign: Campaign) -> None:
    """Refuse a campaign whose hits cannot be continued, or which gives the direction of fire itself.

    Raises:
        CampaignError: the message gives the reason.
    """
    if campaign.stop is not None:
        raise CampaignError("directions cannot be combined with stop")
    if campaign.hits.sampling not in ("sobol", "random") or campaign.hits.irreducible:
        raise CampaignError('directions need hits.sampling = "sobol" or "random", without irreducible')
    if campaign.impact.obliquity > 0.0 or {("obliquity", 0), ("azimuth", 0)} & {*campaign.scatter.given}:
        raise CampaignError("impact.obliquity and impact.azimuth are set by directions; leave them out")


def protect(
    campaign: Campaign, directions: Directions, progress: Callable[[int, int], object] = lambda done, total: None
) -> Question[Sector]:
    """Compute P(perforation) in all directions.

    All directions take the first of the same hits, so their errors are not independent. One pilot with hits from all
    directions finds the resolution.

    Args:
        progress: called with the number of settled directions and the number of all directions.
    """
    check_directions(campaign)
    if directions.velocity is not None:
        impact = campaign.impact.model_copy(update={"velocity": directions.velocity})
        campaign = campaign.model_copy(update={"impact": impact})
    cells = [(azimuth, elevation) for azimuth in directions.azimuth for elevation in directions.elevation]
    passed: dict[tuple[float, float], Array] = dict.fromkeys(cells, np.empty(0))
    hits = campaign.hits.model_copy(update={"count": directions.max_count})
    sampler = campaign.model_copy(update={"hits": hits}).sampler()
    first = sampler.shots(0, directions.first_count)
    every = Shots.joined([toward(first, *cell) for cell in cells])
    (piloted,) = yield Round([Job(_piloted, (campaign, every))], ["pilot"])
    numerics = str(piloted["numerics"])
    open_, count = list(cells), directions.first_count
    while open_:
        known, settled = len(passed[open_[0]]), len(cells) - len(open_)

        def told(now: RoundProgress, settled: int = settled) -> None:
            progress(settled + int(now.done), len(cells))

        more = sampler.shots(known, count - known)
        results = yield Round(
            [Job(_answers, (campaign.scene, toward(more, *cell), numerics)) for cell in open_],
            [f"{azimuth} {elevation} up to {count}" for azimuth, elevation in open_],
            told,
        )
        for cell, answers in zip(open_, results, strict=True):
            passed[cell] = np.concatenate([passed[cell], answers["passed"]])
        open_ = [cell for cell in open_ if _wanted(campaign, passed[cell], directions)]
        count = min(2 * count, directions.max_count)
    return _sector(campaign, directions, passed)


def _piloted(campaign: Campaign, shots: Shots, *, worker: Worker, report: Callable[[float], object]) -> Arrays:
    """Find the numerics with a pilot of some of the shots; returns them as JSON."""
    return {"numerics": np.array(numerics_for(campaign.scene, shots, campaign.numerics, worker).model_dump_json())}


def _answers(scene: Scene, shots: Shots, numerics: str, *, worker: Worker, report: Callable[[float], object]) -> Arrays:
    """1 for a shot that perforates, 0 for one that is stopped, NaN for one that failed."""
    prepared = prepare(scene, shots, Numerics.model_validate_json(numerics))
    status = computed(prepared, worker).status
    answers = np.isin(status, (Status.PERFORATED, Status.MISSED)).astype(float)
    return {"passed": np.where(failures(status), np.nan, answers)}


def toward(shots: Shots, azimuth: float, elevation: float) -> Shots:
    """Shots that come from a direction [rad]."""
    ones = np.ones(len(shots))
    return replace(
        shots, obliquity=obliquity(azimuth, elevation) * ones, azimuth=impact_azimuth(azimuth, elevation) * ones
    )


def _wanted(campaign: Campaign, passed: Array, directions: Directions) -> bool:
    """Whether the interval in a direction needs more hits."""
    if len(passed) >= directions.max_count:
        return False
    known = passed[~np.isnan(passed)]
    if len(known) and np.ptp(known) == 0.0:
        return False
    return _estimate(campaign, passed).half_width > directions.half_width


def _estimate(campaign: Campaign, passed: Array) -> Estimate:
    return estimate_of("share", passed, replicates=campaign.replicates)


def _sector(campaign: Campaign, directions: Directions, passed: dict[tuple[float, float], Array]) -> Sector:
    shape = len(directions.azimuth), len(directions.elevation)
    estimates = [_estimate(campaign, answers) for answers in passed.values()]
    share, low, high = (
        np.array([getattr(estimate, name) for estimate in estimates]).reshape(shape)
        for name in ("value", "low", "high")
    )
    hits = np.array([len(answers) for answers in passed.values()]).reshape(shape)
    failed = np.array([int(np.isnan(answers).sum()) for answers in passed.values()]).reshape(shape)
    mean = weighted_mean(list(passed.values()), directions.weights().ravel(), campaign.replicates)
    return Sector(share, low, high, hits, failed, mean, "\n".join(evidence_of(campaign)))


def weighted_mean(passed: list[Array], weights: Array, replicates: int) -> Estimate:
    """The weighted mean over directions of the share of answers 1, with its 95 % interval.

    With replicates the interval is Student's over their weighted means, which is valid although all directions have the
    same hits. Without replicates the errors of all directions are added, as if they were fully correlated. Where all
    answers are equal, the ends are the means of those of the directions.

    Args:
        passed: answers in every direction, NaN for a hit that failed.
    """
    estimates = [estimate_of("share", answers, replicates=replicates) for answers in passed]
    value, low, high = (
        float(weights @ np.array([getattr(estimate, name) for estimate in estimates]))
        for name in ("value", "low", "high")
    )
    means = np.zeros(replicates)
    for weight, answers in zip(weights, passed, strict=True):
        means += weight * np.array([np.nanmean(answers[place::replicates]) for place in range(replicates)])
    if replicates > 1 and np.ptp(means) > 0.0:
        half = student_quantile(0.975, replicates - 1) * float(means.std(ddof=1)) / math.sqrt(replicates)
        low, high = max(0.0, value - half), min(1.0, value + half)
    total = sum(map(len, passed))
    return Estimate(value, low, high, total, math.sqrt(value * (1.0 - value)))
