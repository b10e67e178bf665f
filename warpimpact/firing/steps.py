"""The messages between a procedure and those who fire it.

A procedure is a generator per test. It yields a velocity to aim at [m/s] and is sent the resulting Shot; it ends when
the test is over. For a D-optimal velocity it yields Optimal, because these are computed for all tests at once.
"""

from __future__ import annotations

from collections.abc import Generator
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple, Self, TypeAlias

from pydantic import Field, model_validator

from warpimpact.scene.model import Model
from warpimpact.scene.units import PositiveSpeed


class Shot(NamedTuple):
    """A fired shot.

    Attributes:
        velocity: measured velocity [m/s].
        perforated: whether it perforated.
    """

    velocity: float
    perforated: bool


class Optimal(NamedTuple):
    """Asks for the D-optimal velocity (`statistics.quantal.d_optimal`) at the fit of greatest likelihood, or at a guess
    of the median and the standard deviation [m/s]."""

    location: float | None = None
    scale: float | None = None


class Estimated(NamedTuple):
    """Asks for the fit of greatest likelihood so far. A StepEstimate is sent back instead of a Shot."""


class StepEstimate(NamedTuple):
    """The fit of greatest likelihood within the levels that were fired [m/s], and its information sums."""

    location: float
    scale: float
    information: tuple[float, float, float]


Steps: TypeAlias = Generator["float | Optimal | Estimated", Any, None]
Count = Annotated[int, Field(strict=True, ge=2, le=1000)]


def ends(fired: list[Shot]) -> tuple[float | None, float | None]:
    """The fastest stop and the slowest perforation; None where there is none."""
    stops = [shot.velocity for shot in fired if not shot.perforated]
    perforations = [shot.velocity for shot in fired if shot.perforated]
    return max(stops, default=None), min(perforations, default=None)


class OfShots(Model):
    """A procedure with a number of `shots`. Its fields stand in the order in which they are read."""

    if TYPE_CHECKING:
        shots: Count

    @property
    def prefixes(self) -> bool:
        """Whether the first shots of a test are the shots of a shorter test."""
        return True

    @property
    def most(self) -> int:
        """Most shots of a test."""
        return self.shots

    def of_size(self, size: int) -> Self:
        """The procedure with this number of shots."""
        return self.model_copy(update={"shots": size})


class InRange(OfShots):
    """A procedure that begins within a range of velocities."""

    if TYPE_CHECKING:
        lowest: PositiveSpeed
        highest: PositiveSpeed

    @model_validator(mode="after")
    def _rises(self) -> Self:
        if self.lowest >= self.highest:
            raise ValueError(
                f"got lowest = {self.lowest:g} m/s and highest = {self.highest:g} m/s, but lowest must be less"
            )
        return self
