"""Campaign: one TOML file, validated, as one immutable value."""

import json
import tomllib
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field, PrivateAttr, ValidationError, field_validator, model_validator
from pydantic_core import ErrorDetails

from ..scene import AnyCore, Hits, Impact, Interaction, Numerics, Plate
from ..scene.model import Model
from ..scene.units import PositiveLength, quoted


class CampaignError(ValueError):
    """A campaign that cannot be run: one sentence naming file, field, value and what is allowed."""


class Output(Model):
    """What is reported.

    Attributes:
        standoffs: distances behind the rear face at which the attitude is reported [m], increasing.
        standoff_point: the point of the core that passes them.
    """

    standoffs: Annotated[tuple[PositiveLength, ...], Field(min_length=1)] = (0.05, 0.13)
    standoff_point: Literal["centre_of_mass", "nose"] = "centre_of_mass"

    @field_validator("standoffs")
    @classmethod
    def _increase(cls, standoffs: tuple[float, ...]) -> tuple[float, ...]:
        for before, after in pairwise(standoffs):
            if after <= before:
                raise ValueError(f"got {after:g} m after {before:g} m, but stand-offs must increase")
        return standoffs


class Campaign(Model):
    """What is shot at what, where, how finely it is computed and what is reported."""

    title: str
    core: AnyCore
    plate: Plate
    impact: Impact
    hits: Hits
    interaction: Interaction = Interaction()
    numerics: Numerics = Numerics()
    output: Output = Output()
    _source: str = PrivateAttr("")

    @property
    def text(self) -> str:
        """The TOML file as it was read; of a campaign made in Python, its values as JSON."""
        return self._source or self.model_dump_json()

    @classmethod
    def from_toml(cls, path: str | Path, *, count: int | None = None) -> Self:
        """Read a campaign file; file names in it count from its folder.

        Args:
            path: the TOML file.
            count: number of hits, in place of the file's.

        Raises:
            CampaignError: the file is missing, is no TOML, or asks for something that cannot be.
        """
        path = Path(path)
        return cls.from_text(_read(path), name=str(path), folder=path.parent, count=count)

    @classmethod
    def from_text(cls, text: str, *, name: str, folder: Path, count: int | None = None) -> Self:
        """Read what `text` gave.

        Args:
            text: TOML, or JSON as of a campaign made in Python.
            name: what errors call it.
            folder: where the files are that it names.
            count: number of hits, in place of the text's.

        Raises:
            CampaignError: the text is no TOML, or asks for something that cannot be.
        """
        try:
            data = json.loads(text) if text.startswith("{") else tomllib.loads(text)
        except ValueError as error:
            raise CampaignError(f"{name}: is not valid TOML: {error}") from None
        if count is not None and isinstance(data.setdefault("hits", {}), dict):
            data["hits"]["count"] = count
        try:
            campaign = cls.model_validate(data, context={"folder": folder})
        except ValidationError as error:
            raise CampaignError(f"{name}: {_sentence(error, data)}") from None
        campaign._source = text
        return campaign

    @model_validator(mode="after")
    def _standoffs_clear_of_plate(self) -> Self:
        needed = self.core.bounding_radius
        if self.output.standoff_point == "nose":
            needed += self.core.mass_properties.centre_of_mass
        if self.output.standoffs[0] < needed:
            raise ValueError(
                f"got output.standoffs of {self.output.standoffs[0]:g} m, "
                f"but a core of this size is sure to be out of the plate only from {needed:.4g} m"
            )
        return self


def _read(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise CampaignError(f"{path}: there is no such file") from None
    except OSError as error:
        raise CampaignError(f"{path}: cannot be read ({error.strerror})") from None
    except UnicodeDecodeError as error:
        raise CampaignError(f"{path}: is not valid TOML: {error}") from None


def _sentence(error: ValidationError, data: dict[str, Any]) -> str:
    """The first problem as a sentence, and how many more there are."""
    problems = error.errors(include_url=False)
    place, complaint = _place(problems[0], data), _complaint(problems[0])
    more = len(problems) - 1
    also = f" (and {more} more problem{'s' if more > 1 else ''})" if more else ""
    return f"{place}: {complaint}{also}" if place else f"{complaint}{also}"


def _place(problem: ErrorDetails, data: Any) -> str:
    """Dotted TOML key of a problem, without the chosen `shape`, which pydantic counts as a key."""
    place = ""
    for part in problem["loc"]:
        if isinstance(data, dict) and part not in data and part == data.get("shape"):
            continue
        place += f"[{part}]" if isinstance(part, int) else f".{part}"
        data = data.get(part) if isinstance(data, dict) else None
    if problem["type"].startswith("union_tag"):
        place += ".shape"
    return place.removeprefix(".")


def _complaint(problem: ErrorDetails) -> str:
    """What was got and what is allowed."""
    context = problem.get("ctx", {})
    match problem["type"]:
        case "missing" | "union_tag_not_found":
            return "is missing, but must be given"
        case "value_error":
            return str(context["error"])
        case "union_tag_invalid":
            return f'got "{context["tag"]}", but it must be one of {context["expected_tags"]}'
        case "model_type" | "model_attributes_type":
            return f"got {quoted(problem['input'])}, but it must be a table"
        case "tuple_type":
            return f"got {quoted(problem['input'])}, but it must be a list"
    allowed = problem["msg"].replace("Input should", "it must")
    return f"got {quoted(problem['input'])}, but {allowed}"
