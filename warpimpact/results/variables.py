"""The variables of the Datasets, with dimensions, units and meanings: the records (records/), the conditions of the
shots (scene/quantities.py), and further ones."""

from __future__ import annotations

import xarray

from warpimpact.records import registry
from warpimpact.records.registry import *
from warpimpact.records.variable import *
from warpimpact.scene.quantities import BY_LAYER, OF_THE_SCENE, QUANTITIES
from warpimpact.scene.units import quantity


def _condition(name: str, of: str = "") -> Variable:
    """The column of a quantity of the shots; `of` names its object if each layer has the quantity."""
    known = QUANTITIES[name]
    units = quantity(known.type).display.stored
    return Variable(known.column or name, HITS, units, f"{known.meaning}{of}", field=name)


def _by_layer(name: str) -> Variable:
    """The column of a quantity of every layer."""
    variable = _condition(name, " of each layer")
    return Variable(f"layer_{name}", IN_LAYER, variable.units, variable.long_name)


# --- Coordinates of a hit map ---
HIT = Variable("hit", HITS, "1", "number of the hit in its campaign, from 0")
HIT_Y, HIT_Z = _condition("hit_y"), _condition("hit_z")
STANDOFF = Variable("standoff", ("standoff",), "m", "distance behind the rear face of the target")
AXIS = Variable("axis", ("axis",), "1", "axis of the plate frame")

COORDINATES = (HIT, HIT_Y, HIT_Z, STANDOFF, AXIS)

# --- Conditions of the shots ---
SHOT_VARIABLES = tuple(_condition(name) for name, quantity in QUANTITIES.items() if quantity.table == "impact")
IMPACT_VELOCITY, OBLIQUITY, AZIMUTH, IMPACT_PITCH, IMPACT_YAW, SPIN = SHOT_VARIABLES
_OF_THE_SCENE = tuple(_condition(name, " of the plate" if name in BY_LAYER else "") for name in OF_THE_SCENE)
RESISTANCE, SHEAR_COEFFICIENT, DEGRADATION, THICKNESS, MASS, STRENGTH, *_ = _OF_THE_SCENE
LAYER_SCATTER = tuple(_by_layer(name) for name in BY_LAYER)
LAYER_THICKNESS = LAYER_SCATTER[BY_LAYER.index("thickness")]
SCATTER_VARIABLES = (*_OF_THE_SCENE, *LAYER_SCATTER)
"""Along "hit" where they differ from shot to shot, else one number."""

EDGE_DISTANCE = Variable("edge_distance", HITS, "m", "from the nearest edge of hole or plate; negative in a hole")
INCLINATION = Variable("inclination", ("inclination",), "degree", "angle between a direction and the axis of the core")
PRESENTED_AREA = Variable(
    "presented_area", INCLINATION.dims, "m2", "area of the core's silhouette along such a direction"
)

LEVEL_VARIABLES = tuple(
    one for one in registry.variables() if one.is_number_of_hit or one in (STATUS, STOPPED_IN, BROKEN)
)
"""Outcomes of the hits that a pilot computes at a finer level, too."""

VARIABLES = (*SHOT_VARIABLES, *OUTCOME_VARIABLES)
"""Present in every hit map."""
_ENDS_OF_LIMITS = {name for names in LIMITS.values() for name in names} - {*LIMIT_VARIABLES}
HIT_NUMBERS = tuple(
    name
    for name in dict.fromkeys((*LIMIT_VARIABLES, *SHOT_VARIABLES, EDGE_DISTANCE, *registry.variables()))
    if name.is_number_of_hit and name not in _ENDS_OF_LIMITS
)
"""Variables of shots and outcomes with one number per hit, or one per hit and stand-off."""


def computed_variables() -> set[Variable]:
    """The variables that are computed, and stored, in the precision of the numerics."""
    return {*registry.variables()} - registry.EXACT


def shown_by(command: str) -> tuple[Variable, ...]:
    """The variables of a hit map that a command shows by default."""
    return tuple(variable for variable in HIT_NUMBERS if command in variable.shown_by)


def shot_variables(dataset: xarray.Dataset) -> list[Variable]:
    """Names of the variables of the impact, of plate and core where they differ; no hit points."""
    return [*SHOT_VARIABLES, *(name for name in SCATTER_VARIABLES if name in dataset and "hit" in dataset[name].dims)]


def outcome_variables(dataset: xarray.Dataset) -> list[Variable]:
    """Names of the variables that say how the shots ended."""
    return [name for name in registry.variables() if "hit" in name.dims and name in dataset.variables]


def hit_variables() -> tuple[Variable, ...]:
    """All variables that a map of hits may have beside its coordinates, in the order of a file."""
    always, *others = registry.RECORDS.values()
    optional = (variable for record in others for variable in record)
    return tuple(dict.fromkeys((*SHOT_VARIABLES, EDGE_DISTANCE, *always, *SCATTER_VARIABLES, *optional)))
