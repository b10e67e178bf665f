"""Published limits that a campaign is compared with."""

from typing import Annotated

from pydantic import Field

from ..scene.model import Model
from ..scene.units import Obliquity, PositiveSpeed, Title


class Published(Model):
    """A published limit velocity of this target, beside which `warpimpact limit` puts its own.

    Attributes:
        velocity: the limit velocity [m/s].
        standard_deviation: of it, where it was published [m/s].
        obliquity: at which it was measured, given in degrees or with its unit [rad].
        label: what was shot at what, for figures; rows of one label are drawn alike.
        source: where it was published.
    """

    velocity: PositiveSpeed
    standard_deviation: PositiveSpeed | None = None
    obliquity: Obliquity = 0.0
    label: Title = ""
    source: Annotated[Title, Field(min_length=1)]
