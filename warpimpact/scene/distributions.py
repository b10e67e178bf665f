"""Distributions of one quantity."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator
from scipy import stats

from .model import Array, Model

EDGE = 2.0**-31
"""Uniform numbers lie between EDGE and 1 − EDGE. EDGE is half a step of the Sobol sequence. So a normal distribution
ends at 6.2 standard deviations, and its range is known in advance."""


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


class _Bounded(Distribution, ABC):
    """A distribution that ends at low and high.

    Attributes:
        low: smallest value.
        high: largest value.
    """

    low: _Finite
    high: _Finite

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if not self.low < self.high:
            raise ValueError(f"got low = {self.low:g} and high = {self.high:g}, but high must be above low")
        return self


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


class TruncatedNormal(_Bounded):
    """The part of a normal distribution between low and high; `mean` and `std` are those of the whole.

    Attributes:
        mean: of the whole distribution.
        std: standard deviation of the whole distribution.
    """

    distribution: Literal["truncated_normal"] = "truncated_normal"
    mean: _Finite
    std: _Positive

    def quantile(self, share: Array) -> Array:
        ends = ((end - self.mean) / self.std for end in (self.low, self.high))
        values = stats.truncnorm.ppf(share, *ends, self.mean, self.std)
        return np.asarray(np.clip(values, self.low, self.high))  # rounding may exceed the ends


class Uniform(_Bounded):
    """Evenly between low and high."""

    distribution: Literal["uniform"] = "uniform"

    def quantile(self, share: Array) -> Array:
        return np.asarray(stats.uniform.ppf(share, self.low, self.high - self.low))


class Triangular(_Bounded):
    """From low to high with its peak at mode.

    Attributes:
        mode: where the peak is.
    """

    distribution: Literal["triangular"] = "triangular"
    mode: _Finite

    @model_validator(mode="after")
    def _peaks_within(self) -> Self:
        if not self.low <= self.mode <= self.high:
            raise ValueError(f"got mode = {self.mode:g}, but it must lie between low and high")
        return self

    def quantile(self, share: Array) -> Array:
        width = self.high - self.low
        return np.asarray(stats.triang.ppf(share, (self.mode - self.low) / width, self.low, width))


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
        return np.asarray(self.scale * (-np.log1p(-share)) ** (1.0 / self.shape))


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
                f"got {len(self.values)} values and {len(self.weights)} weights, but each value needs one weight"
            )
        return self

    def quantile(self, share: Array) -> Array:
        weights = np.ones(len(self.values)) if self.weights is None else np.array(self.weights)
        order = np.argsort(self.values)
        ends = np.cumsum(weights[order])
        which = np.searchsorted(ends[:-1] / ends[-1], share, side="right")
        values: Array = np.array(self.values)[order][which]
        return values


AnyDistribution = Annotated[
    Normal | TruncatedNormal | Uniform | Triangular | Lognormal | Weibull | Discrete,
    Field(discriminator="distribution"),
]
PURE_NUMBERS = {"distribution", "sigma", "shape", "weights"}
"""Fields without the unit of the quantity."""
