"""All variables of a map of hits, in the order of a file: the records of a shot, its conditions, and further ones.

outcomes.py fills the records; limits are filled by the search of limits (solver/limit.py), and what a hit by finite
elements says of itself by the continuum. A core leaves a layer when its last point passes the rear face. By the fast
law, a broken core goes on as one rigid body. The conditions of the shots are those of scene/quantities.py.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from enum import IntEnum
from typing import Any, Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from warpimpact.kernels.status import OF_SHOTS, Status
from warpimpact.scene.core import Core
from warpimpact.scene.model import Array
from warpimpact.scene.quantities import BY_LAYER, OF_THE_SCENE, QUANTITIES
from warpimpact.scene.units import quantity

Mirror: TypeAlias = Literal["along_y", "along_z"]

HITS, AT_STANDOFF, VECTORS = ("hit",), ("hit", "standoff"), ("hit", "axis")
IN_LAYER = ("hit", "layer")
"""Dimensions of the variables of shots."""
MAIN = ("run", "inspect", "plot", "report")
"""Commands that show the main variables by default."""


class Variable(str):
    """Name of a variable, which is its key in a Dataset, with its metadata.

    Attributes:
        dims: names of its dimensions.
        units: as CF writes them; "degree" where the package itself computes in radians.
        long_name: description for people.
        flags: codes that it may hold (CF: flag_values, flag_meanings); None for numbers.
        field: name of its source: a field of shots or history, or a member of the kernels' struct.
        shown_by: commands that show it by default; other commands show it on request, or show all variables.
        mirror: factor of `Symmetry` that a mirror image applies to it; None for a vector, or if it does not change.
    """

    dims: tuple[str, ...]
    units: str
    long_name: str
    flags: Iterable[IntEnum] | None
    field: str
    shown_by: frozenset[str]
    mirror: Mirror | None

    def __new__(
        cls,
        name: str,
        dims: tuple[str, ...],
        units: str,
        long_name: str,
        *,
        flags: Iterable[IntEnum] | None = None,
        field: str | None = None,
        shown_by: Collection[str] = (),
        mirror: Mirror | None = None,
    ) -> Variable:
        self = super().__new__(cls, name)
        self.dims, self.units, self.long_name, self.flags = dims, units, long_name, flags
        self.field, self.shown_by, self.mirror = field or name, frozenset(shown_by), mirror
        return self

    def __reduce__(self) -> tuple[type[str], tuple[str]]:
        """Pickled, it is the plain name, which finds the same entries."""
        return str, (str(self),)

    @property
    def attributes(self) -> dict[str, Any]:
        """CF attributes of the variable in the Dataset."""
        attributes: dict[str, Any] = {"units": self.units, "long_name": self.long_name}
        if self.flags is not None:
            attributes["flag_values"] = np.array(list(self.flags), dtype=np.int8)
            attributes["flag_meanings"] = " ".join(flag.name.lower() for flag in self.flags)
        return attributes

    @property
    def is_number_of_hit(self) -> bool:
        """Whether it has one number with a unit per hit, or per hit and stand-off, as maps and measures need."""
        return self.flags is None and self.units != "1" and self.dims in {HITS, AT_STANDOFF}


def failures(status: NDArray[Any]) -> NDArray[np.bool_]:
    """Whether the computation of each shot failed, by its status; same shape."""
    return np.isin(status, [code for code in Status if code.failed])


def has_passed(status: NDArray[Any]) -> NDArray[np.bool_]:
    """Whether each core passed, or touched nothing, by its status; same shape."""
    return np.isin(status, [Status.PERFORATED, Status.UNTOUCHED])


# --- Records ---
STATUS = Variable("status", HITS, "1", "how the shot ended", flags=OF_SHOTS)
PERFORATED = Variable("perforated", HITS, "1", "whether the core passed the target, or touched nothing of it")
RESIDUAL_VELOCITY = Variable("residual_velocity", HITS, "m s-1", "residual velocity", shown_by=MAIN)
DEFLECTION = Variable("deflection", HITS, "degree", "angle between residual velocity and line of fire", shown_by=MAIN)
ANGULAR_VELOCITY = Variable("angular_velocity", VECTORS, "rad s-1", "angular velocity at the end of contact")
ENERGY_LOSS = Variable("energy_loss", HITS, "J", "kinetic energy lost in the target")
CONTACT_DURATION = Variable("contact_duration", HITS, "s", "duration of contact")
TILT = Variable("tilt", AT_STANDOFF, "degree", "angle between core axis and line of fire", shown_by=MAIN)
PITCH = Variable("pitch", AT_STANDOFF, "degree", "pitch of the core, projected into the x-z plane", mirror="along_z")
YAW = Variable("yaw", AT_STANDOFF, "degree", "yaw of the core, projected into the x-y plane", mirror="along_y")
TOTAL_YAW = Variable("total_yaw", AT_STANDOFF, "degree", "angle between core axis and residual velocity")

EXIT_VELOCITY = Variable("exit_velocity", VECTORS, "m s-1", "velocity at the end of contact")
EXIT_AXIS = Variable("exit_axis", VECTORS, "1", "unit vector along the core towards its nose at the end of contact")
EXIT_POSITION = Variable("exit_position", VECTORS, "m", "centre of mass at the end of contact, in the plate frame")
"""In outcomes it counts from the hit point."""

FLIGHT_VARIABLES = (
    *(RESIDUAL_VELOCITY, DEFLECTION, ANGULAR_VELOCITY, ENERGY_LOSS, CONTACT_DURATION),
    *(TILT, PITCH, YAW, TOTAL_YAW),
)
OUTCOME_VARIABLES = (STATUS, PERFORATED, *FLIGHT_VARIABLES)
EXIT_VARIABLES = (EXIT_VELOCITY, EXIT_AXIS, EXIT_POSITION)
"""In a file unless `output.exit_state` is false. With `angular_velocity` they start a flight behind the plate."""

LARGEST_BENDING_MOMENT = Variable(
    "largest_bending_moment", HITS, "N m", "largest bending moment in the rigid core", shown_by=("inspect", "plot")
)
BENDING_SECTION = Variable("bending_section", HITS, "m", "distance of its section from the nose")
BENDING_STRESS = Variable(
    "bending_stress", HITS, "Pa", "largest nominal bending stress in the rigid core", shown_by=("inspect", "plot")
)
BENDING_STRESS_SECTION = Variable("bending_stress_section", HITS, "m", "distance of its section from the nose")
BROKEN = Variable("broken", HITS, "1", "1 where the core broke, else 0")
BROKEN_TIME = Variable("broken_time", HITS, "s", "when the core broke, since the first touch of the front face")
BROKEN_X = Variable("broken_x", HITS, "m", "where the section that broke was, behind the front face")
BROKEN_SECTION = Variable(
    "broken_section", HITS, "m", "distance of the section that broke from the nose", field="broken_station"
)


BENDING_VARIABLES = (LARGEST_BENDING_MOMENT, BENDING_SECTION, BENDING_STRESS, BENDING_STRESS_SECTION)
"""The stress is 4M/(πr³) where the core is thick enough (solver/rings.py)."""
BROKEN_VARIABLES = (BROKEN, BROKEN_TIME, BROKEN_X, BROKEN_SECTION)
"""By the fast law a core breaks where the bending stress passes its strength."""
FRAGMENTS = Variable("fragments", HITS, "1", "number of the core's fragments behind the layers of finite elements")
FRAGMENT_MASS = Variable("fragment_mass", HITS, "kg", "mass of the fragment of the core that leads")
ERODED_MASS = Variable("eroded_mass", HITS, "kg", "mass of the core that failed")
FRAGMENT_ENERGY = Variable("fragment_energy", HITS, "J", "kinetic energy of all fragments of the core")
FRAGMENT_FRONT = Variable("fragment_front", HITS, "m", "distance of the front of that fragment from the core's nose")
FRAGMENT_REAR = Variable("fragment_rear", HITS, "m", "distance of the rear of that fragment from the core's nose")
FRAGMENT_VARIABLES = (
    *(FRAGMENTS, FRAGMENT_MASS, FRAGMENT_FRONT, FRAGMENT_REAR, ERODED_MASS, FRAGMENT_ENERGY),
    *(BROKEN, BROKEN_SECTION),
)
"""Of hits by finite elements. The core is the fragment that has the most momentum along the line of fire."""

LAYER_STATUS = Variable("layer_status", IN_LAYER, "1", "how the core ended in each layer", flags=Status)
LAYER_RESIDUAL_VELOCITY = Variable(
    "layer_residual_velocity",
    IN_LAYER,
    "m s-1",
    "velocity when the last point of the core leaves the layer",
    field="velocity",
)
LAYER_TILT = Variable(
    "layer_tilt", IN_LAYER, "degree", "angle between core axis and line of fire when its last point leaves the layer"
)
STOPPED_IN = Variable("stopped_in", HITS, "1", "deepest layer that the core rests in; -1 where it does not rest in one")
DEPTH = Variable(
    "depth", HITS, "m", "farthest that the core came behind the front face of the layer where it rests, also out of it"
)

LAYER_FRONT = Variable("layer_front", ("layer",), "m", "front face of the layer, from that of the target")
LAYER_REAR = Variable("layer_rear", ("layer",), "m", "rear face of the layer, from the front face of the target")
LAYER_FACES = (LAYER_FRONT, LAYER_REAR)
"""Means over the shots if thicknesses scatter."""
LAYER = Variable("layer", ("layer",), "1", "number of the layer; the plate is layer 0")
LAYER_NAME = Variable("layer_name", ("layer",), "1", "name of the layer")
LAYER_MATERIAL = Variable("layer_material", ("layer",), "1", "material of the layer in the catalogue, or empty")
LAYER_LABELS = (LAYER, LAYER_NAME, LAYER_MATERIAL)
LAYER_VARIABLES = (LAYER_STATUS, LAYER_RESIDUAL_VELOCITY, LAYER_TILT, STOPPED_IN, DEPTH)
LAYER_NUMBERS = (LAYER_RESIDUAL_VELOCITY, LAYER_TILT)
"""Variables with one number per hit and layer."""


class LimitVariables(NamedTuple):
    """The variables of a search of limits."""

    value: Variable
    lower: Variable
    upper: Variable
    runs: Variable
    converged: Variable


def _limit_variables(quantity: str, units: str, long_name: str) -> LimitVariables:
    name = f"limit_{quantity}"
    return LimitVariables(
        Variable(name, HITS, units, long_name, field="value", shown_by=MAIN),
        Variable(f"{name}_lower", HITS, units, f"{long_name}, lower end", field="lower"),
        Variable(f"{name}_upper", HITS, units, f"{long_name}, upper end", field="upper"),
        Variable("limit_runs", HITS, "1", "how often the hit was computed", field="runs"),
        Variable("limit_converged", HITS, "1", "whether the ends meet the tolerance, 1 or 0", field="converged"),
    )


LIMITS = {
    "velocity": _limit_variables("velocity", "m s-1", "limit velocity"),
    "thickness": _limit_variables("thickness", "m", "limit thickness of the plate"),
}
"""Variables of a limit by the quantity of the search. Only results of `warpimpact limit` have them. All other variables
of such a result belong to the shot at the end of the limit's interval at which the core passes."""
LIMIT_VARIABLES = tuple(variables.value for variables in LIMITS.values())


