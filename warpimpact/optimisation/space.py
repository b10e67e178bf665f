"""The free variables of a design: ranges, steps, lists and alternatives, and the campaign of a point in their space."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from warpimpact.campaign.places import is_table, options_of, resolved
from warpimpact.errors import CampaignError
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
        if self.labels or self.low == self.high:
            return len(self.labels) or 1
        return None if self.step is None else 1 + math.floor((self.high - self.low) / self.step + 1e-9)

    def at(self, coordinate: float) -> float:
        """The value at a coordinate: a share of a continuous range, else the number of a value.

        The value of a choice is the number of the option.
        """
        if self.labels:
            return float(int(coordinate))
        steps = coordinate * (self.high - self.low) if self.count is None else int(coordinate) * (self.step or 0.0)
        digits = _RANGE_DIGITS - 1 - math.floor(math.log10(max(abs(self.low), abs(self.high), 1e-300)))
        return min(max(round(self.low + steps, digits), self.low), self.high)

    def written(self, value: float) -> Any:
        """A value as a campaign has it."""
        if self.labels:
            return self.values[int(value)]
        number = int(value) if not self.unit and value == int(value) and self.step is not None else value
        return f"{value:.12g} {self.unit}" if self.unit else number


@dataclass(frozen=True)
class Space:
    """All variables; a choice comes before the variables below it."""

    variables: tuple[DesignVariable, ...]

    @property
    def size(self) -> float:
        """Number of points, also of those that differ in unused variables only; infinite if continuous."""
        return math.prod(variable.count or math.inf for variable in self.variables)

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
        return list({(point := self.at(numbers)).tobytes(): point for numbers in np.ndindex(*counts)}.values())

    def distances(self, some: Array, others: Array) -> Array:
        """Distances of points, shape [some, others], in shares of the ranges; two options of a choice are 1 apart."""
        squares = np.zeros((len(some), len(others)))
        for number, variable in enumerate(self.variables):
            difference = np.subtract.outer(some[:, number], others[:, number])
            known = ~np.isnan(difference)  # a variable that one of both does not use stands below a choice that differs
            share = difference != 0.0 if variable.labels else difference / ((variable.high - variable.low) or 1.0)
            squares += np.where(known, share, 0.0) ** 2
        return np.sqrt(squares)

    def text(self, values: Array) -> str:
        """A point as text."""
        used = [(free, value) for free, value in zip(self.variables, values, strict=True) if not math.isnan(value)]
        shown = (free.labels[int(value)] if free.labels else free.written(value) for free, value in used)
        return ", ".join(f"{free.name} = {text}" for (free, _), text in zip(used, shown, strict=True))


def read_space(given: Mapping[str, Any], where: str) -> Space:
    """The table `[variables]` of a design file, whose place is for errors.

    Raises:
        CampaignError: a variable is neither a range nor a list, or has no value.
    """
    variables: list[DesignVariable] = []
    for key, value in given.items():
        _read(variables, key, resolved(key, where), value, f"{where}.{key}")
    places = [variable.place for variable in variables if variable.under is None]
    if twice := next((place for place in places if places.count(place) > 1), None):
        raise CampaignError(f"{where}: got two variables for {twice}")
    return Space(tuple(variables))


def _read(variables: list[DesignVariable], name: str, place: str, given: Any, where: str, under: Any = None) -> None:
    """Add a variable, and those below its alternatives."""
    if isinstance(given, dict) and "low" in given:
        variables.append(DesignVariable(name, place, **_range(given, where), under=under))
        return
    if not (isinstance(given, list) and given):
        example = '{ low = "3 mm", high = "8 mm", step = "0.5 mm" }'
        raise CampaignError(f"{where}: got {quoted(given)}, but it must be a range, as {example}, or a list of values")
    whole = is_table(place) or place == "layer" or all(isinstance(option, dict) for option in given)
    options, number = options_of(given, where, whole=whole), len(variables)
    labels, values = tuple(options), [*options.values()]
    if place == "layer":
        values = [table.get("layer", []) for table in values]
    variables.append(DesignVariable(name, place, labels=labels, values=tuple(values), under=under))
    for option, value in enumerate(values if whole else ()):
        for path, part in _ranges_in(value):
            inner = f"{name}[{labels[option]}].{path}", f"{place}.{path}", part, f"{where}[{option}].{path}"
            _read(variables, *inner, (number, option))


def _range(given: Mapping[str, Any], where: str) -> dict[str, Any]:
    """Low, high, step and unit of a range."""
    numbers, units = dict[str, float](), set[str]()
    if {"low", "high"} - given.keys() or given.keys() - {"low", "high", "step"}:
        raise CampaignError(f"{where}: got the keys {', '.join(given)}, but it must be low, high and perhaps step")
    for key, value in given.items():
        try:
            numbers[key], unit = number_and_unit(value) if isinstance(value, str) else (float_of(value), "")
        except (TypeError, ValueError):
            numbers[key], unit = math.nan, ""
        if isinstance(value, bool) or not abs(numbers[key]) <= LARGEST:
            raise CampaignError(f"{where}.{key}: got {quoted(value)}, but it must be a number or a string with a unit")
        units.add(unit)
    if len(units) > 1 or not numbers["low"] <= numbers["high"] or numbers.get("step", 1.0) <= 0.0:
        got = ", ".join(f"{key} = {value}" for key, value in given.items())
        allowed = "the unit must be one, low must not be greater than high, and a step must be greater than 0"
        raise CampaignError(f"{where}: got {got}, but {allowed}")
    return numbers | {"unit": units.pop()}


def _ranges_in(inside: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """The ranges in a table, with their places."""
    entries = inside.items() if isinstance(inside, dict) else enumerate(inside) if isinstance(inside, list) else ()
    for key, entry in entries:
        place = f"{path}.{key}".strip(".")
        if isinstance(entry, dict) and "low" in entry:
            yield place, entry
        else:
            yield from _ranges_in(entry, place)
