"""The file of a replayed hit: its variables, what is checked of it, and what is shown of it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from warpimpact.kernels.status import Status
from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.results.declared import Declaration, Positive, finite, texts
from warpimpact.results.kind import Kind
from warpimpact.view.view import Column, Section, Table, number

if TYPE_CHECKING:
    import xarray


def _history_fault(dataset: xarray.Dataset) -> str | None:
    least = {v.CELL_Y: 2, v.CELL_Z: 2, v.STATION: 2, v.TIME: 1, v.SNAPSHOT: 1}
    few = [name for name, size in least.items() if dataset.sizes[str(name)] < size]
    return f'it has too few values of "{few[0]}"' if few else None


def _turns(values: np.ndarray[Any, Any], sizes: Mapping[str, int]) -> bool:
    """Whether the values are quaternions, none of which is 0."""
    return finite(values, sizes) and values.shape[-1] == 4 and bool((np.linalg.norm(values, axis=-1) > 0.0).all())


def _ascending(values: np.ndarray[Any, Any], sizes: Mapping[str, int]) -> bool:
    return finite(values, sizes) and bool((np.diff(values) > 0.0).all())


_HISTORY = Declaration(
    {variable: variable.dims for variable in (*v.HISTORY_COORDINATES, *v.HISTORY_VARIABLES)},
    rules={
        v.QUATERNION: texts,
        v.ATTITUDE: _turns,
        **dict.fromkeys((v.TIME, v.SNAPSHOT, v.STATION, v.CORE_RADIUS, v.PLATE_POSITION), finite),
        **dict.fromkeys((v.CELL_Y, v.CELL_Z), _ascending),
    },
    attributes={attr.PLATE_THICKNESS: Positive, attr.PLATE_PERIOD: tuple[Positive, Positive]},
    more=_history_fault,
)

_AGREEMENT = {
    "bit-identical": "The end is bit-identical to the stored outcome.",
    "within rounding": "The end equals the stored outcome within rounding, as expected of another device.",
    "different": "The end DIFFERS from the stored outcome; probably another version of warpimpact computed it.",
}


def hit_view(history: xarray.Dataset) -> list[Section]:
    """Where a replayed hit was, how it ended, and whether it agrees with the stored outcome."""
    place = ", ".join(f"{axis} = {float(history[v.HIT_POINT[axis]]) * 1e3:.3f} mm" for axis in "yz")
    tilts = [tilt for tilt in history[v.TILT] if tilt.notnull()]
    numbers = [
        ("residual velocity", float(history[v.RESIDUAL_VELOCITY]), "m/s"),
        *((f"tilt at {float(tilt.standoff) * 1e3:g} mm", float(tilt), "°") for tilt in tilts),
    ]
    table = Table((Column(), number(digits=".1f"), Column()), numbers)
    end, agreement = Status(int(history[v.STATUS])).sentence, _AGREEMENT[history.attrs[attr.AGREEMENT]]
    return [Section([end, table, *_broken(history), agreement], f"hit {history.attrs[attr.HIT]} at {place}")]


def _broken(history: xarray.Dataset) -> list[str]:
    """Whether the core broke, and when and where, if it has a strength."""
    if v.BROKEN not in history:
        return []
    if not history[v.BROKEN]:
        return ["The bending stress stayed below the core's strength."]
    time, section = float(history[v.BROKEN_TIME]) * 1e6, float(history[v.BROKEN_SECTION]) * 1e3
    return [
        f"The bending stress passed the core's strength after {time:.1f} µs, {section:.1f} mm behind the nose. The "
        "computed core goes on as one body."
    ]


HISTORY = Kind(
    "the history of a hit",
    "warpimpact inspect, report and export take it",
    (v.TIME,),
    maker="warpimpact replay",
    fault=_HISTORY.fault,
    view=hit_view,
)
