"""Whether a file that says it is a result is one: what variables and attributes the readers of a Dataset rely on."""

from __future__ import annotations

import json
from collections.abc import Callable, Collection
from typing import TYPE_CHECKING, Any

import numpy as np

from warpimpact.kernels.status import Status
from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.scene.shots import FARTHEST
from warpimpact.scene.units import LARGEST

if TYPE_CHECKING:
    import xarray

_LABELS = (v.AXIS, v.QUATERNION, v.SETTING, v.SCHEME, v.STUDY_LEVEL)
"""Variables that hold words."""
_TOGETHER = (
    (attr.SAMPLING, attr.SEED, attr.REPLICATES),
    (attr.AREAL_DENSITY, attr.OPEN_AREA),
    (attr.COMPUTE_TIME, attr.HITS_PER_SECOND, attr.DEVICE),
    (attr.WARPIMPACT_VERSION, attr.WARP_VERSION),
    (attr.STOP_QUANTITY, attr.STOP_REASON, attr.ESTIMATE, attr.ESTIMATE_INTERVAL, attr.ESTIMATE_UNITS, attr.CONFIDENCE),
    (attr.COMPUTED_HITS, attr.SYMMETRIES),
    (attr.BURST, attr.SHOTS_AT_A_PLATE),
    (attr.PROMISE_KEPT, attr.RESOLUTION, attr.ACCURACY, attr.NUMERICS_GIVEN),
    (attr.RESIDUAL_VELOCITY_ERROR, attr.TILT_ERROR, attr.PROMISE_KEPT),
)
"""Attributes of which the first needs the others."""


_OF_A_STUDY = (attr.TITLE, attr.HISTORY, attr.DEVICE)
"""Attributes of a study."""
_SLICE = 2**22
"""Hits that are looked at together."""


def fault(dataset: xarray.Dataset, known: Collection[v.Variable]) -> str | None:
    """What keeps a Dataset from being what it should be, as a phrase; None if nothing does.

    Args:
        known: the variables that may be in it.
    """
    found = (_variable_fault(dataset[str(one)], one) for one in known if one in dataset.variables)
    return next(filter(None, found), None) or _attribute_fault(dataset.attrs) or _map_fault(dataset, known)


def study_fault(dataset: xarray.Dataset) -> str | None:
    """What keeps a Dataset from being a study, as a phrase; None if nothing does."""
    if missing := [name for name in _OF_A_STUDY if name not in dataset.attrs]:
        return f'it has no attribute "{missing[0]}"'
    if not {0.5, 0.9} <= set(dataset[v.QUANTILE].values.ravel().tolist()):
        return f'its variable "{v.QUANTILE}" lacks the median or the 90th percentile'
    return fault(dataset, (*v.STUDY_COORDINATES, *v.STUDY_VARIABLES))


def history_fault(dataset: xarray.Dataset) -> str | None:
    """What keeps a Dataset from being the history of a hit, as a phrase; None if nothing does."""
    known = (*v.HISTORY_COORDINATES, *v.HISTORY_VARIABLES)
    if missing := [name for name in known if name not in dataset.variables]:
        return f'it has no variable "{missing[0]}"'
    return fault(dataset, known)


def packing_fault(dataset: xarray.Dataset) -> str | None:
    """Numbers may be stored with a factor and an offset, which are read only when the numbers are."""
    for name, array in dataset.variables.items():
        for one in ("scale_factor", "add_offset"):
            if one in array.encoding and not isinstance(array.encoding[one], int | float | np.number):
                return f'its variable "{name}" has a {one} that is no number'
    return None


