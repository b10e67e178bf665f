"""Measures: the one language in which a number of a result is asked for.

    mean(q)   worst_tenth(q)   worst_point(q)   quantile(q, 0.05)   P(q > 30 deg)   P(event)   areal_density

q is a quantity of vocabulary.py, with its stand-off behind @ if it has one, as in `mean(tilt@130mm)`; the default is
the largest stand-off. A search for designs may ask for the limit thickness of a layer with `@layer 1`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from difflib import get_close_matches
from typing import Any, Self, Unpack

import numpy as np
import xarray

from warpimpact.kernels.status import OF_SHOTS
from warpimpact.measures.hits import is_choice
from warpimpact.measures.vocabulary import (
    EVENTS,
    LIMIT_THICKNESS,
    LIMIT_VELOCITY,
    OTHER_LAYERS,
    QUANTITIES,
    WEIGHTS,
    Array,
    HitValue,
    place_of_standoff,
)
from warpimpact.records import attributes as attr
from warpimpact.records import variables as v
from warpimpact.scene import units
from warpimpact.scene.units import STORED, Unit, quantity, quoted
from warpimpact.statistics.comparisons import shift_of_event, shift_of_mean, shift_of_quantile, shift_of_share
from warpimpact.statistics.intervals import (
    WORST,
    Estimate,
    SamplingDesign,
    estimate_of,
    has_interval,
    worst_tenth,
)

_KINDS: dict[str, Any] = {
    quantity(kind).display.stored: kind
    for kind in (
        *(units.Speed, units.Angle, units.Energy, units.EnergyDensity, units.Time, units.Moment, units.Stress),
        *(units.Length, units.ArealDensity, units.Number),
    )
}
"""Types of the quantities with these units in the Dataset."""

STATUSES = {status.name.lower(): status for status in OF_SHOTS if not status.failed}
NAMES = {"V50": "quantile(limit_velocity, 0.5)", "V05": "quantile(limit_velocity, 0.05)"}
NAMES |= {"H50": "quantile(limit_thickness, 0.5)", "H05": "quantile(limit_thickness, 0.05)"}
"""Measures by names of their own."""

_FORM = re.compile(
    r"(?P<statistic>\w+)\(\s*(?P<name>\w+)\s*(?:@\s*(?P<place>[^<>,]+?)\s*)?"
    r"(?:,\s*(?P<share>[^<>]+?)\s*|(?P<relation>[<>])\s*(?P<limit>.+?)\s*)?\)"
)
_LAYER = re.compile(r"layer\s*(\d+)")
_STATISTICS = {
    "mean": (", mean", " Mean over the hits."),
    "worst_tenth": (
        ", worst tenth",
        " Mean over the worst tenth of the hits (R. T. Rockafellar, S. Uryasev, Journal of Risk 2 (2000) 21).",
    ),
    "worst_point": (", worst point", " The worst of the hits, an observed extreme."),
    "quantile": (", {share:g} % quantile", " The value below which this share of the hits lies."),
    "probability": ("", " The share of the hits beyond the limit."),
}
"""Statistics of a quantity, with what each adds to its label and its definition."""


@dataclass(frozen=True)
class Measure:
    """One number of a result.

    Attributes:
        text: the measure in the language of this file.
        kind: "mean", "worst_tenth", "worst_point", "quantile", "probability" (of a quantity beyond a limit), "share"
            (of the shots to which an event happens) or "target" (of a number of the target itself).
        name: name of the quantity or the event.
        standoff: distance behind the rear face [m]; None for the largest, or where there is none.
        layer: layer of the limit thickness; None for the layer whose limits were searched.
        share: share of the values below a quantile.
        above, limit: side and limit of a probability, in the units of the Dataset.
    """

    text: str
    kind: str
    name: str
    standoff: float | None = None
    layer: int | None = None
    share: float = 0.5
    above: bool = True
    limit: float = 0.0

    @classmethod
    def parse(cls, text: str) -> Self:
        """Read a measure.

        Raises:
            ValueError: the message says what was found, what is allowed and, where it is clear, what was meant.
        """
        text = text.strip()
        if text in WEIGHTS:
            return cls(text, "target", text)
        match = _FORM.fullmatch(NAMES.get(text, text))
        if match is None or match["statistic"] not in ("mean", "worst_tenth", "worst_point", "quantile", "P"):
            raise ValueError(
                f"got {quoted(text)}, but it must be of the form mean(residual_velocity), worst_tenth(base_depth), "
                "worst_point(base_depth), quantile(residual_velocity, 0.05), P(tilt@130mm > 30 deg) or P(perforated), "
                f"or be one of {', '.join((*WEIGHTS, *NAMES))}{_meant(text)}"
            )
        statistic, name, place, share, relation, limit = match.groups()
        if statistic == "P" and relation is None:
            if place or share:
                raise ValueError(f"got {quoted(text)}, but the event {name} has neither a place nor a share")
            return cls(text, "share", _known(name, EVENTS))
        kind = "probability" if statistic == "P" else statistic
        if (kind == "probability") != (limit is not None) or (kind == "quantile") != (share is not None):
            needed = {"P": "a limit, as in P(tilt@130mm > 30 deg)", "quantile": "a share, as in quantile(…, 0.05)"}
            raise ValueError(
                f"got {quoted(text)}, but {statistic}(…) takes {needed.get(statistic, 'a quantity alone')}"
            )
        per_hit = QUANTITIES[_known(name, QUANTITIES)]
        measure = cls(text, kind, name, **_place(place, per_hit))
        if kind.startswith("worst") and per_hit.higher_is_better is None:
            raise ValueError(
                f"got {quoted(text)}, but neither a high nor a low {name} is worse; quantile({name}, 0.95) has an end"
            )
        if kind == "quantile":
            number = quantity(units.Number)(share)
            if not 0.0 < number < 1.0:
                raise ValueError(f"got the quantile {number:g}, but it must lie between 0 and 1")
            return replace(measure, share=number)
        if kind == "probability":
            number = _stored(quantity(_KINDS[per_hit.units])(limit), per_hit.units)
            return replace(measure, above=relation == ">", limit=number)
        return measure

    @property
    def quantity(self) -> HitValue:
        """The quantity or the event."""
        if self.kind == "target":
            return WEIGHTS[self.name]
        return (EVENTS if self.kind == "share" else QUANTITIES)[self.name]

    @property
    def label(self) -> str:
        """The measure in words, without its unit."""
        layer = "the layer" if self.layer is None else f"layer {self.layer}" if self.layer else "the plate"
        label = self.quantity.label.format(layer=layer)
        if self.quantity.has_standoff:
            label += " at the last stand-off" if self.standoff is None else f" at {self.standoff * 1e3:g} mm"
        if self.kind == "share":
            return f"P({label})"
        if self.kind == "probability":
            unit = STORED[self.quantity.units]
            either = self.quantity.or_else if self.above else ""
            return f"P({label} {'>' if self.above else '<'} {unit.text(self.limit)}{either})"
        return label + _STATISTICS.get(self.kind, ("", ""))[0].format(share=100.0 * self.share)

    @property
    def title(self) -> str:
        """The label with the unit."""
        return f"{self.label} [{self.display.shown}]" if self.display.shown else self.label

    @property
    def definition(self) -> str:
        return self.quantity.definition + _STATISTICS.get(self.kind, ("", ""))[1]

    @property
    def higher_is_better(self) -> bool | None:
        """Whether a higher value is better for whoever is behind the target; None where neither direction is better."""
        better = self.quantity.higher_is_better
        return not better if self.kind == "probability" and not self.above and better is not None else better

    @property
    def better(self) -> str:
        """Words for the better direction."""
        return {True: "higher is better", False: "lower is better", None: "neither is better"}[self.higher_is_better]

    @property
    def bounds(self) -> tuple[float, float]:
        """Least and largest possible value."""
        return (0.0, 1.0) if self.is_binary else (self.quantity.least, self.quantity.most)

    @property
    def shown_bounds(self) -> tuple[float, float]:
        """Least and largest possible value in the display unit."""
        least, most = self.bounds
        return self.display.factor * least, self.display.factor * most

    @property
    def is_binary(self) -> bool:
        """Whether the values of single shots are 0 or 1."""
        return self.kind in ("probability", "share")

    @property
    def has_interval(self) -> bool:
        """Whether the hits give an interval."""
        return self.kind not in ("worst_point", "target")

    @property
    def is_limit(self) -> bool:
        """Whether the measure needs a search of limits."""
        return self.quantity.need in (LIMIT_VELOCITY, LIMIT_THICKNESS, OTHER_LAYERS)

    @property
    def column(self) -> Measure:
        """The mean of the numbers behind the measure. It is the same for all statistics of a quantity."""
        return self if self.is_binary else replace(self, text=self.name, kind="by_hit", share=0.5)

    @property
    def display(self) -> Unit:
        """The unit in the Dataset, that in which its values are shown, and their format."""
        return STORED["1" if self.is_binary else self.quantity.units]

    @property
    def worse(self) -> float:
        """Factor that makes larger values worse."""
        return -1.0 if self.quantity.higher_is_better else 1.0

    def in_units(self, value: object) -> float:
        """SI value of a difference of this measure that a user wrote."""
        return quantity(_KINDS[self.display.stored])(value)

    def shown(self, value: float) -> float:
        """An SI value in the units of the Dataset."""
        return _stored(value, self.display.stored)

    def of(self, dataset: xarray.Dataset) -> Self:
        """The measure with its place in a result: by default the largest stand-off.

        Raises:
            ValueError: the result lacks what the measure needs.
        """
        if lacking := self.quantity.lacking(dataset):
            raise ValueError(f"got {quoted(self.text)}, which needs {lacking}, but the result has none")
        layer = int(dataset.attrs.get(attr.LIMIT_LAYER, 0))
        if self.layer not in (None, layer):
            raise ValueError(f"got {quoted(self.text)}, but limits of layer {layer} were sought")
        if self.quantity.has_standoff and self.standoff is None:
            last = float(dataset[v.STANDOFF].values[-1])
            text = re.sub(rf"\b{self.name}\b", f"{self.name}@{last * 1e3:.12g}mm", self.text, count=1)
            return replace(self, text=text, standoff=last)
        if self.standoff is not None:
            place_of_standoff(dataset[v.STANDOFF].values, self.standoff)
        if self.quantity.has_layer and self.layer is None:
            return replace(self, layer=layer)
        return self

    def by_hit(self, dataset: xarray.Dataset) -> Array:
        """The quantity or event of every shot, shape [hits]; NaN for a shot that does not count.

        Raises:
            ValueError: the result does not have the stand-off.
        """
        standoff = self.standoff
        if standoff is None:
            standoff = float(dataset[v.STANDOFF].values[-1]) if self.quantity.has_standoff else math.nan
        return self.quantity.values(dataset, standoff)

    def values(self, dataset: xarray.Dataset) -> Array:
        """The values of all shots of which the measure is made, shape [hits]."""
        return self.counted(self.by_hit(dataset))

    def counted(self, by_hit: Array) -> Array:
        """The values of the measure from the quantity of every shot: 1 or 0 for a probability, finite numbers for a
        mean."""
        if self.kind == "probability":
            return np.where(np.isnan(by_hit), np.nan, self.margin(by_hit) > 0.0)
        return np.where(np.isinf(by_hit), np.nan, by_hit) if self.kind == "mean" else by_hit

    def margin(self, by_hit: Array) -> Array:
        """Distance of every shot's quantity from the limit of the probability, positive on the side that counts."""
        return by_hit - self.limit if self.above else self.limit - by_hit

    def averaged(self, values: Array) -> Array:
        """Numbers of the shots whose mean is the measure, from their values. A quantile and a worst point have none."""
        if self.kind != "worst_tenth":
            return values
        numbers = self.worse * worst_tenth(self.worse * values)
        return np.where(np.isinf(numbers), np.nan, numbers)


