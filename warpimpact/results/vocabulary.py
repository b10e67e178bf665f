"""What may be asked of a hit: quantities (a number per hit) and events (1 where it happens, else 0).

A new one needs only an entry of `QUANTITIES` or `EVENTS`. Measures (measures.py) turn them into numbers of a result:
means, worst tenths, quantiles, probabilities.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import xarray
from numpy.typing import NDArray
from pydantic import TypeAdapter

from warpimpact.kernels.status import Status
from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.results.dataset import failed, passed
from warpimpact.scene import AnyCore, Core

Array = NDArray[np.float64]
Values = Callable[[xarray.Dataset, float], Array]
"""Computes the numbers of all hits of a result, shape [hits], at a stand-off [m] where they have one; NaN where a hit
does not count."""

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
    margin: Callable[[xarray.Dataset], Array] | None = None

    def lacking(self, dataset: xarray.Dataset) -> str:
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


def at(part: xarray.Dataset, variable: v.Variable, standoff: float) -> Array:
    """A variable with one number per hit, at a stand-off if it has stand-offs; NaN where it was not recorded, as at the
    solid plate."""
    if variable not in part:
        return np.full(part.sizes["hit"], np.nan)
    column = np.asarray(part[variable].values, dtype=np.float64)
    return column[:, place_of_standoff(part[v.STANDOFF].values, standoff)] if column.ndim == 2 else column


def of_all(part: xarray.Dataset, of_passed: Array, of_stopped: float) -> Array:
    """Numbers where cores passed the target, one number where they did not, NaN where the computation failed."""
    return np.where(failed(part), np.nan, np.where(passed(part), of_passed, of_stopped))


def is_so(which: Callable[[xarray.Dataset], NDArray[np.bool_]]) -> Values:
    """Values of an event: 1 where `which` holds, 0 elsewhere, NaN where the computation failed."""
    return lambda part, _: np.where(failed(part), np.nan, which(part))


def ended_as(status: Status) -> Values:
    """Values of an event: 1 where a shot ended with this status."""
    return is_so(lambda part: np.asarray(part[v.STATUS].values == status))


def energy_fraction(part: xarray.Dataset, _: float) -> Array:
    return of_all(part, (at(part, v.RESIDUAL_VELOCITY, 0.0) / part[v.IMPACT_VELOCITY].values) ** 2, 0.0)


def energy(part: xarray.Dataset) -> Array:
    """Kinetic energy of translation [J], whether the core passed or not."""
    return np.asarray(0.5 * part[v.MASS].values * part[v.RESIDUAL_VELOCITY].values.astype(float) ** 2)


def inclination(part: xarray.Dataset, standoff: float) -> Array:
    tilt = at(part, v.TILT, standoff)
    return np.minimum(tilt, 180.0 - tilt)


def energy_density(part: xarray.Dataset, standoff: float) -> Array:
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


def limit(part: xarray.Dataset, name: str) -> Array:
    """Limits, at most the largest value tried; NaN where the computation failed."""
    return np.where(failed(part), np.nan, np.minimum(part[name].values, part.attrs.get(attr.LIMIT_HIGHEST, np.inf)))


def needed_density(part: xarray.Dataset, _: float) -> Array:
    elsewhere, density = float(part.attrs[attr.LIMIT_ELSEWHERE]), float(part.attrs[attr.LIMIT_DENSITY])
    return elsewhere + density * limit(part, _THICKNESS)


def has_base(dataset: xarray.Dataset) -> bool:
    """Whether there are layers behind the plate."""
    return v.STOPPED_IN in dataset


def base_thickness(dataset: xarray.Dataset) -> Array:
    """Thickness of the base [m]: one number, or shape [hits] where it scatters."""
    if v.LAYER_THICKNESS in dataset:
        return np.asarray(dataset[v.LAYER_THICKNESS].values[..., -1])
    return np.asarray(dataset[v.LAYER_REAR].values[-1] - dataset[v.LAYER_FRONT].values[-1])


def base_depth(dataset: xarray.Dataset) -> Array:
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


def is_pierced(dataset: xarray.Dataset) -> Array:
    """1 where a core comes out of the rear face of the base, whether it rests in the base or passes it, else 0; shape
    [hits]. NaN as in `base_depth`."""
    margin = piercing_margin(dataset)
    return np.where(np.isnan(margin), np.nan, margin >= 0.0)


def piercing_margin(dataset: xarray.Dataset) -> Array:
    """Distance of every core's foremost point behind the rear face of the base [m], negative before it, shape [hits].
    Infinite for a core that passes the base, minus infinity for one that rests before it; NaN as in `base_depth`."""
    if not has_base(dataset):
        return np.full(dataset.sizes["hit"], np.nan)
    rests = dataset[v.STOPPED_IN].values == dataset.sizes["layer"] - 1
    beyond = np.where(rests, dataset[v.DEPTH].values - base_thickness(dataset), -np.inf)
    return np.where(failed(dataset), np.nan, np.where(passed(dataset), np.inf, beyond))


MIL_STD_662F = "MIL-STD-662F, V50 Ballistic Test for Armor"
_ROSENBERG = "Z. Rosenberg, E. Dekel, Terminal Ballistics, Springer 2012"
_VELOCITY, _THICKNESS = (v.LIMITS[name].value for name in ("velocity", "thickness"))

BASE = Need(v.STOPPED_IN, "layers behind the plate", "a table [[layer]]")
STRENGTH = Need(v.BROKEN, "cores with a strength", "output.bending = true and core.strength")
LIMIT_VELOCITY = Need(_VELOCITY, "limit velocities (warpimpact limit)", "")
LIMIT_THICKNESS = Need(_THICKNESS, "limit thicknesses (warpimpact limit --quantity thickness)", "")
OTHER_LAYERS = Need(attr.LIMIT_ELSEWHERE, "limit thicknesses, and the mass of the other layers", "")
CORE = Need(attr.CORE, "a description of its core", "")
MASS = Need(v.MASS, "the mass of its core", "")


_DERIVED = (
    PerHit(
        name="base_depth",
        label="depth in the base",
        units="m",
        definition="How far behind the front face of the last layer, the base, any point of a core comes that rests in "
        "it, at most the thickness of the base; 0 for a core that stops before the base or bounces off it. A core that "
        "passes the base counts with this thickness, too: the numbers are lower bounds if any core pierces the base.",
        source=f"residual depth of penetration in a backing: {_ROSENBERG}",
        higher_is_better=False,
        values=lambda part, _: base_depth(part),
        of=DEPTH_VARIABLES,
        need=BASE,
    ),
    PerHit(
        name="residual_energy",
        label="residual energy",
        units="J",
        definition="Kinetic energy of translation behind the target; 0 for a core that was arrested or ricocheted. A "
        "limit such as 80 J tells which cores count as incapacitating.",
        source="criterion of Rohne: B. P. Kneubuehl and others, Wound Ballistics, Springer 2011",
        higher_is_better=False,
        values=lambda part, _: of_all(part, energy(part), 0.0),
        of=(v.RESIDUAL_VELOCITY, v.MASS),
        need=MASS,
    ),
    PerHit(
        name="residual_energy_fraction",
        label="residual energy fraction",
        definition="Kinetic energy of translation behind the plate as a fraction of that on impact, (v_r/v_0)²; 0 for "
        "a core that was arrested or ricocheted.",
        source="R. F. Recht, T. W. Ipson, Journal of Applied Mechanics 30 (1963) 384",
        higher_is_better=False,
        values=energy_fraction,
        of=(v.RESIDUAL_VELOCITY, v.IMPACT_VELOCITY),
        most=1.0,
    ),
    PerHit(
        name="residual_energy_density",
        label="proxy: energy per presented area",
        units="J m-2",
        definition="Kinetic energy of translation behind the plate over the area of the core's silhouette along the "
        "line of fire at the stand-off, nose or base first alike; 0 for a core that was arrested or ricocheted. A "
        "proxy of how deep the core goes into what follows, which takes resistance times area from it per depth.",
        source="G. Ben-Dor, A. Dubinsky, T. Elperin, Applied Mechanics Reviews 58 (2005) 355; the silhouette of a "
        "convex body is Cauchy's",
        higher_is_better=False,
        values=energy_density,
        of=(v.RESIDUAL_VELOCITY, v.TILT, v.MASS),
        has_standoff=True,
        need=CORE,
    ),
    PerHit(
        name="inclination",
        label="inclination",
        units="degree",
        definition="Angle between the core's axis and the line of fire at the stand-off, nose or base first alike: "
        "tilt beyond 90° counts back from 180°. A core that was arrested or ricocheted counts as beyond every limit.",
        source="Numerical and experimental investigation of asymmetrical contact between a steel plate and "
        "armour-piercing projectiles: what protects is mostly the distortion of the trajectory",
        higher_is_better=True,
        values=lambda part, standoff: of_all(part, inclination(part, standoff), math.inf),
        of=(v.TILT,),
        has_standoff=True,
        or_else=", or stopped",
    ),
    PerHit(
        name=_VELOCITY,
        label="limit velocity",
        units="m s-1",
        definition="Impact velocity at which a core just perforates the target; 0 for a core that touches no material, "
        "and the largest velocity tried for one that is stopped even at that.",
        source=f"ballistic limit as in {MIL_STD_662F}",
        higher_is_better=True,
        values=lambda part, _: limit(part, _VELOCITY),
        of=(_VELOCITY,),
        need=LIMIT_VELOCITY,
    ),
    PerHit(
        name=_THICKNESS,
        label="limit thickness of {layer}",
        units="m",
        definition="Thickness of the layer that a core just perforates; a core that perforates the largest thickness "
        "tried counts with that.",
        source=f"ballistic limit as in {MIL_STD_662F}, of the thickness at one velocity",
        higher_is_better=False,
        values=lambda part, _: limit(part, _THICKNESS),
        of=(_THICKNESS,),
        has_layer=True,
        need=LIMIT_THICKNESS,
    ),
    PerHit(
        name="limit_areal_density",
        label="areal density needed",
        units="kg m-2",
        definition="Mass per area of the whole target where the layer has the limit thickness of the hit.",
        source=f"armour is compared by its areal density at the limit: {_ROSENBERG}",
        higher_is_better=False,
        values=needed_density,
        of=(_THICKNESS,),
        has_layer=True,
        need=OTHER_LAYERS,
    ),
)
"""Quantities that follow from what is recorded."""

EVENTS: Mapping[str, PerHit] = {
    event.name: event
    for event in (
        PerHit(
            name="base_perforated",
            label="base perforated",
            definition="Share of the shots that pass the last layer, the base: they perforate it, or go through a hole "
            "of it or past its rim. Of the solid plate: the share that perforates it.",
            source=f"complete penetration as in {MIL_STD_662F}",
            higher_is_better=False,
            values=is_so(passed),
            need=BASE,
        ),
        PerHit(
            name="base_pierced",
            label="base pierced",
            definition="Share of the shots in which the core comes out of the rear face of the last layer, the base, "
            "whether it rests there or passes.",
            source="Army criterion; P(base perforated) is that of the Navy: J. A. Zukas and others, Impact Dynamics, "
            "Wiley 1982",
            higher_is_better=False,
            values=lambda part, _: is_pierced(part),
            of=DEPTH_VARIABLES,
            need=BASE,
            margin=piercing_margin,
        ),
        PerHit(
            name="perforated",
            label="perforated",
            definition="Share of the shots that come through the target: they perforate it, or touch nothing of it.",
            source=f"complete penetration as in {MIL_STD_662F}",
            higher_is_better=False,
            values=is_so(passed),
        ),
        PerHit(
            name="stopped",
            label="stopped",
            definition="Share of the shots that do not pass the target: arrested in it, or ricocheted off it.",
            source=f"partial penetration as in {MIL_STD_662F}",
            higher_is_better=True,
            values=is_so(lambda part: ~passed(part)),
        ),
        PerHit(
            name="broken",
            label="broken",
            definition="Share of the shots whose nominal bending stress passed the strength of the core.",
            source="beam theory for a rigid core; a bound, not a prediction of fragments",
            higher_is_better=True,
            values=lambda part, standoff: at(part, v.BROKEN, standoff),
            of=(v.BROKEN,),
            need=STRENGTH,
        ),
        PerHit(
            name="stopped_or_broken",
            label="stopped, or broken",
            definition="Share of the shots that do not pass the target, or pass it with a broken core.",
            source=f"partial penetration as in {MIL_STD_662F}; a broken core counts as stopped",
            higher_is_better=True,
            values=lambda part, standoff: of_all(part, at(part, v.BROKEN, standoff), 1.0),
            of=(v.BROKEN,),
            need=STRENGTH,
        ),
        *(
            PerHit(
                name=status.name.lower(),
                label=status.name.lower(),
                definition=f"Share of the shots whose status is {status.name.lower()}.",
                higher_is_better=status is not Status.UNTOUCHED,
                values=ended_as(status),
            )
            for status in (Status.ARRESTED, Status.RICOCHETED, Status.UNTOUCHED)
        ),
    )
}
"""Events of a shot, by name. All shots count except those whose computation failed."""


def _recorded() -> Iterator[PerHit]:
    """A quantity for every recorded number of a hit. The cores that passed the target count."""
    derived = {quantity.name for quantity in _DERIVED}
    better = {v.RESIDUAL_VELOCITY: False, v.ENERGY_LOSS: True}
    for variable in v.HIT_NUMBERS:
        if variable in (*v.SHOT_VARIABLES, v.EDGE_DISTANCE) or variable in derived:
            continue
        every = variable in v.LIMIT_VARIABLES

        def values(
            part: xarray.Dataset, standoff: float, variable: v.Variable = variable, every: bool = every
        ) -> Array:
            return np.where(~failed(part) if every else passed(part), at(part, variable, standoff), np.nan)

        yield PerHit(
            name=str(variable),
            label=variable.replace("_", " "),
            units=variable.units,
            definition=f"{variable.long_name[0].upper()}{variable.long_name[1:]}"
            + ("." if every else ", of the cores that passed the target."),
            higher_is_better=better.get(variable),
            values=values,
            of=(variable,),
            has_standoff="standoff" in variable.dims,
            need=Need(variable, f"the variable {variable}", ""),
            least=-math.inf if variable in (v.PITCH, v.YAW, v.BROKEN_X) else 0.0,
            most=180.0 if variable.units == "degree" else math.inf,
        )


QUANTITIES: Mapping[str, PerHit] = {quantity.name: quantity for quantity in (*_DERIVED, *_recorded())}
"""All quantities, by name."""


def _weight(name: str, label: str, of: str) -> PerHit:
    def values(part: xarray.Dataset, _: float) -> Array:
        return np.full(part.sizes["hit"], part.attrs.get(name, part.attrs.get(attr.AREAL_DENSITY, np.nan)))

    return PerHit(
        name=name,
        label=label,
        units="kg m-2",
        definition=f"Mass per area of {of}.",
        source="mass of what is solid over the area of the cell",
        higher_is_better=False,
        values=values,
    )


WEIGHTS = {
    attr.AREAL_DENSITY: _weight(attr.AREAL_DENSITY, "areal density", "the whole target"),
    attr.ADD_ON_DENSITY: _weight(
        attr.ADD_ON_DENSITY, "areal density of the add-on", "the layers in front of the base, or of a plate alone"
    ),
}
"""Measures of the target itself, by their text."""
