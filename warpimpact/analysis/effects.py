"""What every shot says of how well a plate protects: one number per shot of each effect of vocabulary.py."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter, ValidationError

from warpimpact.analysis import base
from warpimpact.analysis.summary import slices
from warpimpact.analysis.vocabulary import EFFECTS, Meaning, angle_text, layer_text, length_text
from warpimpact.campaign.problems import complaint
from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.results.dataset import failed, passed
from warpimpact.results.files import ResultError
from warpimpact.results.measures import place_of_standoff
from warpimpact.scene import AnyCore, Core
from warpimpact.scene.units import Length, Obliquity

if TYPE_CHECKING:
    import xarray

    from warpimpact.results.table import Result

Array = NDArray[np.float64]

_THICKNESS, _VELOCITY = (v.LIMITS[quantity].value for quantity in ("thickness", "velocity"))
_OF_A_HIT = (v.IMPACT_VELOCITY, v.RESIDUAL_VELOCITY, v.TILT, v.MASS, v.BROKEN)
EFFECT_VARIABLES = (*_OF_A_HIT, _THICKNESS, _VELOCITY, *base.NEEDED)
"""All that effects are made of, beside coordinates and attributes."""


@dataclass(frozen=True, kw_only=True)
class Effect(Meaning):
    """An effect of a result.

    Attributes:
        values: of a hit map with the variables of EFFECT_VARIABLES, NaN where a shot does not count.
        margin: of a share: numbers that are positive where the value is 1, NaN where a shot does not count; None where
            there are none.
    """

    values: Callable[[Result], Array]
    margin: Callable[[Result], Array] | None = None

    @classmethod
    def of(
        cls,
        name: str,
        values: Callable[[Result], Array],
        *,
        margin: Callable[[Result], Array] | None = None,
        **words: str,
    ) -> Self:
        """An effect with its meaning, and these words in its label and definition."""
        meaning = EFFECTS[name]
        told = replace(meaning, label=meaning.label.format(**words), definition=meaning.definition.format(**words))
        return cls(**vars(told), values=values, margin=margin)

    def judged(self, dataset: Result) -> Array:
        """The margins of all shots where there are such, else their values; shape [hits]."""
        return (self.margin or self.values)(dataset)

    def over(self, dataset: xarray.Dataset) -> Array:
        """Values of all shots, shape [hits]; of an open file a slice is in memory at a time."""
        needed = [name for name in EFFECT_VARIABLES if name in dataset]
        return np.concatenate([self.values(part) for part in slices(dataset[needed].drop_vars(v.HIT, errors="ignore"))])


def effects(dataset: Result, *, angle: float | str, standoff: float | str | None) -> Iterator[Effect]:
    """All there are for a result: of the base first, if there is one; of a search of limits, those alone.

    Args:
        angle: inclination beyond which a core counts as tilted: degrees, a string with its unit, or `Radians`.
        standoff: distance behind the rear face [m], or a string; the largest of the result if None.

    Raises:
        ResultError: the angle is none, or the result has no such stand-off.
    """
    if _THICKNESS in dataset:
        yield from _of_limits(dataset)
        return
    if _VELOCITY in dataset:
        yield _of_limit_velocity(dataset)
        return
    if base.has_base(dataset):
        yield from _of_base()
    yield Effect.of("residual_energy_fraction", _energy_fraction)
    if standoff is not None or dataset.sizes["standoff"]:
        degrees = math.degrees(_read("angle", Obliquity, angle))
        yield from _at_a_standoff(dataset, degrees, _at_standoff(dataset, standoff))
    yield Effect.of("stopped_share", lambda part: np.where(failed(part), np.nan, ~passed(part)))
    if v.BROKEN not in dataset:
        return
    yield Effect.of("broken_share", _is_broken)
    yield Effect.of("stopped_or_broken_share", lambda part: _of_passed(part, _is_broken(part), 1.0))


def _at_a_standoff(dataset: Result, degrees: float, standoff: float) -> Iterator[Effect]:
    """Of where and how the core is at a stand-off [m]; it is tilted beyond so many degrees."""
    at = length_text(standoff)
    if attr.CORE in dataset.attrs:
        core = TypeAdapter[Core](AnyCore).validate_json(dataset.attrs[attr.CORE])
        yield Effect.of("residual_energy_density", _energy_density(core, standoff), standoff=at)
    words = {"angle": angle_text(degrees), "standoff": at}
    yield Effect.of("tilted_share", _is_tilted(degrees, standoff), margin=_beyond(degrees, standoff), **words)


def _of_base() -> Iterator[Effect]:
    """Of the base behind the other layers."""
    yield Effect.of("base_perforated_share", lambda part: np.where(failed(part), np.nan, passed(part)))
    yield Effect.of("base_pierced_share", base.is_pierced)
    yield Effect.of("base_depth", lambda part: 1e3 * base.base_depth(part))


def _of_limits(dataset: Result) -> Iterator[Effect]:
    """Of the thickness that a layer needs to stop every core."""
    told = dataset.attrs
    whose, highest = layer_text(int(told[attr.LIMIT_LAYER])), length_text(float(told[attr.LIMIT_HIGHEST]))

    def of_layer(part: Result) -> Array:
        is_this = all(part.attrs.get(name) == told.get(name) for name in (attr.LIMIT_LAYER, attr.LIMIT_ELSEWHERE))
        values = 1e3 * _limits(part, _THICKNESS)
        return values if is_this else np.full_like(values, np.nan)  # a solid plate for the whole has no such layer

    yield Effect.of("limit_thickness", of_layer, layer=whose, highest=highest)
    if attr.LIMIT_ELSEWHERE not in told:
        return
    yield Effect.of("limit_areal_density", _needed_density, layer=whose)


def _of_limit_velocity(dataset: Result) -> Effect:
    highest = f"{float(dataset.attrs[attr.LIMIT_HIGHEST]):g} m/s"
    return Effect.of("limit_velocity", lambda part: _limits(part, _VELOCITY), highest=highest)


def _limits(part: Result, name: str) -> Array:
    """Limits of a result, at most the largest value tried; NaN where the computation failed."""
    return np.where(failed(part), np.nan, np.minimum(part[name].values, float(part.attrs[attr.LIMIT_HIGHEST])))


def _needed_density(part: Result) -> Array:
    elsewhere, density = float(part.attrs[attr.LIMIT_ELSEWHERE]), float(part.attrs[attr.LIMIT_DENSITY])
    return np.asarray(elsewhere + density * _limits(part, _THICKNESS))


def _is_broken(part: Result) -> Array:
    """1 for a broken core, NaN where that was not computed: of a failed shot, and of the solid reference."""
    if v.BROKEN not in part:
        return np.full(part.sizes["hit"], np.nan)
    return np.asarray(part[v.BROKEN].values, dtype=np.float64)


def _read(name: str, kind: Any, value: float | str) -> float:
    try:
        return float(TypeAdapter(kind).validate_python(value))
    except ValidationError as error:
        raise ResultError(f"{name}: {complaint(error.errors()[0])}") from None


def _at_standoff(dataset: Result, standoff: float | str | None) -> float:
    """The stand-off of a result that is meant [m]."""
    distances = dataset[v.STANDOFF].values
    if standoff is None:
        return float(distances[-1])
    try:
        return float(distances[place_of_standoff(distances, _read("standoff", Length, standoff))])
    except ValueError as error:
        raise ResultError(f"standoff: {error}") from None


def _of_passed(part: Result, values: Array, otherwise: float) -> Array:
    """Values of the cores that passed the plate, something else of those that did not, NaN of failed computations."""
    return np.where(failed(part), np.nan, np.where(passed(part), values, otherwise))


def _energy_fraction(part: Result) -> Array:
    fraction = (part[v.RESIDUAL_VELOCITY].values.astype(float) / part[v.IMPACT_VELOCITY].values) ** 2
    return _of_passed(part, fraction, 0.0)


def _inclination(part: Result, standoff: float) -> Array:
    """Between axis and line of fire, nose or base first alike [degree], shape [hits]."""
    tilt = part[v.TILT].values[:, place_of_standoff(part[v.STANDOFF].values, standoff)].astype(float)
    return np.asarray(np.minimum(tilt, 180.0 - tilt))


def _energy_density(core: Core, standoff: float) -> Callable[[Result], Array]:
    """Of a core, whose silhouette is tabulated: a quarter of a degree errs by 1e-5."""
    table = np.linspace(0.0, 90.0, 361)
    silhouette = core.presented_area(np.radians(table)) * 1e6

    def values(part: Result) -> Array:
        mass = part[v.MASS].values if v.MASS in part else core.mass_properties.mass
        energy = 0.5 * mass * part[v.RESIDUAL_VELOCITY].values.astype(float) ** 2
        return _of_passed(part, energy / np.interp(_inclination(part, standoff), table, silhouette), 0.0)

    return values


def _is_tilted(degrees: float, standoff: float) -> Callable[[Result], Array]:
    beyond = _beyond(degrees, standoff)

    def values(part: Result) -> Array:
        margin = beyond(part)
        return np.where(np.isnan(margin), np.nan, margin > 0.0)

    return values


def _beyond(degrees: float, standoff: float) -> Callable[[Result], Array]:
    """How much a core is inclined beyond so many degrees; infinite of one that does not get there."""
    return lambda part: _of_passed(part, _inclination(part, standoff) - degrees, math.inf)
