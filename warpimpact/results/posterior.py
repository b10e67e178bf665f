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

from pathlib import Path
from typing import TYPE_CHECKING

import netCDF4

from warpimpact.results import attributes as attr
from warpimpact.results.checks import draws_fault, posterior_fault
from warpimpact.results.files import ResultError, aside
from warpimpact.results.interrupts import uninterrupted

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
EFFECTIVE = "effective_sample_size"
PARETO_K = "pareto_k"
CONVERGED = "converged"
HIT_NOISE = "hit_noise"
EVIDENCE = "log_evidence"
SETS = "computed_sets"


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
    untold = [name for name in (attr.WARPIMPACT_VERSION, FIT, MATERIAL) if name not in loaded.attrs]
    if missing or untold:
        what = f'group "{missing[0]}"' if missing else f'attribute "{untold[0]}"'
        raise ResultError(f"{path}: not a posterior of warpimpact identify, it has no {what}")
    groups = {name: loaded[name].to_dataset() for name in GROUPS}
    if draws_alone:
        found = draws_fault(groups["posterior"].drop_vars(HITS, errors="ignore"), loaded.attrs)
    else:
        found = posterior_fault(groups, loaded.attrs)
    if found:
        raise ResultError(f"{path}: not a posterior of warpimpact identify, or damaged: {found}")
    return loaded


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
