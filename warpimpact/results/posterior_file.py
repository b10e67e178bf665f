"""The file of a posterior: a tree of Datasets with the groups that ArviZ reads.

posterior, prior          draws of the parameters, along chain and draw; the posterior has the hit of every shot, too
sample_stats              ln of the likelihood and the misfit of every draw
log_likelihood            of every draw and shot
observed_data             what was measured
posterior_predictive      what another shot like each would show; `fitted` is what the draw computes for this very shot
sets                      all sets of parameters that were computed, with their weights
best                      the set of smallest misfit
"""

from __future__ import annotations

GROUPS = (
    "posterior",
    "prior",
    "sample_stats",
    "log_likelihood",
    "observed_data",
    "posterior_predictive",
    "sets",
    "best",
)
HITS = ("hit_y", "hit_z")
"""Variables of the posterior that are not parameters."""
MEASURED, STD, FITTED = "measured", "std", "fitted"
UNITS_OF = "units_of_observation"
SHOT_OF = "shot_of_observation"
PATH = "path"
"""Attribute of a parameter: its key in the scene, as JSON."""

FIT_TEXT = "fit"
EFFECTIVE = "effective_sample_size"
PARETO_K = "pareto_k"
CONVERGED = "converged"
HIT_NOISE = "hit_noise"
EVIDENCE = "log_evidence"
SETS = "computed_sets"
WANTED = "wanted_sample_size"
ROW_PROBABILITY = "row_probability"
"""JSON: for every shot, the share of simulated rows that are less probable than its own row."""
