"""What may be asked of a hit: quantities (a number per hit) and events (1 where it happens, else 0).

A new one is a function with `_quantity` or `_event`; its docstring is its definition. Measures (measures.py) turn them
into numbers of a result: means, worst tenths, quantiles, probabilities.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from inspect import cleandoc
from typing import Any, NamedTuple

import numpy as np
import xarray
from numpy.typing import NDArray

from warpimpact.kernels.status import Status
from warpimpact.measures.hits import failed, passed
from warpimpact.records import attributes as attr
from warpimpact.records import variables as v
from warpimpact.solver.accuracy import passing_share

Array = NDArray[np.float64]
Values = Callable[[xarray.Dataset, float], Array]
"""Computes the numbers of all hits of a result, shape [hits], at a stand-off [m] where they have one; NaN where a hit
does not count."""


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


_VELOCITY, _THICKNESS = (v.LIMITS[name].value for name in ("velocity", "thickness"))
BASE = Need(v.STOPPED_IN, "layers behind the plate", "a table [[layer]]")
STRENGTH = Need(v.BROKEN, "cores with a strength", "output.bending = true and core.strength")
LIMIT_VELOCITY = Need(_VELOCITY, "limit velocities (warpimpact limit)", "")
LIMIT_THICKNESS = Need(_THICKNESS, "limit thicknesses (warpimpact limit --quantity thickness)", "")
OTHER_LAYERS = Need(attr.LIMIT_ELSEWHERE, "limit thicknesses, and the mass of the other layers", "")
CORE = Need(v.PRESENTED_AREA, "the silhouette of its core", "")
MASS = Need(v.MASS, "the mass of its core", "")


@dataclass(frozen=True, kw_only=True)
class HitValue:
    """A quantity or an event.

    Attributes:
        name: name in a measure.
        label: label, with {layer} where it names the layer.
        definition: one sentence or two, with the source.
        higher_is_better: for whoever is behind the target; None where neither direction is better.
        values: computes the numbers of the hits. An infinite number is beyond every limit of a probability; a mean
            leaves it out.
        units: units of the stored numbers; "1" for an event.
        has_standoff: whether they depend on the distance behind the rear face.
        has_layer: whether they depend on the layer whose limit thickness is searched.
        need: requirement on the result; None where every result has it.
        or_else: what makes a number infinite, as text behind a probability.
        least, most: bounds of the numbers.
        margin: for an event, computes a number of every hit that is positive where the event happens, negative where it
            does not, and continuous at 0; None without one.
        smooth: for an event without a margin, computes a number of every hit from 0 to 1 whose mean changes with the
            numerics as the share of the hits does, and that is continuous where the event just happens; NaN where the
            computation failed; None without one.
        implied_by: names of events that happen only where this one does.
    """

    name: str
    label: str
    definition: str
    values: Values
    higher_is_better: bool | None = False
    units: str = "1"
    has_standoff: bool = False
    has_layer: bool = False
    need: Need | None = None
    or_else: str = ""
    least: float = 0.0
    most: float = math.inf
    margin: Callable[[xarray.Dataset], Array] | None = None
    smooth: Callable[[xarray.Dataset], Array] | None = None
    implied_by: tuple[str, ...] = ()

    def lacking(self, dataset: xarray.Dataset) -> str:
        """Words for what a result lacks; empty where it lacks nothing."""
        if self.need is not None and self.need.name not in dataset and self.need.name not in dataset.attrs:
            return self.need.words
        if self.has_standoff and not len(dataset[v.STANDOFF].values):
            return "stand-offs (output.standoffs)"
        return ""


QUANTITIES: dict[str, HitValue] = {}
"""All quantities, by name."""
EVENTS: dict[str, HitValue] = {}
"""Events of a shot, by name. All shots count except those whose computation failed."""


def _quantity(name: str, label: str, units: str, **fields: Any) -> Callable[[Values], Values]:
    """Register a function as the values of a quantity that is derived from what is recorded."""

    def register(values: Values) -> Values:
        definition = cleandoc(values.__doc__ or "").replace("\n", " ")
        QUANTITIES[name] = HitValue(name=name, label=label, units=units, definition=definition, values=values, **fields)
        return values

    return register


def _event(name: str, label: str = "", **fields: Any) -> Callable[[Callable[[xarray.Dataset], Any]], None]:
    """Register a function as an event: whether it happens to each hit that was computed."""

    def register(happens: Callable[[xarray.Dataset], Any]) -> None:
        definition = f"Share of the shots {cleandoc(happens.__doc__ or '')}".replace("\n", " ")
        EVENTS[name] = HitValue(
            name=name,
            label=label or name,
            definition=definition,
            values=lambda part, _: np.where(failed(part), np.nan, happens(part)),
            **fields,
        )

    return register


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


def at(part: xarray.Dataset, variable: v.Variable, standoff: float = 0.0) -> Array:
    """A variable with one number per hit, at a stand-off if it has stand-offs; NaN where it was not recorded, as at the
    solid plate."""
    if variable not in part:
        return np.full(part.sizes["hit"], np.nan)
    column = np.asarray(part[variable].values, dtype=np.float64)
    return column[:, place_of_standoff(part[v.STANDOFF].values, standoff)] if column.ndim == 2 else column


def of_all(part: xarray.Dataset, of_passed: Array, of_stopped: float) -> Array:
    """Numbers where cores passed the target, one number where they did not, NaN where the computation failed."""
    return np.where(failed(part), np.nan, np.where(passed(part), of_passed, of_stopped))


# --- The base ---
def has_base(dataset: xarray.Dataset) -> bool:
    """Whether there are layers behind the plate."""
    return v.STOPPED_IN in dataset


def base_thickness(dataset: xarray.Dataset) -> Array:
    """Thickness of the base [m]: one number, or shape [hits] where it scatters."""
    if v.LAYER_THICKNESS in dataset:
        return np.asarray(dataset[v.LAYER_THICKNESS].values[..., -1])
    return np.asarray(dataset[v.LAYER_REAR].values[-1] - dataset[v.LAYER_FRONT].values[-1])


def _in_base(dataset: xarray.Dataset, depths: Callable[[Array], Array], if_stopped: float, if_passed: Any) -> Array:
    """Numbers of cores that rest in the base by their depths, of those stopped before it, and of those that passed; NaN
    without a base, and where the computation failed."""
    if not has_base(dataset):
        return np.full(dataset.sizes["hit"], np.nan)
    rests = dataset[v.STOPPED_IN].values == dataset.sizes["layer"] - 1
    numbers = np.where(rests, depths(dataset[v.DEPTH].values), if_stopped)
    return np.where(failed(dataset), np.nan, np.where(passed(dataset), if_passed, numbers))


def piercing_margin(dataset: xarray.Dataset) -> Array:
    """Distance of every core's foremost point behind the rear face of the base [m], negative before it, shape [hits].
    Infinite for a core that passes the base, minus infinity for one that rests before it; NaN where unknown."""
    return _in_base(dataset, lambda depth: np.asarray(depth - base_thickness(dataset)), -np.inf, np.inf)


@_quantity("base_depth", "depth in the base", "m", need=BASE)
def _base_depth(part: xarray.Dataset, _: float) -> Array:
    """How far behind the front face of the last layer, the base, any point of a core comes that rests in it, at most
    the thickness of the base; 0 for a core that stops before the base or bounces off it. A core that passes the base
    counts with this thickness, too: the numbers are lower bounds if any core comes out of its rear face (residual
    depth of penetration: Z. Rosenberg, E. Dekel, Terminal Ballistics, Springer 2012)."""
    thickness = base_thickness(part) if has_base(part) else 0.0
    return _in_base(part, lambda depth: np.minimum(depth, thickness), 0.0, thickness)


# --- Behind the target ---
def _energy(part: xarray.Dataset) -> Array:
    return np.asarray(0.5 * _mass_left(part) * part[v.RESIDUAL_VELOCITY].values.astype(float) ** 2)


def _mass_left(part: xarray.Dataset) -> Array:
    """Mass of each core, or of the fragment that leads [kg]."""
    return np.asarray(part[v.FRAGMENT_MASS if v.FRAGMENT_MASS in part else v.MASS].values, dtype=float)


@_quantity("residual_energy", "residual energy", "J", need=MASS)
def _residual_energy(part: xarray.Dataset, _: float) -> Array:
    """Kinetic energy of translation behind the target; 0 for a core that was arrested or ricocheted. A limit such as
    80 J says which cores count as incapacitating (criterion of Rohne: B. P. Kneubuehl and others, Wound Ballistics,
    Springer 2011)."""
    return of_all(part, _energy(part), 0.0)


@_quantity(
    "residual_energy_fraction",
    "residual energy fraction",
    "1",
    most=1.0,
)
def _residual_energy_fraction(part: xarray.Dataset, _: float) -> Array:
    """Kinetic energy of translation behind the plate as a fraction of that on impact, (v_r/v_0)²; 0 for a core that was
    arrested or ricocheted (R. F. Recht, T. W. Ipson, Journal of Applied Mechanics 30 (1963) 384). Of a core that
    deforms, the fragment that leads counts, with its mass."""
    share = _mass_left(part) / part[v.MASS].values if v.FRAGMENT_MASS in part else 1.0
    return of_all(part, share * (at(part, v.RESIDUAL_VELOCITY) / part[v.IMPACT_VELOCITY].values) ** 2, 0.0)


def _inclination(part: xarray.Dataset, standoff: float) -> Array:
    tilt = at(part, v.TILT, standoff)
    return np.minimum(tilt, 180.0 - tilt)


@_quantity(
    "residual_energy_density",
    "proxy: energy per presented area",
    "J m-2",
    has_standoff=True,
    need=CORE,
)
def _residual_energy_density(part: xarray.Dataset, standoff: float) -> Array:
    """Kinetic energy of translation behind the plate over the area of the core's silhouette along the line of fire at
    the stand-off, nose or base first alike; 0 for a core that was arrested or ricocheted. A proxy of how deep the core
    goes into what follows, which takes resistance times area from it per depth (G. Ben-Dor, A. Dubinsky, T. Elperin,
    Applied Mechanics Reviews 58 (2005) 355; the silhouette of a convex body is Cauchy's)."""
    angles, areas = _inclination(part, standoff), part[v.PRESENTED_AREA].values
    if areas.ndim == 1:
        silhouette = np.interp(angles, part[v.INCLINATION].values, areas)
    else:  # joined results of several cores
        pairs = zip(angles, areas, strict=True)
        silhouette = np.array([np.interp(angle, part[v.INCLINATION].values, of) for angle, of in pairs])
    return of_all(part, _energy(part) / silhouette, 0.0)


@_quantity(
    "inclination",
    "inclination",
    "degree",
    higher_is_better=True,
    has_standoff=True,
    or_else=", or stopped",
)
def _tipping(part: xarray.Dataset, standoff: float) -> Array:
    """Angle between the core's axis and the line of fire at the stand-off, nose or base first alike: tilt beyond 90°
    counts back from 180°. A core that was arrested or ricocheted counts as beyond every limit."""
    return of_all(part, _inclination(part, standoff), math.inf)


# --- Limits ---
def _limit(part: xarray.Dataset, name: str) -> Array:
    """Limits, at most the largest value tried; NaN where the computation failed."""
    return np.where(failed(part), np.nan, np.minimum(part[name].values, part.attrs.get(attr.LIMIT_HIGHEST, np.inf)))


@_quantity(_VELOCITY, "limit velocity", "m s-1", higher_is_better=True, need=LIMIT_VELOCITY)
def _limit_velocity(part: xarray.Dataset, _: float) -> Array:
    """Impact velocity at which a core just passes the target; 0 for a core that touches no material, and the
    largest velocity tried for one that is stopped even at that (ballistic limit as in MIL-STD-662F)."""
    return _limit(part, _VELOCITY)


@_quantity(_THICKNESS, "limit thickness of {layer}", "m", has_layer=True, need=LIMIT_THICKNESS)
def _limit_thickness(part: xarray.Dataset, _: float) -> Array:
    """Thickness of the layer that a core just passes; a core that passes the largest thickness tried counts with
    that."""
    return _limit(part, _THICKNESS)


@_quantity("limit_areal_density", "areal density needed", "kg m-2", has_layer=True, need=OTHER_LAYERS)
def needed_density(part: xarray.Dataset, _: float) -> Array:
    """Mass per area of the whole target where the layer has the limit thickness of the hit."""
    elsewhere, density = float(part.attrs[attr.LIMIT_ELSEWHERE]), float(part.attrs[attr.LIMIT_DENSITY])
    return elsewhere + density * _limit(part, _THICKNESS)


# --- Events ---
def _passing(part: xarray.Dataset) -> Array:
    """Smooth count of the cores that pass, as in a pilot: a core that stops has no distance to the limit."""
    return of_all(part, passing_share(at(part, v.RESIDUAL_VELOCITY) / part[v.IMPACT_VELOCITY].values), 0.0)


def _stopping(part: xarray.Dataset) -> Array:
    return 1.0 - _passing(part)


def _stopping_or_broken(part: xarray.Dataset) -> Array:
    return 1.0 - _passing(part) * (1.0 - np.where(passed(part), at(part, v.BROKEN), 0.0))


@_event("base_perforated", "base perforated", need=BASE, smooth=_passing)
def _passes_base(part: xarray.Dataset) -> Any:
    """that pass the last layer, the base: through its material, through a hole of it or past its rim. Of the solid
    plate: the share that passes it (complete penetration of MIL-STD-662F)."""
    return passed(part)


@_event("base_pierced", "base pierced", need=BASE, margin=piercing_margin, implied_by=("base_perforated",))
def _pierces(part: xarray.Dataset) -> Any:
    """in which the core comes out of the rear face of the last layer, the base, whether it rests there or passes (Army
    criterion; P(base_perforated) is that of the Navy: J. A. Zukas and others, Impact Dynamics, Wiley 1982)."""
    margin = piercing_margin(part)
    return np.where(np.isnan(margin), np.nan, margin >= 0.0)


@_event("perforated", smooth=_passing)
def _perforated(part: xarray.Dataset) -> Any:
    """that pass the target: they leave it through its rear face, or touch nothing of it (complete penetration of
    MIL-STD-662F)."""
    return passed(part)


@_event("stopped", higher_is_better=True, smooth=_stopping)
def _stopped(part: xarray.Dataset) -> Any:
    """that do not pass the target: arrested in it, or ricocheted off it (partial penetration of MIL-STD-662F)."""
    return ~passed(part)


@_event("broken", higher_is_better=True, need=STRENGTH)
def _broken(part: xarray.Dataset) -> Any:
    """whose nominal bending stress passed the strength of the core (beam theory for a rigid core: a bound, not a
    prediction of fragments)."""
    return at(part, v.BROKEN)


_EITHER = ("stopped", "broken")


@_event(
    "stopped_or_broken",
    "stopped, or broken",
    higher_is_better=True,
    need=STRENGTH,
    smooth=_stopping_or_broken,
    implied_by=_EITHER,
)
def _stopped_or_broken(part: xarray.Dataset) -> Any:
    """that do not pass the target, or pass it with a broken core."""
    return np.where(passed(part), at(part, v.BROKEN), 1.0)


for _status, _is_better in ((Status.ARRESTED, True), (Status.RICOCHETED, True), (Status.UNTOUCHED, False)):

    def _ends(part: xarray.Dataset, status: Status = _status) -> Any:
        return part[v.STATUS].values == status

    _ends.__doc__ = f"whose status is {_status.name.lower()}."
    _event(_status.name.lower(), higher_is_better=_is_better)(_ends)


# --- What is recorded ---
def _recorded(variable: v.Variable) -> HitValue:
    """A recorded number of a hit as a quantity. The cores that passed the target count; limits are of all."""
    of_every_hit = variable in v.LIMIT_VARIABLES

    def values(part: xarray.Dataset, standoff: float) -> Array:
        return np.where(~failed(part) if of_every_hit else passed(part), at(part, variable, standoff), np.nan)

    return HitValue(
        name=str(variable),
        label=variable.replace("_", " "),
        units=variable.units,
        definition=f"{variable.long_name[0].upper()}{variable.long_name[1:]}"
        + ("." if of_every_hit else ", of the cores that passed the target."),
        higher_is_better={v.RESIDUAL_VELOCITY: False, v.ENERGY_LOSS: True}.get(variable),
        values=values,
        has_standoff="standoff" in variable.dims,
        need=Need(variable, f"the variable {variable}", ""),
        least=-math.inf if variable in (v.PITCH, v.YAW, v.BROKEN_X) else 0.0,
        most=180.0 if variable.units == "degree" else math.inf,
    )


for _variable in v.HIT_NUMBERS:
    if _variable not in (*v.SHOT_VARIABLES, v.EDGE_DISTANCE, *QUANTITIES):
        QUANTITIES[_variable] = _recorded(_variable)


def _weight(name: str, label: str, of: str) -> HitValue:
    def values(part: xarray.Dataset, _: float) -> Array:
        return np.full(part.sizes["hit"], part.attrs.get(name, part.attrs.get(attr.AREAL_DENSITY, np.nan)))

    definition = f"Mass per area of {of}: mass of what is solid over the area of the cell."
    return HitValue(name=name, label=label, definition=definition, values=values, units="kg m-2")


WEIGHTS = {
    attr.AREAL_DENSITY: _weight(attr.AREAL_DENSITY, "areal density", "the whole target"),
    attr.ADD_ON_DENSITY: _weight(
        attr.ADD_ON_DENSITY, "areal density of the add-on", "the layers in front of the base, or of a plate alone"
    ),
}
"""Measures of the target itself, by their text."""
