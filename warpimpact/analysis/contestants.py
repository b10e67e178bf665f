"""The parts of a comparison of plates: the plates, and differences of pairs of them."""

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
