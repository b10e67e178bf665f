"""Files of every kind, each altered in one place: an attribute, a value of its JSON, a variable, a dimension or a bit.

A sample of them is a function of its seed.
"""

from __future__ import annotations

import json
import random
import shutil
from collections.abc import Callable, Collection, Iterator
from copy import deepcopy
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np

Change = Callable[["Group"], None]
NOTHING = "nothing"
"""Name of no alteration."""


@dataclass
class Group:
    """A netCDF file, or a group of it, in memory; a variable has dimensions, values and attributes."""

    attrs: dict[str, Any] = field(default_factory=dict)
    dims: dict[str, int] = field(default_factory=dict)
    variables: dict[str, tuple[tuple[str, ...], Any, dict[str, Any]]] = field(default_factory=dict)
    groups: dict[str, Group] = field(default_factory=dict)

    @classmethod
    def of(cls, source: Any) -> Group:
        source.set_auto_mask(False)
        return cls(
            {name: source.getncattr(name) for name in source.ncattrs()},
            {name: len(dim) for name, dim in source.dimensions.items()},
            {
                name: (one.dimensions, one[...], {key: one.getncattr(key) for key in one.ncattrs()})
                for name, one in source.variables.items()
            },
            {name: cls.of(group) for name, group in source.groups.items()},
        )

    def write(self, target: Any) -> None:
        target.setncatts(self.attrs)
        for name, size in self.dims.items():
            target.createDimension(name, size)
        for name, (dims, values, attributes) in self.variables.items():
            kind = str if np.asarray(values).dtype.kind in "OUT" else np.asarray(values).dtype
            told = {key: value for key, value in attributes.items() if key != "_FillValue"}
            written = target.createVariable(name, kind, dims, fill_value=attributes.get("_FillValue"))
            written.setncatts(told)
            written.set_auto_maskandscale(False)
            written[...] = np.asarray(values, dtype=object) if kind is str else values
        for name, group in self.groups.items():
            group.write(target.createGroup(name))

    def at(self, place: str) -> Group:
        return self.groups[place] if place else self

    def resized(self, dim: str, size: int) -> None:
        self.dims[dim] = size
        for name, (dims, values, told) in self.variables.items():
            if dim in dims:
                self.variables[name] = dims, np.asarray(values)[(slice(None),) * dims.index(dim) + (slice(size),)], told

    def renamed(self, dim: str) -> None:
        self.dims = {"other" if name == dim else name: size for name, size in self.dims.items()}
        for name, (dims, values, told) in self.variables.items():
            self.variables[name] = tuple("other" if one == dim else one for one in dims), values, told


JUNK: tuple[Any, ...] = (
    "",
    "x",
    "[]",
    "{",
    "[[1]]",
    '{"a": [1]}',
    -1,
    7,
    1e300,
    float("nan"),
    [1.0, float("nan"), 2.0],
)
INNER: tuple[Any, ...] = ("x", [1, [2]], None, float("nan"), -1.0, {})
NUMBERS = (float("nan"), float("inf"), -1.0, 0.0, 99.0, 1e300)
WORDS = ("", "[", "x", "=1+1")


def alterations(whole: Group) -> Iterator[tuple[str, Change]]:
    """Every alteration in one place, each with a name."""
    for place in ("", *whole.groups):
        group = whole.at(place)
        for name, value in group.attrs.items():
            for told, new in _attributes(value):
                yield f"{place}@{name}: {told}", _set(lambda g, p=place: g.at(p).attrs, name, new)
        for name, (dims, values, attributes) in group.variables.items():
            here = f"{place}/{name}"
            for told, new in _variables(dims, np.asarray(values), attributes):
                yield f"{here}: {told}", _set(lambda g, p=place: g.at(p).variables, name, new)
            for key, value in attributes.items():
                for told, new in _attributes(value) if key != "_FillValue" else ():
                    yield f"{here}@{key}: {told}", _set(lambda g, p=place, n=name: g.at(p).variables[n][2], key, new)
            yield f"{here}: renamed", _renamed(place, name)
        for dim in group.dims:
            yield f"{place}#{dim}: renamed", lambda g, p=place, d=dim: g.at(p).renamed(d)
            for size in (0, 1):
                yield f"{place}#{dim}: {size}", lambda g, p=place, d=dim, s=size: g.at(p).resized(d, s)
    for name in whole.groups:
        yield f"{name}: no group", lambda g, n=name: g.groups.__delitem__(n)


