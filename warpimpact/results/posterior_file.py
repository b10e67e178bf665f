"""Names in the file of a posterior (identification/identify.py makes it): variables, and attributes."""

from __future__ import annotations

LOG_LIKELIHOOD, MISFIT = "log_likelihood", "misfit"
HITS = ("hit_y", "hit_z")

# --- Attributes of a parameter ---
PATH = "path"
"""Its key in the scene, as JSON."""
PRIOR = "prior"
"""Evenly spaced quantiles of its prior."""
EFFECTIVE, R_HAT = "effective_sample_size", "r_hat"
VERDICT = "verdict"

# --- Global attributes ---
FIT_TEXT = "fit"
SETS = "computed_sets"
WANTED = "wanted_sample_size"
HIT_NOISE = "hit_noise"
CONVERGED, INTERRUPTED = "converged", "interrupted"
