"""The JSON schema of design files, for editors and for the reference in the documentation."""

from __future__ import annotations

from typing import Any

from warpimpact.campaign.schema import campaign_schema, completed_schema
from warpimpact.optimisation.design import Asking

Schema = dict[str, Any]


def asking_schema() -> Schema:
    """The JSON schema of the tables of a design file beside those of a campaign."""
    schema = completed_schema(Asking)
    schema["properties"]["variables"] = {
        "description": 'Free variables by their places, such as "plate.pattern.width": a range with low, high and, '
        "where it has one, a step; or a list of values, or of tables with names.",
        "type": "object",
        "additionalProperties": {"type": ["object", "array"]},
    }
    return schema


def design_schema() -> Schema:
    """The JSON schema (2020-12) of a design file, with the meaning, the default and the bounds of every key."""
    campaign, asking = campaign_schema(), asking_schema()
    left_out = ("stop", "burst", "sweep", "published")
    return campaign | {
        "title": "warpimpact design",
        "description": "A search for designs: a campaign, what is free in it, and what is sought.",
        "properties": {key: key_schema for key, key_schema in campaign["properties"].items() if key not in left_out}
        | asking["properties"],
        "$defs": campaign["$defs"] | asking["$defs"],
        "required": [*(key for key in campaign.get("required", ()) if key != "hits"), "objectives"],
    }
