"""A simulated firing test: the models of its file, its procedures, and how the file is read."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, PrivateAttr, model_validator
from scipy import special

from warpimpact.campaign.text import as_campaign_error, parsed, read_text
from warpimpact.firing.v50 import within_span
from warpimpact.results.kinds import TEST
from warpimpact.scene.input_files import InputFile
from warpimpact.scene.model import Array, Model
from warpimpact.scene.units import Number, PositiveSpeed, Speed, Title, Whole
from warpimpact.statistics.quantal import Flags, fewest_shots

Share = Annotated[Number, Field(gt=0, lt=1)]
Count = Annotated[Whole, Field(ge=2, le=1000)]


class FiringTarget(Model):
    """The target is a campaign or its limits.

    Attributes:
        campaign: campaign file, whose limit velocities are searched.
        limits: result of `warpimpact limit`.
        count: limits that are searched of a campaign.
    """

    campaign: InputFile | None = None
    limits: InputFile | None = None
    count: Annotated[Whole, Field(ge=1, le=2**20)] = 256

    @model_validator(mode="after")
    def _is_one(self) -> FiringTarget:
        if (self.campaign is None) == (self.limits is None):
            raise ValueError("got both or neither of campaign and limits, but it must be one of them")
        return self


class Gun(Model):
    """How well a velocity is met. It is measured exactly.

    Attributes:
        deviation: standard deviation from the velocity that was aimed at [m/s].
        window: largest difference of a fair hit from the velocity aimed at [m/s]; other shots are fired again.
    """

    deviation: Annotated[Speed, Field(ge=0)] = 0.0
    window: PositiveSpeed | None = None

    def errors(self, drawn: Array) -> Array:
        """Differences from the velocity aimed at [m/s] for uniform numbers in [0, 1), cut at the window."""
        if self.deviation == 0.0:
            return np.zeros_like(drawn)
        outside = 0.0 if self.window is None else 2.0 * float(special.ndtr(-self.window / self.deviation))
        share = np.clip(outside / 2.0 + (1.0 - outside) * drawn, 1e-15, 1.0 - 1e-15)
        return np.asarray(self.deviation * special.ndtri(share))


class MilStd662F(Model):
    """Up and down until equal numbers of the slowest complete penetrations and the fastest stops lie within a span.

    V50 is their mean. The first change of velocity is larger, until there are a stop and a complete penetration. The
    standard's text was not at hand: spans, changes and counts are as publications quote them.

    Attributes:
        start: velocity of the first shot [m/s].
        first_change: of velocity until there are a stop and a complete penetration [m/s].
        change: of velocity from then on [m/s].
        pairs: stops, and as many complete penetrations, that V50 is the mean of.
        span: largest difference between their velocities [m/s].
        most_shots: after which a test ends without a V50.
    """

    name: Literal["mil_std_662f"] = "mil_std_662f"
    start: PositiveSpeed
    first_change: PositiveSpeed = 30.0
    change: PositiveSpeed = 15.0
    pairs: Annotated[Whole, Field(ge=1, le=50)] = 3
    span: PositiveSpeed = 27.0
    most_shots: Count = 30

    def chosen(self, velocity: Array, perforated: Flags) -> list[float] | None:
        """Velocities that V50 is the mean of; None until they lie within the span."""
        return within_span(velocity[~perforated].tolist(), velocity[perforated].tolist(), self.pairs, self.span)

    def aim(self, velocity: Array, perforated: Flags) -> float | None:
        """Velocity of the next shot [m/s] after those of a test; None at its end."""
        if not len(velocity):
            return self.start
        if self.chosen(velocity, perforated) is not None:
            return None
        change = self.first_change if perforated.all() or not perforated.any() else self.change
        return float(velocity[-1]) + (-change if perforated[-1] else change)


class Langlie(Model):
    """One-shot test of H. J. Langlie (A reliability test method for "one-shot" items, Aeronutronic U-1792, 1962).

    The next velocity is the mean of the last one and that of the nearest earlier shot from which on stops and complete
    penetrations are equal in number; without such a shot, of the last one and an end of the range.

    Attributes:
        lowest, highest: ends of the range, in which V50 must lie [m/s].
        most_shots: shots of a test.
    """

    name: Literal["langlie"] = "langlie"
    lowest: PositiveSpeed
    highest: PositiveSpeed
    shots: Count = 12

    @model_validator(mode="after")
    def _rises(self) -> Langlie:
        if self.lowest >= self.highest:
            ends = f"lowest = {self.lowest:g} m/s and highest = {self.highest:g} m/s"
            raise ValueError(f"got {ends}, but lowest must be less")
        return self

    @property
    def most_shots(self) -> int:
        """Shots of a test."""
        return self.shots

    def aim(self, velocity: Array, perforated: Flags) -> float | None:
        """Velocity of the next shot [m/s] after those of a test."""
        if not len(velocity):
            return 0.5 * (self.lowest + self.highest)
        end = self.lowest if perforated[-1] else self.highest
        even = np.cumsum(np.where(perforated, 1, -1)[::-1]) == 0
        return 0.5 * float(velocity[-1] + (velocity[::-1][even.argmax()] if even.any() else end))


Procedure = MilStd662F | Langlie


class Proof(Model):
    """Shots at one velocity, with at most some complete penetrations.

    Attributes:
        velocity: velocity aimed at [m/s].
        shots: shots of a test; by default the fewest that show `stop_probability` at `confidence`.
        allowed: complete penetrations with which a target is still accepted.
        stop_probability: probability of a stop that acceptance shall show.
        confidence: confidence at which it shows this.
    """

    velocity: PositiveSpeed
    shots: Annotated[Whole, Field(ge=1, le=100_000)] | None = None
    allowed: Annotated[Whole, Field(ge=0, le=1000)] = 0
    stop_probability: Share = 0.9
    confidence: Share = 0.9

    @model_validator(mode="after")
    def _can_fail(self) -> Proof:
        if self.shots is not None and self.allowed >= self.shots:
            raise ValueError(f"got allowed = {self.allowed}, but it must be less than shots = {self.shots}")
        return self

    @property
    def shot_count(self) -> int:
        """Shots of a test: the given number, or the fewest that show what acceptance shall show."""
        return self.shots or fewest_shots(self.allowed, self.stop_probability, self.confidence)


class FiringTest(Model):
    """A simulated firing test: target, procedure, gun and proof.

    Attributes:
        title: one line, which the figure shows.
        tests: how often the procedure is fired.
        seed: of all random numbers.
        target: what is fired at.
        procedure: how V50 is sought.
        gun: how well a velocity is met.
        proof: how often a target is accepted with at most k complete penetrations of n shots.
    """

    title: Title
    tests: Annotated[Whole, Field(ge=1, le=100_000)] = 1000
    seed: Annotated[Whole, Field(ge=0, le=2**63 - 1)] = 0
    target: FiringTarget
    procedure: Annotated[Procedure, Field(discriminator="name")] | None = None
    gun: Gun = Gun()
    proof: Proof | None = None
    _text: str = PrivateAttr("")
    """The TOML file as it was read."""


def read_test(path: str | Path) -> FiringTest:
    """Read a test file; file names in it count from its folder.

    Raises:
        CampaignError: the file is missing, is not TOML, or has a value that is not allowed.
    """
    path = Path(path)
    text = read_text(path)
    data: dict[str, Any] = parsed(text, str(path), TEST)
    with as_campaign_error(f"{path}: ", data):
        test = FiringTest.model_validate(data, context={"folder": path.parent})
    test._text = text
    return test
