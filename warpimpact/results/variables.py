"""The variables of the Datasets: the one place that knows their names, dimensions, units and meanings.

Long because it is one table: each variable stands here once.
"""

from __future__ import annotations

from collections.abc import Collection
from enum import IntEnum
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from warpimpact.kernels.status import LayerStatus, Status

if TYPE_CHECKING:
    import xarray


class Variable(str):
    """Name of a variable, which is its key in a Dataset, with its metadata.

    Attributes:
        dims: names of its dimensions.
        units: as CF writes them; "degree" where the package itself computes in radians.
        long_name: what it is, for people.
        flags: the codes that it may hold, if it holds codes (CF: flag_values, flag_meanings).
        field: name of the field of shots, outcomes or history that it comes from.
        shown_by: commands that show it by default. Other commands show it on request, or they show all variables.
    """

    dims: tuple[str, ...]
    units: str
    long_name: str
    flags: type[IntEnum] | None
    field: str
    shown_by: frozenset[str]

    def __new__(
        cls,
        name: str,
        dims: tuple[str, ...],
        units: str,
        long_name: str,
        *,
        flags: type[IntEnum] | None = None,
        field: str | None = None,
        shown_by: Collection[str] = (),
    ) -> Variable:
        self = super().__new__(cls, name)
        self.dims, self.units, self.long_name, self.flags = dims, units, long_name, flags
        self.field, self.shown_by = field or name, frozenset(shown_by)
        return self

    def __reduce__(self) -> tuple[type[str], tuple[str]]:
        """A copy in another process is the plain name. It finds the same entries."""
        return str, (str(self),)

    @property
    def attributes(self) -> dict[str, Any]:
        """CF attributes of the variable in the Dataset."""
        told: dict[str, Any] = {"units": self.units, "long_name": self.long_name}
        if self.flags is not None:
            told["flag_values"] = np.array(list(self.flags), dtype=np.int8)
            told["flag_meanings"] = " ".join(flag.name.lower() for flag in self.flags)
        return told

    @property
    def is_number_of_hit(self) -> bool:
        """Whether it has one number with a unit per hit, or one per hit and stand-off. Maps and measures need this."""
        return self.flags is None and self.units != "1" and self.dims in {("hit",), ("hit", "standoff")}


_HIT, _AT_STANDOFF, _IN_LAYER = ("hit",), ("hit", "standoff"), ("hit", "layer")
_BEHIND_LAYER = ("hit", "layer", "layer_standoff")
_MAIN = ("run", "inspect", "plot", "report")

# --- Coordinates of a hit map ---
HIT = Variable("hit", _HIT, "1", "number of the hit in its campaign, from 0")
HIT_Y = Variable("hit_y", _HIT, "m", "hit point on the front face, y")
HIT_Z = Variable("hit_z", _HIT, "m", "hit point on the front face, z")
STANDOFF = Variable("standoff", ("standoff",), "m", "distance behind the rear face of the target")
AXIS = Variable("axis", ("axis",), "1", "axis of the plate frame")

COORDINATES = (HIT, HIT_Y, HIT_Z, STANDOFF, AXIS)

# --- Impact ---
IMPACT_VELOCITY = Variable("impact_velocity", _HIT, "m s-1", "impact velocity", field="velocity")
OBLIQUITY = Variable("obliquity", _HIT, "degree", "angle between line of fire and plate normal")
AZIMUTH = Variable("azimuth", _HIT, "degree", "direction of the obliquity, from +y towards +z")
IMPACT_PITCH = Variable(
    "impact_pitch", _HIT, "degree", "pitch of the core on impact, relative to the line of fire", field="pitch"
)
IMPACT_YAW = Variable(
    "impact_yaw", _HIT, "degree", "yaw of the core on impact, relative to the line of fire", field="yaw"
)
SPIN = Variable("spin", _HIT, "rad s-1", "spin of the core about its axis on impact")

SHOT_VARIABLES = (IMPACT_VELOCITY, OBLIQUITY, AZIMUTH, IMPACT_PITCH, IMPACT_YAW, SPIN)

# --- Plate and core, where they differ from shot to shot ---
RESISTANCE = Variable("resistance", _HIT, "Pa", "resistance of the plate")
SHEAR_COEFFICIENT = Variable("shear_coefficient", _HIT, "1", "friction per normal stress")
DEGRADATION = Variable("degradation", _HIT, "1", "share of the resistance left after an interval of contact")
THICKNESS = Variable("thickness", _HIT, "m", "thickness of the plate")
MASS = Variable("mass", _HIT, "kg", "mass of the core")
STRENGTH = Variable("strength", _HIT, "Pa", "strength of the core, a nominal bending stress")

