"""What the hits of a result are: their numbers, which of them passed or failed, and the variables that they have."""

from __future__ import annotations

import numpy as np
import xarray
from numpy.typing import NDArray

from warpimpact.records import variables as v
from warpimpact.records.variables import failures, has_passed

SLICE = 2**18
"""Numbers of hits in memory at a time."""


def shot_variables(dataset: xarray.Dataset) -> list[v.Variable]:
    """Names of the variables of the impact, of plate and core where they differ; no hit points."""
    return [
        *v.SHOT_VARIABLES,
        *(name for name in v.SCATTER_VARIABLES if name in dataset and "hit" in dataset[name].dims),
    ]


def outcome_variables(dataset: xarray.Dataset) -> list[v.Variable]:
    """Names of the variables that say how the shots ended."""
    return [name for name in v.record_variables() if "hit" in name.dims and name in dataset.variables]


def hit_numbers(dataset: xarray.Dataset) -> NDArray[np.int64]:
    """Numbers of the hits in their campaign, shape (hit,)."""
    return np.asarray(dataset[v.HIT].values)


def is_choice(dataset: xarray.Dataset) -> bool:
    """Whether the hits differ from the first ones of the campaign in their order. Of an open file, one slice at a time
    is in memory."""
    if v.HIT not in dataset.coords:
        return False
    hits = dataset.sizes["hit"]
    return any(
        not np.array_equal(hit_numbers(dataset[[v.HIT]].isel(hit=slice(first, first + SLICE))), numbers)
        for first in range(0, hits, SLICE)
        for numbers in [np.arange(first, min(first + SLICE, hits))]
    )


def passed(dataset: xarray.Dataset) -> NDArray[np.bool_]:
    """Whether each core came through the target, shape (hit,)."""
    return has_passed(dataset[v.STATUS].values)


def failed(dataset: xarray.Dataset) -> NDArray[np.bool_]:
    """Whether the computation of each shot failed, shape (hit,)."""
    return failures(dataset[v.STATUS].values)
