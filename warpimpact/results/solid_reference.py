"""The references in a Dataset: the solid plate, or the solid add-on before the base, and the base alone."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray

from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.results.dataset import hit_numbers


def solid_reference(dataset: xarray.Dataset) -> xarray.Dataset | None:
    """Shots and outcomes at the solid plate, or at the solid add-on before the base, with the names of a hit map and
    along "hit"; None if there are none.

    The hits are the first ones of the Dataset, or a single one that stands for all. A solid plate that stands alone is
    its own reference.
    """
    if dataset.attrs.get(attr.OPEN_AREA) == 0.0 and v.LAYER_STATUS not in dataset.variables:
        return dataset
    if not set(v.SOLID_DEPTHS) <= dataset.variables.keys() or not set(v.LAYER_FACES) <= dataset.variables.keys():
        return _of_the_first_hits(dataset, v.SOLID_VARIABLES)
    reference = _of_the_first_hits(dataset, v.SOLID_VARIABLES | v.SOLID_DEPTHS)
    faces = {name: dataset[name] for name in v.LAYER_FACES}
    return None if reference is None else reference.assign_coords(faces)


def base_alone(dataset: xarray.Dataset) -> xarray.Dataset | None:
    """Shots and outcomes at the base alone, in the form of `solid_reference`."""
    return _of_the_first_hits(dataset, v.BASE_ALONE_VARIABLES)


def _of_the_first_hits(dataset: xarray.Dataset, variables: Mapping[v.Variable, v.Variable]) -> xarray.Dataset | None:
    """Shots and outcomes at a reference. `variables` are its variables with those of the hits."""
    if any(name not in dataset.variables or dataset[name].dims != name.dims for name in variables):
        return None  # joined results of different plates have several references
    shots = dataset.sizes["solid_hit"]
    numbers = np.zeros(1, dtype=int) if shots == 1 else hit_numbers(dataset[[v.HIT]].isel(hit=slice(shots)))
    numbers = numbers[: np.argmax(np.append(numbers, shots) >= shots)]  # the first hits that have a reference
    if not len(numbers):
        return None
    solid = dataset[list(variables)].reset_coords(list(variables)).isel(solid_hit=numbers).load()
    first = dataset[v.shot_variables(dataset)].isel(hit=slice(len(numbers))).load()
    return first.assign({of_hits: solid[name].rename(solid_hit="hit") for name, of_hits in variables.items()})
