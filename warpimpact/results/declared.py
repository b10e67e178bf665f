"""Declarations of what a kind of file has: variables with rules for their values, and attributes with their types."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeAlias

import numpy as np
from pydantic import AfterValidator, BaseModel, Field, Json, TypeAdapter, ValidationError

from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.scene import AnyCore, Numerics
from warpimpact.scene.display import STORED
from warpimpact.scene.units import LARGEST

if TYPE_CHECKING:
    import xarray

Rule: TypeAlias = Callable[[np.ndarray[Any, Any], Mapping[str, int]], bool]
"""Check of the values of a variable, given the sizes of all dimensions."""

_ENDS = {"low": "lower", "high": "upper"}

Number = Annotated[float, Field(strict=True)]
Finite = Annotated[Number, Field(ge=-LARGEST, le=LARGEST)]
Positive = Annotated[Finite, Field(gt=0.0)]
Text = Annotated[str, Field(strict=True)]
Count = Annotated[int, Field(strict=True, ge=1)]
Size = Annotated[int, Field(strict=True, ge=0)]


def _one_of(allowed: Any) -> Any:
    def check(value: str) -> str:
        if value not in allowed:
            raise ValueError("is unknown")
        return value

    return Annotated[Text, AfterValidator(check)]


def _at_a_level(numerics: Numerics) -> Numerics:
    if numerics.explicit is None:
        raise ValueError("fixes no resolution")
    return numerics


_Resolution = Annotated[Numerics, AfterValidator(_at_a_level)]


class _Accuracy(BaseModel):
    share: Finite


class _Layer(BaseModel):
    offset: tuple[Finite, Finite] = (0.0, 0.0)


class _Fidelity(BaseModel):
    fidelity: Any


class _DeclaredMaterial(BaseModel):
    resistance: Finite
    density: Positive = 1.0
    degradation: Finite = 1.0
    degradation_interval: Finite | None = None
    degradation_distance: Finite | None = None
    degradation_depth: Finite | None = None


_Shifts = Annotated[list[Number], Field(min_length=1, max_length=2)]
"""Shifts of the means of residual velocity and, where there is a stand-off, tilt."""
_TYPES: Mapping[str, Any] = {
    "text": Text,
    "table": Json[dict[str, Any]],
    "number": Number,
    "count": Count,
    "pair": tuple[Number, Number],
}
"""Types of attributes by their kind."""
_SHAPES: Mapping[str, Any] = {
    attr.CORE: Annotated[AnyCore, Json],
    attr.RESOLUTION: Json[_Resolution],
    attr.ACCURACY: Json[_Accuracy],
    attr.MATERIAL: Json[_DeclaredMaterial],
    attr.NUMERICS_GIVEN: Json[_Fidelity],
    attr.LAYERS: Json[dict[str, _Layer]],
    attr.LEVEL_SHIFTS: Json[dict[Annotated[str, Field(pattern=r"^\d{1,3}$")], _Shifts]],
    attr.SWEEP: Json[dict[str, Annotated[list[Text], Field(min_length=1)]]],
    attr.LIMIT: _one_of(v.LIMITS),
    attr.LIMIT_LAYER: Size,
    attr.ESTIMATE_UNITS: _one_of(STORED),
    attr.STOP_REASON: Literal["half_width", "numerics", "max_count"],
    attr.PLATE_PERIOD: tuple[Positive, Positive],
}
"""Types of attributes on whose contents readers rely."""


def with_interval(name: str, dims: tuple[str, ...], units: str, meaning: str) -> tuple[v.Variable, ...]:
    """A variable, and the lower and the upper end of its interval."""
    ends = (v.Variable(f"{name}_{end}", dims, units, f"{what} end of its 95 % interval") for end, what in _ENDS.items())
    return (v.Variable(name, dims, units, meaning), *ends)


def numbers(values: np.ndarray[Any, Any], _: Mapping[str, int]) -> bool:
    """Whether the values are numbers; NaN or infinity stands for no value."""
    return values.dtype.kind in "iuf" and not bool((np.abs(values[np.isfinite(values)]) > LARGEST).any())


def finite(values: np.ndarray[Any, Any], sizes: Mapping[str, int]) -> bool:
    """Whether the values are finite numbers."""
    return numbers(values, sizes) and bool(np.isfinite(values).all())


def not_negative(values: np.ndarray[Any, Any], sizes: Mapping[str, int]) -> bool:
    """Whether the values are finite numbers of at least 0."""
    return finite(values, sizes) and bool((values >= 0).all())


def texts(values: np.ndarray[Any, Any], _: Mapping[str, int]) -> bool:
    """Whether the values are texts. The type of an empty array is not stored in a file."""
    return values.size == 0 or values.dtype.kind in "UT" or all(isinstance(value, str) for value in values.flat)


def among(*allowed: float) -> Rule:
    """Rule that each value is one of these numbers."""
    return lambda values, _: values.dtype.kind in "iuf" and bool(np.isin(values, allowed).all())


def place_in(dim: str) -> Rule:
    """Rule that each value is the index of a place along a dimension."""
    return lambda values, sizes: (
        values.size == 0 or (values.dtype.kind in "iu" and bool(((values >= 0) & (values < sizes.get(dim, 0))).all()))
    )


@dataclass(frozen=True)
class Declaration:
    """What a file, or a group in a file, has. Anything else in it is ignored.

    Attributes:
        variables: dimensions of each variable, by name. The units of a `Variable` are checked, too.
        optional: variables that may be absent.
        whole: groups of variables that are present or absent together.
        rules: rules of variables, where they are not `numbers`.
        attributes: global attributes, with their types for pydantic.
        more: returns a further fault of a Dataset as a phrase; None if there is none.
    """

    variables: Mapping[str, tuple[str, ...]]
    optional: Sequence[str] = ()
    whole: Sequence[Sequence[str]] = ()
    rules: Mapping[str, Rule] = field(default_factory=dict)
    attributes: Mapping[str, Any] = field(default_factory=dict)
    more: Callable[[xarray.Dataset], str | None] = lambda dataset: None

    def fault(self, dataset: xarray.Dataset) -> str | None:
        """What keeps a Dataset from being what it should be, as a phrase; None if nothing does."""
        return next(self._faults(dataset), None)

    def _faults(self, dataset: xarray.Dataset) -> Iterator[str]:
        yield from filter(None, (missing_fault(dataset, names) for names in self.whole))
        for name, dims in self.variables.items():
            if name in dataset.variables:
                yield from self._of_a_variable(dataset, name, dims)
            elif name not in self.optional:
                yield f'it has no variable "{name}"'
        for name, kind in self.attributes.items():
            if name not in dataset.attrs:
                yield f'it has no attribute "{name}"'
            elif not _fits(dataset.attrs[name], TypeAdapter(kind)):
                yield f'its attribute "{name}" is not what it should be'
        yield from attribute_faults(
            {name: value for name, value in dataset.attrs.items() if name not in self.attributes}
        )
        yield from filter(None, [self.more(dataset)])

    def _of_a_variable(self, dataset: xarray.Dataset, name: str, dims: tuple[str, ...]) -> Iterator[str]:
        array, rule = dataset.variables[name], self.rules.get(name, numbers)
        if array.dims != dims:
            yield f'its variable "{name}" is along {array.dims}, not {dims}'
        elif not rule(array.values, {str(dim): size for dim, size in dataset.sizes.items()}):
            yield f'its variable "{name}" has values that it must not have'
        elif isinstance(name, v.Variable):
            yield from metadata_faults(array, name)


def missing_fault(dataset: xarray.Dataset, names: Sequence[str]) -> str | None:
    """A phrase about the first missing variable, if not all of these are missing."""
    there = [name for name in names if name in dataset.variables]
    absent = [name for name in names if name not in there]
    return f'it has "{there[0]}", but no variable "{absent[0]}"' if there and absent else None


def metadata_faults(array: xarray.Variable, declared: v.Variable) -> Iterator[str]:
    for name, value in declared.attributes.items():
        given = array.attrs.get(name)
        if not isinstance(given, type(value)) or (name == "units" and given != value):
            yield f'its variable "{declared}" has no {name} as it should'
    if declared.flags is not None and len(array.attrs["flag_values"]) != len(array.attrs["flag_meanings"].split()):
        yield f'its variable "{declared}" has flags without a meaning'


def attribute_faults(attributes: Mapping[Any, Any]) -> Iterator[str]:
    """Faults of global attributes that any kind of file may have."""
    for name, value in attributes.items():
        if not _is_allowed(str(name), value):
            yield f'its attribute "{name}" is not what it should be'


def _is_allowed(name: str, value: Any) -> bool:
    if name in attr.ATTRIBUTES:
        return _fits(value, _type_of(name))
    return isinstance(value, str) or name.removesuffix("_units") not in attr.ATTRIBUTES


@cache
def _type_of(name: str) -> TypeAdapter[Any]:
    return TypeAdapter(_SHAPES.get(name, _TYPES[attr.ATTRIBUTES[name].kind]))


def _fits(value: Any, kind: TypeAdapter[Any]) -> bool:
    try:
        kind.validate_python(value.tolist() if isinstance(value, np.ndarray | np.generic) else value)
    except (ValidationError, RecursionError):
        return False
    return True
