"""The base class of the models of a scene, and the reason why a table is not valid as a sentence."""

import inspect
import re
from collections.abc import Mapping
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, GetJsonSchemaHandler, ValidationError, model_validator
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, ErrorDetails

from .units import hint, quoted, shorten

Array = NDArray[np.float64]
_ENTRY = re.compile(r"^    (?P<names>\w+(?:, \w+)*): ?(?P<text>.*)$")
"""An entry under Attributes in a docstring."""


class Model(BaseModel):
    """A validated, immutable value. A misspelt field is an error, and its message suggests the right name."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    @classmethod
    def __get_pydantic_json_schema__(cls, core_schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        """The schema of a table, with the meanings of its keys and with keys that are read into others."""
        schema = handler(core_schema)
        table = handler.resolve_ref_schema(schema)
        table["description"] = " ".join(inspect.cleandoc(cls.__doc__ or "").partition("Attributes:\n")[0].split())
        for name, text in cls.meanings().items():
            if name in cls._keys():
                table["properties"].setdefault(name, {})["description"] = text
        return schema

    @classmethod
    def meanings(cls) -> dict[str, str]:
        """Meanings of the keys, by the docstrings."""
        entries: dict[str, str] = {}
        for kind in reversed(cls.__mro__):
            names: list[str] = []
            section = inspect.cleandoc(kind.__doc__ or "").partition("Attributes:\n")[2].partition("\n\n")[0]
            for line in section.splitlines():
                if match := _ENTRY.match(line):
                    names = match["names"].split(", ")
                    entries |= dict.fromkeys(names, match["text"])
                else:
                    entries |= {name: f"{entries[name]} {line.strip()}" for name in names}
        return entries

    @model_validator(mode="before")
    @classmethod
    def _knows_every_key(cls, values: Any) -> Any:
        allowed = cls._keys()
        unknown = [key for key in values if key not in allowed] if isinstance(values, dict) else []
        if unknown:
            raise ValueError(f"got the unknown key {quoted(unknown[0])}; {hint(str(unknown[0]), allowed)}")
        return values

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """A copy with changes. It is validated like any other value. Cached values of the original are not copied.

        Args:
            update: new values of fields, as the model takes them; file names are relative to the working directory.
            deep: without effect, as values cannot change.

        Raises:
            ValidationError: a field is unknown, or the copy is not valid.
        """
        kept = {name: value for name, value in self if name in self.model_fields_set}
        return type(self).model_validate(kept | dict(update or {}))

    def __eq__(self, other: object) -> bool:
        """Whether all fields are equal; cached values and the text of a file do not count."""
        names = type(self).model_fields
        return type(self) is type(other) and all(getattr(self, name) == getattr(other, name) for name in names)

    @classmethod
    def _keys(cls) -> list[str]:
        return list(cls.model_fields)


_CHOICES = ("shape", "distribution", "name")
_MOST_PROBLEMS = 8
"""Most problems of a file that a sentence names."""


def sentence(error: ValidationError, data: dict[str, Any], root: tuple[str, int] = ("", 0)) -> str:
    """The first problems as a sentence, and how many more there are; `root` stands for this many parts of a place."""
    described = [
        ": ".join(filter(None, (_place(problem, data, root), complaint(problem))))
        for problem in error.errors(include_url=False)
    ]
    more = [f"{len(described) - _MOST_PROBLEMS} more"] if len(described) > _MOST_PROBLEMS else []
    return "; also ".join(described[:_MOST_PROBLEMS] + more)


def _place(problem: ErrorDetails, data: Any, root: tuple[str, int]) -> str:
    """Dotted TOML key of a problem, without the names of choices (_CHOICES), which pydantic counts as keys. The first
    table [[layer]] is "layer 1", because the plate is layer 0."""
    place = ""
    for depth, part in enumerate(problem["loc"], start=1):
        if isinstance(data, dict) and part not in data and part in map(data.get, _CHOICES):
            continue
        number = f" {part + 1}" if place == ".layer" and isinstance(part, int) else f"[{part}]"
        place = root[0] if depth <= root[1] else place + (number if isinstance(part, int) else f".{part}")
        inner = isinstance(data, list) and isinstance(part, int) and part < len(data)
        data = data[part] if inner else data.get(part) if isinstance(data, dict) else None
    if problem["type"].startswith("union_tag"):
        place += f".{problem['ctx']['discriminator'].strip(chr(39))}"
    return shorten(place.removeprefix("."))


_ALLOWED = {
    **dict.fromkeys(("model_type", "model_attributes_type", "dict_type"), "it must be a table"),
    **dict.fromkeys(("tuple_type", "list_type"), "it must be a list"),
    "bool_type": "it must be true or false",
    **dict.fromkeys(("int_type", "int_from_float", "int_parsing"), "it must be a whole number"),
    "too_short": "it must have at least {min_length} items",
    "too_long": "it must have at most {max_length} items",
}
"""What is allowed, by types of problems for which pydantic has words of Python."""


def complaint(problem: ErrorDetails) -> str:
    """Sentence on what was found and what is allowed."""
    kind, context = problem["type"], problem.get("ctx", {})
    if kind in ("missing", "union_tag_not_found"):
        return "is missing, but must be given"
    if kind == "value_error":
        return str(context["error"])
    if kind == "union_tag_invalid":
        return f'got "{shorten(str(context["tag"]))}", but it must be one of {context["expected_tags"]}'
    if _ALLOWED.get(kind) == "it must be a list" and isinstance(problem["input"], dict):
        return f"is a table, but there may be several: write [[{problem['loc'][-1]}]]"
    allowed = _ALLOWED.get(kind, "").format(**context) or problem["msg"].replace("Input should", "it must")
    return f"got {quoted(problem['input'])}, but {allowed}"
