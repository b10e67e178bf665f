"""Whether a file that says it is a result is one: what variables and attributes the readers of a Dataset rely on."""

from __future__ import annotations

import json
from collections.abc import Collection
from typing import Any

import numpy as np
import xarray

from warpimpact.results import attributes as attr
from warpimpact.results import variables as v

_LABELS = (v.AXIS, v.QUATERNION, v.SETTING, v.SCHEME, v.STUDY_LEVEL)
"""Variables that hold words."""
_TEXTS = (
    *(attr.TITLE, attr.HISTORY, attr.REFERENCES, attr.CAMPAIGN, attr.WARPIMPACT_VERSION, attr.WARP_VERSION),
    *(attr.DEVICE, attr.NUMERICS, attr.NUMERICS_GIVEN, attr.FINGERPRINT, attr.SAMPLING, attr.SYMMETRIES, attr.CORE),
    *(attr.MATERIAL, attr.CAMPAIGN_ANGLES, attr.RESOLUTION, attr.IMPACT, attr.STANDOFF_POINT, attr.STOP_QUANTITY),
    *(attr.STOP_REASON, attr.ESTIMATE_UNITS, attr.AGREEMENT, attr.LAYERS, attr.BURST),
)
_TABLES = (attr.CORE, attr.IMPACT, attr.MATERIAL, attr.LAYERS, attr.NUMERICS_GIVEN, attr.RESOLUTION, attr.BURST)
"""Texts that are JSON objects."""
_COUNTS = (attr.COUNT, attr.REPLICATES, attr.IMAGES, attr.COMPUTED_HITS, attr.SHOTS_AT_A_PLATE)
_NUMBERS = (
    *(attr.COMPUTE_TIME, attr.HITS_PER_SECOND, attr.SEED, attr.OPEN_AREA, attr.AREAL_DENSITY, attr.LIGAMENT),
    *(attr.PLATE_THICKNESS, attr.FAILED_SHARE, attr.ESTIMATE, attr.CONFIDENCE, attr.HIT),
    *(attr.PROMISE_KEPT, attr.RESIDUAL_VELOCITY_ERROR_P90, attr.TILT_ERROR_P90),
)
_PAIRS = (attr.PLATE_PERIOD, attr.ESTIMATE_INTERVAL)
_TOGETHER = (
    (attr.SAMPLING, attr.SEED, attr.REPLICATES),
    (attr.AREAL_DENSITY, attr.OPEN_AREA),
    (attr.COMPUTE_TIME, attr.HITS_PER_SECOND, attr.DEVICE),
    (attr.WARPIMPACT_VERSION, attr.WARP_VERSION),
    (attr.STOP_QUANTITY, attr.STOP_REASON, attr.ESTIMATE, attr.ESTIMATE_INTERVAL, attr.ESTIMATE_UNITS, attr.CONFIDENCE),
    (attr.COMPUTED_HITS, attr.SYMMETRIES),
    (attr.BURST, attr.SHOTS_AT_A_PLATE),
    (attr.PROMISE_KEPT, attr.RESOLUTION, attr.RESIDUAL_VELOCITY_ERROR_P90, attr.TILT_ERROR_P90, attr.NUMERICS_GIVEN),
)
"""Attributes of which the first needs the others."""


def fault(dataset: xarray.Dataset, known: Collection[v.Variable]) -> str | None:
    """What keeps a Dataset from being what it should be, as a phrase; None if nothing does.

    Args:
        known: the variables that may be in it.
    """
    found = (_variable_fault(dataset[str(one)], one) for one in known if one in dataset.variables)
    return next(filter(None, found), None) or _attribute_fault(dataset.attrs)


def _variable_fault(array: xarray.DataArray, declared: v.Variable) -> str | None:
    one = array.variable
    if any(declared is label for label in _LABELS):
        return None
    if one.dtype.kind not in "iuf":
        return f'its variable "{declared}" has no numbers'
    if one.dims not in {declared.dims, ()} and array.ndim != len(declared.dims) - 1:
        return f'its variable "{declared}" is along {one.dims}, not {declared.dims}'
    for name, value in declared.attributes.items():
        given = one.attrs.get(name)
        if not isinstance(given, type(value)) or (name == "units" and given != value):
            return f'its variable "{declared}" has no {name} as it should'
    return None


def _attribute_fault(told: dict[str, Any]) -> str | None:
    for name, value in told.items():
        if not _is_allowed(name, value):
            return f'its attribute "{name}" is not what it should be'
    for first, *others in _TOGETHER:
        missing = [name for name in others if name not in told]
        if first in told and missing:
            return f'it has no attribute "{missing[0]}" beside "{first}"'
    return None


def _is_allowed(name: str, value: Any) -> bool:
    if name in _TEXTS:
        return isinstance(value, str) and (name not in _TABLES or _is_table(value))
    if name in _PAIRS:
        return np.shape(value) == (2,) and np.asarray(value).dtype.kind in "iuf"
    if name in _COUNTS:
        return isinstance(value, int | np.integer) and bool(value >= 1)
    if name in _NUMBERS:
        return isinstance(value, int | float | np.number)
    return True


def _is_table(text: str) -> bool:
    try:
        return isinstance(json.loads(text), dict)
    except (ValueError, RecursionError):
        return False
