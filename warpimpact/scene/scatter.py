"""Scatter: distributions of quantities that differ from shot to shot."""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import (
    Field,
    FieldSerializationInfo,
    SerializerFunctionWrapHandler,
    TypeAdapter,
    ValidationError,
    ValidationInfo,
    field_serializer,
    field_validator,
    model_validator,
)
from scipy import stats

from .model import Array, Model
from .quantities import QUANTITIES, SCATTERED
from .units import Radians, in_radians, quantity

EDGE = 2.0**-31
"""Uniform numbers lie between EDGE and 1 − EDGE. EDGE is half a step of the Sobol sequence. So a normal distribution
ends at 6.2 standard deviations, and its range is known in advance."""
_PURE_NUMBERS = {"distribution", "sigma", "shape", "weights"}
"""Fields without the unit of the quantity."""

_Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
_Finite = Annotated[float, Field(allow_inf_nan=False)]


class Distribution(Model, ABC):
    """A distribution of one quantity; its fields hold SI and radians.

    Attributes:
        distribution: its name.
    """

    distribution: str

    @abstractmethod
    def quantile(self, share: Array) -> Array:
        """Values that exceed these shares of the distribution, same shape."""

    @property
    def ends(self) -> tuple[float, float]:
        """Smallest and largest value that is drawn."""
        low, high = self.quantile(np.array([EDGE, 1.0 - EDGE]))
        return float(low), float(high)


class Normal(Distribution):
    """Mean and standard deviation.

    Attributes:
        mean: of the quantity.
        std: standard deviation.
    """

    distribution: Literal["normal"] = "normal"
    mean: _Finite
    std: _Positive

    def quantile(self, share: Array) -> Array:
        return np.asarray(stats.norm.ppf(share, self.mean, self.std))


class Uniform(Distribution):
    """Evenly between low and high.

    Attributes:
        low: smallest value.
        high: largest value.
    """

    distribution: Literal["uniform"] = "uniform"
    low: _Finite
    high: _Finite

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if not self.low < self.high:
            raise ValueError(f"got low = {self.low:g} and high = {self.high:g}, but high must be above low")
        return self

    def quantile(self, share: Array) -> Array:
        return self._within(stats.uniform.ppf(share, self.low, self.high - self.low))

    def _within(self, values: Array) -> Array:
        return np.clip(values, self.low, self.high)  # rounding may exceed the ends


class TruncatedNormal(Uniform):
    """The part of a normal distribution between low and high; `mean` and `std` are those of the whole.

    Attributes:
        mean: of the whole distribution.
        std: standard deviation of the whole distribution.
    """

    distribution: Literal["truncated_normal"] = "truncated_normal"  # type: ignore[assignment]
    mean: _Finite
    std: _Positive

    def quantile(self, share: Array) -> Array:
        low, high = (self.low - self.mean) / self.std, (self.high - self.mean) / self.std
        return self._within(stats.truncnorm.ppf(share, low, high, self.mean, self.std))


class Triangular(Uniform):
    """From low to high with its peak at mode.

    Attributes:
        mode: where the peak is.
    """

    distribution: Literal["triangular"] = "triangular"  # type: ignore[assignment]
    mode: _Finite

    @model_validator(mode="after")
    def _peaks_within(self) -> Self:
        if not self.low <= self.mode <= self.high:
            raise ValueError(f"got mode = {self.mode:g}, but it must lie between low and high")
        return self

    def quantile(self, share: Array) -> Array:
        width = self.high - self.low
        return self._within(stats.triang.ppf(share, (self.mode - self.low) / width, self.low, width))


class Discrete(Distribution):
    """One of several values.

    Attributes:
        values: the possible values.
        weights: proportional to the probabilities; without weights all values are equally probable.
    """

    distribution: Literal["discrete"] = "discrete"
    values: Annotated[tuple[_Finite, ...], Field(min_length=1)]
    weights: tuple[_Positive, ...] | None = None

    @model_validator(mode="after")
    def _paired(self) -> Self:
        if self.weights is not None and len(self.weights) != len(self.values):
            raise ValueError(
                f"got values: {len(self.values)}, weights: {len(self.weights)}, but each value needs one weight"
            )
        return self

    def quantile(self, share: Array) -> Array:
        weights = np.ones(len(self.values)) if self.weights is None else np.array(self.weights)
        order = np.argsort(self.values)
        ends = np.cumsum(weights[order])
        which = np.searchsorted(ends[:-1] / ends[-1], share, side="right")
        return np.asarray(np.array(self.values)[order][which])


class Lognormal(Distribution):
    """The logarithm is normal.

    Attributes:
        median: half of the values lie below it.
        sigma: standard deviation of the logarithm.
    """

    distribution: Literal["lognormal"] = "lognormal"
    median: _Positive
    sigma: _Positive

    def quantile(self, share: Array) -> Array:
        return np.asarray(stats.lognorm.ppf(share, self.sigma, scale=self.median))


