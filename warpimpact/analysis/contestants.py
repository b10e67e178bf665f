"""The parts of a comparison of plates: the plates, differences of pairs of them, and verdicts under assumptions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from warpimpact.analysis.effectiveness import Score


@dataclass(frozen=True)
class Contestant:
    """A plate and how well it protects: areal density of the whole target [kg/m²], share of open area, solid reference
    and its name, and `Target.weights`."""

    name: str
    hits: int
    areal_density: float
    open_area: float
    measures: tuple[Score, ...]
    solid: str = ""
    reference: str = "solid plate"
    weights: Mapping[str, float] = field(default_factory=dict)

    def score(self, measure: str) -> Score:
        """The score in a measure of this text."""
        return next(score for score in self.measures if score.name == measure)


@dataclass(frozen=True)
class Difference:
    """Difference of a measure between one plate and another, with its interval; NaN where there is none."""

    measure: str
    one: str
    other: str
    value: float
    low: float
    high: float

    @property
    def told_apart(self) -> bool:
        """Whether the interval excludes 0."""
        return self.low > 0.0 or self.high < 0.0


@dataclass(frozen=True)
class Verdict:
    """Which of two plates has the better value of a measure, whatever their weight: 1 the one, −1 the other, 0 unknown.

    Attributes:
        given: verdict for the campaigns as given.
        under: verdict under each assumption, by name.
    """

    measure: str
    one: str
    other: str
    given: int
    under: Mapping[str, int]

    @property
    def turned(self) -> list[str]:
        """Assumptions that reverse the verdict."""
        return [name for name, verdict in self.under.items() if verdict == -self.given]

    @property
    def text(self) -> str:
        """Text such as "a is better than b in 9 of 12 assumptions; turned over by: β = 1"."""
        if not self.given:
            apart = [name for name, verdict in self.under.items() if verdict]
            sentence = f"{self.one} and {self.other} cannot be told apart as given"
            return sentence + f", but with: {', '.join(apart)}" * bool(apart)
        better, worse = (self.one, self.other) if self.given > 0 else (self.other, self.one)
        open_ = [name for name, verdict in self.under.items() if not verdict]
        kept = len(self.under) - len(self.turned) - len(open_)
        text = f"{better} is better than {worse} in {kept} of {len(self.under)} assumptions"
        text += f"; turned over by: {', '.join(self.turned)}" * bool(self.turned)
        return text + f"; not told apart with: {', '.join(open_)}" * bool(open_)


@dataclass(frozen=True)
class Pair:
    """How the hits of two plates were used.

    Attributes:
        paired: number of first hits that are the same shots at both plates, which are compared shot by shot.
        independent: why the plates were compared as independent; empty where they were hit by the same shots.
    """

    one: str
    other: str
    paired: int
    independent: str
