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
OF_THE_HIT_POINT = (EDGE_DISTANCE,)


OUTLINE_Y = Variable("outline_y", ("vertex",), "m", "hole outlines in the unit cell, y, separated by NaN")
OUTLINE_Z = Variable("outline_z", ("vertex",), "m", "hole outlines in the unit cell, z, separated by NaN")

OUTLINE_VARIABLES = (OUTLINE_Y, OUTLINE_Z)
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

# --- History of one hit ---
TIME = Variable("time", ("time",), "s", "time since the first touch of the front face")
QUATERNION = Variable("quaternion", ("quaternion",), "1", "component of a quaternion, w its scalar part")
SNAPSHOT = Variable("snapshot", ("snapshot",), "s", "time at which the plate is shown")
CELL_Y = Variable("cell_y", ("cell_y",), "m", "cell of the plate, y")
CELL_Z = Variable("cell_z", ("cell_z",), "m", "cell of the plate, z")
SECTION = Variable("section", ("section",), "m", "distance from the hit point in the plate")
STATION = Variable("station", ("station",), "m", "distance along the core, from its centre of mass towards the nose")

HISTORY_COORDINATES = (TIME, QUATERNION, SNAPSHOT, CELL_Y, CELL_Z, SECTION, STATION)

_ALONG = ("time", "axis")
POSITION = Variable("position", _ALONG, "m", "centre of mass, from the hit point")
PLATE_POSITION = Variable("plate_position", _ALONG, "m", "centre of mass in the plate")
ATTITUDE = Variable(
    "attitude", ("time", "quaternion"), "1", "turn of the plate's axes into the core's, x towards its nose"
)
CORE_AXIS = Variable("core_axis", _ALONG, "1", "unit vector along the core towards its nose")
VELOCITY = Variable("velocity", _ALONG, "m s-1", "velocity of the centre of mass")
MARCHED_ANGULAR_VELOCITY = Variable("angular_velocity", _ALONG, "rad s-1", "angular velocity")
FORCE = Variable("force", _ALONG, "N", "force on the core, mean over the step")
MOMENT = Variable("moment", _ALONG, "N m", "moment about the centre of mass, mean over the step")
TRANSLATIONAL_ENERGY = Variable("translational_energy", ("time",), "J", "kinetic energy of translation")
ROTATIONAL_ENERGY = Variable("rotational_energy", ("time",), "J", "kinetic energy of rotation")
RESISTANCE_SHARE = Variable(
    "resistance_share", ("snapshot", "cell_y", "cell_z"), "1", "share of the resistance left; 0 in holes"
)
CORE_RADIUS = Variable("core_radius", ("station",), "m", "radius of the core")
SOLID_ALONG_Y = Variable(
    "solid_along_y", ("section",), "1", "1 where the plate is solid along y through the hit point, else 0"
)
SOLID_ALONG_Z = Variable(
    "solid_along_z", ("section",), "1", "1 where the plate is solid along z through the hit point, else 0"
)

LAYER_SOLID_ALONG_Y = Variable(
    "layer_solid_along_y", ("layer", "section"), "1", "1 where the layer is solid along y through the hit point, else 0"
)
LAYER_SOLID_ALONG_Z = Variable(
    "layer_solid_along_z", ("layer", "section"), "1", "1 where the layer is solid along z through the hit point, else 0"
)

LAYER_SECTIONS = (LAYER_SOLID_ALONG_Y, LAYER_SOLID_ALONG_Z)
"""Present only with layers behind the plate, as LAYER_FACES, which here are those of the hit."""

ELEMENT_CORNER = Variable("element_corner", ("element", "corner"), "1", "node at a corner, in the order of VTK")
NODE_POSITION = Variable("node_position", ("snapshot", "node", "axis"), "m", "place of a node in the plate frame")
ELEMENT_LEFT = Variable("element_left", ("snapshot", "element"), "1", "1 where the element has not failed, else 0")
ELEMENT_STRAIN = Variable("element_strain", ("snapshot", "element"), "1", "plastic strain of the element")

MESH_VARIABLES = (ELEMENT_CORNER, NODE_POSITION, ELEMENT_LEFT, ELEMENT_STRAIN)
"""Present only in the history of a hit by finite elements: the deformed layers."""

HISTORY_VARIABLES = (
    *(POSITION, PLATE_POSITION, ATTITUDE, CORE_AXIS, VELOCITY, MARCHED_ANGULAR_VELOCITY, FORCE, MOMENT),
    *(TRANSLATIONAL_ENERGY, ROTATIONAL_ENERGY, RESISTANCE_SHARE, CORE_RADIUS, SOLID_ALONG_Y, SOLID_ALONG_Z),
)
RESIDUAL_ANGULAR_VELOCITY = "residual_angular_velocity"
"""Name of the outcome's angular velocity in a history, where the name `angular_velocity` belongs to the motion."""

# By the axis y or z of the plate frame.
HIT_POINT = {"y": HIT_Y, "z": HIT_Z}
OUTLINE = {"y": OUTLINE_Y, "z": OUTLINE_Z}
CELL = {"y": CELL_Y, "z": CELL_Z}
LAYER_SOLID_ALONG = {"y": LAYER_SOLID_ALONG_Y, "z": LAYER_SOLID_ALONG_Z}
SOLID_ALONG = {"y": SOLID_ALONG_Y, "z": SOLID_ALONG_Z}


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
