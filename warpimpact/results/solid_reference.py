"""The references in a Dataset, with outcomes or with limits: the solid plate, or the solid add-on before the base, and
the base alone."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray

from warpimpact.kernels.status import Status
from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.results.dataset import hit_numbers, stored_columns


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


def solid_limits(dataset: xarray.Dataset) -> xarray.Dataset | None:
    """The limits at the solid plate as a result of limits, along "hit", with the attributes of this plate; None if the
    result has none. They belong to the first hits, or one shot stands for all hits."""
    attributes = dataset.attrs
    if not {attr.LIMIT, attr.SOLID_LIMIT_DENSITY, attr.SOLID_LIMIT_ELSEWHERE} <= attributes.keys():
        return None
    of_solid = {
        attr.LIMIT_LAYER: attributes[attr.LIMIT_LAYER],
        attr.LIMIT_HIGHEST: attributes[attr.SOLID_LIMIT_HIGHEST],
        attr.LIMIT_ELSEWHERE: attributes[attr.SOLID_LIMIT_ELSEWHERE],
        attr.LIMIT_DENSITY: attributes[attr.SOLID_LIMIT_DENSITY],
    }
    return _limits_in(dataset, v.SOLID_LIMITS, of_solid)


def base_alone_limits(dataset: xarray.Dataset) -> xarray.Dataset | None:
    """The limits at the base alone, in the form of `solid_limits`."""
    attributes = dataset.attrs
    if attr.LIMIT not in attributes:
        return None
    of_base = {attr.LIMIT_LAYER: 0, attr.LIMIT_ELSEWHERE: 0.0, attr.LIMIT_HIGHEST: attributes[attr.LIMIT_HIGHEST]}
    if attr.LIMIT_DENSITY in attributes:
        of_base[attr.LIMIT_DENSITY] = attributes[attr.LIMIT_DENSITY]
    return _limits_in(dataset, v.BASE_ALONE_LIMITS, of_base)


def _limits_in(
    dataset: xarray.Dataset, variables: Mapping[str, v.Variable], attributes: Mapping[str, Any]
) -> xarray.Dataset | None:
    """The limits at a reference. `variables` are its variables by the quantity of the search."""
    quantity = dataset.attrs[attr.LIMIT]
    if (name := variables[quantity]) not in dataset.variables:
        return None
    if dataset[name].dims != name.dims:  # joined results of different plates
        return None
    values = dataset[name].values
    if len(values) > 1 and not np.array_equal(hit_numbers(dataset[[v.HIT]])[: len(values)], np.arange(len(values))):
        return None  # the hits were chosen, and are not the first ones
    status = np.where(np.isnan(values), Status.UNFINISHED, Status.PERFORATED).astype(np.int8)
    names = v.LIMITS[quantity].value, v.STATUS
    columns = stored_columns(names, dict(zip(names, (values, status), strict=True)))
    return xarray.Dataset(columns, attrs={attr.LIMIT: quantity, **attributes})