_GONE = object()


def _set(of: Callable[[Group], dict[str, Any]], name: str, new: Any) -> Change:
    def change(whole: Group) -> None:
        of(whole).pop(name) if new is _GONE else of(whole).__setitem__(name, new)

    return change


def _renamed(place: str, name: str) -> Change:
    return lambda whole: whole.at(place).variables.__setitem__("other", whole.at(place).variables.pop(name))


def _attributes(value: Any) -> Iterator[tuple[str, Any]]:
    yield "gone", _GONE
    for new in JUNK:
        yield repr(new), new
    try:
        inside = json.loads(value)
    except (TypeError, ValueError):
        return
    for path in _paths(inside):
        for new in (*INNER, _GONE):
            yield f"{path} {'gone' if new is _GONE else repr(new)}", json.dumps(_put(deepcopy(inside), path, new))


def _paths(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    for key, inner in value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ():
        yield (*path, key)
        yield from _paths(inner, (*path, key))


def _put(value: Any, path: tuple[Any, ...], new: Any) -> Any:
    inner = value
    for key in path[:-1]:
        inner = inner[key]
    if new is _GONE:
        del inner[path[-1]]
    else:
        inner[path[-1]] = new
    return value


def _variables(dims: tuple[str, ...], values: np.ndarray, told: dict[str, Any]) -> Iterator[tuple[str, Any]]:
    yield "gone", _GONE
    if dims:
        yield "without a dimension", (dims[1:], values[0] if len(values) else np.zeros(values.shape[1:]), told)
        yield "backwards", (dims[::-1], values.T, told)
    is_text = values.dtype.kind in "OUT"
    bare = {key: value for key, value in told.items() if key != "_FillValue"}
    if is_text:
        yield "numbers", (dims, np.zeros(values.shape), bare)
    else:
        yield "texts", (dims, values.astype(str).astype(object), bare)
        yield "floats", (dims, values.astype(np.float32), bare)
    for new in WORDS if is_text else NUMBERS:
        for where in (..., 0):
            altered = values.copy() if is_text or values.dtype.kind == "f" or np.isfinite(new) else values.astype(float)
            if altered.size and (where is ... or altered.ndim):
                with np.errstate(all="ignore"):
                    altered[where] = np.asarray(new).astype(altered.dtype) if not is_text else new
                yield f"{'all' if where is ... else 'first'} {new!r}", (dims, altered, told if is_text else bare)


def altered_files(
    source: Path, target: Path, tries: int, seed: object = 0, only: Collection[str] = ()
) -> Iterator[str]:
    """Write one altered file after the other; gives the name of each alteration. The first one is not altered.

    Args:
        only: names of alterations to take in place of a sample.
    """
    target.unlink(missing_ok=True)  # of a damaged file the libraries may keep a handle
    shutil.copyfile(source, target)
    yield NOTHING
    with netCDF4.Dataset(source) as file:
        whole = Group.of(file)
    data, draw, every = source.read_bytes(), random.Random(f"{seed}"), list(alterations(whole))
    assert {*only} <= {name for name, _ in every}
    chosen = [one for one in every if one[0] in only] or draw.sample(every, min(len(every), tries - tries // 4))
    for name, change in chosen:
        altered = deepcopy(whole)
        change(altered)
        target.unlink(missing_ok=True)
        try:
            with netCDF4.Dataset(target, "w") as file:
                altered.write(file)
        except Exception:  # some alterations are none that netCDF can hold
            continue
        yield name
    for _ in range(tries // 4):
        flipped, at, bit = bytearray(data), draw.randrange(len(data)), draw.randrange(8)
        flipped[at] ^= 1 << bit
        target.unlink(missing_ok=True)
        target.write_bytes(flipped)
        yield f"bit {bit} of byte {at}"
