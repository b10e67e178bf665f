"""JSON schemas of TOML files, which pydantic makes from the models: for editors and for the documentation."""

import math
from typing import Any

from pydantic import BaseModel

from .campaign import Campaign

Schema = dict[str, Any]

_BOUNDS = {"gt": "exclusiveMinimum", "ge": "minimum", "lt": "exclusiveMaximum", "le": "maximum"}


def file_schema(model: type[BaseModel], title: str) -> Schema:
    """The JSON schema (2020-12) of a file whose tables are those of a model.

    A quantity is a number, a string with a unit, or a table of its distribution. The keyword `unit` is the unit of a
    number.
    """
    schema = _plain(model.model_json_schema())
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema, "title": title}


def campaign_schema() -> Schema:
    """The JSON schema of a campaign, and of one with several plates. No key is required, as names give some of them."""
    schema = file_schema(Campaign, "warpimpact campaign")
    properties = schema["properties"]
    for key, table in (("scatter", "Scatter"), ("reference_of", "ReferenceOf")):  # a file has distributions in place
        del properties[key], schema["$defs"][table]  # of values, and is no reference
    several = {"type": "array", "items": {"type": "object"}, "minItems": 2}
    properties["plate"] = {
        "description": properties["plate"].pop("description"),
        "anyOf": [properties["plate"], several],
    }
    properties["sweep"] = {
        "description": 'Values of inputs, such as obliquity or "plate.pattern.width", for warpimpact sweep.',
        "type": "object",
        "additionalProperties": {"type": "array", "minItems": 1},
    }
    for table in (schema, *schema["$defs"].values()):
        table.pop("required", None)
    return schema


def _plain(part: Any) -> Any:
    """The schema without what TOML lacks (null, infinity), with bounds and choices in standard keywords."""
    if isinstance(part, list):
        return [_plain(entry) for entry in part]
    if not isinstance(part, dict):
        return part
    kept = {_BOUNDS.get(name, name): _plain(value) for name, value in part.items()}
    if isinstance(kept.get("title"), str):  # not a key of that name
        del kept["title"]
    if kept.get("default", 0) in (None, math.inf):
        del kept["default"]
    kept.pop("discriminator", None)
    choices = [choice for choice in kept.pop("oneOf", kept.pop("anyOf", [])) if choice != {"type": "null"}]
    if len(choices) == 1:
        return choices[0] | kept
    return kept | ({"anyOf": choices} if choices else {})
