"""Numbers of single hits: what describes a quantity or an event of vocabulary.py, and functions that compute them."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter

from warpimpact.kernels.status import Status
from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.results.dataset import failed, passed
from warpimpact.scene import AnyCore, Core

if TYPE_CHECKING:
    from warpimpact.results.table import Result

Array = NDArray[np.float64]
Values = Callable[["Result", float], Array]
"""Computes the numbers of all hits of a result, shape [hits], at a stand-off [m] where they have one; NaN where a hit
does not count."""

_THICKNESS = v.LIMITS["thickness"].value
DEPTH_VARIABLES = (v.STATUS, v.STOPPED_IN, v.DEPTH, v.LAYER_THICKNESS, *v.LAYER_FACES)
"""Variables from which the depth in the base follows."""


class Need(NamedTuple):
    """A requirement on a result beyond the columns of every result.

    Attributes:
        name: a variable or an attribute that must be present.
        words: the requirement in words.
        keys: keys of a campaign that produce it.
    """

    name: str
    words: str
    keys: str


@dataclass(frozen=True, kw_only=True)
class PerHit:
    """A quantity or an event.

    Attributes:
        name: name in a measure.
        label: label, with {layer} where it names the layer.
        units: units of the stored numbers; "1" for an event.
        definition: one sentence or two.
        source: source of the definition.
        higher_is_better: for whoever is behind the target; None where neither direction is better.
        values: computes the numbers of the hits. An infinite number is beyond every limit of a probability; a mean
            leaves it out.
        of: variables from which the numbers follow.
        has_standoff: whether they depend on the distance behind the rear face.
        has_layer: whether they depend on the layer whose limit thickness is searched.
        need: requirement on the result; None where every result has it.
        or_else: what makes a number infinite, as text behind a probability.
        least, most: bounds of the numbers.
        margin: for an event, computes a number of every hit that is positive where the event happens, negative where it
            does not, and continuous at 0; None without one.
    """

    name: str
    label: str
    units: str = "1"
    definition: str
    source: str = "docs/glossary.md"
    higher_is_better: bool | None
    values: Values
    of: tuple[v.Variable, ...] = ()
    has_standoff: bool = False
    has_layer: bool = False
    need: Need | None = None
    or_else: str = ""
    least: float = 0.0
    most: float = math.inf
    margin: Callable[[Result], Array] | None = None

    def lacking(self, dataset: Result) -> str:
        """Words for what a result lacks; empty where it lacks nothing."""
        if self.need is not None and self.need.name not in dataset and self.need.name not in dataset.attrs:
            return self.need.words
        if self.has_standoff and not len(dataset[v.STANDOFF].values):
            return "stand-offs (output.standoffs)"
        return ""


def place_of_standoff(distances: Sequence[float] | Array, standoff: float) -> int:
    """Index of a stand-off [m] among the distances of a result.

    Raises:
        ValueError: it is none of them.
    """
    places = np.flatnonzero(np.isclose(distances, standoff, rtol=1e-9, atol=0.0))
    if not len(places):
        known = ", ".join(f"{distance * 1e3:g} mm" for distance in distances) or "not given"
        raise ValueError(f"got {standoff * 1e3:g} mm, but the stand-offs are {known}")
    return int(places[0])


def at(part: Result, variable: v.Variable, standoff: float) -> Array:
    """A variable with one number per hit, at a stand-off if it has stand-offs; NaN where it was not recorded, as at the
    solid plate."""
    if variable not in part:
        return np.full(part.sizes["hit"], np.nan)
    column = np.asarray(part[variable].values, dtype=np.float64)
    return column[:, place_of_standoff(part[v.STANDOFF].values, standoff)] if column.ndim == 2 else column


def of_all(part: Result, of_passed: Array, of_stopped: float) -> Array:
    """Numbers where cores passed the target, one number where they did not, NaN where the computation failed."""
    return np.where(failed(part), np.nan, np.where(passed(part), of_passed, of_stopped))


def is_so(which: Callable[[Result], NDArray[np.bool_]]) -> Values:
    """Values of an event: 1 where `which` holds, 0 elsewhere, NaN where the computation failed."""
    return lambda part, _: np.where(failed(part), np.nan, which(part))


def ended_as(status: Status) -> Values:
    """Values of an event: 1 where a shot ended with this status."""
    return is_so(lambda part: np.asarray(part[v.STATUS].values == status))


def energy_fraction(part: Result, _: float) -> Array:
    return of_all(part, (at(part, v.RESIDUAL_VELOCITY, 0.0) / part[v.IMPACT_VELOCITY].values) ** 2, 0.0)


def energy(part: Result) -> Array:
    """Kinetic energy of translation [J], whether the core passed or not."""
    mass = part[v.MASS].values if v.MASS in part else _core(part.attrs[attr.CORE]).mass_properties.mass
    return np.asarray(0.5 * mass * part[v.RESIDUAL_VELOCITY].values.astype(float) ** 2)


def inclination(part: Result, standoff: float) -> Array:
    tilt = at(part, v.TILT, standoff)
    return np.minimum(tilt, 180.0 - tilt)


def energy_density(part: Result, standoff: float) -> Array:
    silhouette = np.interp(inclination(part, standoff), *_silhouette(part.attrs[attr.CORE]))
    return of_all(part, energy(part) / silhouette, 0.0)


@lru_cache(maxsize=64)
def _core(text: str) -> Core:
    return TypeAdapter[Core](AnyCore).validate_json(text)


@lru_cache(maxsize=64)
def _silhouette(text: str) -> tuple[Array, Array]:
    """Inclinations of a core [degree] and its presented areas [m²]. Steps of a quarter of a degree err by 1e-5."""
    inclinations = np.linspace(0.0, 90.0, 361)
    return inclinations, _core(text).presented_area(np.radians(inclinations))


def limit(part: Result, name: str) -> Array:
    """Limits, at most the largest value tried; NaN where the computation failed."""
    return np.where(failed(part), np.nan, np.minimum(part[name].values, part.attrs.get(attr.LIMIT_HIGHEST, np.inf)))


def needed_density(part: Result, _: float) -> Array:
    elsewhere, density = float(part.attrs[attr.LIMIT_ELSEWHERE]), float(part.attrs[attr.LIMIT_DENSITY])
    return elsewhere + density * limit(part, _THICKNESS)


def has_base(dataset: Result) -> bool:
    """Whether there are layers behind the plate."""
    return v.STOPPED_IN in dataset


def base_thickness(dataset: Result) -> Array:
    """Thickness of the base [m]: one number, or shape [hits] where it scatters."""
    if v.LAYER_THICKNESS in dataset:
        return np.asarray(dataset[v.LAYER_THICKNESS].values[:, -1])
    return np.asarray(dataset[v.LAYER_REAR].values[-1] - dataset[v.LAYER_FRONT].values[-1])


def base_depth(dataset: Result) -> Array:
    """How deep every core goes into the base [m], shape [hits]; NaN where the computation failed.

    A core that stops before the base or bounces off it counts as 0. A core that pierces or passes the base counts as
    the thickness of the base, the least depth that it could reach in a thicker one. NaN where the result has no depth,
    as for a single plate.
    """
    if not has_base(dataset):
        return np.full(dataset.sizes["hit"], np.nan)
    rests = dataset[v.STOPPED_IN].values == dataset.sizes["layer"] - 1
    thickness = base_thickness(dataset)
    depth = np.where(rests, np.minimum(dataset[v.DEPTH].values, thickness), 0.0)
    return np.where(failed(dataset), np.nan, np.where(passed(dataset), thickness, depth))


def is_pierced(dataset: Result) -> Array:
    """1 where a core comes out of the rear face of the base, whether it rests in the base or passes it, else 0; shape
    [hits]. NaN as in `base_depth`."""
    margin = piercing_margin(dataset)
    return np.where(np.isnan(margin), np.nan, margin >= 0.0)


def piercing_margin(dataset: Result) -> Array:
    """Distance of every core's foremost point behind the rear face of the base [m], negative before it, shape [hits].
    Infinite for a core that passes the base, minus infinity for one that rests before it; NaN as in `base_depth`."""
    if not has_base(dataset):
        return np.full(dataset.sizes["hit"], np.nan)
    rests = dataset[v.STOPPED_IN].values == dataset.sizes["layer"] - 1
    beyond = np.where(rests, dataset[v.DEPTH].values - base_thickness(dataset), -np.inf)
    return np.where(failed(dataset), np.nan, np.where(passed(dataset), np.inf, beyond))
