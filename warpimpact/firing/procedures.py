"""Procedures: how the velocity of the next shot of a test follows from the answers before it (`steps.py`)."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal, Self, TypeAlias

from pydantic import Field

from warpimpact.firing.steps import Count, InRange, OfShots, Optimal, Shot, Steps, ends
from warpimpact.firing.three_pod import ThreePod
from warpimpact.scene.model import Model
from warpimpact.scene.units import PositiveSpeed


class UpAndDown(OfShots):
    """Up and down in equal steps (Bruceton): down after a perforation, up after a stop (W. J. Dixon and A. M. Mood,
    Journal of the American Statistical Association 43 (1948) 109).

    Attributes:
        start: velocity of the first shot [m/s].
        step: between two velocities [m/s].
        shots: of a test.
    """

    name: Literal["up_and_down"] = "up_and_down"
    start: PositiveSpeed
    step: PositiveSpeed
    shots: Count = 30

    def steps(self) -> Steps:
        """The velocities of one test."""
        aim = self.start
        for _ in range(self.shots):
            shot = yield aim
            aim += -self.step if shot.perforated else self.step


class MilStd662F(Model):
    """V50 of MIL-STD-662F: up and down until equal numbers of the slowest perforations and the fastest stops lie within
    a span.

    The first change of velocity is larger, until there are a stop and a perforation. The standard's text was not at
    hand: spans, changes and counts are as publications quote them.

    Attributes:
        start: velocity of the first shot [m/s].
        first_change: of velocity until there are a stop and a perforation [m/s].
        change: of velocity from then on [m/s].
        pairs: stops, and as many perforations, that V50 is the mean of.
        span: largest difference between their velocities [m/s].
        most_shots: after which a test ends without a V50.
    """

    name: Literal["mil_std_662f"] = "mil_std_662f"
    start: PositiveSpeed
    first_change: PositiveSpeed = 30.0
    change: PositiveSpeed = 15.0
    pairs: Annotated[int, Field(strict=True, ge=1, le=50)] = 3
    span: PositiveSpeed = 27.0
    most_shots: Count = 30

    prefixes: ClassVar[bool] = False

    @property
    def most(self) -> int:
        """Shots of a test, at most."""
        return self.most_shots

    def of_size(self, size: int) -> Self:
        """The procedure with half as many pairs as `size`, and room for more shots."""
        return self.model_copy(update={"pairs": size // 2, "most_shots": max(self.most_shots, 5 * size)})

    def steps(self) -> Steps:
        """The velocities of one test."""
        aim, stops, perforations = self.start, list[float](), list[float]()
        for _ in range(self.most_shots):
            shot = yield aim
            (perforations if shot.perforated else stops).append(shot.velocity)
            if within_span(stops, perforations, self.pairs, self.span) is not None:
                return
            change = self.change if stops and perforations else self.first_change
            aim = shot.velocity + (-change if shot.perforated else change)


def within_span(stops: list[float], perforations: list[float], pairs: int, span: float) -> list[float] | None:
    """The fastest stops and the slowest perforations, if there are enough and they lie within the span."""
    if min(len(stops), len(perforations)) < pairs:
        return None
    chosen = sorted(stops)[-pairs:] + sorted(perforations)[:pairs]
    return chosen if max(chosen) - min(chosen) <= span else None


class Langlie(InRange):
    """One-shot test of H. J. Langlie (A reliability test method for "one-shot" items, Aeronutronic U-1792, 1962).

    The next velocity is the middle between the last one and that of the nearest earlier shot from which on stops and
    perforations are equal in number; without such a shot, between the last one and an end of the range.

    Attributes:
        lowest, highest: ends of the range, in which V50 must lie [m/s].
        shots: of a test.
    """

    name: Literal["langlie"] = "langlie"
    lowest: PositiveSpeed
    highest: PositiveSpeed
    shots: Count = 12

    def steps(self) -> Steps:
        """The velocities of one test."""
        fired = list[Shot]()
        aim = 0.5 * (self.lowest + self.highest)
        for _ in range(self.shots):
            fired.append((yield aim))
            balance, other = 0, None
            for shot in reversed(fired):
                balance += 1 if shot.perforated else -1
                if balance == 0:
                    other = shot.velocity
                    break
            end = self.lowest if fired[-1].perforated else self.highest
            aim = 0.5 * (fired[-1].velocity + (end if other is None else other))


class Neyer(InRange):
    """D-optimal test (B. T. Neyer, Technometrics 36 (1994) 61). It searches until there are a stop and a perforation,
    halves their distance down to the guess of the spread, and shrinks this guess until the answers overlap. From then
    on the velocity is the one that says most about V50 and spread together.

    Attributes:
        lowest, highest: ends of the range that V50 is expected in [m/s].
        spread: guess of the standard deviation [m/s].
        shots: of a test.
    """

    name: Literal["neyer"] = "neyer"
    lowest: PositiveSpeed
    highest: PositiveSpeed
    spread: PositiveSpeed
    shots: Count = 20

    def steps(self) -> Steps:
        """The velocities of one test."""
        fired, spread = list[Shot](), self.spread
        aim: float | Optimal = 0.5 * (self.lowest + self.highest)
        for _ in range(self.shots):
            fired.append((yield aim))
            slowest, fastest = min(shot.velocity for shot in fired), max(shot.velocity for shot in fired)
            below, above = ends(fired)
            if below is None:
                aim = min(0.5 * (self.lowest + slowest), slowest - 2.0 * spread, 2.0 * slowest - fastest)
            elif above is None:
                aim = max(0.5 * (self.highest + fastest), fastest + 2.0 * spread, 2.0 * fastest - slowest)
            elif above - below > spread:
                aim = 0.5 * (below + above)
            elif above >= below:
                aim = Optimal(0.5 * (below + above), min(spread, fastest - slowest))
                spread *= 0.8
            else:
                aim = Optimal()


AnyProcedure = Annotated[UpAndDown | MilStd662F | Langlie | Neyer | ThreePod, Field(discriminator="name")]
Procedure: TypeAlias = UpAndDown | MilStd662F | Langlie | Neyer | ThreePod
