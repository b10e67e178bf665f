"""Procedures: which velocity the next shot of a test is fired at, by the answers of the shots before it.

A procedure is a generator per test. It yields a velocity to aim at [m/s] and is sent the Shot that this became; it ends
when the test is over. For a D-optimal velocity it yields Optimal: these are computed for all tests at once.
"""

from __future__ import annotations

from collections.abc import Generator
from typing import Annotated, Any, ClassVar, Literal, NamedTuple, Self, TypeAlias

import numpy as np
from pydantic import Field, model_validator

from warpimpact.scene.model import Model
from warpimpact.scene.units import Number, PositiveSpeed


class Shot(NamedTuple):
    """What a shot became.

    Attributes:
        velocity: as it was measured [m/s].
        perforated: whether it perforated.
    """

    velocity: float
    perforated: bool


class Optimal(NamedTuple):
    """Asks for the D-optimal velocity (`statistics.quantal.d_optimal`): at the fit of greatest likelihood, or at a
    guess of the median and the standard deviation [m/s]."""

    location: float | None = None
    scale: float | None = None


class Estimated(NamedTuple):
    """Asks for the fit of greatest likelihood so far; what is sent back is an Estimate in the place of a Shot."""


class Estimate(NamedTuple):
    """The fit of greatest likelihood within the levels that were fired [m/s], and the information sums of it."""

    location: float
    scale: float
    information: tuple[float, float, float]


Steps: TypeAlias = Generator["float | Optimal | Estimated", Any, None]
Count = Annotated[int, Field(strict=True, ge=2, le=1000)]


class UpAndDown(Model):
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

    prefixes: ClassVar[bool] = True

    @property
    def most(self) -> int:
        """Shots of a test, at most."""
        return self.shots

    def of_size(self, size: int) -> Self:
        """The procedure with so many shots."""
        return self.model_copy(update={"shots": size})

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


class Langlie(Model):
    """One-shot test of H. J. Langlie (A reliability test method for "one-shot" items, Aeronutronic U-1792, 1962).

    The next velocity is the middle of the last one and that of the nearest earlier shot from which on stops and
    perforations are equal in number; without such a shot, of the last one and an end of the range.

    Attributes:
        lowest, highest: ends of the range, in which V50 must lie [m/s].
        shots: of a test.
    """

    name: Literal["langlie"] = "langlie"
    lowest: PositiveSpeed
    highest: PositiveSpeed
    shots: Count = 12

    @model_validator(mode="after")
    def _rises(self) -> Self:
        _check_range(self.lowest, self.highest)
        return self

    prefixes: ClassVar[bool] = True

    @property
    def most(self) -> int:
        """Shots of a test, at most."""
        return self.shots

    def of_size(self, size: int) -> Self:
        """The procedure with so many shots."""
        return self.model_copy(update={"shots": size})

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


