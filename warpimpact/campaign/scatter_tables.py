"""Distributions of a campaign file, moved out of the places of the values that they replace."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from pydantic import ValidationError

from ..scene import Scatter
from ..scene.distributions import Distribution
from ..scene.problems import sentence
from ..scene.quantities import SCATTERED
from ..scene.target import layer_name
from ..scene.units import quantity
from .text import CampaignError


def with_scatter_apart(data: dict[str, Any], name: str) -> dict[str, Any]:
    """Tables with distributions moved to `scatter`, and with their medians in the place of values."""
    data = {key: dict(table) if isinstance(table, dict) else table for key, table in data.items()}
    if isinstance(tables := data.get("layer"), list):
        data["layer"] = [dict(table) if isinstance(table, dict) else table for table in tables]
    scatter: dict[str, Any] = {}
    for field, known in SCATTERED.items():
        layers = [_taken(table, field, f"{name}: {place}", k) for k, place, table in _tables(data, field)]
        if any(layers):
            scatter[field] = layers if known.by_layer else layers[0]
    return data | {"scatter": scatter} if scatter else data


def _tables(data: dict[str, Any], field: str) -> Iterator[tuple[int, str, Any]]:
    """Number, place and table of everything that has a quantity: its table, or the layers from the plate on."""
    known, behind = SCATTERED[field], data.get("layer")
    yield 0, known.table, data.get(known.table)
    if known.by_layer and isinstance(behind, list):
        yield from ((k, layer_name(k), table) for k, table in enumerate(behind, start=1))


def _taken(table: Any, field: str, place: str, layer: int) -> Distribution | None:
    """Take the distribution of a quantity out of a table, which keeps its median."""
    if not isinstance(table, dict):
        return None
    key, at = (field[:-2], "yz".index(field[-1])) if field.startswith("offset") else (field, None)
    value: Any = table.get(key)
    pair = isinstance(value, list) and len(value) == 2
    entry = value if at is None else value[at] if pair else None
    if not isinstance(entry, dict):
        return None
    known, label = SCATTERED[field], key if at is None else f"{key}[{at}]"
    given = [*[None] * layer, entry] if known.by_layer else entry
    try:
        ((_, distribution),) = Scatter.model_validate({field: given}).given.items()
    except ValidationError as error:
        problem = sentence(error, {field: given}).removeprefix(field).removeprefix(f"[{layer}]")
        raise CampaignError(f"{place}.{label}{problem}") from None
    median = quantity(known.type).as_read(float(distribution.quantile(np.array(0.5))))
    table[key] = median if at is None else [median if k == at else old for k, old in enumerate(value or ())]
    return distribution
