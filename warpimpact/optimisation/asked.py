"""What a design file asks for: objectives and bounds, each a measure."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Any, Literal

from pydantic import field_validator, model_validator

from warpimpact.campaign.needs import lacking
from warpimpact.results.measures import Measure
from warpimpact.results.vocabulary import WEIGHTS
from warpimpact.scene.model import Model
from warpimpact.scene.units import Number, quoted


class _Asked(Model):
    """A measure of a target.

    Attributes:
        measure: such as `mean(residual_energy_density@130mm)`, `worst_tenth(base_depth)`, `P(base_perforated)`,
            `P(inclination@130mm > 30 deg)`, `V50`, `mean(limit_thickness@layer 1)` or `areal_density`; the default
            stand-off is the largest one.
        threats: over several threats the "worst" one counts, or their weighted "mean".
    """

    measure: str
    threats: Literal["worst", "mean"] = "worst"

    @field_validator("measure")
    @classmethod
    def _can_be_sought(cls, text: str) -> str:
        if Measure.parse(text).kind == "worst_point":
            raise ValueError(
                f"got {quoted(text)}, but a search takes a mean, a worst tenth, a quantile, a probability or "
                f"{' or '.join(WEIGHTS)}"
            )
        return text

    @cached_property
    def asked(self) -> Measure:
        """The measure."""
        return Measure.parse(self.measure)


class Objective(_Asked):
    """What is minimised or maximised.

    Attributes:
        goal: "minimise" or "maximise"; by default, what is better for whoever is behind the plate.
    """

    goal: Literal["minimise", "maximise"] | None = None

    @property
    def sign(self) -> float:
        """Factor that turns the measure into a quantity to minimise."""
        if self.goal is not None:
            return 1.0 if self.goal == "minimise" else -1.0
        return -1.0 if self.asked.higher_is_better else 1.0

    @model_validator(mode="after")
    def _has_a_goal(self) -> Objective:
        if self.goal is None and self.asked.higher_is_better is None:
            raise ValueError(f'needs goal = "minimise" or "maximise": neither is better of {quoted(self.measure)}')
        return self


class Bound(_Asked):
    """A measure with an upper or a lower limit.

    Attributes:
        at_most, at_least: limits, in the units in which inspect shows the measure.
    """

    at_most: Number | None = None
    at_least: Number | None = None

    @model_validator(mode="after")
    def _has_a_limit(self) -> Bound:
        if (self.at_most is None) == (self.at_least is None):
            raise ValueError("needs at_most or at_least, one of both")
        return self

    @property
    def limit(self) -> float:
        return float(next(limit for limit in (self.at_most, self.at_least) if limit is not None))

    @property
    def sign(self) -> float:
        """Factor that turns a lower limit into an upper one."""
        return 1.0 if self.at_most is not None else -1.0


def check_needs(asked: Mapping[str, Objective | Bound], output: Mapping[str, Any], *, layered: bool) -> None:
    """Refuse a measure if the campaign, with layers behind the plate or not, lacks what it needs.

    Args:
        asked: objectives and bounds by their places in the file.

    Raises:
        ValueError: the message names the measure, and what it needs.
    """
    bends, none = output.get("bending") is True, output.get("standoffs") == []
    for place, goal in asked.items():
        measure = goal.asked
        keys = lacking(measure, standoffs=[] if none else None, layered=layered, bending=bends, breakable=True)
        if keys:
            raise ValueError(f'{place}.measure = "{goal.measure}" needs {keys}')
