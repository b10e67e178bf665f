"""A hit map as a table, for pandas and for spreadsheets."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray

from warpimpact.analysis.estimates import slices
from warpimpact.results import variables as v
from warpimpact.results.dataset import hit_numbers, status_codes
from warpimpact.results.files import aside

_ANGLE_DECIMALS = 10
"""Decimals of an angle that a user gave in degrees."""


def to_dataframe(dataset: xarray.Dataset) -> pd.DataFrame:
    """One row per hit, in the units of the Dataset.

    A variable with stand-offs, axes or layers gets one column for each: ``tilt_130mm``, ``angular_velocity_x``,
    ``layer_tilt_0``. ``status`` and ``layer_status_0`` are words. An angle that was given as 30° is 30.
    """
    columns: dict[str, Any] = {name: _as_given(array) for name, array in _columns(dataset)}
    for name, variable in _statuses(dataset).items():
        words = {code: word for word, code in status_codes(dataset, variable).items()}
        columns[name] = [words[code] for code in columns[name].tolist()]
    return pd.DataFrame(columns, index=pd.Index(hit_numbers(dataset), name=v.HIT))


def _statuses(dataset: xarray.Dataset) -> dict[str, v.Variable]:
    """Columns that tell how a core ended, in the target and in each layer, with their variables."""
    layers = dataset.sizes["layer"] if v.LAYER_STATUS in dataset else 0
    return {v.STATUS: v.STATUS} | {f"{v.LAYER_STATUS}_{layer}": v.LAYER_STATUS for layer in range(layers)}


def _as_given(array: xarray.DataArray) -> np.ndarray[Any, Any]:
    """Values of a column. Angles in a file are degrees converted from radians. If a short number of degrees has the
    same value after this conversion, it is taken as the given one."""
    values: np.ndarray[Any, Any] = array.values
    if array.attrs.get("units") != "degree" or values.dtype != np.float64:
        return values
    short = np.round(values, _ANGLE_DECIMALS)
    return np.where(np.degrees(np.radians(short)) == values, short, values)


def _columns(dataset: xarray.Dataset) -> Iterator[tuple[str, xarray.DataArray]]:
    """Columns of the table by their names, each of shape [hits]."""
    for name in (v.HIT_Y, v.HIT_Z, *dataset.data_vars):
        array = dataset[name]
        if array.dims == ("hit",):
            yield str(name), array
        elif array.dims == ("hit", "standoff"):
            for index, standoff in enumerate(dataset[v.STANDOFF].values):
                yield f"{name}_{standoff * 1e3:g}mm", array[:, index]
        elif array.dims == ("hit", "axis"):
            for index, axis in enumerate(dataset[v.AXIS].values):
                yield f"{name}_{axis}", array[:, index]
        elif array.dims == ("hit", "layer"):
            for layer in range(array.sizes["layer"]):
                yield f"{name}_{layer}", array[:, layer]


def _units(dataset: xarray.Dataset) -> dict[str, str]:
    """Units of the columns; a status is a word."""
    words = _statuses(dataset)
    return {name: "1" if name in words else str(array.attrs["units"]) for name, array in _columns(dataset)}


def write_csv(dataset: xarray.Dataset, path: Path) -> None:
    """Write `to_dataframe` as CSV, whole or not at all. Of an open file, one slice at a time is in memory.

    A header is a name and its unit, as in ``hit_y [m]``; a campaign can take the file as its list of hits. Numbers have
    all significant digits; a missing value is empty.

    Raises:
        OutputError: the file cannot be written; an existing file stays as it is.
    """
    is_first = True
    with aside(path) as file:
        for part in slices(dataset):
            frame = to_dataframe(part)
            header = [_header(name, unit) for name, unit in _units(part).items()] if is_first else False
            frame.to_csv(file, mode="w" if is_first else "a", header=header)
            is_first = False


def _header(name: str, unit: str) -> str:
    """Text such as "spin [rad/s]"; without brackets if there is no unit."""
    shown = unit.replace(" s-1", "/s").replace("degree", "deg")
    return name if shown == "1" else f"{name} [{shown}]"
