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

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import Json

from warpimpact.results import attributes as attr
from warpimpact.results.declared import Declaration, Finite, Number, Size, Text, finite, not_negative, numbers, texts
from warpimpact.results.kind import Kind
from warpimpact.scene.toml_text import parsed_json

if TYPE_CHECKING:
    import xarray

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
EFFECTIVE = attr.EFFECTIVE
PARETO_K = "pareto_k"
CONVERGED = "converged"
HIT_NOISE = "hit_noise"
EVIDENCE = "log_evidence"
SETS = "computed_sets"
WANTED = "wanted_sample_size"
ROW_PROBABILITY = "row_probability"
"""JSON: for every shot, the share of simulated rows that are less probable than its own row."""

_DRAWS, _SHOTS, _OBSERVED = ("chain", "draw"), ("shot",), ("observation",)
_OF_A_POSTERIOR: Mapping[str, Mapping[str, tuple[str, ...]]] = {
    "posterior": {**dict.fromkeys(HITS, _DRAWS + _SHOTS)},
    "best": {"misfit": _SHOTS, **dict.fromkeys(HITS, _SHOTS)},
    "observed_data": {MEASURED: _OBSERVED, STD: _OBSERVED},
    "posterior_predictive": {MEASURED: _DRAWS + _OBSERVED, FITTED: _DRAWS + _OBSERVED},
}
"""Numbers of a posterior beside its parameters, by group, and their dimensions."""
_MAY_LACK = {"best": ("misfit",), "posterior_predictive": (MEASURED, FITTED)}
"""Numbers that are NaN where a core does not come through, by group."""
_OF_A_PARAMETER = {"prior": _DRAWS, "posterior": _DRAWS, "sets": ("set",), "best": ()}


_ATTRIBUTES: Mapping[str, Any] = {
    **dict.fromkeys((attr.TITLE, attr.HISTORY, attr.DEVICE, attr.WARPIMPACT_VERSION, FIT_TEXT), Text),
    **dict.fromkeys((EFFECTIVE, WANTED), Finite),
    **dict.fromkeys((PARETO_K, HIT_NOISE), Number),
    **dict.fromkeys((CONVERGED, SETS), Size),
    ROW_PROBABILITY: Json[dict[str, Number]],
}


def _fault(tree: xarray.DataTree) -> str | None:
    """What keeps a tree from being a posterior, as a phrase; None if nothing does."""
    if missing := [name for name in GROUPS if name not in tree.children]:
        return f'it has no group "{missing[0]}"'
    if fault := Declaration({}, attributes=_ATTRIBUTES).fault(tree.to_dataset()):
        return fault
    datasets = {name: tree[name].to_dataset() for name in GROUPS}
    parameters = list(datasets["prior"].data_vars)
    for name, dataset in datasets.items():
        if fault := _declared(name, parameters, datasets).fault(dataset):
            return f'in its group "{name}" {fault}'
    return next((fault for name in parameters if (fault := _path_fault(datasets["posterior"][name]))), None)


def _declared(group: str, parameters: Sequence[Any], datasets: Mapping[str, xarray.Dataset]) -> Declaration:
    """The declaration of a group: the parameters with their dimensions in it, and the numbers beside them."""
    variables = dict.fromkeys(map(str, parameters), _OF_A_PARAMETER[group]) if group in _OF_A_PARAMETER else {}
    variables |= _OF_A_POSTERIOR.get(group, {})
    if not datasets["observed_data"].data_vars:  # only limits, or statuses, were measured
        variables = {name: dims for name, dims in variables.items() if _OBSERVED[0] not in dims}
    along = {dim: (dim,) for dims in variables.values() for dim in dims if dim in (*_SHOTS, *_OBSERVED)}
    rules = {name: numbers if name in _MAY_LACK.get(group, ()) else _some for name in variables}
    rules |= {STD: not_negative} if group == "observed_data" else {}
    return Declaration(variables | along, rules=rules | dict.fromkeys(along, texts))


def _some(values: np.ndarray[Any, Any], sizes: Mapping[str, int]) -> bool:
    return values.size > 0 and finite(values, sizes)


def _path_fault(parameter: xarray.DataArray) -> str | None:
    path = parsed_json(parameter.attrs.get(PATH))
    is_path = isinstance(path, list) and all(isinstance(step, str | int) for step in path)
    return None if is_path else f'its parameter "{parameter.name}" has no path as it should'


POSTERIOR = Kind(
    "a posterior",
    "warpimpact report takes it",
    ("posterior", EFFECTIVE),
    maker="warpimpact identify",
    fault=_fault,
    is_tree=True,
)