ENERGY_IMBALANCE = Variable(
    "energy_imbalance", HITS, "1", "energy that is missing or too much, as a share of what the core lost"
)
HOURGLASS_SHARE = Variable(
    "hourglass_share", HITS, "1", "share of the lost energy that the resistance against hourglasses took"
)
ERODED_ELEMENTS = Variable("eroded_elements", HITS, "1", "number of finite elements that failed")
_AT_HANDOVER = "as the core leaves the last layer of finite elements"
HANDOVER_VELOCITY = Variable("handover_velocity", VECTORS, "m s-1", f"velocity {_AT_HANDOVER}")
HANDOVER_AXIS = Variable("handover_axis", VECTORS, "1", f"unit vector along the core towards its nose {_AT_HANDOVER}")
HANDOVER_RATE = Variable("handover_rate", VECTORS, "rad s-1", f"angular velocity {_AT_HANDOVER}")
HANDOVER_POSITION = Variable("handover_position", VECTORS, "m", f"centre of mass from the hit point {_AT_HANDOVER}")
HANDOVER_VARIABLES = (HANDOVER_VELOCITY, HANDOVER_AXIS, HANDOVER_RATE, HANDOVER_POSITION)
"""Of hits whose cores go on through other layers by the fast law; NaN of those that stop before."""


