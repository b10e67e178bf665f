"""Numbers of a campaign with their confidence intervals: means, quantiles and probabilities.

Of independent shots the intervals are Student's for a mean, Wilson's for a probability and that of the order
statistics for a quantile. Points of a Sobol sampling are not independent; there the shots are dealt out to
independent scramblings, and Student's interval over the answers of these replicates holds (A. B. Owen, Monte Carlo
theory, methods and examples, chapter 17).
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Self

import numpy as np
import xarray
from numpy.typing import NDArray
from pydantic import Field, ValidationInfo, field_validator

from warpimpact.kernels.status import Status
from warpimpact.results import BENDING_VARIABLES, OUTCOME_VARIABLES, failed, passed
from warpimpact.scene.model import Model
from warpimpact.scene.units import Angle, Energy, Length, Moment, Number, Speed, Stress, Time, quantity, quoted

Array = NDArray[np.float64]

_KINDS: dict[str, Any] = {
    "m s-1": Speed,
    "degree": Angle,
    "J": Energy,
    "s": Time,
    "N m": Moment,
    "Pa": Stress,
    "m": Length,
    "1": Number,
}
"""Types of the quantities that have these units in the Dataset."""
_VARIABLES = OUTCOME_VARIABLES | BENDING_VARIABLES
MEASURED = tuple(
    name
    for name, variable in _VARIABLES.items()
    if name != "status" and variable.dims in {("hit",), ("hit", "standoff")}
)
STATUSES = {status.name.lower(): status for status in Status if not status.failed}

_VARIABLE = r"(?P<variable>[a-z_]+)(?:\s*@\s*(?P<standoff>[^<>,]+?))?"
_FORMS = {
    "mean": re.compile(rf"mean\(\s*{_VARIABLE}\s*\)"),
    "quantile": re.compile(rf"quantile\(\s*{_VARIABLE}\s*,\s*(?P<share>[\d.eE+-]+)\s*\)"),
    "probability": re.compile(rf"P\(\s*{_VARIABLE}\s*(?P<relation>[<>])\s*(?P<limit>.+?)\s*\)"),
    "share": re.compile(r"P\(\s*(?P<variable>[a-z_]+)\s*\)"),
}


@dataclass(frozen=True)
class Measure:
    """One number of a result.

    Attributes:
        text: as it was asked for.
        kind: "mean", "quantile", "probability" (that a variable lies beyond a limit) or "share" (of a status).
        variable: of the Dataset, or the status of a share.
        standoff: distance behind the rear face [m] for a variable that has one.
        share: of a quantile.
        above, limit: of a probability, the limit in the units of the Dataset.

    A share counts all shots but those whose computation failed; the others count the cores that passed the plate.
    """

    text: str
    kind: str
    variable: str
    standoff: float | None = None
    share: float = 0.5
    above: bool = True
    limit: float = 0.0

    @classmethod
    def parse(cls, text: str) -> Self:
        """Read ``mean(v)``, ``quantile(v, 0.05)``, ``P(v > limit)`` or ``P(status)``; v may be ``tilt@130mm``.

        Raises:
            ValueError: says what is allowed.
        """
        for kind, form in _FORMS.items():
            if (match := form.fullmatch(text.strip())) is not None:
                return cls._from(text, kind, match.groupdict())
        raise ValueError(
            f"got {quoted(text)}, but it must be of the form mean(residual_velocity), "
            "quantile(residual_velocity, 0.05), P(tilt@130mm > 30 deg) or P(perforated)"
        )

    @classmethod
    def _from(cls, text: str, kind: str, parts: dict[str, str]) -> Self:
        name, allowed = parts["variable"], tuple(STATUSES) if kind == "share" else MEASURED
        if name not in allowed:
            raise ValueError(f'got "{name}", but it must be one of {", ".join(allowed)}')
        if kind == "share":
            return cls(text, kind, name)
        variable = _VARIABLES[name]
        has_standoff = "standoff" in variable.dims
        if has_standoff != (parts["standoff"] is not None):
            raise ValueError(
                f'got "{name}", which {"needs a" if has_standoff else "has no"} stand-off, as in tilt@130mm'
            )
        standoff = quantity(Length)(parts["standoff"]) if has_standoff else None
        if kind == "quantile":
            share = quantity(Number)(parts["share"])
            if not 0.0 < share < 1.0:
                raise ValueError(f"got the quantile {share:g}, but it must lie between 0 and 1")
            return cls(text, kind, name, standoff, share=share)
        if kind == "probability":
            limit = _shown(variable.units, quantity(_KINDS[variable.units])(parts["limit"]))
            return cls(text, kind, name, standoff, above=parts["relation"] == ">", limit=limit)
        return cls(text, kind, name, standoff)

    @property
    def is_binary(self) -> bool:
        """Whether the values of single shots are 0 or 1."""
        return self.kind in ("probability", "share")

    @property
    def units(self) -> str:
        """Those of the Dataset; "1" for a probability."""
        return "1" if self.is_binary else _VARIABLES[self.variable].units

    def in_units(self, value: object) -> float:
        """SI value of what a person wrote for a difference of this measure."""
        return quantity(_KINDS[self.units])(value)

    def shown(self, value: float) -> float:
        """An SI value in the units of the Dataset."""
        return _shown(self.units, value)

    def values(self, dataset: xarray.Dataset) -> Array:
        """What every shot says, NaN where it does not count; shape [hits]."""
        if self.kind == "share":
            return np.where(failed(dataset), np.nan, dataset["status"].values == STATUSES[self.variable])
        column = dataset[self.variable]
        if self.standoff is not None:
            column = column.sel(standoff=self.standoff, method="nearest")
        values = np.where(passed(dataset), column.values, np.nan)
        if self.kind != "probability":
            return values
        beyond = values > self.limit if self.above else values < self.limit
        return np.where(np.isnan(values), np.nan, beyond)


def _shown(units: str, value: float) -> float:
    return math.degrees(value) if units == "degree" else value


class Stop(Model):
    """When a campaign is good enough: the half width of a confidence interval.

    Attributes:
        quantity: see `Measure.parse`.
        half_width: at most this, SI.
        confidence: of the interval.
        max_count: shots after which it ends anyhow.
    """

    quantity: str
    half_width: float
    confidence: Annotated[Number, Field(gt=0, lt=1)] = 0.95
    max_count: Annotated[int, Field(strict=True, ge=1, le=2**30)]

    @field_validator("quantity")
    @classmethod
    def _is_a_measure(cls, text: str) -> str:
        Measure.parse(text)
        return text

    @field_validator("half_width", mode="before")
    @classmethod
    def _in_si(cls, value: object, info: ValidationInfo) -> float:
        if "quantity" not in info.data:
            raise ValueError(f"got {quoted(value)}, which means nothing without a quantity")
        number = Measure.parse(info.data["quantity"]).in_units(value)
        if number <= 0.0:
            raise ValueError(f"got {quoted(value)}, but it must be greater than 0")
        return number

    @property
    def measure(self) -> Measure:
        """The quantity."""
        return Measure.parse(self.quantity)


@dataclass(frozen=True)
class Estimate:
    """A measure's value and its interval, in the units of the Dataset; NaN where there is none.

    Attributes:
        count: shots that it counts.
        spread: standard deviation over these shots.
    """

    value: float
    low: float
    high: float
    count: int
    spread: float

    @property
    def half_width(self) -> float:
        """Half of the interval's length."""
        return 0.5 * (self.high - self.low)


