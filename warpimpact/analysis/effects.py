"""What every shot says of how well a plate protects: defined, cited, one number per shot."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter, ValidationError

from warpimpact.analysis import base
from warpimpact.analysis.summary import slices
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


@dataclass(frozen=True)
class Effect:
    """What is measured of each shot.

    Attributes:
        name: for programs.
        label: for people.
        units: "1", "mm", "J mm-2", "kg m-2" or "m s-1".
        definition: one sentence.
        source: where it comes from.
        higher_is_better: for whoever is behind the plate.
        kind: "mean" of any numbers, or "share" of numbers 0 and 1.
        values: of a hit map with the variables of EFFECT_VARIABLES, NaN where a shot does not count.
        margin: of a share: numbers that are positive where the value is 1, NaN where a shot does not count; None where
            there are none.
    """

    name: str
    label: str
    units: str
    definition: str
    source: str
    higher_is_better: bool
    kind: str
    values: Callable[[Result], Array]
    margin: Callable[[Result], Array] | None = None

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
    yield Effect(
        name="residual_energy_fraction",
        label="residual energy fraction",
        units="1",
        definition="Kinetic energy of translation behind the plate as a fraction of that on impact, (v_r/v_0)²; 0 for "
        "a core that was arrested or ricocheted.",
        source="R. F. Recht, T. W. Ipson, Journal of Applied Mechanics 30 (1963) 384",
        higher_is_better=False,
        kind="mean",
        values=_energy_fraction,
    )
    if standoff is not None or dataset.sizes["standoff"]:
        degrees = math.degrees(_read("angle", Obliquity, angle))
        yield from _at_a_standoff(dataset, degrees, _at_standoff(dataset, standoff))
    yield Effect(
        name="stopped_share",
        label="P(stopped)",
        units="1",
        definition="Share of the shots that do not pass the plate: arrested in it, or ricocheted off it.",
        source="partial penetration as in MIL-STD-662F, V50 Ballistic Test for Armor",
        higher_is_better=True,
        kind="share",
        values=lambda part: np.where(failed(part), np.nan, ~passed(part)),
    )
    if v.BROKEN not in dataset:
        return
    yield Effect(
        name="broken_share",
        label="P(broken)",
        units="1",
        definition="Share of the shots whose nominal bending stress passed the strength of the core.",
        source="beam theory for a rigid core; a bound, not a prediction of fragments",
        higher_is_better=True,
        kind="share",
        values=_is_broken,
    )
    yield Effect(
        name="stopped_or_broken_share",
        label="P(stopped, or broken)",
        units="1",
        definition="Share of the shots that do not pass the plate, or pass it with a broken core.",
        source="partial penetration as in MIL-STD-662F, V50 Ballistic Test for Armor; a broken core counts as stopped",
        higher_is_better=True,
        kind="share",
        values=lambda part: np.where(passed(part), _is_broken(part), np.where(failed(part), np.nan, 1.0)),
    )


def _at_a_standoff(dataset: Result, degrees: float, standoff: float) -> Iterator[Effect]:
    """Of where and how the core is at a stand-off [m]; it is tilted beyond so many degrees."""
    at = f"{standoff * 1e3:g} mm"
    if attr.CORE in dataset.attrs:
        yield Effect(
            name="residual_energy_density",
            label=f"proxy: energy per presented area at {at}",
            units="J mm-2",
            definition="Kinetic energy of translation behind the plate over the area of the core's silhouette along "
            f"the line of fire {at} behind it, nose or base first alike; 0 for a core that was arrested or "
            "ricocheted. A proxy of how deep the core goes into what follows, which takes resistance times area from "
            "it per depth.",
            source="G. Ben-Dor, A. Dubinsky, T. Elperin, Applied Mechanics Reviews 58 (2005) 355; the silhouette of "
            "a convex body is Cauchy's",
            higher_is_better=False,
            kind="mean",
            values=_energy_density(TypeAdapter[Core](AnyCore).validate_json(dataset.attrs[attr.CORE]), standoff),
        )
    yield Effect(
        name="tilted_share",
        label=f"P(inclined > {degrees:g}° at {at}, either end first, or stopped)",
        units="1",
        definition=f"Share of the shots that {at} behind the plate are inclined to the line of fire by more than "
        f"{degrees:g}°, tilt beyond 90° counted back from 180°, or that do not get there because they were arrested "
        "or ricocheted.",
        source="Numerical and experimental investigation of asymmetrical contact between a steel plate and "
        "armour-piercing projectiles: what protects is mostly the distortion of the trajectory",
        higher_is_better=True,
        kind="share",
        values=_is_tilted(degrees, standoff),
        margin=_beyond(degrees, standoff),
    )


def _of_base() -> Iterator[Effect]:
    """Of the base behind the other layers."""
    yield Effect(
        name="base_perforated_share",
        label="P(base perforated)",
        units="1",
        definition="Share of the shots that pass the last layer, the base: they perforate it, or go through a hole of "
        "it or past its rim. Of the solid plate: the share that perforates it.",
        source="complete penetration as in MIL-STD-662F, V50 Ballistic Test for Armor",
        higher_is_better=False,
        kind="share",
        values=lambda part: np.where(failed(part), np.nan, passed(part)),
    )
    yield Effect(
        name="base_pierced_share",
        label="P(base pierced)",
        units="1",
        definition="Share of the shots in which the core comes out of the rear face of the last layer, the base, "
        "whether it rests there or passes.",
        source="Army criterion; P(base perforated) is that of the Navy: J. A. Zukas and others, Impact Dynamics, Wiley "
        "1982",
        higher_is_better=False,
        kind="share",
        values=base.is_pierced,
    )
    yield Effect(
        name="base_depth",
        label="depth in the base",
        units="mm",
        definition="How far behind the front face of the last layer, the base, any point of a core comes that rests in "
        "it, at most the thickness of the base; 0 for a core that stops before the base or bounces off it. A core that "
        "passes the base counts with this thickness, too: the numbers are lower bounds if any core pierces the base.",
        source="residual depth of penetration in a backing: Z. Rosenberg, E. Dekel, Terminal Ballistics, Springer 2012",
        higher_is_better=False,
        kind="mean",
        values=lambda part: 1e3 * base.base_depth(part),
    )


def _of_limits(dataset: Result) -> Iterator[Effect]:
    """Of the thickness that a layer needs to stop every core."""
    told = dataset.attrs
    layer, highest = int(told[attr.LIMIT_LAYER]), float(told[attr.LIMIT_HIGHEST])
    whose = f"layer {layer}" if layer else "the plate"

    def of_layer(part: Result) -> Array:
        is_this = all(part.attrs.get(name) == told.get(name) for name in (attr.LIMIT_LAYER, attr.LIMIT_ELSEWHERE))
        values = 1e3 * _limits(part, _THICKNESS)
        return values if is_this else np.full_like(values, np.nan)  # a solid plate for the whole has no such layer

    yield Effect(
        name="limit_thickness",
        label=f"limit thickness of {whose}",
        units="mm",
        definition=f"Thickness of {whose} that a core just perforates; a core that perforates the largest thickness "
        f"tried, {highest * 1e3:g} mm, counts with that.",
        source="ballistic limit as in MIL-STD-662F, V50 Ballistic Test for Armor, of the thickness at one velocity",
        higher_is_better=False,
        kind="mean",
        values=of_layer,
    )
    if attr.LIMIT_ELSEWHERE not in told:
        return
    yield Effect(
        name="limit_areal_density",
        label="areal density needed",
        units="kg m-2",
        definition=f"Mass per area of the whole target where {whose} has the limit thickness of the hit.",
        source="armour is compared by its areal density at the limit: Z. Rosenberg, E. Dekel, Terminal Ballistics, "
        "Springer 2012",
        higher_is_better=False,
        kind="mean",
        values=_needed_density,
    )


def _of_limit_velocity(dataset: Result) -> Effect:
    highest = float(dataset.attrs[attr.LIMIT_HIGHEST])
    return Effect(
        name="limit_velocity",
        label="limit velocity",
        units="m s-1",
        definition="Impact velocity at which a core just perforates the target; 0 for a core that touches no material, "
        f"and {highest:g} m/s for one that is stopped even at that velocity, the largest tried.",
        source="ballistic limit as in MIL-STD-662F, V50 Ballistic Test for Armor",
        higher_is_better=True,
        kind="mean",
        values=lambda part: _limits(part, _VELOCITY),
    )


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
