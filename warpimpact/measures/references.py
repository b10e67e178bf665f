"""References of a result: results of the solid plate or add-on that is as heavy, and of the base alone."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray

from warpimpact.measures.hits import hit_numbers
from warpimpact.records import attributes as attr
from warpimpact.records import variables as v
from warpimpact.records.variables import has_passed

NAMES = {"solid": "solid, same weight", "base_alone": "base alone"}
"""Names of the references, which are those of their groups in a file, and their names as plates."""
ELEMENTS, SECOND_LAW = "elements", "free_surface"
"""Groups of a corrected result: some of its hits by finite elements, and all of them by a second fast law."""
FINER = "finer"
"""Group of the outcomes of some hits at a finer level of resolution, present where a pilot found the resolution."""
GROUPS = (*NAMES, ELEMENTS, SECOND_LAW, FINER)


def with_references(dataset: xarray.Dataset, references: Mapping[str, xarray.Dataset]) -> xarray.Dataset:
    """A result with its references by their names, such as {"solid": run(campaign.solid())}."""
    result = dataset.copy()
    result.encoding = dataset.encoding | {"references": dict(references)}
    return result


def references_of(dataset: xarray.Dataset) -> dict[str, xarray.Dataset]:
    """The references of a result by their names."""
    return dict(dataset.encoding.get("references", {}))


def reference(dataset: xarray.Dataset, name: str) -> xarray.Dataset | None:
    """A reference of a result, along "hit": its first hits, or a single one that stands for all; None if there is none.

    A solid plate that stands alone is its own reference, except that of its limits.
    """
    is_alone = attr.LIMIT not in dataset.attrs and v.LAYER_STATUS not in dataset.variables
    if name == "solid" and is_alone and dataset.attrs.get(attr.OPEN_AREA) == 0.0:
        return dataset
    reference = references_of(dataset).get(name)
    if reference is None or dataset[v.STATUS].dims != (v.HIT,):
        return None
    numbers, hits = hit_numbers(dataset), reference.sizes["hit"]
    if len(np.unique(numbers)) < len(numbers):
        return None  # joined results have several references
    if hits == 1:
        return reference
    numbers = numbers[: np.argmax(np.append(numbers, hits) >= hits)]  # the first hits that have a reference
    return reference.isel(hit=numbers) if len(numbers) else None


def as_plates(dataset: xarray.Dataset) -> dict[str, xarray.Dataset]:
    """The references of a result by their names as plates. One that stands for all has every hit of the result."""
    plates = {label: reference(dataset, name) for name, label in NAMES.items() if name in references_of(dataset)}
    every = {name: dataset[name].variable for name in (v.HIT, v.HIT_Y, v.HIT_Z)}
    return {
        label: plate if plate.sizes["hit"] > 1 else plate.isel(hit=[0] * dataset.sizes["hit"]).assign_coords(every)
        for label, plate in plates.items()
        if plate is not None
    }


def finer_pair(dataset: xarray.Dataset) -> tuple[xarray.Dataset, xarray.Dataset] | None:
    """The hits of a result that were computed at a finer level, too: with their values in the result, and with those at
    the finer level. None if there are none."""
    finer = references_of(dataset).get(FINER)
    if finer is None or v.HIT not in dataset.sizes:
        return None
    inputs = [name for name in finer[v.STATUS].dims if name != v.HIT]
    if not all(name in dataset.coords and not dataset[name].dims for name in inputs):
        return None
    finer = finer.sel({name: dataset[name] for name in inputs})  # of a point of a sweep
    hits = hit_numbers(dataset)
    numbers, places, at = np.intersect1d(hits, finer[v.HIT].values, return_indices=True)
    if not len(numbers) or np.isin(hits, numbers).sum() > len(numbers):  # joined results have several hits of a number
        return None
    order = np.argsort(at)  # that of the pilot
    given, fine = dataset.isel(hit=places[order]), finer.isel(hit=at[order])
    columns = {
        name: (dataset[name].dims, fine[name].values, dataset[name].attrs) for name in fine.data_vars if name in dataset
    }
    columns[v.PERFORATED] = (v.HITS, has_passed(fine[v.STATUS].values), {})
    return given, given.assign(columns)
