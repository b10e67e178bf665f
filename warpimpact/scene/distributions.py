"""Distributions of one quantity."""

from __future__ import annotations

from abc import ABC
from collections.abc import Callable
from typing import Annotated, Any, Literal, Self

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

    def quantile(self, share: Array) -> Array:
        """Values that exceed these shares of the distribution, same shape."""
        return np.asarray(_SCIPY[self.distribution](self).ppf(share))

    @property
    def ends(self) -> tuple[float, float]:
        """Smallest and largest value that is drawn."""
        low, high = self.quantile(np.array([EDGE, 1.0 - EDGE]))
        return float(low), float(high)


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

    def quantile(self, share: Array) -> Array:
        return np.clip(super().quantile(share), self.low, self.high)  # rounding may exceed the ends


class Normal(Distribution):
    """Mean and standard deviation.

    Attributes:
        mean: of the quantity.
        std: standard deviation.
    """

    distribution: Literal["normal"] = "normal"
    mean: _Finite
    std: _Positive


class TruncatedNormal(_Bounded):
    """The part of a normal distribution between low and high; `mean` and `std` are those of the whole.

    Attributes:
        mean: of the whole distribution.
        std: standard deviation of the whole distribution.
    """

    distribution: Literal["truncated_normal"] = "truncated_normal"
    mean: _Finite
    std: _Positive


class Uniform(_Bounded):
    """Evenly between low and high."""

    distribution: Literal["uniform"] = "uniform"


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


class Lognormal(Distribution):
    """The logarithm is normal.

    Attributes:
        median: half of the values lie below it.
        sigma: standard deviation of the logarithm.
    """

    distribution: Literal["lognormal"] = "lognormal"
    median: _Positive
    sigma: _Positive


class Weibull(Distribution):
    """The strength of the weakest link.

    Attributes:
        shape: a large one has little spread.
        scale: 63 % of the values lie below it.
    """

    distribution: Literal["weibull"] = "weibull"
    shape: _Positive
    scale: _Positive


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
        return np.asarray(np.array(self.values)[order][which])


_SCIPY: dict[str, Callable[[Any], Any]] = {
    "normal": lambda d: stats.norm(d.mean, d.std),
    "truncated_normal": lambda d: stats.truncnorm(
        (d.low - d.mean) / d.std, (d.high - d.mean) / d.std, loc=d.mean, scale=d.std
    ),
    "uniform": lambda d: stats.uniform(d.low, d.high - d.low),
    "triangular": lambda d: stats.triang((d.mode - d.low) / (d.high - d.low), d.low, d.high - d.low),
    "lognormal": lambda d: stats.lognorm(d.sigma, scale=d.median),
    "weibull": lambda d: stats.weibull_min(d.shape, scale=d.scale),
}
AnyDistribution = Annotated[
    Normal | TruncatedNormal | Uniform | Triangular | Lognormal | Weibull | Discrete,
    Field(discriminator="distribution"),
]
PURE_NUMBERS = {"distribution", "sigma", "shape", "weights"}
"""Fields without the unit of the quantity."""
