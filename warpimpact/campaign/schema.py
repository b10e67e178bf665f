"""The JSON schema of campaign files, from the models: for editors, and for the reference in the documentation."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator
from typing import Any

from pydantic import BaseModel, TypeAdapter

from ..scene.distributions import PURE_NUMBERS, Distribution
from ..scene.model import Model
from ..scene.quantities import SCATTERED
from ..scene.units import PositiveArealDensity
from .campaign import Campaign

Schema = dict[str, Any]

_BOUNDS = {"gt": "exclusiveMinimum", "ge": "minimum", "lt": "exclusiveMaximum", "le": "maximum"}
_ENTRY = re.compile(r"^    (?P<names>\w+(?:, \w+)*)(?: \[[^]]*\])?: ?(?P<text>.*)$")


def campaign_schema() -> Schema:
    """The JSON schema (2020-12) of a campaign file, and of one with several plates for ``warpimpact compare``.

    Every key has its description, its default and its bounds. A quantity is a number or a string with a unit; the
    keyword ``unit`` is the unit of a number. A schema cannot say that keys exclude each other: warpimpact does.
    """
    schema = _described(Campaign)
    definitions = schema["$defs"]
    _take_weights(definitions)
    _take_distributions(schema)
    _take_plates(schema)
    schema["properties"]["sweep"] = {
        "description": 'Values of inputs, such as obliquity or "plate.pattern.width", for warpimpact sweep.',
        "type": "object",
        "additionalProperties": {"type": "array", "minItems": 1},
    }
    definitions["Stop"]["properties"]["half_width"]["type"] = ["number", "string"]
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **_named(_decided(schema, definitions)),
        "title": "warpimpact campaign",
        "description": "A campaign of warpimpact: what is shot at what, where, how finely it is computed.",
    }


def completed_schema(model: type[BaseModel]) -> Schema:
    """The JSON schema of a file whose tables are those of a model, with descriptions, defaults and bounds."""
    schema = _described(model)
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **_decided(schema, schema["$defs"])}


def _described(model: type[BaseModel]) -> Schema:
    schema: Schema = _tidied(model.model_json_schema(mode="validation"))
    for kind in _models():
        if kind.__name__ in schema["$defs"]:
            _complete(schema["$defs"][kind.__name__], kind)
    _complete(schema, model)
    return schema


def _models(base: type[BaseModel] = Model) -> Iterator[type[BaseModel]]:
    """All models of campaigns."""
    for model in base.__subclasses__():
        yield model
        yield from _models(model)


def _tidied(part: Any) -> Any:
    """The schema without titles and without what TOML lacks (null, infinity), with the bounds in standard names."""
    if isinstance(part, list):
        return [_tidied(entry) for entry in part]
    if not isinstance(part, dict):
        return part
    kept = {_BOUNDS.get(name, name): _tidied(value) for name, value in part.items() if _says_something(name, value)}
    choices = [choice for choice in kept.get("anyOf", []) if choice != {"type": "null"}]
    if len(choices) == 1:
        del kept["anyOf"]
        return choices[0] | kept
    return kept | ({"anyOf": choices} if choices else {})


def _says_something(name: str, value: Any) -> bool:
    if name == "title":
        return isinstance(value, dict)  # a key of that name
    return name != "default" or value not in (None, float("inf"))


def _complete(definition: Schema, model: type[BaseModel]) -> None:
    """Add to a definition what the model knows of its keys beyond their types."""
    properties, (summary, meanings) = definition["properties"], read_docstring(model)
    definition["description"] = summary
    for name, text in meanings.items():
        if name in properties:
            properties[name]["description"] = _in_a_file(text)
    if issubclass(model, Model):
        of_files = [key for key in model._keys() if key not in (*properties, *model.in_python)]
        for name in of_files:  # read into other keys, as a file is
            properties[name] = {"description": _in_a_file(meanings.get(name, ""))}
            if name == "file":
                definition.pop("required", None)
    chosen = [name for name in ("shape", "distribution", "name") if "const" in properties.get(name, {})]
    if chosen:
        definition["required"] = [*chosen, *definition.get("required", [])]


def _in_a_file(text: str) -> str:
    """The description of a field for the key of a file. The unit is left out, because the schema gives it."""
    return re.sub(r"\bNone\b", "not given", re.sub(r"(?:^|\s)\[[^]]*\]", "", text)).strip(" .") + "."


def read_docstring(model: type) -> tuple[str, dict[str, str]]:
    """The first paragraphs of a model's docstring, and the meanings of its keys."""
    meanings: dict[str, str] = {}
    for kind in reversed(model.__mro__):
        meanings |= _entries(inspect.cleandoc(kind.__doc__ or "").partition("Attributes:\n")[2])
    summary = inspect.cleandoc(model.__doc__ or "").partition("Attributes:\n")[0]
    return " ".join(summary.split()), meanings


