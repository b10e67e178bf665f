"""A hit map as a table, for pandas and for spreadsheets."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import xarray

from warpimpact.analysis.summary import slices
from warpimpact.results import variables as v
from warpimpact.results.dataset import status_codes
from warpimpact.results.files import aside


def to_dataframe(dataset: xarray.Dataset) -> pd.DataFrame:
    """One row per hit, in the units of the Dataset.

    A variable with stand-offs or axes gets one column for each: ``tilt_130mm``, ``angular_velocity_x``. ``status`` is a
    word.
    """
    columns = {}
    for name in (v.HIT_Y, v.HIT_Z, *dataset.data_vars):
        array = dataset[name]
        if array.dims == ("hit",):
            columns[str(name)] = array.values
        elif array.dims == ("hit", "standoff"):
            for index, standoff in enumerate(dataset[v.STANDOFF].values):
                columns[f"{name}_{standoff * 1e3:g}mm"] = array.values[:, index]
        elif array.dims == ("hit", "axis"):
            for index, axis in enumerate(dataset[v.AXIS].values):
                columns[f"{name}_{axis}"] = array.values[:, index]
    words = {code: word for word, code in status_codes(dataset).items()}
    columns[v.STATUS] = pd.Categorical.from_codes(columns[v.STATUS].astype(int), categories=pd.Index(words.values()))
    return pd.DataFrame(columns).rename_axis(index="hit")


def write_csv(dataset: xarray.Dataset, path: Path) -> None:
    """Write `to_dataframe` as CSV, whole or not at all. Of an open file, one slice at a time is in memory.

    Numbers have all significant digits; a missing value is empty.

    Raises:
        OutputError: the file cannot be written; an existing file stays as it is.
    """
    first = 0
    with aside(path) as file:
        for part in slices(dataset):
            frame = to_dataframe(part)
            frame.index += first
            frame.to_csv(file, mode="a" if first else "w", header=not first)
            first += len(frame)