POSTERIOR_DRAW = Variable("posterior_draw", _HIT, "1", "place of the shot's parameters in the posterior")
POSTERIOR_VARIABLES = (POSTERIOR_DRAW,)
"""Present only in a campaign with a posterior."""

LAYER_THICKNESS = Variable("layer_thickness", _IN_LAYER, "m", "thickness of each layer")

LAYER_SCATTER = (
    LAYER_THICKNESS,
    Variable("layer_resistance", _IN_LAYER, "Pa", "resistance of each layer"),
    Variable("layer_shear_coefficient", _IN_LAYER, "1", "friction per normal stress of each layer"),
    Variable("layer_degradation", _IN_LAYER, "1", "share of the resistance left after contact, of each layer"),
    Variable("layer_offset_y", _IN_LAYER, "m", "place of the layer's origin in the plane of the plate, y"),
    Variable("layer_offset_z", _IN_LAYER, "m", "place of the layer's origin in the plane of the plate, z"),
)

SCATTER_VARIABLES = (RESISTANCE, SHEAR_COEFFICIENT, DEGRADATION, THICKNESS, MASS, STRENGTH, *LAYER_SCATTER)
"""Present only in a campaign in which they differ from shot to shot."""

# --- Bursts ---
SAMPLE = Variable("sample", _HIT, "1", "number of the plate that the shot hits")
BURST_ORDER = Variable("burst_order", _HIT, "1", "number of hits on that plate before")
NEAREST_EARLIER_HIT = Variable("nearest_earlier_hit", _HIT, "m", "distance from the nearest earlier hit on that plate")

BURST_VARIABLES = (SAMPLE, BURST_ORDER, NEAREST_EARLIER_HIT)
"""Present only in a campaign of bursts."""

# --- How the shot ended ---
STATUS = Variable("status", _HIT, "1", "how the shot ended", flags=Status)
RESIDUAL_VELOCITY = Variable("residual_velocity", _HIT, "m s-1", "residual velocity", shown_by=_MAIN)
DEFLECTION = Variable("deflection", _HIT, "degree", "angle between residual velocity and line of fire", shown_by=_MAIN)
ANGULAR_VELOCITY = Variable("angular_velocity", ("hit", "axis"), "rad s-1", "angular velocity at the end of contact")
ENERGY_LOSS = Variable("energy_loss", _HIT, "J", "kinetic energy lost in the target")
CONTACT_DURATION = Variable("contact_duration", _HIT, "s", "duration of contact")
TILT = Variable("tilt", _AT_STANDOFF, "degree", "angle between core axis and line of fire", shown_by=_MAIN)
PITCH = Variable("pitch", _AT_STANDOFF, "degree", "pitch of the core, projected into the x-z plane")
YAW = Variable("yaw", _AT_STANDOFF, "degree", "yaw of the core, projected into the x-y plane")
TOTAL_YAW = Variable("total_yaw", _AT_STANDOFF, "degree", "angle between core axis and residual velocity")

OUTCOME_VARIABLES = (
    STATUS,
    RESIDUAL_VELOCITY,
    DEFLECTION,
    ANGULAR_VELOCITY,
    ENERGY_LOSS,
    CONTACT_DURATION,
    TILT,
    PITCH,
    YAW,
    TOTAL_YAW,
)

_VECTOR = ("hit", "axis")
EXIT_VELOCITY = Variable("exit_velocity", _VECTOR, "m s-1", "velocity at the end of contact")
EXIT_AXIS = Variable("exit_axis", _VECTOR, "1", "unit vector along the core towards its nose at the end of contact")
EXIT_POSITION = Variable("exit_position", _VECTOR, "m", "centre of mass at the end of contact, in the plate frame")

EXIT_VARIABLES = (EXIT_VELOCITY, EXIT_AXIS, EXIT_POSITION)
"""Present unless `output.exit_state` is false. With `angular_velocity` they start a flight behind the plate."""


def _solid(variable: Variable) -> Variable:
    """The same variable for the solid plate of equal areal density."""
    return Variable(
        f"solid_{variable}",
        tuple("solid_hit" if dim == "hit" else dim for dim in variable.dims),
        variable.units,
        f"{variable.long_name}, solid plate of equal areal density",
        field=variable.field,
    )


SOLID_VARIABLES = {_solid(variable): variable for variable in (STATUS, RESIDUAL_VELOCITY, TILT)}
"""Outcomes of the first shots against the solid plate of equal areal density, each with the variable of the hits that
it corresponds to. There is one shot if the shots differ only in their hit points. Present only for a perforated plate
and with `output.solid_reference`."""