class Neyer(Model):
    """D-optimal test (B. T. Neyer, Technometrics 36 (1994) 61): search until there are a stop and a perforation, halve
    their distance down to the guess of the spread, shrink this guess until the answers overlap; from then on the
    velocity that tells most about V50 and spread together.

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

    @model_validator(mode="after")
    def _rises(self) -> Self:
        _check_range(self.lowest, self.highest)
        return self

    prefixes: ClassVar[bool] = True

    @property
    def most(self) -> int:
        """Shots of a test, at most."""
        return self.shots

    def of_size(self, size: int) -> Self:
        """The procedure with so many shots."""
        return self.model_copy(update={"shots": size})

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


class ThreePod(Model):
    """Three-phase optimal design, 3pod (C. F. J. Wu and Y. Tian, Journal of Statistical Planning and Inference 149
    (2014) 1): a search until the answers overlap, D-optimal shots, then shots that approach a quantile (Robbins, Monro
    and Joseph: V. R. Joseph, Biometrika 91 (2004) 461).

    Attributes:
        lowest, highest: ends of the range that V50 is expected in [m/s].
        spread: guess of the standard deviation [m/s].
        shots: of a test in the first two phases.
        quantile_shots: of the third phase.
        quantile: share of perforations that the third phase approaches.
    """

    name: Literal["3pod"] = "3pod"
    lowest: PositiveSpeed
    highest: PositiveSpeed
    spread: PositiveSpeed
    shots: Count = 20
    quantile_shots: Annotated[int, Field(strict=True, ge=0, le=1000)] = 0
    quantile: Annotated[Number, Field(gt=0, lt=1)] = 0.5

    @model_validator(mode="after")
    def _rises(self) -> Self:
        _check_range(self.lowest, self.highest)
        return self

    @property
    def prefixes(self) -> bool:
        """Whether the first shots of a test are those of a shorter one."""
        return self.quantile_shots == 0

    @property
    def most(self) -> int:
        """Shots of a test, at most."""
        return self.shots + self.quantile_shots

    def of_size(self, size: int) -> Self:
        """The procedure with so many shots in its first two phases."""
        return self.model_copy(update={"shots": size})

    def steps(self) -> Steps:
        """The velocities of one test."""
        search, aim, fired = self._search(), None, list[Shot]()
        for _ in range(self.shots):
            if aim is None or not isinstance(aim, Optimal):
                aim = next(search, Optimal()) if aim is None else _sent(search, fired[-1])
            fired.append((yield aim))
        if self.quantile_shots:
            yield from self._approach((yield Estimated()))

    def _search(self) -> Generator[float, Shot, None]:
        """Phase I: until the answers overlap, and one or two shots in the middle of the overlap."""
        low, high, spread = self.lowest, self.highest, self.spread
        fired = list[Shot]()
        for aim in (0.75 * low + 0.25 * high, 0.25 * low + 0.75 * high):
            fired.append((yield aim))
        first, second = (shot.perforated for shot in fired)
        outward = 0
        while first == second and fired[-1].perforated == first:
            outward += 1
            spread *= 2.0 if outward % 3 == 0 else 1.0
            fired.append((yield low - 1.5 * outward * spread if first else high + 1.5 * outward * spread))
        if first and not second:
            for aim in (low - 3.0 * spread, high + 3.0 * spread):
                fired.append((yield aim))
        yield from self._overlap(fired, spread)

    def _overlap(self, fired: list[Shot], spread: float) -> Generator[float, Shot, None]:
        while True:
            below, above = ends(fired)
            if below is None or above is None or below > above:
                break
            if above - below >= 1.5 * spread:
                fired.append((yield 0.5 * (below + above)))
                continue
            perforations = sum(shot.perforated for shot in fired)
            outside = [above + 0.3 * spread, below - 0.3 * spread]
            for aim in outside if len(fired) > 2 * perforations else outside[::-1]:
                fired.append((yield aim))
                if fired[-1].perforated != (aim > above):
                    break
            else:
                spread *= 2.0 / 3.0
        below, above = ends(fired)
        if below is not None and above is not None:
            middle = 0.5 * (below + above)
            wide = below - above >= spread
            for aim in (middle,) if wide else (middle + 0.5 * spread, middle - 0.5 * spread):
                fired.append((yield aim))

    def _approach(self, estimate: Estimate) -> Steps:
        """Phase III, in units of the standard deviation; τ² is the variance of the quantile that the fit leaves, kept
        between those of ± 3 and ± 5 at 95 %, and β = 1/2, as Wu and Tian take them."""
        from scipy import special

        z = float(special.ndtri(self.quantile))
        s0, s1, s2 = estimate.information
        determinant = max(s0 * s2 - s1 * s1, 1e-12)
        least, most = ((half / 1.959964) ** 2 for half in (3.0, 5.0))
        variance = float(np.clip((s2 - 2.0 * z * s1 + z * z * s0) / determinant, least, most))
        aim = estimate.location + z * estimate.scale
        for _ in range(self.quantile_shots):
            shot = yield aim
            root = np.sqrt(1.0 + 0.25 * variance)
            share = float(special.ndtr(z / root))
            density = float(np.exp(-0.5 * (z / root) ** 2) / np.sqrt(2.0 * np.pi))
            gain = 0.5 * variance / root * density / (share * (1.0 - share))
            aim = aim - gain * estimate.scale * (float(shot.perforated) - share)
            variance -= share * (1.0 - share) * gain**2


def ends(fired: list[Shot]) -> tuple[float | None, float | None]:
    """The fastest stop and the slowest perforation; None where there is none."""
    stops = [shot.velocity for shot in fired if not shot.perforated]
    perforations = [shot.velocity for shot in fired if shot.perforated]
    return max(stops, default=None), min(perforations, default=None)


def _sent(search: Generator[float, Shot, None], shot: Shot) -> float | Optimal:
    try:
        return search.send(shot)
    except StopIteration:
        return Optimal()


def _check_range(lowest: float, highest: float) -> None:
    if lowest >= highest:
        raise ValueError(f"got lowest = {lowest:g} m/s and highest = {highest:g} m/s, but lowest must be less")


AnyProcedure = Annotated[UpAndDown | MilStd662F | Langlie | Neyer | ThreePod, Field(discriminator="name")]
Procedure: TypeAlias = UpAndDown | MilStd662F | Langlie | Neyer | ThreePod
