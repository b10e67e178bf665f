"""What may be asked of a hit: quantities (a number per hit) and events (1 where it happens, else 0).

A new one needs only an entry of `QUANTITIES` or `EVENTS`. Measures (measures.py) turn them into numbers of a result:
means, worst tenths, quantiles, probabilities.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

import numpy as np

from warpimpact.kernels.status import OF_SHOTS
from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.results.dataset import failed, passed
from warpimpact.results.per_hit import (
    DEPTH_VARIABLES,
    Array,
    Need,
    PerHit,
    at,
    base_depth,
    ended_as,
    energy,
    energy_density,
    energy_fraction,
    inclination,
    is_pierced,
    is_so,
    limit,
    needed_density,
    of_all,
    piercing_margin,
)

if TYPE_CHECKING:
    from warpimpact.results.table import Result

MIL_STD_662F = "MIL-STD-662F, V50 Ballistic Test for Armor"
_ROSENBERG = "Z. Rosenberg, E. Dekel, Terminal Ballistics, Springer 2012"
_VELOCITY, _THICKNESS = (v.LIMITS[name].value for name in ("velocity", "thickness"))

BASE = Need(v.STOPPED_IN, "layers behind the plate", "a table [[layer]]")
STRENGTH = Need(v.BROKEN, "cores with a strength", "output.bending = true and core.strength")
LIMIT_VELOCITY = Need(_VELOCITY, "limit velocities (warpimpact limit)", "")
LIMIT_THICKNESS = Need(_THICKNESS, "limit thicknesses (warpimpact limit --quantity thickness)", "")
OTHER_LAYERS = Need(attr.LIMIT_ELSEWHERE, "limit thicknesses, and the mass of the other layers", "")
CORE = Need(attr.CORE, "a description of its core", "")


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
        need=CORE,
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
                higher_is_better=status.name in ("ARRESTED", "RICOCHETED"),
                values=ended_as(status),
            )
            for status in OF_SHOTS
            if not status.failed
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

        def values(part: Result, standoff: float, variable: v.Variable = variable, every: bool = every) -> Array:
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
    def values(part: Result, _: float) -> Array:
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