def _stored(value: float, units: str) -> float:
    return math.degrees(value) if units == "degree" else value


def _known(name: str, allowed: Mapping[str, HitValue]) -> str:
    if name in allowed:
        return name
    other = EVENTS if allowed is QUANTITIES else QUANTITIES
    if name in other:
        form = f"P({name})" if other is EVENTS else f"mean({name}) or P({name} > …)"
        raise ValueError(f'got "{name}", which takes the form {form}')
    known = ", ".join(allowed)
    raise ValueError(f'got "{name}", but it must be one of {known}{_meant(name)}')


def _meant(text: str) -> str:
    """What was probably meant, as the end of a sentence; empty where nothing is close."""
    match = get_close_matches(text, (*NAMES, *WEIGHTS, *QUANTITIES, *EVENTS), n=1, cutoff=0.75)
    if not match:
        return ""
    form = f"P({match[0]})" if match[0] in EVENTS else f"mean({match[0]})" if match[0] in QUANTITIES else match[0]
    return f"; did you mean {form}?"


def _place(text: str | None, number: HitValue) -> dict[str, Any]:
    """Stand-off or layer behind an @."""
    if text is None:
        return {}
    layer = _LAYER.fullmatch(text)
    if layer and number.has_layer:
        return {"layer": int(layer[1])}
    if not number.has_standoff:
        raise ValueError(f'got "{number.name}@{text}", but {number.name} has no stand-off')
    return {"standoff": quantity(units.Length)(text)}


