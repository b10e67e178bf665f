"""How the shot ended, and the state of the core at the end of contact."""

from __future__ import annotations

import numpy as np

from warpimpact.kernels.status import OF_SHOTS, Status
from warpimpact.records.variable import (
    AT_STANDOFF,
    HITS,
    MAIN,
    VECTORS,
    Columns,
    Returned,
    Variable,
    VariableGroup,
    doubles,
)

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