def _entries(text: str) -> dict[str, str]:
    entries: dict[str, str] = {}
    names: list[str] = []
    for line in text.splitlines():
        if line and not line.startswith(" "):  # the section ends
            break
        if (match := _ENTRY.match(line)) is not None:
            names = match["names"].split(", ")
            entries |= dict.fromkeys(names, match["text"])
        elif line.strip():
            entries |= {name: f"{entries[name]} {line.strip()}" for name in names}
    return entries


def _take_weights(definitions: Schema) -> None:
    """Accept a thickness or an areal density for a plate."""
    density = _tidied(TypeAdapter(PositiveArealDensity).json_schema())
    for table in (definitions["Plate"], definitions["Layer"]):
        table["properties"]["areal_density"] |= density
        table["required"].remove("thickness")
        table |= {"if": {"required": ["areal_density"]}, "then": {"properties": {"thickness": {"not": {}}}}}
        table["else"] = {"required": ["thickness"]}


def _named(schema: Schema) -> Schema:
    """A schema that also accepts a threat for the keys of a core and for the velocity, and a material for a
    resistance."""
    definitions = schema["$defs"]
    cores = [choice["then"]["$ref"].rpartition("/")[2] for choice in schema["properties"]["core"]["allOf"]]
    for name in cores:
        required = definitions[name]["required"]
        definitions[name] |= {"required": ["shape"], "allOf": [_unless("threat", {"required": required})]}
    for name in ("Plate", "Layer", "NamedPlate"):
        definitions[name]["required"] = [key for key in definitions[name]["required"] if key != "resistance"]
        definitions[name]["allOf"] = [_unless("material", {"required": ["resistance"]})]
    core = schema["properties"]["core"]
    core["allOf"].append(_unless("threat", {"required": core.pop("required")}))
    del definitions["Impact"]["required"]
    without = {"required": ["impact"], "properties": {"impact": {"required": ["velocity"]}}}
    named = {"properties": {"core": {"required": ["threat"]}}}
    required = [key for key in schema["required"] if key != "impact"]
    return schema | {"required": required, "if": named, "else": without}


def _unless(key: str, rest: Schema) -> Schema:
    """A condition that applies to a table without a key."""
    return {"if": {"required": [key]}, "else": rest}


def _take_distributions(schema: Schema) -> None:
    """Accept distributions for values that scatter."""
    definitions, kinds = schema["$defs"], [model.__name__ for model in _models(Distribution)]
    kinds = [name for name in kinds if name in definitions]
    for name in kinds:
        for key, key_schema in definitions[name]["properties"].items():
            if key not in PURE_NUMBERS:
                key_schema.get("items", key_schema)["type"] = ["number", "string"]
    definitions["Distribution"] = {
        "description": "A distribution in the place of a value: each shot draws its own.",
        "oneOf": [{"$ref": f"#/$defs/{name}"} for name in kinds],
    }
    # A file has its distributions in the places of values.
    del schema["properties"]["scatter"], definitions["Scatter"]
    for name, quantity in SCATTERED.items():
        for table in (schema["properties"][quantity.table], {"$ref": "#/$defs/Layer"} if quantity.by_layer else {}):
            for definition in _referred(schema, table):
                if name in definition["properties"]:
                    _let_scatter(definition["properties"], name)
    offset = definitions["Layer"]["properties"]["offset"]
    offset["prefixItems"] = [{"anyOf": [item, {"$ref": "#/$defs/Distribution"}]} for item in offset["prefixItems"]]