class PictureLabel(IntEnum):
    """What lies in a cell of a picture. Failed elements are air."""

    AIR = 0
    CORE = 1
    JACKET = 2
    FILLER = 3
    PLATE = 4
    LAYER = 5


_OF_PICTURE = ("hit", "instant")
PICTURE = Variable(
    "picture",
    (*_OF_PICTURE, "across", "along"),
    "1",
    "what lies in a plane through the line of flight, that in which the core has turned at its end",
    flags=PictureLabel,
)
PICTURE_TIME = Variable("picture_time", _OF_PICTURE, "s", "time of the picture since the impact")
PICTURE_PLACE = Variable("picture_place", (*_OF_PICTURE, "axis"), "m", "middle of the picture from the hit point")
PICTURE_ACROSS = Variable("picture_across", VECTORS, "1", "unit vector across the line of flight in the picture")
PICTURE_VARIABLES = (PICTURE, PICTURE_TIME, PICTURE_PLACE, PICTURE_ACROSS)
"""Of hits by finite elements, in a node of their own: a file has their numbers along `PICTURE_HIT`."""
PICTURE_HIT = "picture_hit"
INSTANTS = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Instants of the pictures, as shares of the march from the touch of the front face to the end."""
INSTANT = Variable("instant", ("instant",), "1", "instant of the picture, as a share of the time of the march")
ALONG = Variable("along", ("along",), "m", "place along the line of flight, from the middle of the picture")
ACROSS = Variable("across", ("across",), "m", "place across the line of flight, from the middle of the picture")
PICTURE_AXES = (INSTANT, ALONG, ACROSS)
_CELLS_OF_RADIUS, _BEYOND_ALONG, _BEYOND_ACROSS = 16, 3.0, 2.0
"""Cells of a picture in the largest radius of a core; how far it reaches beyond half the core's length along the
flight, and beyond a quarter of it across, in radii."""


def picture_axes(core: Core) -> tuple[Array, Array]:
    """Middles of the cells of a picture across and along the line of flight, from its middle, the core [m]."""
    cell = core.max_radius / _CELLS_OF_RADIUS
    reaches = 0.25 * core.length + _BEYOND_ACROSS * core.max_radius, 0.5 * core.length + _BEYOND_ALONG * core.max_radius
    across, along = (cell * np.arange(-round(reach / cell), round(reach / cell) + 1) for reach in reaches)
    return np.asarray(across), np.asarray(along)


RECORDS: dict[str, tuple[Variable, ...]] = {
    "How the shot ended": OUTCOME_VARIABLES,
    "At the end of contact": EXIT_VARIABLES,
    "With `output.bending`": BENDING_VARIABLES,
    "With `core.strength`": BROKEN_VARIABLES,
    "With layers behind the plate": (*LAYER_VARIABLES, *LAYER_FACES),
    **{f"With `warpimpact limit --quantity {quantity}`": variables for quantity, variables in LIMITS.items()},
    'With `continuum.core = "deformable"`': FRAGMENT_VARIABLES,
    "With `warpimpact continuum`": (
        *(ENERGY_IMBALANCE, HOURGLASS_SHARE, ERODED_ELEMENTS),
        *HANDOVER_VARIABLES,
        *PICTURE_VARIABLES,
    ),
}
"""All variables, by the heading that says when they are recorded."""
EXACT = frozenset(variable for variables in LIMITS.values() for variable in variables) | {*LAYER_FACES}
"""Variables in double precision also where shots are computed in single precision."""


def record_variables() -> tuple[Variable, ...]:
    """The variables of all records."""
    return tuple(dict.fromkeys(name for record in RECORDS.values() for name in record))


# --- Conditions of the shots ---
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

DRAW, DRAWN_HIT = "draw", "drawn_hit"
"""Dimensions of draws of a map. The coordinate of the second one has the numbers of the hits."""
DRAWN = (STATUS, RESIDUAL_VELOCITY, DEFLECTION, ENERGY_LOSS, TILT, PITCH, YAW, TOTAL_YAW)
DRAWN_BEHIND = (STOPPED_IN, DEPTH)
DRAWN_OF_FRAGMENTS = (BROKEN, FRAGMENT_MASS)
"""Variables of draws; those of targets with several layers, and those with hits of cores that deform."""
MEANS_ONLY = (ANGULAR_VELOCITY, LAYER_STATUS, *LAYER_NUMBERS)
"""Variables of which an answer has means over the draws only."""

LEVEL_VARIABLES = tuple(
    one for one in record_variables() if one.is_number_of_hit or one in (STATUS, STOPPED_IN, BROKEN)
)
"""Outcomes of the hits that a pilot computes at a finer level, too."""

LAW_ONLY = (CONTACT_DURATION, *EXIT_VARIABLES)
"""Variables that draws lack: an answer has them in its node of the fast law."""
VARIABLES = (*SHOT_VARIABLES, *(one for one in OUTCOME_VARIABLES if one not in LAW_ONLY))
"""Present in every hit map."""
_ENDS_OF_LIMITS = {name for names in LIMITS.values() for name in names} - {*LIMIT_VARIABLES}
HIT_NUMBERS = tuple(
    name
    for name in dict.fromkeys((*LIMIT_VARIABLES, *SHOT_VARIABLES, EDGE_DISTANCE, *record_variables()))
    if name.is_number_of_hit and name not in _ENDS_OF_LIMITS
)
"""Variables of shots and outcomes with one number per hit, or one per hit and stand-off."""


def computed_variables() -> set[Variable]:
    """The variables that are computed, and stored, in the precision of the numerics."""
    return {*record_variables()} - EXACT


def shown_by(command: str) -> tuple[Variable, ...]:
    """The variables of a hit map that a command shows by default."""
    return tuple(variable for variable in HIT_NUMBERS if command in variable.shown_by)


def hit_variables() -> tuple[Variable, ...]:
    """All variables that a map of hits may have beside its coordinates, in the order of a file."""
    always, *others = RECORDS.values()
    optional = (variable for record in others for variable in record)
    return tuple(dict.fromkeys((*SHOT_VARIABLES, EDGE_DISTANCE, *always, *SCATTER_VARIABLES, *optional)))
