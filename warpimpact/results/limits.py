"""What a Dataset tells of a search of limits, and of the same search at the solid plate of equal areal density."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from warpimpact.kernels.status import Status
from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.results.dataset import hit_numbers, stored_columns

if TYPE_CHECKING:
    import xarray


def solid_limits(dataset: xarray.Dataset) -> xarray.Dataset | None:
    """The limits at the solid plate as a result of limits: along "hit", with the attributes of that plate. None if the
    result has none. One shot tells of all hits; else they are those of the first hits."""
    import xarray

    quantity = dataset.attrs.get(attr.LIMIT)
    if quantity is None or (name := v.SOLID_LIMITS[quantity]) not in dataset.variables:
        return None
    if dataset[name].dims != name.dims:  # of results of different plates that were joined
        return None
    if not {attr.SOLID_LIMIT_DENSITY, attr.SOLID_LIMIT_HIGHEST} <= dataset.attrs.keys():
        return None
    values = dataset[name].values
    if len(values) > 1 and not np.array_equal(hit_numbers(dataset[[v.HIT]])[: len(values)], np.arange(len(values))):
        return None  # a choice of hits that are not the first ones
    status = np.where(np.isnan(values), Status.UNFINISHED, Status.PERFORATED).astype(np.int8)
    attributes = {
        attr.LIMIT: quantity,
        attr.LIMIT_LAYER: dataset.attrs[attr.LIMIT_LAYER] if attr.SOLID_LIMIT_ELSEWHERE in dataset.attrs else 0,
        attr.LIMIT_HIGHEST: dataset.attrs[attr.SOLID_LIMIT_HIGHEST],
        attr.LIMIT_ELSEWHERE: dataset.attrs.get(attr.SOLID_LIMIT_ELSEWHERE, 0.0),
        attr.LIMIT_DENSITY: dataset.attrs[attr.SOLID_LIMIT_DENSITY],
    }
    names = v.LIMITS[quantity].value, v.STATUS
    return xarray.Dataset(stored_columns(names, dict(zip(names, (values, status), strict=True))), attrs=attributes)
