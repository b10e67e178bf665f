"""The variables of the Datasets: the one place that knows their names, dimensions, units and meanings."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    import xarray


class Variable(NamedTuple):
    """What the Dataset says about one of its variables."""

    dims: tuple[str, ...]
    units: str
    long_name: str


COORDINATES = {
    "hit_y": Variable(("hit",), "m", "hit point on the front face, y"),
    "hit_z": Variable(("hit",), "m", "hit point on the front face, z"),
    "standoff": Variable(("standoff",), "m", "distance behind the rear face"),
    "axis": Variable(("axis",), "1", "axis of the plate frame"),
}

SHOT_VARIABLES = {
    "impact_velocity": Variable(("hit",), "m s-1", "impact velocity"),
    "obliquity": Variable(("hit",), "degree", "angle between line of fire and plate normal"),
    "azimuth": Variable(("hit",), "degree", "direction of the obliquity, from +y towards +z"),
    "impact_pitch": Variable(("hit",), "degree", "pitch of the core on impact, relative to the line of fire"),
    "impact_yaw": Variable(("hit",), "degree", "yaw of the core on impact, relative to the line of fire"),
    "spin": Variable(("hit",), "rad s-1", "spin of the core about its axis on impact"),
}

SCATTER_VARIABLES = {
    "resistance": Variable(("hit",), "Pa", "resistance of the plate"),
    "shear_coefficient": Variable(("hit",), "1", "friction per normal stress"),
    "degradation": Variable(("hit",), "1", "share of the resistance left after an interval of contact"),
    "thickness": Variable(("hit",), "m", "thickness of the plate"),
    "mass": Variable(("hit",), "kg", "mass of the core"),
}
"""Only of a campaign in which they differ from shot to shot."""

OUTCOME_VARIABLES = {
    "status": Variable(("hit",), "1", "how the shot ended"),
    "residual_velocity": Variable(("hit",), "m s-1", "residual velocity"),
    "deflection": Variable(("hit",), "degree", "angle between residual velocity and line of fire"),
    "angular_velocity": Variable(("hit", "axis"), "rad s-1", "residual angular velocity"),
    "energy_loss": Variable(("hit",), "J", "kinetic energy lost in the plate"),
    "contact_duration": Variable(("hit",), "s", "duration of contact"),
    "tilt": Variable(("hit", "standoff"), "degree", "angle between core axis and line of fire"),
    "pitch": Variable(("hit", "standoff"), "degree", "pitch of the core, projected into the x-z plane"),
    "yaw": Variable(("hit", "standoff"), "degree", "yaw of the core, projected into the x-y plane"),
    "total_yaw": Variable(("hit", "standoff"), "degree", "angle between core axis and residual velocity"),
}

SOLID_VARIABLES = {
    f"solid_{name}": Variable(
        tuple("solid_hit" if dim == "hit" else dim for dim in OUTCOME_VARIABLES[name].dims),
        OUTCOME_VARIABLES[name].units,
        f"{OUTCOME_VARIABLES[name].long_name}, solid plate of equal areal density",
    )
    for name in ("status", "residual_velocity", "tilt")
}
"""What the solid plate of equal areal density makes of the first shots; of the first one alone where no two differ but
in where they hit. Only of a perforated plate, where `output.solid_reference` asks for it."""

BENDING_VARIABLES = {
    "largest_bending_moment": Variable(("hit",), "N m", "largest bending moment in the rigid core"),
    "bending_section": Variable(("hit",), "m", "distance of its section from the nose"),
    "bending_stress": Variable(("hit",), "Pa", "largest nominal bending stress in the rigid core"),
    "bending_stress_section": Variable(("hit",), "m", "distance of its section from the nose"),
}
"""Only of a campaign with output.bending."""

ESTIMATE_VARIABLES = {
    "residual_velocity_error": Variable(("hit",), "m s-1", "estimated error of the residual velocity"),
    "tilt_error": Variable(("hit", "standoff"), "degree", "estimated error of the tilt"),
    "converged": Variable(("hit",), "1", "whether the estimated errors meet the tolerance, 1 or 0"),
    "level": Variable(("hit",), "1", "level of resolution on which the hit was computed"),
}
"""Only of a run to a tolerance."""

OUTLINE_VARIABLES = {
    "outline_y": Variable(("vertex",), "m", "hole outlines in the unit cell, y, separated by NaN"),
    "outline_z": Variable(("vertex",), "m", "hole outlines in the unit cell, z, separated by NaN"),
}

VARIABLES = SHOT_VARIABLES | OUTCOME_VARIABLES | OUTLINE_VARIABLES

HISTORY_COORDINATES = {
    "time": Variable(("time",), "s", "time since the first touch of the front face"),
    "quaternion": Variable(("quaternion",), "1", "component of a quaternion, w its scalar part"),
    "snapshot": Variable(("snapshot",), "s", "time at which the plate is shown"),
    "cell_y": Variable(("cell_y",), "m", "cell of the plate, y"),
    "cell_z": Variable(("cell_z",), "m", "cell of the plate, z"),
    "section": Variable(("section",), "m", "distance from the hit point in the plate"),
    "station": Variable(("station",), "m", "distance along the core, from its centre of mass towards the nose"),
}

HISTORY_VARIABLES = {
    "position": Variable(("time", "axis"), "m", "centre of mass, from the hit point"),
    "plate_position": Variable(("time", "axis"), "m", "centre of mass in the plate"),
    "attitude": Variable(("time", "quaternion"), "1", "turn of the plate's axes into the core's, x towards its nose"),
    "core_axis": Variable(("time", "axis"), "1", "unit vector along the core towards its nose"),
    "velocity": Variable(("time", "axis"), "m s-1", "velocity of the centre of mass"),
    "angular_velocity": Variable(("time", "axis"), "rad s-1", "angular velocity"),
    "force": Variable(("time", "axis"), "N", "force on the core, mean over the step"),
    "moment": Variable(("time", "axis"), "N m", "moment about the centre of mass, mean over the step"),
    "translational_energy": Variable(("time",), "J", "kinetic energy of translation"),
    "rotational_energy": Variable(("time",), "J", "kinetic energy of rotation"),
    "resistance_share": Variable(("snapshot", "cell_y", "cell_z"), "1", "share of the resistance left; 0 in holes"),
    "core_radius": Variable(("station",), "m", "radius of the core"),
    "solid_along_y": Variable(("section",), "1", "1 where the plate is solid along y through the hit point, else 0"),
    "solid_along_z": Variable(("section",), "1", "1 where the plate is solid along z through the hit point, else 0"),
}

STUDY_COORDINATES = {
    "setting": Variable(("setting",), "1", "numerics under study"),
    "quantile": Variable(("quantile",), "1", "share of the hits with at most this error"),
    "level": Variable(("level",), "1", "level of refinement behind the converged answer"),
} | {name: COORDINATES[name] for name in ("standoff", "hit_y", "hit_z")}

STUDY_VARIABLES = {
    "scheme": Variable(("setting",), "1", "scheme"),
    "patches_axial": Variable(("setting",), "1", "surface patches along the core"),
    "patches_around": Variable(("setting",), "1", "surface patches around the core"),
    "grid_spacing": Variable(("setting",), "m", "spacing of the plate grid"),
    "time_step": Variable(("setting",), "s", "time step at impact velocity"),
    "hits_per_second": Variable(("setting",), "s-1", "hits computed per second"),
    "residual_velocity_error": Variable(("setting", "quantile"), "m s-1", "error of the residual velocity"),
    "tilt_error": Variable(("setting", "quantile", "standoff"), "degree", "error of the tilt"),
    "other_status": Variable(("setting",), "1", "hits that end otherwise than the converged answer"),
    "residual_velocity_front": Variable(("setting",), "1", "1 where no faster setting has a smaller 90 % error"),
    "tilt_front": Variable(("setting",), "1", "1 where no faster setting has a smaller 90 % error, last stand-off"),
    "residual_velocity_change": Variable(
        ("level", "quantile"), "m s-1", "change of the residual velocity from the level before"
    ),
    "tilt_change": Variable(("level", "quantile", "standoff"), "degree", "change of the tilt from the level before"),
    "settled": Variable(("hit",), "1", "1 where the hit ends with the same status on all levels"),
    "status": Variable(("hit",), "1", "how the shot ended, converged"),
    "residual_velocity": Variable(("hit",), "m s-1", "residual velocity, converged"),
    "residual_velocity_uncertainty": Variable(("hit",), "m s-1", "change of it on the last level"),
    "tilt": Variable(("hit", "standoff"), "degree", "angle between core axis and line of fire, converged"),
    "tilt_uncertainty": Variable(("hit", "standoff"), "degree", "change of it on the last level"),
}


def shot_variables(dataset: xarray.Dataset) -> list[str]:
    """Names of the variables that say how the cores came and what they hit, but for where."""
    return [*SHOT_VARIABLES, *(name for name in SCATTER_VARIABLES if name in dataset)]


def outcome_variables(dataset: xarray.Dataset) -> list[str]:
    """Names of the variables that say how the shots ended."""
    return [*OUTCOME_VARIABLES, *(name for name in BENDING_VARIABLES if name in dataset)]
