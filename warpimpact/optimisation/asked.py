"""What a design file asks for: objectives and bounds, each a measure, also by the names of earlier versions."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Any, Literal

from pydantic import field_validator, model_validator

from warpimpact.campaign.needs import lacking
from warpimpact.results.measures import Measure
from warpimpact.results.vocabulary import QUANTITIES, WEIGHTS
from warpimpact.scene.model import Model
from warpimpact.scene.units import Number, quoted

OLD_WORDS = {
    "tilted_share": "P(inclination{at} > {angle})",
    "base_perforated_share": "P(base_perforated)",
    "base_pierced_share": "P(base_pierced)",
    "stopped_share": "P(stopped)",
    "broken_share": "P(broken)",
    "stopped_or_broken_share": "P(stopped_or_broken)",
}
"""Measures under names of earlier versions; a quantity alone was its mean, and with _worst_tenth its worst tenth."""


def in_new_words(name: str, angle: object = "30 deg", standoff: object = "", layer: object = 0) -> str:
    """The text of a measure that is given by its name in an earlier version, with its place in keys of its own: angles
    are in degrees, stand-offs in metres. Other texts stay unchanged."""
    angle = f"{angle} deg" if isinstance(angle, int | float) else angle
    at = f"@{standoff} m" if isinstance(standoff, int | float) else f"@{standoff}" if standoff else ""
    if name in OLD_WORDS:
        return OLD_WORDS[name].format(at=at, angle=angle)
    bare = name.removesuffix("_worst_tenth")
    if bare not in QUANTITIES:
        return name
    quantity = QUANTITIES[bare]
    place = f"@layer {layer}" if quantity.has_layer else at if quantity.has_standoff else ""
    return f"{'mean' if bare == name else 'worst_tenth'}({bare}{place})"


class _Asked(Model):
    """A measure of a target.

    Attributes:
        measure: such as `mean(residual_energy_density@130mm)`, `worst_tenth(base_depth)`, `P(base_perforated)`,
            `P(inclination@130mm > 30 deg)`, `V50`, `mean(limit_thickness@layer 1)` or `areal_density`; without a
            stand-off the largest one counts.
        threats: over several threats the "worst" one counts, or their weighted "mean".
        assumptions: of what nobody measured, what the campaign says counts ("given"), or over all assumptions the
            "worst" or the "mean".
    """

    measure: str
    threats: Literal["worst", "mean"] = "worst"
    assumptions: Literal["given", "worst", "mean"] = "given"

    @model_validator(mode="before")
    @classmethod
    def _in_new_words(cls, given: Any) -> Any:
        """A measure by its name in earlier versions, which had angle, stand-off and layer as keys of their own."""
        if not isinstance(given, dict) or not isinstance(name := given.get("measure"), str):
            return given
        places = {key: given[key] for key in ("angle", "standoff", "layer") if key in given}
        text = in_new_words(name, **places)
        return given if text == name else {k: v for k, v in given.items() if k not in places} | {"measure": text}

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
        goal: "minimise" or "maximise"; unless given, what is better for whoever is behind the plate.
    """

    goal: Literal["minimise", "maximise"] | None = None

    @property
    def sign(self) -> float:
        """Factor that makes it a quantity to minimise."""
        if self.goal is not None:
            return 1.0 if self.goal == "minimise" else -1.0
        return -1.0 if self.asked.higher_is_better else 1.0

    @model_validator(mode="after")
    def _has_a_goal(self) -> Objective:
        if self.goal is None and self.asked.higher_is_better is None:
            raise ValueError(f'needs goal = "minimise" or "maximise": neither is better of {quoted(self.measure)}')
        return self


class Bound(_Asked):
    """A measure that is held within a limit, one of both.

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
        """Factor that makes it a quantity that must not exceed the limit."""
        return 1.0 if self.at_most is not None else -1.0


def check_needs(asked: Mapping[str, Objective | Bound], output: Mapping[str, Any], *, layered: bool) -> None:
    """Refuse a measure of which a campaign lacks what it needs.

    Args:
        asked: objectives and bounds by their places in the file.
        output: the table of the campaign.
        layered: whether it has layers behind the plate.

    Raises:
        ValueError: names the measure, and what it needs.
    """
    bends, none = output.get("bending") is True, output.get("standoffs") == []
    for place, goal in asked.items():
        measure = goal.asked
        keys = lacking(measure, standoffs=[] if none else None, layered=layered, bending=bends, breakable=True)
        if keys:
            raise ValueError(f'{place}.measure = "{goal.measure}" needs {keys}')
