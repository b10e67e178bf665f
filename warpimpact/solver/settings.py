"""Settings of the fast law: an accuracy, or a resolution and a scheme (docs/model.md §4)."""

import math
from typing import Annotated, Any, Literal, Self

from pydantic import Field, SerializerFunctionWrapHandler, model_serializer, model_validator

from warpimpact.scene.model import Model
from warpimpact.scene.units import PositiveAngle, PositiveLength, PositiveSpeed, PositiveTime, Whole

AtLevel = Annotated[Whole, Field(ge=0, le=9)]
"""A level of the ladder of resolutions."""
_Share = Annotated[float, Field(gt=0.0, lt=1.0)]


class _AsGiven(Model):
    """A model that writes only the keys that were given."""

    @model_serializer(mode="wrap")
    def _given(self, write: SerializerFunctionWrapHandler) -> dict[str, Any]:
        return {name: value for name, value in write(self).items() if name in self.model_fields_set}


class Accuracy(_AsGiven):
    """Largest errors for a share of the hits; a quantity that is not given has no limit.

    Attributes:
        residual_velocity: of the residual velocity [m/s].
        tilt: of the tilt at the largest stand-off [rad].
        residual_velocity_share, tilt_share: additional error behind several layers, as a share of the residual velocity
            or of the tilt.
        depth: of the depth in a layer that stops a core [m].
        status_share: largest share of the hits at several layers with another status or another stopping layer.
        limit: of a limit velocity, as a share of the median limit; twice as large for a limit thickness.
        base_perforated: of the share of the cores that pass the last of several layers.
        mean_velocity: of the mean residual velocity behind several layers, where a core that stops counts 0, as a share
            of the impact velocity.
        share: of the hits that keep the errors, from 0.5 to 0.99.
    """

    residual_velocity: PositiveSpeed = math.inf
    tilt: PositiveAngle = math.inf
    residual_velocity_share: Annotated[float, Field(ge=0.0, le=0.2)] = 0.0
    tilt_share: Annotated[float, Field(ge=0.0, le=0.2)] = 0.0
    depth: PositiveLength = math.inf
    status_share: Annotated[float, Field(gt=0.0, le=1.0)] = 1.0
    limit: _Share | None = None
    base_perforated: _Share | None = None
    mean_velocity: _Share | None = None
    share: Annotated[float, Field(ge=0.5, le=0.99)] = 0.9

    @model_validator(mode="after")
    def _asks_for_something(self) -> Self:
        if self.model_fields_set.isdisjoint(("residual_velocity", "tilt", "limit", "base_perforated", "mean_velocity")):
            raise ValueError("needs at least one of residual_velocity, tilt, limit, base_perforated and mean_velocity")
        return self

    @property
    def bounds_hits(self) -> bool:
        """Whether it bounds the errors of single hits."""
        return math.isfinite(self.residual_velocity) or math.isfinite(self.tilt)

    @property
    def bounds_answer(self) -> bool:
        """Whether it bounds what all hits at several layers come to."""
        return self.base_perforated is not None or self.mean_velocity is not None

    @property
    def strictness(self) -> float:
        """Error of draft over this error, in residual velocity or tilt, whichever is larger."""
        draft = PRESETS["draft"]
        return max(draft.residual_velocity / self.residual_velocity, draft.tilt / self.tilt)


PRESETS = {
    fidelity: Accuracy(
        residual_velocity=1.0 / strictness,
        tilt=1.0 / strictness,
        residual_velocity_share=0.002 / strictness,
        tilt_share=0.02 / strictness,
        depth=1e-4 / strictness,
        status_share=0.01 / strictness,
        limit=limit,
    )
    for fidelity, strictness, limit in (("draft", 0.2, 0.02), ("standard", 1.0, 0.006), ("reference", 5.0, 0.0015))
}
"""Accuracy by fidelity: the standard one with errors divided by a strictness, and the error of a limit."""
BASE_ACCURACY = Accuracy(base_perforated=0.01, mean_velocity=0.01, limit=PRESETS["standard"].limit)
"""Default accuracy at several layers: that of the answer. Single hits near a limit velocity may not meet "standard"."""


class FastLawSettings(_AsGiven):
    """Fields of `FastLaw`, which documents them; what prepares the shots reads no more."""

    fidelity: Literal["draft", "standard", "reference"] = "standard"
    accuracy: Accuracy | None = None
    level: AtLevel | None = None
    scheme: Literal["consistent", "nodal"] = "consistent"
    time_step: PositiveTime | None = None
    travel: Annotated[float, Field(gt=0.0, le=2.0)] | None = None
    patches_axial: Annotated[Whole, Field(ge=4, le=4096)] | None = None
    patches_around: Annotated[Whole, Field(ge=8, le=4096, multiple_of=4)] | None = None
    grid_spacing: PositiveLength | None = None
    precision: Literal["single", "double"] | None = None
    layout: Literal["simple", "block"] = "simple"

    def at_level(self, level: int) -> Self:
        """These settings at a level of the ladder, with the precision and layout given."""
        kept = {name: getattr(self, name) for name in ("precision", "layout") if name in self.model_fields_set}
        return type(self)(level=level, **kept)

    @property
    def required(self) -> Accuracy:
        """The accuracy that a pilot must reach, unless a setting fixes the resolution."""
        return self.accuracy or PRESETS[self.fidelity]

    def required_at(self, layers: int) -> Accuracy:
        """The accuracy that a pilot must reach at a number of layers."""
        is_default = layers > 1 and self.accuracy is None and "fidelity" not in self.model_fields_set
        return BASE_ACCURACY if is_default else self.required

    @property
    def explicit(self) -> str | None:
        """Name of the first setting that fixes the resolution, without a tolerance; None if a pilot chooses it."""
        fixed = ("level", "time_step", "travel", "patches_axial", "patches_around", "grid_spacing")
        given = [name for name in fixed if getattr(self, name) is not None]
        return "scheme" if self.scheme == "nodal" else next(iter(given), None)

    @model_validator(mode="after")
    def _sets_one_resolution(self) -> Self:
        names = ["fidelity"] if "fidelity" in self.model_fields_set else []
        names += [name for name in ("level", "accuracy") if getattr(self, name) is not None]
        names += [self.explicit] if self.accuracy is not None and self.explicit not in (None, "level") else []
        if len(names) > 1:
            raise ValueError(f"{names[0]} and {names[1]} cannot be combined: each sets the resolution")
        if self.travel is not None and (self.time_step is not None or self.scheme == "nodal"):
            raise ValueError('travel cannot be combined with time_step or scheme = "nodal": time_step sets the step')
        return self
