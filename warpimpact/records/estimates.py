"""Estimated errors of a computation to a tolerance (solver/refinement.py), which fills them."""

from __future__ import annotations

from warpimpact.records.group import Group
from warpimpact.records.variable import AT_STANDOFF, HITS, Variable

RESIDUAL_VELOCITY_ERROR = Variable("residual_velocity_error", HITS, "m s-1", "estimated error of the residual velocity")
TILT_ERROR = Variable("tilt_error", AT_STANDOFF, "degree", "estimated error of the tilt")
CONVERGED = Variable("converged", HITS, "1", "whether the estimated errors meet the tolerance, 1 or 0")
LEVEL = Variable("level", HITS, "1", "level of resolution on which the hit was computed")

ESTIMATE_VARIABLES = Group("With a tolerance", (RESIDUAL_VELOCITY_ERROR, TILT_ERROR, CONVERGED, LEVEL), measured=False)
