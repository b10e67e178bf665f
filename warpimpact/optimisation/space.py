"""The free variables of a design: ranges, steps, lists and alternatives, and the campaign of a point in their space."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from warpimpact.campaign.places import is_table, labels_of, put, resolved
from warpimpact.campaign.text import CampaignError
from warpimpact.scene.model import Array
from warpimpact.scene.units import LARGEST, float_of, number_and_unit, quoted

_RANGE_DIGITS = 6
"""Significant digits of a value of a range without a step."""


@dataclass(frozen=True)
class DesignVariable:
    """A free variable: a range, with or without a step, or a choice.

    Attributes:
        name: key in the design file; below an alternative such as "plate.pattern[slots].width".
        place: place of its value in the campaign.
        low, high, step: bounds and step of a range, in its unit; no step if the range is continuous.
        unit: unit as written.
        labels, values: options of a choice.
        under: number of the choice, and of its option, below which the variable stands; None if it always counts.
    """

    name: str
    place: str
    low: float = 0.0
    high: float = 0.0
    step: float | None = None
    unit: str = ""
    labels: tuple[str, ...] = ()
    values: tuple[Any, ...] = ()
    under: tuple[int, int] | None = None

    @property
    def count(self) -> int | None:
        """Number of values; None of a continuous variable."""
        if self.labels:
            return len(self.labels)
        if self.low == self.high:
            return 1
        return None if self.step is None else 1 + math.floor((self.high - self.low) / self.step + 1e-9)

    def at(self, coordinate: float) -> float:
        """The value at a coordinate: a share of a continuous range, else the number of a value.

        The value of a choice is the number of the option.
        """
        if self.labels:
            return float(int(coordinate))
        if self.count is None:
            value = self.low + coordinate * (self.high - self.low)
        else:
            value = self.low + int(coordinate) * (self.step or 0.0)
        digits = _RANGE_DIGITS - 1 - math.floor(math.log10(max(abs(self.low), abs(self.high), 1e-300)))
        return min(max(round(value, digits), self.low), self.high)

    def written(self, value: float) -> Any:
        """A value as a campaign has it."""
        if self.labels:
            return self.values[int(value)]
        number = int(value) if not self.unit and value == int(value) and self.step is not None else value
        return f"{value:.12g} {self.unit}" if self.unit else number

    def text(self, value: float) -> str:
        """A value as text."""
        return self.labels[int(value)] if self.labels else f"{value:.6g} {self.unit}".strip()


@dataclass(frozen=True)
class Space:
    """All variables; a choice comes before the variables below it."""

    variables: tuple[DesignVariable, ...]

    @property
    def size(self) -> float:
        """Number of points, also of those that differ in unused variables only; infinite if continuous."""
        counts = [variable.count for variable in self.variables]
        return math.inf if None in counts else float(math.prod(count for count in counts if count is not None))

    def at(self, coordinates: Sequence[float]) -> Array:
        """Values at coordinates (`DesignVariable.at`), shape [variables]; NaN for unused variables."""
        values = np.full(len(self.variables), math.nan)
        for number, (variable, coordinate) in enumerate(zip(self.variables, coordinates, strict=True)):
            if variable.under is None or values[variable.under[0]] == variable.under[1]:
                values[number] = variable.at(coordinate)
        return values

    def points(self) -> list[Array]:
        """All points of a space that is not continuous, each once."""
        counts = [variable.count or 0 for variable in self.variables]
        every = (self.at([float(number) for number in numbers]) for numbers in np.ndindex(*counts))
        return list({point.tobytes(): point for point in every}.values())

    def tables(self, base: Mapping[str, Any], values: Array, name: str) -> dict[str, Any]:
        """The tables of the campaign of a point, from those of the design file, whose name is for errors."""
        data: dict[str, Any] = json.loads(json.dumps(base, default=str))
        for variable, value in zip(self.variables, values, strict=True):
            if not math.isnan(value):
                written = json.loads(json.dumps(variable.written(value), default=str))
                put(data, variable.place, written, f"{name}: variables")
        return data

    def text(self, values: Array) -> str:
        """A point as text."""
        used = ((free, value) for free, value in zip(self.variables, values, strict=True) if not math.isnan(value))
        return ", ".join(f"{free.name} = {free.text(value)}" for free, value in used)


def read_space(given: Any, name: str) -> Space:
    """The table `[variables]` of a design file, whose name is for errors.

    Raises:
        CampaignError: a variable is neither a range nor a list, or has no value.
    """
    if not isinstance(given, dict):
        raise CampaignError(f"{name}: variables: got {quoted(given)}, but it must be a table")
    variables: list[DesignVariable] = []
    for key, value in given.items():
        _read(variables, key, resolved(key, f"{name}: variables"), value, f"{name}: variables.{key}")
    places = [variable.place for variable in variables if variable.under is None]
    if twice := next((place for place in places if places.count(place) > 1), None):
        raise CampaignError(f"{name}: variables: got two variables for {twice}")
    return Space(tuple(variables))


def _read(variables: list[DesignVariable], name: str, place: str, given: Any, where: str, under: Any = None) -> None:
    """Add a variable, and those below its alternatives."""
    if isinstance(given, dict) and "low" in given:
        variables.append(DesignVariable(name, place, **_range(given, where), under=under))
        return
    if not (isinstance(given, list) and given):
        raise CampaignError(
            f"{where}: got {quoted(given)}, but it must be a range, as "
            '{ low = "3 mm", high = "8 mm", step = "0.5 mm" }, or a list of values'
        )
    whole = is_table(place) or place == "layer" or all(isinstance(option, dict) for option in given)
    if not whole and any(isinstance(option, dict | list) for option in given):
        raise CampaignError(f"{where}: got {quoted(given)}, but it must be a list of values")
    labels, values = labels_of(given, where, whole=whole), given
    if whole:
        tables = [{key: part for key, part in option.items() if key != "name"} for option in given]
        values = [table.get("layer", []) for table in tables] if place == "layer" else tables
    number = len(variables)
    variables.append(DesignVariable(name, place, labels=labels, values=tuple(values), under=under))
    for option, value in enumerate(values if whole else ()):
        for path, part in _ranges_in(value):
            inner = f"{name}[{labels[option]}].{path}", f"{place}.{path}", part, f"{where}[{option}].{path}"
            _read(variables, *inner, (number, option))


def _range(given: dict[str, Any], where: str) -> dict[str, Any]:
    """Low, high, step and unit of a range."""
    numbers, units = dict[str, float](), dict[str, str]()
    for key, value in given.items():
        if key not in ("low", "high", "step"):
            raise CampaignError(f"{where}: got the unknown key {quoted(key)}; allowed are low, high, step")
        try:
            numbers[key], units[key] = number_and_unit(value) if isinstance(value, str) else (float_of(value), "")
        except (TypeError, ValueError):
            numbers[key] = math.nan
        if isinstance(value, bool) or not abs(numbers[key]) <= LARGEST:
            raise CampaignError(f"{where}.{key}: got {quoted(value)}, but it must be a number or a string with a unit")
    if "high" not in given:
        raise CampaignError(f"{where}.high: is missing, but must be given")
    low, high, step = numbers["low"], numbers["high"], numbers.get("step", math.inf)
    if len(set(units.values())) > 1:
        raise CampaignError(f"{where}: got the units {', '.join(map(quoted, units.values()))}, but they must be one")
    if not low <= high:
        raise CampaignError(f"{where}: got low = {low:g} and high = {high:g}, but low must not be greater")
    if step <= 0.0:
        raise CampaignError(f"{where}.step: got {step:g}, but it must be greater than 0")
    return numbers | {"unit": units["low"]}


def _ranges_in(inside: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """The ranges in a table, with their places."""
    entries = inside.items() if isinstance(inside, dict) else enumerate(inside) if isinstance(inside, list) else ()
    for key, entry in entries:
        place = f"{path}.{key}" if path else str(key)
        if isinstance(entry, dict) and "low" in entry:
            yield place, entry
        else:
            yield from _ranges_in(entry, place)
