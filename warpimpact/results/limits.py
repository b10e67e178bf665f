"""The limits in a Dataset at the solid plate of equal areal density, and at the base alone."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from warpimpact.kernels.status import Status
from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.results.dataset import hit_numbers, stored_columns

if TYPE_CHECKING:
    import xarray


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
    import xarray

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