class Tally:
    """Gathers a measure over shots, in the order of their numbers.

    Means and probabilities take a few numbers whatever the count; a quantile keeps one number per shot.

    Args:
        replicates: independent scramblings that the shots are dealt out to in turn; 1 if they are independent.
        images: how many shots in a row are images of each other, which tell as much as one of them.
    """

    def __init__(self, measure: Measure, *, replicates: int = 1, images: int = 1, confidence: float = 0.95) -> None:
        self.measure, self.confidence, self._images = measure, confidence, images
        self._replicates = [_Sample(keeps=measure.kind == "quantile") for _ in range(replicates)]
        self._shots = 0

    def add(self, dataset: xarray.Dataset) -> None:
        """Take in the shots that follow."""
        values, replicates = self.measure.values(dataset), len(self._replicates)
        dealt_to = (self._shots + np.arange(len(values))) // self._images % replicates
        for replicate, sample in enumerate(self._replicates):
            mine = values[dealt_to == replicate]
            sample.add(mine[~np.isnan(mine)])
        self._shots += len(values)

    def estimate(self) -> Estimate:
        """What the shots so far say."""
        pooled = _Sample.pooled(self._replicates)
        if pooled.count == 0:
            return Estimate(math.nan, math.nan, math.nan, 0, math.nan)
        value = pooled.quantile(self.measure.share) if self.measure.kind == "quantile" else pooled.mean
        interval = self._of_replicates(pooled, value) or self._independent(pooled)
        return Estimate(value, *interval, pooled.count, pooled.deviation)

    def _of_replicates(self, pooled: _Sample, value: float) -> tuple[float, float] | None:
        """Interval from the spread of the replicates, None where there is none to tell from.

        That of a quantile is Woodruff's: the replicates say how certain the share below it is (R. S. Woodruff, Journal
        of the American Statistical Association 47 (1952) 635). Their own quantiles would be biased.
        """
        replicates = [sample for sample in self._replicates if sample.count]
        if len(replicates) < 2:
            return None
        quantile = self.measure.kind == "quantile"
        answers = [float((one.values <= value).mean()) if quantile else one.mean for one in replicates]
        half = _student(self.confidence, len(answers)) * float(np.std(answers, ddof=1))
        # Replicates that all say the same of something that happens or not (never, mostly) tell nothing.
        if half == 0.0 and (quantile or self.measure.is_binary):
            return None
        if not quantile:
            return value - half, value + half
        ends = (self.measure.share - half, self.measure.share + half)
        low, high = (pooled.quantile(end) if 0.0 < end < 1.0 else math.nan for end in ends)
        return low, high

    def _independent(self, sample: _Sample) -> tuple[float, float]:
        """Interval as of independent shots; images of each other count as one."""
        from scipy import stats  # a second to import

        count = math.ceil(sample.count / self._images)
        if self.measure.kind == "quantile":
            tail = 0.5 * (1.0 - self.confidence)
            ends = stats.binom.ppf([tail, 1.0 - tail], count, self.measure.share).astype(int)
            ordered = np.sort(sample.values)[:: self._images]
            low, high = ends[0] - 1, ends[1]
            return (
                float(ordered[low]) if low >= 0 else math.nan,
                float(ordered[high]) if high < count else math.nan,
            )
        if self.measure.is_binary:
            successes = round(sample.mean * count)
            interval = stats.binomtest(successes, count).proportion_ci(self.confidence, method="wilson")
            return float(interval.low), float(interval.high)
        if count < 2:
            return math.nan, math.nan
        unbiased = sample.deviation * math.sqrt(count / (count - 1))
        half = _student(self.confidence, count) * unbiased
        return sample.mean - half, sample.mean + half


