"""A hit map as a table, for pandas and for spreadsheets."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray

from warpimpact.analysis.hit_map import BY_ELEMENTS, is_by_law, marked
from warpimpact.measures.estimates import slices
from warpimpact.measures.hits import hit_numbers
from warpimpact.measures.references import Result
from warpimpact.records import variables as v
from warpimpact.results.files import atomic_path
from warpimpact.scene.units import MM

_ANGLE_DECIMALS = 10
"""Decimals of an angle that a user gave in degrees."""


def table(result: Result) -> pd.DataFrame:
    """One row per hit, in the units of the Dataset.

    A variable with stand-offs, axes or layers gets one column for each: ``tilt_130mm``, ``angular_velocity_x``,
    ``layer_tilt_0``. ``status`` and ``layer_status_0`` are words. An angle that was given as 30° is 30.

    Of an answer, ``perforated`` is the share of the draws in which the core passes, ``by_elements`` says which hits
    finite elements have computed, and what the fast law alone knows is named ``law_largest_bending_moment``.
    """
    dataset = marked(result)
    columns = {name: _values(array) for name, array in _columns(dataset)}
    return pd.DataFrame(columns, index=pd.Index(hit_numbers(dataset), name=v.HIT))


def _columns(dataset: xarray.Dataset) -> Iterator[tuple[str, xarray.DataArray]]:
    """Columns of the table by their names, each of shape [hits]."""
    for variable in (v.HIT_Y, v.HIT_Z, *([BY_ELEMENTS] if BY_ELEMENTS in dataset.coords else []), *dataset.data_vars):
        array = dataset[variable]
        name = f"law_{variable}" if is_by_law(dataset, str(variable)) else variable
        match array.dims:
            case ("hit",):
                yield str(name), array
            case ("hit", "standoff" | "axis" | "layer" as along):
                for place in range(array.sizes[along]):
                    label = dataset[along].values[place] if along in dataset.coords else place
                    end = f"{label * MM:g}mm" if along == "standoff" else label
                    yield f"{name}_{end}", array[:, place]


def _values(array: xarray.DataArray) -> np.ndarray[Any, Any]:
    """Values of a column: words for codes, and short numbers of degrees as they were given.

    Angles in a file are degrees converted from radians. If a short number of degrees has the same value after this
    conversion, it is taken as the given one.
    """
    values = array.values
    if "flag_meanings" in array.attrs:
        words = dict(zip(array.attrs["flag_values"].tolist(), array.attrs["flag_meanings"].split(), strict=True))
        return np.array([words.get(code) for code in values.tolist()], dtype=object)  # where() leaves NaN
    if array.attrs.get("units") != "degree" or values.dtype != np.float64:
        return values
    short = np.round(values, _ANGLE_DECIMALS)
    return np.where(np.degrees(np.radians(short)) == values, short, values)


def write_csv(result: Result, path: Path) -> None:
    """Write `table` as CSV, whole or not at all. Of an open file, one slice at a time is in memory.

    A header is a name and its unit, as in ``hit_y [m]``; a campaign can take the file as its list of hits. Numbers have
    all significant digits; a missing value is empty.

    Raises:
        OutputError: the file cannot be written; an existing file stays as it is.
    """
    is_first = True
    with atomic_path(path) as file:
        for part in slices(marked(result)):
            header = [_header(name, array) for name, array in _columns(part)] if is_first else False
            table(part.load()).to_csv(file, mode="w" if is_first else "a", header=header)
            is_first = False


def _header(name: str, array: xarray.DataArray) -> str:
    """Text such as "spin [rad/s]"; without brackets if there is no unit."""
    unit = "1" if "flag_meanings" in array.attrs else str(array.attrs.get("units", "1"))
    shown = unit.replace(" s-1", "/s").replace("degree", "deg")
    return name if shown == "1" else f"{name} [{shown}]"