def _let_scatter(properties: Schema, name: str) -> None:
    """Accept a distribution for this value."""
    value = properties[name]
    beside = {key: value.pop(key) for key in ("description", "default") if key in value}
    properties[name] = beside | {"anyOf": [value, {"$ref": "#/$defs/Distribution"}]}


def _referred(schema: Schema, part: Schema) -> list[Schema]:
    """The definitions to which a part of the schema refers."""
    references = [choice["$ref"] for choice in (part, *part.get("oneOf", [])) if "$ref" in choice]
    return [schema["$defs"][reference.rpartition("/")[2]] for reference in references]


def _take_plates(schema: Schema) -> None:
    """Accept several plates, each with a name, in a file for ``warpimpact compare``."""
    plate_schema = schema["$defs"]["Plate"]
    name = {"type": "string", "description": "Name of the plate and of its result; only where there are several."}
    layers = {
        "type": "array",
        "items": {"$ref": "#/$defs/Layer"},
        "description": "What stands behind this plate, in order.",
    }
    schema["$defs"]["NamedPlate"] = plate_schema | {
        "description": "One of several plates that are compared.",
        "properties": {"name": name, "layer": layers} | plate_schema["properties"],
        "required": ["name", *plate_schema["required"]],
    }
    several = {"type": "array", "items": {"$ref": "#/$defs/NamedPlate"}, "minItems": 2}
    plate = schema["properties"]["plate"]
    description = plate.pop("description")
    schema["properties"]["plate"] = {"description": description, "anyOf": [several, plate]}


def _decided(part: Any, definitions: Schema) -> Any:
    """The schema with conditions on the kind of a value or on a key instead of anyOf and oneOf. An editor then marks
    the wrong key; for several choices none of which fits, it would mark the whole table."""
    if isinstance(part, list):
        return [_decided(entry, definitions) for entry in part]
    if not isinstance(part, dict):
        return part
    rest = {name: _decided(inner, definitions) for name, inner in part.items() if name not in ("anyOf", "oneOf")}
    rest.pop("discriminator", None)
    if "oneOf" in part:
        return rest | _by_key([choice["$ref"] for choice in part["oneOf"]], definitions)
    if "anyOf" in part:
        return rest | _by_kind(_decided(part["anyOf"], definitions))
    return rest


def _by_kind(choices: list[Schema]) -> Schema:
    """A choice by the kind of the value: keywords for a number, a string or a list do not affect other kinds."""
    merged: Schema = {"type": []}
    for choice in choices:
        table = "$ref" in choice or choice["type"] == "object"
        kinds = ["object"] if table else choice["type"] if isinstance(choice["type"], list) else [choice["type"]]
        merged["type"] += kinds
        merged |= (
            {"if": {"type": "object"}, "then": choice} if table else {k: v for k, v in choice.items() if k != "type"}
        )
    return merged


def _by_key(references: list[str], definitions: Schema) -> Schema:
    """A choice between tables by one of their keys. Their keys are repeated here, for completion."""
    tables = [definitions[reference.rpartition("/")[2]] for reference in references]
    key = next(name for name, table in tables[0]["properties"].items() if "const" in table)
    names = [table["properties"][key]["const"] for table in tables]
    meant = {
        name: key_schema.get("description", "") for table in tables for name, key_schema in table["properties"].items()
    }
    return {
        "type": "object",
        "required": [key],
        "properties": {name: {"description": text} for name, text in meant.items()}
        | {key: {"enum": names, "description": f"One of {', '.join(names)}."}},
        "allOf": [
            {"if": {"required": [key], "properties": {key: {"const": name}}}, "then": {"$ref": reference}}
            for name, reference in zip(names, references, strict=True)
        ],
    }