LARGEST_BENDING_MOMENT = Variable(
    "largest_bending_moment",
    _HIT,
    "N m",
    "largest bending moment in the rigid core",
    shown_by=("inspect", "plot"),
)
BENDING_SECTION = Variable("bending_section", _HIT, "m", "distance of its section from the nose")
BENDING_STRESS = Variable(
    "bending_stress", _HIT, "Pa", "largest nominal bending stress in the rigid core", shown_by=("inspect", "plot")
)
BENDING_STRESS_SECTION = Variable("bending_stress_section", _HIT, "m", "distance of its section from the nose")

BENDING_VARIABLES = (LARGEST_BENDING_MOMENT, BENDING_SECTION, BENDING_STRESS, BENDING_STRESS_SECTION)
"""Present only with `output.bending`."""

LAYER_STATUS = Variable("layer_status", _IN_LAYER, "1", "how the core ended in each layer", flags=LayerStatus)
LAYER_RESIDUAL_VELOCITY = Variable(
    "layer_residual_velocity", _IN_LAYER, "m s-1", "velocity when the last point of the core leaves the layer"
)
LAYER_TILT = Variable(
    "layer_tilt", _IN_LAYER, "degree", "angle between core axis and line of fire when its last point leaves the layer"
)
LAYER_TIME = Variable(
    "layer_time", _IN_LAYER, "s", "time when the last point of the core leaves the layer, since the first touch"
)
STOPPED_IN = Variable("stopped_in", _HIT, "1", "deepest layer that the core rests in; -1 where it does not rest in one")
DEPTH = Variable("depth", _HIT, "m", "how far behind the front face of that layer any point of the core came")

LAYER_VARIABLES = (LAYER_STATUS, LAYER_RESIDUAL_VELOCITY, LAYER_TILT, LAYER_TIME, STOPPED_IN, DEPTH)
"""Present only with layers behind the plate, which is layer 0."""

LAYER_STANDOFF = Variable("layer_standoff", ("layer_standoff",), "m", "distance behind the rear face of a layer")
LAYER_COORDINATES = (LAYER_STANDOFF,)
LAYER_DEFLECTION = Variable(
    "layer_deflection", _IN_LAYER, "degree", "angle between velocity and line of fire behind the layer"
)
LAYER_STANDOFF_TILT = Variable(
    "layer_standoff_tilt", _BEHIND_LAYER, "degree", "angle between core axis and line of fire behind the layer"
)
LAYER_STANDOFF_PITCH = Variable(
    "layer_standoff_pitch", _BEHIND_LAYER, "degree", "pitch of the core behind the layer, projected into the x-z plane"
)
LAYER_STANDOFF_YAW = Variable(
    "layer_standoff_yaw", _BEHIND_LAYER, "degree", "yaw of the core behind the layer, projected into the x-y plane"
)

LAYER_STANDOFF_VARIABLES = (LAYER_DEFLECTION, LAYER_STANDOFF_TILT, LAYER_STANDOFF_PITCH, LAYER_STANDOFF_YAW)
"""Present only with `output.layer_standoffs`, as LAYER_COORDINATES. No value where free flight ends at the next layer:
a stand-off and the size of the core are more than the gap."""

LAYER_FRONT = Variable("layer_front", ("layer",), "m", "front face of the layer, from that of the target")
LAYER_REAR = Variable("layer_rear", ("layer",), "m", "rear face of the layer, from the front face of the target")

LAYER_FACES = (LAYER_FRONT, LAYER_REAR)
"""Likewise; of the means where thicknesses scatter."""


BROKEN = Variable("broken", _HIT, "1", "1 where the bending stress passed the strength of the core, else 0")
BROKEN_TIME = Variable("broken_time", _HIT, "s", "when the core broke, since the first touch of the front face")
BROKEN_X = Variable("broken_x", _HIT, "m", "where the section that broke was, behind the front face")
BROKEN_SECTION = Variable("broken_section", _HIT, "m", "distance of the section that broke from the nose")

BROKEN_VARIABLES = (BROKEN, BROKEN_TIME, BROKEN_X, BROKEN_SECTION)
"""Present only for a core with a strength. A broken core goes on as one rigid body."""


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
        Variable(name, _HIT, units, long_name, field="value", shown_by=_MAIN),
        Variable(f"{name}_lower", _HIT, units, f"{long_name}, lower end", field="lower"),
        Variable(f"{name}_upper", _HIT, units, f"{long_name}, upper end", field="upper"),
        Variable("limit_runs", _HIT, "1", "how often the hit was computed", field="runs"),
        Variable("limit_converged", _HIT, "1", "whether the ends meet the tolerance, 1 or 0", field="converged"),
    )


