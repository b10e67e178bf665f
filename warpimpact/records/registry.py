"""All variables that a computation records, in the order of a file; outcomes.py fills them.

Limits are filled by the search of limits (solver/limit.py), and what a hit by finite elements says of itself by the
continuum. A core leaves a layer when its last point passes the rear face. A broken core goes on as one rigid body.
"""

from __future__ import annotations

from typing import NamedTuple

from warpimpact.kernels.status import OF_SHOTS, Status
from warpimpact.records.variable import AT_STANDOFF, HITS, IN_LAYER, MAIN, VECTORS, Variable

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
BROKEN = Variable("broken", HITS, "1", "1 where the bending stress passed the strength of the core, else 0")
BROKEN_TIME = Variable("broken_time", HITS, "s", "when the core broke, since the first touch of the front face")
BROKEN_X = Variable("broken_x", HITS, "m", "where the section that broke was, behind the front face")
BROKEN_SECTION = Variable(
    "broken_section", HITS, "m", "distance of the section that broke from the nose", field="broken_station"
)


BENDING_VARIABLES = (LARGEST_BENDING_MOMENT, BENDING_SECTION, BENDING_STRESS, BENDING_STRESS_SECTION)
"""The stress is 4M/(πr³) where the core is thick enough (solver/rings.py)."""
BROKEN_VARIABLES = (BROKEN, BROKEN_TIME, BROKEN_X, BROKEN_SECTION)

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
DEPTH = Variable("depth", HITS, "m", "how far the core came behind the front face of that layer, at most its thickness")

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

RECORDS: dict[str, tuple[Variable, ...]] = {
    "How the shot ended": OUTCOME_VARIABLES,
    "At the end of contact": EXIT_VARIABLES,
    "With `output.bending`": BENDING_VARIABLES,
    "With `core.strength`": BROKEN_VARIABLES,
    "With layers behind the plate": (*LAYER_VARIABLES, *LAYER_FACES),
    **{f"With `warpimpact limit --quantity {quantity}`": variables for quantity, variables in LIMITS.items()},
    "With `warpimpact continuum`": (ENERGY_IMBALANCE, HOURGLASS_SHARE, ERODED_ELEMENTS),
}
"""All variables, by the heading that says when they are recorded."""
EXACT = frozenset(variable for variables in LIMITS.values() for variable in variables) | {*LAYER_FACES}
"""Variables in double precision also where shots are computed in single precision."""


def variables() -> tuple[Variable, ...]:
    """The variables of all records."""
    return tuple(dict.fromkeys(name for record in RECORDS.values() for name in record))
