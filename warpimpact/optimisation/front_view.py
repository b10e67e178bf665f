"""The view of a search for designs."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import numpy as np
import pandas as pd
import xarray

from warpimpact.analysis.numbers import interval_text, number_text
from warpimpact.results import front as f
from warpimpact.results.vocabulary import WEIGHTS


def front_view(dataset: xarray.Dataset) -> dict[str, list[str | pd.DataFrame]]:
    """The view of a search: its front with intervals, the values of its variables, and how fresh hits changed it."""
    attributes = dataset.attrs
    computed = (
        f"{dataset.sizes['design']} designs computed with {attributes[f.HITS]} hits each, {attributes[f.PILOTS]} "
        f"pilots; {attributes[f.REFUSED]} more broke a constraint and were not computed"
    )
    if attributes[f.OUTCOME] == f.NONE_FEASIBLE:
        return {"": [computed, *_nearest(dataset)]}
    on_front, confirmed = int(dataset[f.ON_FRONT].sum()), dataset.sizes["front"]
    again = f"front: {on_front} designs, of which {confirmed} were computed again with fresh hits"
    return {
        "": [computed, again],
        "objectives and bounds": [_front_table(dataset)],
        "variables": [_variables_table(dataset), *_shrinkage(dataset)],
    }


def _front_table(dataset: xarray.Dataset) -> pd.DataFrame:
    """Objectives and bounds of the front and of the targets to compare with, by fresh hits."""
    columns = ["design", *(part for label in dataset[f.GOAL_LABEL].values for part in (label, "95 % interval"))]
    rows: list[tuple[Any, ...]] = []
    for place, file in enumerate(dataset[f.FILE].values):
        notes = []
        if not int(dataset[f.CONFIRMED][place]):
            notes.append("not on the front by fresh hits")
        if outside := str(dataset[f.OUTSIDE].values[place]):
            notes.append(f"outside the tested range: {outside}")
        rows.append((file, *_cells(dataset, OF_FRONT, place), "; ".join(notes)))
    for place, name in enumerate(dataset[f.REFERENCE].values):
        rows.append((name, *_cells(dataset, OF_REFERENCE, place), ""))
    return pd.DataFrame(rows, columns=[*columns, "note"]).set_index("design")


OF_FRONT = (f.FRESH, f.FRESH_LOW, f.FRESH_HIGH)
OF_REFERENCE = (f.REFERENCE_RESULT, f.REFERENCE_LOW, f.REFERENCE_HIGH)


def _cells(dataset: xarray.Dataset, names: tuple[str, str, str], place: int) -> Iterator[Any]:
    """Cells with value and interval of each objective and bound of a design."""
    for value, low, high in zip(*(dataset[name].values[place] for name in names), strict=True):
        yield from (float(value), "" if low == high else interval_text(low, high, digits=".4g"))


def _variables_table(dataset: xarray.Dataset) -> pd.DataFrame:
    """The values of the variables that count somewhere on the front."""
    designs = dataset[f.NUMBER].values
    used = np.flatnonzero(np.isfinite(dataset[f.VALUE].values[designs]).any(axis=0))
    names, units = dataset[f.NAME].values[used], dataset[f.UNIT].values[used]
    columns = [f"{name} [{unit}]" if unit else str(name) for name, unit in zip(names, units, strict=True)]
    rows = []
    for file, design in zip(dataset[f.FILE].values, designs, strict=True):
        values = [value for _, value, _ in _values(dataset, int(design))]
        rows.append((file, *(values[place] for place in used)))
    return pd.DataFrame(rows, columns=["design", *columns]).set_index("design")


def numbers_of(dataset: xarray.Dataset, names: tuple[str, str, str], place: int) -> list[str]:
    """Objectives and bounds of a target with their intervals, by the `names` of their variables."""
    cells = list(_cells(dataset, names, place))
    numbers = []
    for label, value, interval in zip(dataset[f.GOAL_LABEL].values, cells[::2], cells[1::2], strict=True):
        name, unit = label_and_unit(label)
        numbers.append(f"{name} {number_text(value)}{f' ({interval})' if interval else ''} {unit}".rstrip())
    return numbers


def label_and_unit(label: str) -> tuple[str, str]:
    """Label and unit of an objective or bound: "thickness [mm]" → "thickness", "mm"."""
    name, _, unit = str(label).removesuffix("]").partition(" [")
    return name, unit


def design_text(dataset: xarray.Dataset, design: int) -> str:
    """The variables of a design with their values."""
    values = _values(dataset, design)
    return ", ".join(f"{name} = {value} {unit}".rstrip() for name, value, unit in values if value)


def _values(dataset: xarray.Dataset, design: int) -> Iterator[tuple[str, str, str]]:
    """Name, value and unit of every variable of a design; the value is empty where the design does not use it."""
    for name, value, labels, unit in zip(
        dataset[f.NAME].values,
        dataset[f.VALUE].values[design],
        dataset[f.LABELS].values,
        dataset[f.UNIT].values,
        strict=True,
    ):
        unused = bool(np.isnan(value))
        yield str(name), "" if unused else json.loads(labels)[int(value)] if labels else f"{value:.6g}", str(unit)


def _shrinkage(dataset: xarray.Dataset) -> Iterator[str]:
    """How much worse the fresh hits are than the hits of the search."""
    searched, fresh = dataset[f.RESULT].values[dataset[f.NUMBER].values], dataset[f.FRESH].values
    worse = (dataset[f.GOAL_SIGN].values * (fresh - searched)).mean(axis=0)
    for goal in np.flatnonzero(np.isnan(dataset[f.GOAL_LIMIT].values)):
        if str(dataset[f.GOAL].values[goal]).startswith(tuple(WEIGHTS)):
            continue
        name, unit = label_and_unit(dataset[f.GOAL_LABEL].values[goal])
        by = f"{number_text(abs(float(worse[goal])))} {unit}".strip()
        before = float(searched[:, goal].mean())
        share = f", {abs(worse[goal] / before):.1%} of it" if before else ""
        which = "worse" if worse[goal] > 0 else "better"
        yield f"shrinkage: by fresh hits {name} is {which} by {by}{share}, mean over the front"


def _nearest(dataset: xarray.Dataset) -> Iterator[str]:
    """The design that comes nearest to the bounds, if none keeps them."""
    limits, signs, values = dataset[f.GOAL_LIMIT].values, dataset[f.GOAL_SIGN].values, dataset[f.RESULT].values
    bounds = np.flatnonzero(~np.isnan(limits))
    over = np.maximum(signs * (values - limits) / np.maximum(np.abs(limits), 1e-30), 0.0)[:, bounds].sum(axis=1)
    nearest = int(np.nanargmin(over)) if np.isfinite(over).any() else 0
    texts = [
        f"{dataset[f.GOAL_LABEL].values[bound]!s} {'<' if signs[bound] > 0 else '>'}= {limits[bound]:.4g}"
        f" (nearest: {number_text(float(values[nearest, bound]))})"
        for bound in bounds
    ]
    yield f"no design keeps the bounds: {'; '.join(texts) or 'no hit of any design could be computed'}"
    yield f"the nearest: {design_text(dataset, nearest)}"