LIMITS = {
    "velocity": _limit_variables("velocity", "m s-1", "limit velocity"),
    "thickness": _limit_variables("thickness", "m", "limit thickness of the plate"),
}
"""By the quantity of a search. Present only in a result of `warpimpact limit`, whose other variables are those of the
shot as it just perforates: at the end of its limit where the core passed."""
LIMIT_VARIABLES = tuple(variables.value for variables in LIMITS.values())

SOLID_LIMITS = {quantity: _solid(limit.value) for quantity, limit in LIMITS.items()}
"""Limits of the first shots at the solid plate of equal areal density, by the quantity of the search; one if all shots
are alike. Present only in a result of `warpimpact limit` with `output.solid_reference`."""
SOLID_LIMIT_VARIABLES = tuple(SOLID_LIMITS.values())

OUTLINE_Y = Variable("outline_y", ("vertex",), "m", "hole outlines in the unit cell, y, separated by NaN")
OUTLINE_Z = Variable("outline_z", ("vertex",), "m", "hole outlines in the unit cell, z, separated by NaN")

OUTLINE_VARIABLES = (OUTLINE_Y, OUTLINE_Z)

GROUPS = {"plate": OUTLINE_VARIABLES, "solid": (*SOLID_VARIABLES, *SOLID_LIMIT_VARIABLES)}
"""What is not along "hit" stands in groups of the file. In memory these are coordinates, which no choice of hits
spreads over the hits."""

VARIABLES = (*SHOT_VARIABLES, *OUTCOME_VARIABLES)
"""Present in every hit map."""
_OF_HITS = (*LIMIT_VARIABLES, *SHOT_VARIABLES, *OUTCOME_VARIABLES, *BENDING_VARIABLES, *BROKEN_VARIABLES)
HIT_NUMBERS = tuple(v for v in (*_OF_HITS, *LAYER_VARIABLES) if v.is_number_of_hit)
"""Variables of shots and outcomes with one number per hit, or one per hit and stand-off."""

LAYER_NUMBERS = (LAYER_RESIDUAL_VELOCITY, LAYER_TILT, LAYER_TIME, *LAYER_STANDOFF_VARIABLES)
"""Variables with one number per hit and layer, or one for each stand-off behind the layer."""

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

_IN_WINDOW = ("snapshot", "layer", "layer_row", "layer_column")
LAYER_CELL_Y = Variable("layer_cell_y", ("layer", "layer_row"), "m", "cell of the layer, y")
LAYER_CELL_Z = Variable("layer_cell_z", ("layer", "layer_column"), "m", "cell of the layer, z")
LAYER_RESISTANCE_SHARE = Variable(
    "layer_resistance_share", _IN_WINDOW, "1", "share of the resistance left in the layer; 0 in holes"
)

LAYER_FIELDS = (LAYER_CELL_Y, LAYER_CELL_Z, LAYER_RESISTANCE_SHARE)
"""Present only if the core reached a layer behind the plate that weakens. No value in a layer that does not, and beyond
the window of one whose window is smaller than that of another. Layer 0 has its own variables."""

LAYER_SECTIONS = (LAYER_SOLID_ALONG_Y, LAYER_SOLID_ALONG_Z)
"""Present only with layers behind the plate, as LAYER_FACES, which are those of the hit here."""

HISTORY_VARIABLES = (
    POSITION,
    PLATE_POSITION,
    ATTITUDE,
    CORE_AXIS,
    VELOCITY,
    MARCHED_ANGULAR_VELOCITY,
    FORCE,
    MOMENT,
    TRANSLATIONAL_ENERGY,
    ROTATIONAL_ENERGY,
    RESISTANCE_SHARE,
    CORE_RADIUS,
    SOLID_ALONG_Y,
    SOLID_ALONG_Z,
)
RESIDUAL_ANGULAR_VELOCITY = "residual_angular_velocity"
"""Name of the outcome's angular velocity in a history. Its own name belongs to the motion there."""

# By the axis y or z of the plate frame.
HIT_POINT = {"y": HIT_Y, "z": HIT_Z}
OUTLINE = {"y": OUTLINE_Y, "z": OUTLINE_Z}
CELL = {"y": CELL_Y, "z": CELL_Z}
LAYER_SOLID_ALONG = {"y": LAYER_SOLID_ALONG_Y, "z": LAYER_SOLID_ALONG_Z}
SOLID_ALONG = {"y": SOLID_ALONG_Y, "z": SOLID_ALONG_Z}

