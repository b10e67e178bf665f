"""Checks that a file that says it is a result, a history or a sweep is one."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from warpimpact.kernels.status import Status
from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.results.declared import attribute_faults, metadata_faults, missing_fault
from warpimpact.results.kind import Kind
from warpimpact.scene.display import STORED
from warpimpact.scene.shots import FARTHEST_HIT
from warpimpact.scene.toml_text import parsed_json
from warpimpact.scene.units import LARGEST

if TYPE_CHECKING:
    import xarray

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
"""Groups of attributes: the first one needs the others."""
_CHECKED_AT_ONCE = 2**22
"""Hits that are checked at a time."""


def _of_columns(
    dataset: xarray.Dataset, known: Sequence[v.Variable], inputs: Collection[str], along: tuple[str, ...] = ()
) -> Iterator[str]:
    """Faults of the variables of hits, whose values are not read. An input of a sweep has its own dimension, or none
    at a point of the sweep; all others may be `along` the inputs."""
    for variable in known:
        if variable not in dataset.variables:
            continue
        array = dataset.variables[variable]
        if variable is not v.AXIS:
            if array.dtype.kind not in "iuf":
                yield f'its variable "{variable}" has no numbers'
            yield from metadata_faults(array, variable)
        allowed = {variable.dims, along + variable.dims} | ({(), (variable,)} if variable in inputs else set())
        if array.dims not in allowed:
            yield f'its variable "{variable}" is along {array.dims}, not {along + variable.dims}'


def _attribute_faults(attributes: Mapping[Any, Any]) -> Iterator[str]:
    """Faults of the attributes of hits."""
    yield from attribute_faults(attributes)
    for first, *others in _TOGETHER:
        missing = [name for name in others if name not in attributes]
        if first in attributes and missing:
            yield f'it has "{first}", but no attribute "{missing[0]}"'


def _map_faults(dataset: xarray.Dataset) -> Iterator[str]:
    """What keeps a Dataset from being a map of hits, as phrases. Only the values on which readers rely are checked, a
    part at a time."""
    in_groups = (name for names in v.GROUPS.values() for name in names)
    known = [*v.COORDINATES, *v.hit_variables(), *in_groups]
    yield from _of_columns(dataset, known, parsed_json(dataset.attrs.get(attr.SWEEP)) or ())
    yield from _attribute_faults(dataset.attrs)
    yield from filter(None, (missing_fault(dataset, names) for names in v.whole_groups()))
    yield from _of_hits(dataset)


def _of_hits(dataset: xarray.Dataset) -> Iterator[str]:
    """Faults in the statuses, the places and the stand-offs of hits."""
    codes = np.array([*Status])
    if not all(_ended(part, codes) for part in _parts(dataset[v.STATUS])):
        yield f'its variable "{v.STATUS}" has unknown codes'
    for name in (v.HIT_Y, v.HIT_Z):
        if not all((np.abs(part) <= FARTHEST_HIT).all() for part in _parts(dataset[name])):
            yield f'its variable "{name}" has values that are not numbers, or are more than {FARTHEST_HIT:g} m'
    standoffs = dataset[v.STANDOFF].values
    if not ((np.abs(standoffs) <= LARGEST).all() and np.unique(standoffs).size == standoffs.size):
        yield f'its variable "{v.STANDOFF}" has values that are no lengths, or one of them twice'


def _parts(array: xarray.DataArray) -> Iterator[np.ndarray[Any, Any]]:
    along = array.sizes[v.HIT] if v.HIT in array.dims else 1
    return (
        array.isel(hit=slice(at, at + _CHECKED_AT_ONCE), missing_dims="ignore").values
        for at in range(0, along, _CHECKED_AT_ONCE)
    )


def _ended(status: np.ndarray[Any, Any], codes: np.ndarray[Any, Any]) -> bool:
    """Whether statuses are known codes, or NaN: a point of a sweep may lack hits that another has."""
    return bool((np.isin(status, codes) | np.isnan(status)).all())


def _sweep_faults(dataset: xarray.Dataset) -> Iterator[str]:
    inputs = parsed_json(dataset.attrs[attr.SWEEP])
    along = tuple(name for name in inputs if name in dataset.dims)
    yield from _of_columns(dataset, [*v.COORDINATES, *v.hit_variables()], inputs, along)
    yield from _attribute_faults(dataset.attrs)
    for name, labels in inputs.items():
        if name not in dataset.coords or dataset[name].dims not in ((), (name,)):
            yield f'it has no coordinate "{name}", which it sweeps'
        elif dataset.sizes.get(name, len(labels)) != len(labels):
            yield f'it has {dataset.sizes[name]} values of "{name}", but names {len(labels)}'
        elif dataset[name].dtype.kind == "f" and dataset[name].attrs.get("units") not in STORED:
            yield f'its coordinate "{name}" has an unknown unit'
    yield from _of_hits(dataset)


def _missing(dataset: xarray.Dataset) -> str | None:
    """A sentence about a variable or attribute that every result has and this one lacks; None if nothing is missing."""
    missing = {*v.COORDINATES, *v.VARIABLES} - dataset.variables.keys()
    if missing:
        return f'not a warpimpact result, it has no variable "{min(missing)}"'
    if attr.PLATE_PERIOD in dataset.attrs:
        return None
    return (
        f'not a warpimpact result, it has no attribute "{attr.PLATE_PERIOD}"; where it was chosen from one, keep its '
        "attributes"
    )


def _misuse(dataset: xarray.Dataset) -> str | None:
    """A sentence about why hits chosen from a result cannot be used as a result; None if they can."""
    if (sentence := _missing(dataset)) is not None:
        return sentence
    if v.HIT not in dataset.sizes:
        return "holds one hit without its dimension; choose hits as a list, as in isel(hit=[5])"
    if v.STANDOFF not in dataset.sizes:
        return "holds one stand-off without its dimension; choose stand-offs as a list, as in isel(standoff=[0])"
    status = dataset[v.STATUS]
    if status.dtype.kind == "f" and bool(status.isnull().any()):
        return "has hits without a status, as where(...) leaves them; choose hits with where(..., drop=True)"
    return None if dataset.sizes[v.HIT] else "has no hits, so there is nothing to show"


def packing_fault(dataset: xarray.Dataset) -> str | None:
    """What is wrong with the factor and the offset of packed numbers, which are read only when the numbers are."""
    for name, array in dataset.variables.items():
        for attribute in ("scale_factor", "add_offset"):
            if attribute in array.encoding and not isinstance(array.encoding[attribute], int | float | np.number):
                return f'its variable "{name}" has a {attribute} that is no number'
    return None


RESULT = Kind(
    "a map of hits",
    "warpimpact inspect, plot, report, export, compare and replay take it",
    maker="warpimpact run or limit",
    misuse=_misuse,
    fault=lambda dataset: next(_map_faults(dataset), None),
)
SWEEP = Kind(
    "a sweep",
    "warpimpact inspect and report take it; its points, in the folder beside it, are results, as is what isel(INPUT=0) "
    "chooses of it",
    maker="warpimpact sweep",
    misuse=_missing,
    fault=lambda dataset: next(_sweep_faults(dataset), None),
)
