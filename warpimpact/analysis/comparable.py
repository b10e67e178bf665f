"""Whether results answer the same question, and whether their shots are the same."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
import xarray

from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.results.files import ResultError
from warpimpact.results.tallies import dealing
from warpimpact.runs.manifests import first_difference

_SAME_PLACE = 1e-9
"""Rounding of a place in units of the cell."""
_ANGLES = ("obliquity", "azimuth", "pitch", "yaw")


def check_same_question(result: xarray.Dataset, name: str, other: xarray.Dataset, other_name: str) -> None:
    """Refuse results with another core, impact or stand-offs.

    Raises:
        ResultError: the message names the first difference.
    """
    asked, asked_other = _question(result, name), _question(other, other_name)
    if (mismatch := first_difference(asked, asked_other)) is not None:
        place, was, now = mismatch
        raise ResultError(f"{other_name}: cannot be compared with {name}: {place} is {now} here and {was} there")


def _question(dataset: xarray.Dataset, name: str) -> dict[str, Any]:
    """What must be the same for plates to be compared."""
    attributes = dataset.attrs
    if not {attr.CORE, attr.IMPACT} <= attributes.keys():
        raise ResultError(f"{name}: has no description of its core and impact, which a comparison needs; run it again")
    output = {"standoffs": dataset[v.STANDOFF].values.tolist(), "standoff_point": attributes[attr.STANDOFF_POINT]}
    limit = {"limit": attributes[attr.LIMIT]} if attr.LIMIT in attributes else {}
    return limit | {
        "core": json.loads(attributes[attr.CORE]),
        "impact": _in_degrees(json.loads(attributes[attr.IMPACT])),
        "output": output,
    }


def _in_degrees(impact: dict[str, Any]) -> dict[str, Any]:
    """An impact whose angles in numbers are in degrees."""
    return {
        name: f"{math.degrees(value)!r} deg" if name in _ANGLES and isinstance(value, float) else value
        for name, value in impact.items()
    }


def other_shots(result: xarray.Dataset, other: xarray.Dataset) -> str:
    """Why the shots of two results differ; empty where they are the same."""
    if dealing(result) != dealing(other):
        return "their shots have other replicates"
    for axis, coordinate in enumerate((v.HIT_Y, v.HIT_Z)):
        here, there = (
            dataset[coordinate].values / dataset.attrs[attr.PLATE_PERIOD][axis] for dataset in (result, other)
        )
        if not np.allclose(here, there, rtol=0.0, atol=_SAME_PLACE):
            return "their shots hit other places of the cell"
    for name in (*v.SHOT_VARIABLES, v.MASS):
        if name in result and not (name in other and np.array_equal(result[name], other[name])):
            return f"their shots differ in {name}"
    return ""
