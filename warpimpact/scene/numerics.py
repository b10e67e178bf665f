"""Resolution and scheme with which a shot is computed."""

from typing import Annotated, Any, Literal, Self

from pydantic import Field, SerializerFunctionWrapHandler, model_serializer, model_validator

from .model import Model
from .units import PositiveAngle, PositiveLength, PositiveSpeed, PositiveTime


class _AsGiven(Model):
    """A model that writes only the keys that were given."""

    @model_serializer(mode="wrap")
    def _given(self, write: SerializerFunctionWrapHandler) -> dict[str, Any]:
        return {name: value for name, value in write(self).items() if name in self.model_fields_set}


class Accuracy(_AsGiven):
    """Errors that a share of the hits must stay within; a quantity that is not given has no limit.

    Attributes:
        residual_velocity: of the residual velocity [m/s].
        tilt: of the tilt at the largest stand-off [rad].
    """

    residual_velocity: PositiveSpeed = float("inf")
    tilt: PositiveAngle = float("inf")

    @model_validator(mode="after")
    def _asks_for_something(self) -> Self:
        if not self.model_fields_set:
            raise ValueError("got neither residual_velocity nor tilt, but at least one of them must be given")
        return self


class Numerics(_AsGiven):
    """A fidelity, and single settings that override it. A setting that is None follows from fidelity and scheme.

    Attributes:
        fidelity: "draft", "standard" or "reference". A campaign chooses the resolution so that 90 % of its hits are
            within 5 m/s and 5°, 1 m/s and 1°, or 0.2 m/s and 0.2°. A single setting ends that promise.
        scheme: "consistent", or "nodal" for the paper's literal scheme (docs/model.md §4).
        time_step: length of a step [s].
        patches_axial, patches_around: surface patches per length of the core and around it. The consistent scheme takes
            shorter patches behind the widest station. With a multiple of 4 around the core, mirrored shots have exactly
            mirrored outcomes.
        grid_spacing: spacing of the plate grid [m].
        precision: of the arithmetic.
        layout: of the work on a CUDA device. "simple" computes a shot per thread. "block" computes a shot per block of
            32 threads, with its window of the plate in shared memory; no device has measured it yet. It computes single
            plates in single precision, one hit each, without the bending moment.
    """

    fidelity: Literal["draft", "standard", "reference"] = "standard"
    scheme: Literal["consistent", "nodal"] = "consistent"
    time_step: PositiveTime | None = None
    patches_axial: Annotated[int, Field(strict=True, ge=4, le=4096)] | None = None
    patches_around: Annotated[int, Field(strict=True, ge=8, le=4096, multiple_of=4)] | None = None
    grid_spacing: PositiveLength | None = None
    precision: Literal["single", "double"] | None = None
    layout: Literal["simple", "block"] = "simple"

    @property
    def explicit(self) -> str | None:
        """The first setting that fixes the resolution, so that nothing is promised; None if the fidelity chooses it."""
        fixed = ("time_step", "patches_axial", "patches_around", "grid_spacing")
        given = [name for name in fixed if getattr(self, name) is not None]
        return "scheme" if self.scheme == "nodal" else next(iter(given), None)
