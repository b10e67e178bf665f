"""Distributions of a campaign file, taken out of the places of the values that they replace."""

from typing import Any

import numpy as np
from pydantic import ValidationError

from ..scene import Scatter
from ..scene.scatter import OF_A_LAYER, QUANTITIES, LayerScatter
from ..scene.units import quantity
from .problems import sentence
from .text import CampaignError


def with_scatter_apart(data: dict[str, Any], name: str) -> dict[str, Any]:
    """Distributions moved from the places of their values to `scatter`, their medians in the places."""
    data, scatter = dict(data), {}
    for field, (table, kind) in QUANTITIES.items():
        value = data[table].get(field) if isinstance(data.get(table), dict) else None
        if isinstance(value, dict):
            try:
                scatter[field] = getattr(Scatter.model_validate({field: value}), field)
            except ValidationError as error:
                raise CampaignError(f"{name}: {table}.{sentence(error, {field: value})}") from None
            median = float(scatter[field].quantile(np.array(0.5)))
            data[table] = data[table] | {field: quantity(kind).as_read(median)}
    if layers := _layers_apart(data, name):
        scatter["layers"] = layers
    return data | {"scatter": scatter} if scatter else data


def _layers_apart(data: dict[str, Any], name: str) -> list[LayerScatter]:
    """The distributions in the tables of the layers, whose places get the medians; empty if there are none."""
    tables = data.get("layer")
    if not isinstance(tables, list):
        return []
    data["layer"] = tables = [dict(table) if isinstance(table, dict) else table for table in tables]
    found = [_layer_apart(table, f"{name}: layer[{k}]") for k, table in enumerate(tables)]
    return found if any(one.given for one in found) else []


def _layer_apart(table: Any, place: str) -> LayerScatter:
    scatter: dict[str, Any] = {}
    for field, (_, kind) in OF_A_LAYER.items() if isinstance(table, dict) else ():
        key, at = (field[:-2], "yz".index(field[-1])) if field.startswith("offset") else (field, None)
        value = table.get(key)
        pair = isinstance(value, list) and len(value) == 2
        one = value[at] if at is not None and pair else None if at is not None else value
        if not isinstance(one, dict):
            continue
        try:
            scatter[field] = getattr(LayerScatter.model_validate({field: one}), field)
        except ValidationError as error:
            label = key if at is None else f"{key}[{at}]"
            raise CampaignError(f"{place}.{label}{sentence(error, {field: one}).removeprefix(field)}") from None
        median = quantity(kind).as_read(float(scatter[field].quantile(np.array(0.5))))
        table[key] = median if at is None else [median if k == at else old for k, old in enumerate(value)]
    return LayerScatter(**scatter)