def _map_fault(dataset: xarray.Dataset, known: Collection[v.Variable]) -> str | None:
    """What only a map of hits is held to."""
    if "hit" not in dataset.sizes:
        return None
    chosen = json.loads(dataset.attrs[attr.SWEEP]) if attr.SWEEP in dataset.attrs else ()  # inputs of a sweep's point
    for one in known:
        if one in chosen and dataset.variables[one].dims == ():
            continue
        if one in dataset.variables and dataset.variables[one].dims != one.dims:
            return f'its variable "{one}" is along {dataset.variables[one].dims}, not {one.dims}'
    for names in v.whole_groups():
        there = [name for name in names if name in dataset.variables]
        if there and (missing := [name for name in names if name not in there]):
            return f'it has "{there[0]}", but no variable "{missing[0]}"'
    status, codes = dataset[v.STATUS], [*Status]
    if not all(np.isin(status[at : at + _SLICE].values, codes).all() for at in range(0, len(status), _SLICE)):
        return f'its variable "{v.STATUS}" has unknown codes'
    for place in (dataset[name] for name in (v.HIT_Y, v.HIT_Z) if name in dataset.variables):
        if not all((np.abs(place[at : at + _SLICE].values) <= FARTHEST).all() for at in range(0, place.size, _SLICE)):
            return f'its variable "{place.name}" has values that are not numbers, or are more than {FARTHEST:g} m'
    if v.STANDOFF in dataset.coords:
        standoffs = dataset[v.STANDOFF].values
        if not ((np.abs(standoffs) <= LARGEST).all() and np.unique(standoffs).size == standoffs.size):
            return f'its variable "{v.STANDOFF}" has values that are no lengths, or one of them twice'
    return None


def unusable(dataset: xarray.Dataset) -> str | None:
    """What keeps hits that were chosen from a result from being used as one, as a sentence; None if nothing does."""
    if v.HIT not in dataset.sizes:
        return "holds one hit without its dimension; choose hits as a list, as in isel(hit=[5])"
    if v.STANDOFF not in dataset.sizes:
        return "holds one stand-off without its dimension; choose stand-offs as a list, as in isel(standoff=[0])"
    status = dataset[v.STATUS]
    if status.dtype.kind == "f" and bool(status.isnull().any()):
        return "has hits without a status, as where(...) leaves them; choose hits with where(..., drop=True)"
    return None


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


def _attribute_fault(attributes: dict[str, Any]) -> str | None:
    for name, value in attributes.items():
        if not _is_allowed(name, value):
            return f'its attribute "{name}" is not what it should be'
    for first, *others in _TOGETHER:
        missing = [name for name in others if name not in attributes]
        if first in attributes and missing:
            return f'it has "{first}", but no attribute "{missing[0]}"'
    return None


def _is_allowed(name: str, value: Any) -> bool:
    return _is_of_its_kind(name, value) and _HELD.get(name, lambda value: True)(value)


def _is_core(value: str) -> bool:
    from pydantic import TypeAdapter, ValidationError

    from warpimpact.scene import AnyCore

    try:
        TypeAdapter[Any](AnyCore).validate_json(value)
    except ValidationError:
        return False
    return True


def _is_resolution(value: str) -> bool:
    from warpimpact.scene import Numerics

    try:
        return Numerics.model_validate_json(value).explicit is not None
    except ValueError:
        return False


def _has_number(key: str) -> Callable[[str], bool]:
    return lambda value: isinstance(json.loads(value).get(key), int | float)


_HELD: dict[str, Callable[[Any], bool]] = {
    attr.CORE: _is_core,
    attr.RESOLUTION: _is_resolution,
    attr.ACCURACY: _has_number("share"),
    attr.MATERIAL: _has_number("resistance"),
    attr.NUMERICS_GIVEN: lambda value: "fidelity" in json.loads(value),
    attr.DISCREPANCY: lambda value: all(isinstance(one, int | float) for one in json.loads(value).values()),
    attr.LAYERS: lambda value: all(isinstance(one, dict) for one in json.loads(value).values()),
    attr.LIMIT: lambda value: value in v.LIMITS,
    attr.PLATE_PERIOD: lambda value: bool(((np.asarray(value) > 0.0) & (np.asarray(value) <= LARGEST)).all()),
}
"""What the readers of an attribute rely on beyond its kind."""


def _is_of_its_kind(name: str, value: Any) -> bool:
    if name in v.OUTLINE_VARIABLES:
        return np.asarray(value).dtype.kind == "f"
    if name not in attr.ATTRIBUTES:
        return isinstance(value, str) or name.removesuffix("_units") not in attr.ATTRIBUTES
    match attr.ATTRIBUTES[name].kind:
        case "text":
            return isinstance(value, str)
        case "table":
            return isinstance(value, str) and isinstance(parsed_json(value), dict)
        case "pair":
            return np.shape(value) == (2,) and np.asarray(value).dtype.kind in "iuf"
        case "count":
            return isinstance(value, int | np.integer) and bool(value >= 1)
        case "number":
            return isinstance(value, int | float | np.number)


def parsed_json(text: Any) -> Any:
    """What a text says as JSON; None if it is none."""
    try:
        return json.loads(text)
    except (TypeError, ValueError, RecursionError):
        return None