def _student(confidence: float, count: int) -> float:
    """Half width of the interval of a mean of `count` numbers, in their standard deviations."""
    from scipy import stats

    return float(stats.t.isf(0.5 * (1.0 - confidence), count - 1)) / math.sqrt(count)


class _Sample:
    """Count, mean and sum of squared deviations of numbers, and if it keeps them the numbers themselves."""

    def __init__(self, *, keeps: bool) -> None:
        self.count, self.mean, self._squares = 0, 0.0, 0.0
        self._kept: list[Array] | None = [] if keeps else None

    @classmethod
    def pooled(cls, samples: Sequence[_Sample]) -> _Sample:
        """All numbers of some samples."""
        if len(samples) == 1:
            return samples[0]
        whole = cls(keeps=samples[0]._kept is not None)
        for sample in samples:
            whole._merge(sample.count, sample.mean, sample._squares)
            if whole._kept is not None:
                whole._kept.append(sample.values)
        return whole

    def add(self, values: Array) -> None:
        """Take in numbers; none is NaN."""
        if len(values):
            mean = float(values.mean())
            self._merge(len(values), mean, float(np.square(values - mean).sum()))
            if self._kept is not None:
                self._kept.append(values)

    def _merge(self, count: int, mean: float, squares: float) -> None:
        """T. F. Chan, G. H. Golub, R. J. LeVeque, The American Statistician 37 (1983) 242."""
        if count:
            total, apart = self.count + count, mean - self.mean
            self._squares += squares + apart * apart * self.count * count / total
            self.mean += apart * count / total
            self.count = total

    @property
    def deviation(self) -> float:
        """Standard deviation of the numbers themselves (ddof = 0)."""
        return math.sqrt(self._squares / self.count) if self.count else math.nan

    @property
    def values(self) -> Array:
        """The numbers, if it keeps them."""
        return np.concatenate(self._kept) if self._kept else np.empty(0)

    def quantile(self, share: float) -> float:
        """Value below which this share of the numbers lies."""
        return float(np.quantile(self.values, share, method="hazen"))


def looks(sampling: str, shards: int) -> Iterator[int]:
    """Numbers of shards after which a stop rule looks at its interval: few, as every look is a chance to stop on a
    spread that is small by accident. Sobol points are balanced at powers of two."""
    at = 1
    while at < shards:
        yield at
        at = 2 * at if sampling == "sobol" else max(at + 1, math.ceil(1.25 * at))
    yield shards
