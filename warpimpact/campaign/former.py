"""Campaigns in results of version 0.1.0, which took numbers of angles for radians."""

import json
from typing import Any

from ..results.measures import Measure
from ..scene.units import in_radians
from .text import parsed

_OF_THE_SHOT = ("obliquity", "azimuth", "pitch", "yaw")
_PURE_NUMBERS = ("distribution", "sigma", "weights")


def in_present_terms(text: str, name: str) -> str:
    """The text of such a campaign, in which every angle given as a number says that it is radians.

    Args:
        text: TOML or JSON.
        name: what errors call it.

    Raises:
        CampaignError: it is neither.
    """
    data = parsed(text, name)
    for table in (data.get("impact"), data.get("scatter")):
        _mark(table, *_OF_THE_SHOT)
    pattern = _inner(data, "plate", "pattern")
    _mark(pattern, "rotation")
    for hole in _inner(pattern, "holes") or ():
        hole[2:] = [_marked(turn) for turn in hole[2:]]
    stop = data.get("stop")
    if isinstance(stop, dict) and Measure.parse(stop["quantity"]).units == "degree":
        _mark(stop, "half_width")
    return json.dumps(data, default=str)


def _inner(table: Any, *names: str) -> Any:
    """What lies inside tables; None where there is no such table."""
    for name in names:
        table = table.get(name) if isinstance(table, dict) else None
    return table


def _mark(table: Any, *names: str) -> None:
    for name in names:
        if isinstance(table, dict) and name in table:
            table[name] = _marked(table[name])


def _marked(value: Any) -> Any:
    """A number with its unit; inside distributions, too."""
    if isinstance(value, dict):
        return {name: part if name in _PURE_NUMBERS else _marked(part) for name, part in value.items()}
    if isinstance(value, list):
        return [_marked(part) for part in value]
    return in_radians(value) if isinstance(value, int | float) else value
