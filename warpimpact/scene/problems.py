"""The reason why the tables of a file are not valid, as a sentence."""

from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from .units import brief, quoted

_CHOICES = ("shape", "distribution", "name")
_MOST_PROBLEMS = 8
"""Most problems of a file that a sentence names."""


def sentence(error: ValidationError, data: dict[str, Any]) -> str:
    """The first problems as a sentence, and how many more there are."""
    problems = [problem for problem in error.errors(include_url=False) if not _follows(problem, error)]
    described = [
        ": ".join(filter(None, (_place(problem, data), complaint(problem)))) for problem in problems[:_MOST_PROBLEMS]
    ]
    if (more := len(problems) - len(described)) > 0:
        described.append(f"{more} more problem{'s' if more > 1 else ''}")
    return "; also ".join(described)


def _follows(problem: ErrorDetails, error: ValidationError) -> bool:
    """Whether a list is too short only because its items are wrong, which another problem reports."""
    place = problem["loc"]
    inner = (other["loc"] for other in error.errors(include_url=False) if len(other["loc"]) > len(place))
    return problem["type"] == "too_short" and any(other[: len(place)] == place for other in inner)


def _place(problem: ErrorDetails, data: Any) -> str:
    """Dotted TOML key of a problem, without the names of choices (_CHOICES), which pydantic counts as keys. The first
    table [[layer]] is "layer 1", because the plate is layer 0."""
    place = ""
    for part in problem["loc"]:
        if isinstance(data, dict) and part not in data and part in map(data.get, _CHOICES):
            continue
        number = f" {part + 1}" if place == ".layer" and isinstance(part, int) else f"[{part}]"
        place += number if isinstance(part, int) else f".{part}"
        inner = isinstance(data, list) and isinstance(part, int) and part < len(data)
        data = data[part] if inner else data.get(part) if isinstance(data, dict) else None
    if problem["type"].startswith("union_tag"):
        place += f".{problem['ctx']['discriminator'].strip(chr(39))}"
    return brief(place.removeprefix("."))


def complaint(problem: ErrorDetails) -> str:
    """Sentence on what was found and what is allowed."""
    context = problem.get("ctx", {})
    match problem["type"]:
        case "missing" | "union_tag_not_found":
            return "is missing, but must be given"
        case "value_error":
            return str(context["error"])
        case "union_tag_invalid":
            return f'got "{brief(str(context["tag"]))}", but it must be one of {context["expected_tags"]}'
        case "model_type" | "model_attributes_type" | "dict_type":
            return f"got {quoted(problem['input'])}, but it must be a table"
        case "too_short":
            return f"got {quoted(problem['input'])}, but it must have at least {context['min_length']} items"
        case "too_long":
            return f"got {quoted(problem['input'])}, but it must have at most {context['max_length']} items"
        case "tuple_type" | "list_type":
            return f"got {quoted(problem['input'])}, but it must be a list"
    allowed = problem["msg"].replace("Input should", "it must")
    return f"got {quoted(problem['input'])}, but {allowed}"
