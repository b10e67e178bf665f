"""The stop rule of a campaign."""

from typing import Annotated

from pydantic import Field, ValidationInfo, ValidatorFunctionWrapHandler, field_serializer, field_validator

from ..results.measures import Measure
from ..scene.model import Model
from ..scene.units import Number, Radians, in_radians, quoted


class Stop(Model):
    """When a run ends: as soon as a confidence interval is narrow enough.

    Attributes:
        quantity: a measure with an interval, such as `mean(residual_velocity)`, `quantile(tilt@130mm, 0.05)`,
            `worst_tenth(residual_energy_density@130mm)` or `P(perforated)`.
        half_width: largest half width of the interval, SI; that of an angle is given in degrees or with its unit.
        confidence: of the interval.
        max_count: number of shots after which the run ends in any case.
    """

    quantity: str
    half_width: Annotated[float, Field(json_schema_extra={"type": ["number", "string"]})]
    confidence: Annotated[Number, Field(gt=0, lt=1)] = 0.95
    max_count: Annotated[int, Field(strict=True, ge=1, le=2**30)]

    @field_validator("quantity")
    @classmethod
    def _is_a_measure(cls, text: str) -> str:
        if not Measure.parse(text).has_interval:
            raise ValueError(f"got {quoted(text)}, but a run cannot stop by a number without an interval")
        return text

    @field_validator("half_width", mode="wrap")
    @classmethod
    def _in_si(cls, value: object, _: ValidatorFunctionWrapHandler, info: ValidationInfo) -> float:
        if "quantity" not in info.data:
            raise ValueError(f"got {quoted(value)}, but it needs a valid stop.quantity")
        number = Measure.parse(info.data["quantity"]).in_units(value)
        if number <= 0.0:
            raise ValueError(f"got {quoted(value)}, but it must be greater than 0")
        return number

    @field_serializer("half_width", when_used="json")
    def _as_read(self, value: float) -> float | str:
        return in_radians(value) if isinstance(value, Radians) else value

    @property
    def measure(self) -> Measure:
        """The measure that the quantity names."""
        return Measure.parse(self.quantity)