# --- Study of speed and accuracy; some names also occur in a hit map, with another meaning ---
SETTING = Variable("setting", ("setting",), "1", "numerics under study")
QUANTILE = Variable("quantile", ("quantile",), "1", "share of the hits with at most this error")
STUDY_LEVEL = Variable("level", ("level",), "1", "level of refinement behind the converged answer")

STUDY_COORDINATES = (SETTING, QUANTILE, STUDY_LEVEL, STANDOFF, HIT_Y, HIT_Z)

_SETTING = ("setting",)
SCHEME = Variable("scheme", _SETTING, "1", "scheme")
PATCHES_AXIAL = Variable("patches_axial", _SETTING, "1", "surface patches along the core")
PATCHES_AROUND = Variable("patches_around", _SETTING, "1", "surface patches around the core")
GRID_SPACING = Variable("grid_spacing", _SETTING, "m", "spacing of the plate grid")
TIME_STEP = Variable("time_step", _SETTING, "s", "time step at impact velocity")
HITS_PER_SECOND = Variable("hits_per_second", _SETTING, "s-1", "hits computed per second")
OTHER_STATUS = Variable("other_status", _SETTING, "1", "hits whose status differs from the converged answer")
SETTLED = Variable("settled", _HIT, "1", "1 where the hit ends with the same status on all levels")
CONVERGED_STATUS = Variable("status", _HIT, "1", "how the shot ended, converged", flags=Status)
CONVERGED_VELOCITY = Variable("residual_velocity", _HIT, "m s-1", "residual velocity, converged")
CONVERGED_TILT = Variable("tilt", _AT_STANDOFF, "degree", "angle between core axis and line of fire, converged")

ERRORS = {
    RESIDUAL_VELOCITY: Variable(
        "residual_velocity_error", ("setting", "quantile"), "m s-1", "error of the residual velocity"
    ),
    TILT: Variable("tilt_error", ("setting", "quantile", "standoff"), "degree", "error of the tilt"),
}
"""By the two quantities of a study, as the following tables."""
FRONTS = {
    RESIDUAL_VELOCITY: Variable(
        "residual_velocity_front", _SETTING, "1", "1 where no faster setting has a smaller 90 % error"
    ),
    TILT: Variable("tilt_front", _SETTING, "1", "1 where no faster setting has a smaller 90 % error, last stand-off"),
}
CHANGES = {
    RESIDUAL_VELOCITY: Variable(
        "residual_velocity_change",
        ("level", "quantile"),
        "m s-1",
        "change of the residual velocity from the level before",
    ),
    TILT: Variable(
        "tilt_change", ("level", "quantile", "standoff"), "degree", "change of the tilt from the level before"
    ),
}
UNCERTAINTIES = {
    RESIDUAL_VELOCITY: Variable("residual_velocity_uncertainty", _HIT, "m s-1", "velocity change on the last level"),
    TILT: Variable("tilt_uncertainty", _AT_STANDOFF, "degree", "tilt change on the last level"),
}

STUDY_VARIABLES = (
    SCHEME,
    PATCHES_AXIAL,
    PATCHES_AROUND,
    GRID_SPACING,
    TIME_STEP,
    HITS_PER_SECOND,
    *ERRORS.values(),
    OTHER_STATUS,
    *FRONTS.values(),
    *CHANGES.values(),
    SETTLED,
    CONVERGED_STATUS,
    CONVERGED_VELOCITY,
    UNCERTAINTIES[RESIDUAL_VELOCITY],
    CONVERGED_TILT,
    UNCERTAINTIES[TILT],
)


def shown_by(command: str) -> tuple[Variable, ...]:
    """The variables of a hit map that a command shows by default."""
    return tuple(variable for variable in HIT_NUMBERS if command in variable.shown_by)


def shot_variables(dataset: xarray.Dataset) -> list[Variable]:
    """Names of the variables of the impact, of plate and core where they differ, and of bursts; no hit points."""
    return [*SHOT_VARIABLES, *(name for name in (*SCATTER_VARIABLES, *BURST_VARIABLES) if name in dataset)]


def outcome_variables(dataset: xarray.Dataset) -> list[Variable]:
    """Names of the variables that say how the shots ended."""
    optional = (*EXIT_VARIABLES, *BENDING_VARIABLES, *BROKEN_VARIABLES, *LAYER_VARIABLES, *LAYER_STANDOFF_VARIABLES)
    return [*OUTCOME_VARIABLES, *(name for name in optional if name in dataset)]
