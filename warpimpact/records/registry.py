"""All variables that a computation records, in the order of a file, with the functions that fill them.

Limits are filled by the search of limits (solver/limit.py), and what a hit by finite elements says of itself by the
continuum. A core leaves a layer when its last point passes the rear face. A broken core goes on as one rigid body.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from warpimpact.kernels.status import OF_SHOTS, Status
from warpimpact.records.variable import (
    AT_STANDOFF,
    HITS,
    IN_LAYER,
    MAIN,
    VECTORS,
    Columns,
    Returned,
    Variable,
    VariableGroup,
    doubles,
)
from warpimpact.scene import Scene, Shots

STATUS = Variable("status", HITS, "1", "how the shot ended", flags=OF_SHOTS)
PERFORATED = Variable("perforated", HITS, "1", "whether the core came through: it perforated, or touched nothing")
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

_OF_FLIGHT = (
    *(RESIDUAL_VELOCITY, DEFLECTION, ANGULAR_VELOCITY, ENERGY_LOSS, CONTACT_DURATION),
    *(TILT, PITCH, YAW, TOTAL_YAW),
)


def _ends(returned: Returned) -> Columns:
    return {STATUS: returned.status} | {name: doubles(getattr(returned.flight, name.field)) for name in _OF_FLIGHT}


def _exits(returned: Returned) -> Columns:
    """State at the end of contact: NaN if the computation failed. The velocity of an arrested core is 0."""
    arrested, contact = (returned.status == Status.ARRESTED)[:, None], returned.contact
    state = {
        EXIT_VELOCITY: np.where(arrested, 0.0, doubles(contact.velocity)),
        EXIT_AXIS: doubles(contact.axis),
        EXIT_POSITION: doubles(contact.position),
    }
    return {name: np.where(returned.failed[:, None], np.nan, values) for name, values in state.items()}


OUTCOME_VARIABLES = VariableGroup(
    "How the shot ended", (STATUS, PERFORATED, *_OF_FLIGHT), lambda scene, shots: True, _ends
)
EXIT_VARIABLES = VariableGroup(
    "At the end of contact", (EXIT_VELOCITY, EXIT_AXIS, EXIT_POSITION), lambda scene, shots: True, _exits
)
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


def _bent(returned: Returned) -> Columns:
    """Columns of the bending: 0 without a section if the core touched nothing, NaN if the computation failed."""
    largest = returned.bending
    columns = {
        LARGEST_BENDING_MOMENT: largest["moment"],
        BENDING_SECTION: np.where(largest["moment"] > 0.0, largest["moment_station"], np.nan),
        BENDING_STRESS: largest["stress"],
        BENDING_STRESS_SECTION: np.where(largest["stress"] > 0.0, largest["stress_station"], np.nan),
    }
    return {name: np.where(returned.failed, np.nan, values).astype(np.float64) for name, values in columns.items()}


def _breaks(scene: Scene, shots: Shots) -> bool:
    return scene.record.bending and (scene.core.strength is not None or shots.strength is not None)


def _broken(returned: Returned) -> Columns:
    """Columns of the break: NaN if the computation failed. The time is the middle of a step."""
    bending, failed = returned.bending, returned.failed
    unbroken = failed | (bending["broken"] == 0)
    columns = {BROKEN: np.where(failed, np.nan, bending["broken"]).astype(np.float64)}
    for variable in (BROKEN_TIME, BROKEN_X, BROKEN_SECTION):
        columns[variable] = np.where(unbroken, np.nan, bending[variable.field]).astype(np.float64)
    return columns


BENDING_VARIABLES = VariableGroup(
    "With `output.bending`",
    (LARGEST_BENDING_MOMENT, BENDING_SECTION, BENDING_STRESS, BENDING_STRESS_SECTION),
    lambda scene, shots: scene.record.bending,
    _bent,
)
"""The stress is 4M/(πr³) where the core is thick enough (solver/rings.py)."""
BROKEN_VARIABLES = VariableGroup(
    "With `core.strength`", (BROKEN, BROKEN_TIME, BROKEN_X, BROKEN_SECTION), _breaks, _broken
)

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
_CODES = (LAYER_STATUS, STOPPED_IN)


def _layered(scene: Scene, shots: Shots) -> bool:
    return len(scene.target.layers) > 1


def _columns(returned: Returned, group: VariableGroup) -> Columns:
    """Columns of a group from the struct of the same names."""
    arrays = {name: getattr(returned.passage, name.field.removeprefix("layer_")).numpy() for name in group}
    return {name: values.astype(np.int8 if name in _CODES else np.float64) for name, values in arrays.items()}


LAYER_VARIABLES: VariableGroup = VariableGroup(
    "With layers behind the plate",
    (LAYER_STATUS, LAYER_RESIDUAL_VELOCITY, LAYER_TILT, STOPPED_IN, DEPTH),
    _layered,
    lambda returned: _columns(returned, LAYER_VARIABLES),
    constants=LAYER_FACES,
)
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

LIMIT_RECORDS = tuple(
    VariableGroup(f"With `warpimpact limit --quantity {quantity}`", variables, measured=False, exact=True)
    for quantity, variables in LIMITS.items()
)


ENERGY_IMBALANCE = Variable(
    "energy_imbalance", HITS, "1", "energy that is missing or too much, as a share of what the core lost"
)
HOURGLASS_SHARE = Variable(
    "hourglass_share", HITS, "1", "share of the lost energy that the resistance against hourglasses took"
)
ERODED_ELEMENTS = Variable("eroded_elements", HITS, "1", "number of finite elements that failed")

CONTINUUM_VARIABLES = VariableGroup(
    "With `warpimpact continuum`", (ENERGY_IMBALANCE, HOURGLASS_SHARE, ERODED_ELEMENTS), measured=False
)


RECORDS: tuple[VariableGroup, ...] = (
    OUTCOME_VARIABLES,
    EXIT_VARIABLES,
    BENDING_VARIABLES,
    BROKEN_VARIABLES,
    LAYER_VARIABLES,
    *LIMIT_RECORDS,
    CONTINUUM_VARIABLES,
)


def variables() -> tuple[Variable, ...]:
    """The variables of all groups."""
    return tuple(dict.fromkeys(name for group in RECORDS for name in group))


def variable(name: str) -> Variable:
    """The variable of a column.

    Raises:
        KeyError: no group has it.
    """
    return {str(variable): variable for variable in variables()}[name]