class Weibull(Distribution):
    """The strength of the weakest link.

    Attributes:
        shape: a large one has little spread.
        scale: 63 % of the values lie below it.
    """

    distribution: Literal["weibull"] = "weibull"
    shape: _Positive
    scale: _Positive

    def quantile(self, share: Array) -> Array:
        return np.asarray(stats.weibull_min.ppf(share, self.shape, scale=self.scale))


AnyDistribution = Annotated[
    Normal | TruncatedNormal | Uniform | Triangular | Discrete | Lognormal | Weibull,
    Field(discriminator="distribution"),
]
_ByLayer = tuple[AnyDistribution | None, ...]


def check_range(name: str, low: float, high: float) -> None:
    """Refuse a range of a quantity, `low` to `high`, with values that the quantity may not have.

    Raises:
        ValueError: the message has the value that is reached and what is allowed.
    """
    kind = QUANTITIES[name].type
    read = quantity(kind)
    for value in (low, high):
        try:
            TypeAdapter(kind).validate_python(read.as_read(value))
        except ValidationError as error:
            allowed = error.errors()[0]["msg"].replace("Input should", "it must")
            reached = f"{math.degrees(value):.6g} deg" if read.unit == "rad" else f"{value:.6g}"
            raise ValueError(f"reaches {reached}, but {allowed}") from None


def in_si(read: Callable[[Any], float], given: Mapping[str, Any]) -> dict[str, Any]:
    """The parameters of a distribution in SI; `read` is the reader of its quantity.

    Raises:
        ValueError: the message names the parameter.
    """
    values = dict(given)
    for name in values.keys() - _PURE_NUMBERS:
        try:
            values[name] = _of_each(read, values[name])
        except ValueError as error:
            raise ValueError(f"{name}: {error}") from None
    return values


def _of_each(change: Callable[[Any], Any], value: Any) -> Any:
    """What a change makes of a value, or of each in a list."""
    return [change(one) for one in value] if isinstance(value, list | tuple) else change(value)


class Scatter(Model):
    """Distributions of the quantities that differ from shot to shot, beside the hit point; None for all others.

    In a campaign file a distribution takes the place of the value:
    ``velocity = { distribution = "normal", mean = "820 m/s", std = "10 m/s" }``.
    A quantity of layers has a distribution or None for each layer; a single distribution is that of the plate.
    """

    velocity: AnyDistribution | None = None
    obliquity: AnyDistribution | None = None
    azimuth: AnyDistribution | None = None
    pitch: AnyDistribution | None = None
    yaw: AnyDistribution | None = None
    spin: AnyDistribution | None = None
    resistance: _ByLayer = ()
    shear_coefficient: _ByLayer = ()
    degradation: _ByLayer = ()
    thickness: _ByLayer = ()
    mass: AnyDistribution | None = None
    strength: AnyDistribution | None = None
    offset_y: _ByLayer = ()
    offset_z: _ByLayer = ()

    @field_validator("*", mode="before")
    @classmethod
    def _in_si(cls, value: Any, info: ValidationInfo) -> Any:
        """Read parameters with the unit of their quantity."""
        known = SCATTERED[str(info.field_name)]
        if known.by_layer and isinstance(value, dict | Distribution):
            value = (value,)
        of_layers = value if isinstance(value, list | tuple) else (value,)
        read = [in_si(quantity(known.type), one) if isinstance(one, dict) else one for one in of_layers]
        return read if of_layers is value else read[0]

    @field_validator("*", mode="after")
    @classmethod
    def _is_possible(cls, value: Any, info: ValidationInfo) -> Any:
        for distribution in value if isinstance(value, tuple) else (value,):
            try:
                if distribution is not None:
                    check_range(str(info.field_name), *distribution.ends)
            except ValueError as error:
                raise ValueError(f"got a {distribution.distribution} distribution that {error}") from None
        if str(info.field_name).startswith("offset") and value and value[0] is not None:
            raise ValueError("got a distribution for the plate, but only layers behind it have an offset")
        return value

    @field_serializer("*", mode="wrap")
    def _as_read(self, value: Any, write: SerializerFunctionWrapHandler, info: FieldSerializationInfo) -> Any:
        """Write angles in the form in which they are read."""
        written = write(value)
        if not isinstance(written, dict) or quantity(SCATTERED[info.field_name].type).unit != "rad":
            return written
        mark = in_radians if info.mode == "json" else Radians
        return {name: part if name in _PURE_NUMBERS else _of_each(mark, part) for name, part in written.items()}

    @property
    def given(self) -> dict[tuple[str, int], Distribution]:
        """The given distributions by name and layer; the layer is 0, the plate, for quantities of the shot."""
        by_layer = {name: value if isinstance(value, tuple) else (value,) for name, value in self}
        return {(name, k): given for name, layers in by_layer.items() for k, given in enumerate(layers) if given}

    @property
    def layers(self) -> int:
        """One more than the number of the last layer with a distribution."""
        return 1 + max((layer for _, layer in self.given), default=0)
