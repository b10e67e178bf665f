"""The JSON schema of fit files, for editors."""

from __future__ import annotations

from typing import Any

from warpimpact.campaign.schema import campaign_schema
from warpimpact.identification.fit import Sampling
from warpimpact.identification.fit_file import DISCREPANCY
from warpimpact.scene import Record

Schema = dict[str, Any]


def fit_schema() -> Schema:
    """The JSON schema (2020-12) of a fit file. Its tables core, plate, interaction and impact are those of a campaign,
    where a prior may replace any value."""
    whole = campaign_schema()
    for definition in whole["$defs"].values():
        definition.pop("allOf", None)  # a prior may also give what a name of the catalogue gives
        definition["required"] = [name for name in definition.get("required", []) if name in ("shape", "distribution")]
        if definition.get("if") == {"required": ["areal_density"]}:  # a prior may give the thickness
            del definition["if"], definition["then"], definition["else"]
    keys = whole["properties"]
    keys["plate"] = {"description": keys["plate"]["description"], **keys["plate"]["then"]}
    tables = {name: keys[name] for name in ("core", "plate", "interaction")}
    free: Schema = {"type": "object"}
    shot = {"name": {"type": "string"}, "hit": {}, "impact": keys["impact"], "measured": free, **tables}
    properties = {
        "title": keys["title"],
        **tables,
        "record": _table("What is recorded of a shot.", _keys(Record)),
        "numerics": keys["numerics"],
        "prior": free | {"description": "Distributions of the parameters, in the tables core, plate and interaction."},
        "discrepancy": _table("Scale of what the model misses.", {kind: {} for kind in DISCREPANCY}),
        "selection": {"description": "What the measured cores have in common."},
        "sampling": _table("How much is computed.", _keys(Sampling)),
        "catalogue": keys["catalogue"],
        "shot": {"type": "array", "minItems": 1, "items": _table("A measured shot.", shot)},
    }
    return {
        "$schema": whole["$schema"],
        "$defs": whole["$defs"],
        "title": "warpimpact fit",
        **_table("Measured shots, and what is to be found from them.", properties),
        "required": ["prior", "shot"],
    }


def _table(description: str, properties: Schema) -> Schema:
    return {"type": "object", "description": description, "properties": properties, "additionalProperties": False}


def _keys(model: Any) -> Schema:
    return {name: {} for name in model.model_fields}
