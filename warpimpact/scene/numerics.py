"""How finely and by which scheme a shot is computed."""

from typing import Annotated, Any, Literal, Self

from pydantic import Field, SerializerFunctionWrapHandler, model_serializer, model_validator

from .model import Model
from .units import PositiveAngle, PositiveLength, PositiveSpeed, PositiveTime


class _AsGiven(Model):
    """A model in which giving a key says something: only what was given is written."""

    @model_serializer(mode="wrap")
    def _given(self, write: SerializerFunctionWrapHandler) -> dict[str, Any]:
        return {name: value for name, value in write(self).items() if name in self.model_fields_set}


class Tolerance(_AsGiven):
    """What an outcome may be off by; what is not given does not count.

    Attributes:
        residual_velocity: [m/s].
        tilt: at every stand-off, given in degrees or with its unit [rad].
    """

    residual_velocity: PositiveSpeed = float("inf")
    tilt: PositiveAngle = float("inf")

    @model_validator(mode="after")
    def _asks_for_something(self) -> Self:
        if not self.model_fields_set:
            raise ValueError("got neither residual_velocity nor tilt, but at least one of them must be given")
        return self


class Numerics(_AsGiven):
    """A fidelity, and single settings that go before it; what is None follows from fidelity and scheme.

    Attributes:
        fidelity: "draft", "standard" or "reference".
        scheme: "consistent", or "nodal" for the paper's literal scheme (docs/model.md §4).
        time_step: [s].
        patches_axial, patches_around: surface patches per length of the core (the consistent scheme takes shorter ones
            behind the widest station), and around it; a multiple of 4 around it makes mirrored shots mirror exactly.
        grid_spacing: spacing of the plate grid [m].
        precision: of the arithmetic.
        tolerance: instead of a fidelity: each hit is refined until its estimated error meets it.
    """

    fidelity: Literal["draft", "standard", "reference"] = "standard"
    scheme: Literal["consistent", "nodal"] = "consistent"
    time_step: PositiveTime | None = None
    patches_axial: Annotated[int, Field(strict=True, ge=4, le=4096)] | None = None
    patches_around: Annotated[int, Field(strict=True, ge=8, le=4096, multiple_of=4)] | None = None
    grid_spacing: PositiveLength | None = None
    precision: Literal["single", "double"] | None = None
    tolerance: Tolerance | None = None

    @model_validator(mode="after")
    def _tolerance_chooses(self) -> Self:
        chosen = self.model_fields_set - {"tolerance", "precision"}
        if self.tolerance is not None and chosen:
            raise ValueError(f"got {min(chosen)} beside tolerance, which chooses the resolution itself")
        return self