def estimate_from(measure: Measure, values: Array, **design: Unpack[SamplingDesign]) -> Estimate:
    """A measure with its interval, from the values of all shots. A worst point and a number of the target have none."""
    known = values[~np.isnan(values)]
    if not measure.has_interval or not len(known):
        worst = measure.worse * float(np.max(measure.worse * known)) if len(known) else math.nan
        return Estimate(worst, count=len(known))
    kind = "share" if measure.is_binary else "quantile" if measure.kind == "quantile" else "mean"
    bounds = measure.bounds
    if measure.kind == "worst_tenth":  # each of its numbers counts 1 / WORST times
        bounds = tuple(known[0] + (end - known[0]) / WORST for end in bounds)
    estimate = estimate_of(kind, measure.averaged(values), share=measure.share, bounds=bounds, **design)
    if measure.kind == "worst_tenth" and not has_interval(estimate.count):
        estimate = replace(estimate, low=math.nan, high=math.nan)
    return estimate.within(*measure.bounds)


def shift_of(measure: Measure, levels: tuple[xarray.Dataset, xarray.Dataset] | None, confidence: float = 0.95) -> float:
    """Upper estimate of the shift of a measure by the numerics, from hits at two levels (`finer_pair`); NaN without
    them."""
    if levels is None or not measure.has_interval:
        return math.nan
    coarse, fine = (measure.by_hit(level) for level in levels)
    match measure.kind:
        case "quantile":
            return shift_of_quantile(coarse, fine, measure.share, confidence)
        case "probability":
            return shift_of_share(measure.margin(coarse), measure.margin(fine), confidence)
        case "share":
            margin, smooth = measure.quantity.margin, measure.quantity.smooth
            if margin is not None:
                return shift_of_share(margin(levels[0]), margin(levels[1]), confidence)
            if smooth is not None:
                return shift_of_mean(smooth(levels[0]), smooth(levels[1]), confidence)
            return shift_of_event(coarse, fine, confidence)
    coarse, fine = (measure.averaged(measure.counted(numbers)) for numbers in (coarse, fine))
    return shift_of_mean(coarse, fine, confidence)


def sampling_design(dataset: xarray.Dataset, confidence: float = 0.95) -> SamplingDesign:
    """The replicates of a result, and a confidence. Chosen hits are no longer in the order of the replicates."""
    replicates = 1 if is_choice(dataset) else int(dataset.attrs.get(attr.REPLICATES, 1))
    return {"replicates": replicates, "confidence": confidence}
