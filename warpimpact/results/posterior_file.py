"""The file of a posterior: a tree of Datasets with the groups that ArviZ reads, written whole or not at all.

posterior, prior          draws of the parameters, along chain and draw; the posterior has the hit of every shot, too
sample_stats              ln of the likelihood and the misfit of every draw
log_likelihood            of every draw and shot
observed_data             what was measured
posterior_predictive      what another such shot would show; `fitted` is what the draw computes for this very shot
sets                      all sets of parameters that were computed, with their weights
best                      the set of smallest misfit
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import netCDF4
import numpy as np

from warpimpact.results import attributes as attr
from warpimpact.results.checks import parsed_json
from warpimpact.results.files import ResultError, aside
from warpimpact.results.interrupts import uninterrupted
from warpimpact.scene.units import LARGEST

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
"""Variables of the posterior that are no parameters."""
MEASURED, STD, FITTED = "measured", "std", "fitted"
UNITS_OF = "units_of_observation"
SHOT_OF = "shot_of_observation"
PATH = "path"
"""Attribute of a parameter: its key in the scene, as JSON."""

FIT = "fit"
MATERIAL = "material"
"""What the material had in the fit, the parameters at their medians: JSON of the tables plate and interaction."""
EFFECTIVE = attr.EFFECTIVE
PARETO_K = "pareto_k"
CONVERGED = "converged"
HIT_NOISE = "hit_noise"
EVIDENCE = "log_evidence"
SETS = "computed_sets"
WANTED = "wanted_sample_size"
ROW_PROBABILITY = "row_probability"
"""JSON: of every shot the share of rows of another such shot that are less probable than its own."""

_DRAWS, _SHOTS, _OBSERVED = ("chain", "draw"), ("shot",), ("observation",)
_OF_A_POSTERIOR: Mapping[str, Mapping[str, tuple[str, ...]]] = {
    "posterior": {**dict.fromkeys(HITS, _DRAWS + _SHOTS)},
    "best": {"misfit": _SHOTS, **dict.fromkeys(HITS, _SHOTS)},
    "observed_data": {MEASURED: _OBSERVED, STD: _OBSERVED},
    "posterior_predictive": {MEASURED: _DRAWS + _OBSERVED, FITTED: _DRAWS + _OBSERVED},
}
"""Numbers of a posterior beside its parameters, by group, and what they are along."""
_MAY_LACK = (("best", "misfit"), ("posterior_predictive", MEASURED), ("posterior_predictive", FITTED))
"""NaN where a core does not come through."""
_OF_A_PARAMETER = {"prior": _DRAWS, "posterior": _DRAWS, "sets": ("set",), "best": ()}
_OF_A_REPORT = (attr.TITLE, attr.HISTORY, attr.DEVICE)
_NUMBERS = (EFFECTIVE, PARETO_K, HIT_NOISE, CONVERGED, WANTED, SETS)


def write(tree: xarray.DataTree, path: Path) -> None:
    """Write a posterior; an existing file is replaced.

    Raises:
        OutputError: it cannot be written; what was there before is untouched.
    """
    with uninterrupted(), aside(path) as file:
        tree.to_netcdf(file, engine="netcdf4", format="NETCDF4")


def read(path: Path, *, draws_alone: bool = False) -> xarray.DataTree:
    """Read a posterior into memory.

    Args:
        draws_alone: whether its draws are all that is needed of it.

    Raises:
        ResultError: the file is missing, is not netCDF, or is no posterior.
    """
    if not path.is_file():
        raise ResultError(f"{path}: cannot be read (it {'is no file' if path.exists() else 'is not there'})")
    try:
        with uninterrupted():
            loaded = _loaded(path)
    except Exception as error:  # a file that was altered leads xarray into errors of any class
        raise ResultError(f"{path}: cannot be read as a netCDF file ({str(error)[:200]})") from error
    missing = [name for name in GROUPS if name not in loaded.children]
    wanted = [attr.WARPIMPACT_VERSION, FIT, MATERIAL, *([] if draws_alone else _OF_A_REPORT)]
    untold = [name for name in wanted if name not in loaded.attrs]
    if missing or untold:
        what = f'group "{missing[0]}"' if missing else f'attribute "{untold[0]}"'
        raise ResultError(f"{path}: not a posterior of warpimpact identify, it has no {what}")
    groups = {name: loaded[name].to_dataset() for name in GROUPS}
    if draws_alone:
        found = _draws_fault(groups["posterior"].drop_vars(HITS, errors="ignore"), loaded.attrs)
    else:
        found = _fault(groups, loaded.attrs)
    if found:
        raise ResultError(f"{path}: not a posterior of warpimpact identify, or damaged: {found}")
    return loaded


def _fault(groups: Mapping[str, xarray.Dataset], attributes: Mapping[Any, Any]) -> str | None:
    """What keeps the groups of a posterior from being one, as a phrase; None if nothing does.

    Args:
        attributes: global attributes.
    """
    parameters = [str(name) for name in groups["prior"].data_vars]
    wanted = [(group, name, dims) for name in parameters for group, dims in _OF_A_PARAMETER.items()]
    wanted += [(group, name, dims) for group, names in _OF_A_POSTERIOR.items() for name, dims in names.items()]
    if not groups["observed_data"].data_vars:  # of limits and of how shots ended alone
        wanted = [one for one in wanted if _OBSERVED[0] not in one[2]]
    for group, name, dims in wanted:
        array = groups[group].variables.get(name)
        if array is None or array.dims != dims or array.dtype.kind not in "iuf" or not array.size:
            return f'its group "{group}" has no numbers "{name}" along {dims}'
        if (group, name) not in _MAY_LACK and not (np.abs(array.values) <= LARGEST).all():
            return f'its group "{group}" has a number "{name}" that is not finite, or is more than {LARGEST:g}'
        if set(dims) & {*_SHOTS, *_OBSERVED} - groups[group].coords.keys():
            return f'its group "{group}" does not name what "{name}" is along'
    for name in _NUMBERS:
        if not isinstance(attributes.get(name), int | float | np.number):
            return f'its attribute "{name}" is no number'
    if not math.isfinite(attributes[WANTED]):
        return f'its attribute "{WANTED}" is not finite'
    shares = parsed_json(attributes.get(ROW_PROBABILITY))
    if not isinstance(shares, dict) or not all(isinstance(one, int | float) for one in shares.values()):
        return f'its attribute "{ROW_PROBABILITY}" is not what it should be'
    return _draws_fault(groups["posterior"][parameters], attributes)


def _draws_fault(draws: xarray.Dataset, attributes: Mapping[Any, Any]) -> str | None:
    """What keeps the draws of parameters from being drawn from, as a phrase; None if nothing does.

    Args:
        attributes: global attributes of the posterior.
    """
    for name, array in draws.data_vars.items():
        if array.dims != _DRAWS or array.dtype.kind not in "iuf" or not array.size:
            return f'its group "posterior" has no numbers "{name}" along {_DRAWS}'
        if not isinstance(parsed_json(array.attrs.get(PATH)), list):
            return f'its parameter "{name}" has no path as it should'
    material = parsed_json(attributes.get(MATERIAL))
    tables = material if isinstance(material, dict) else {}
    if not all(isinstance(tables.get(one), dict) for one in ("plate", "interaction")):
        return f'its attribute "{MATERIAL}" is not what it should be'
    return None


def _loaded(path: Path) -> xarray.DataTree:
    """The groups in memory, read one after the other.

    Each is closed before the next one opens. A tree that stays open is closed when Python collects it, in the middle of
    another access, which crashes netCDF.
    """
    import xarray

    with netCDF4.Dataset(path) as file:
        names = list(file.groups)
    groups = {name: xarray.load_dataset(path, group=name, engine="netcdf4") for name in names}
    return xarray.DataTree.from_dict({"/": xarray.load_dataset(path, engine="netcdf4"), **groups})


def is_posterior(path: Path) -> bool:
    """Whether a file says that it is a posterior."""
    try:
        with netCDF4.Dataset(path) as file:
            return "posterior" in file.groups
    except OSError:
        return False
