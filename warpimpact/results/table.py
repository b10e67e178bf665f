"""A hit map as plain columns, with the methods of an xarray Dataset that a run needs.

The first Dataset of a process takes xarray a good part of a second, because it looks for pint, Dask and other kinds of
arrays. A run therefore computes, gathers and writes a HitTable, and `HitTable.to_xarray` makes a Dataset where one is
needed. Functions that take a `Result` take either.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar, overload

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import xarray

    Result: TypeAlias = "HitTable | xarray.Dataset"
    AResult = TypeVar("AResult", "HitTable", "xarray.Dataset")
    """A HitTable or a Dataset; functions return the type that they were given."""

_HIT = "hit"


@dataclass(frozen=True)
class StoredColumn:
    """A variable.

    Attributes:
        dims: names of its dimensions.
        data: its values, or a variable of an open netCDF file, which is read by `values`.
        attrs: its attributes.
        first, stop: range of the hits of `data` that count; `data` may have others.
    """

    dims: tuple[str, ...]
    data: Any
    attrs: Mapping[str, Any]
    first: int = 0
    stop: int | None = None

    @property
    def shape(self) -> tuple[int, ...]:
        if _HIT not in self.dims:
            return tuple(self.data.shape)
        return len(range(self.data.shape[0])[self.first : self.stop]), *self.data.shape[1:]

    @property
    def values(self) -> NDArray[Any]:
        """The values, in memory."""
        return np.asarray(self.data[self.first : self.stop] if _HIT in self.dims else self.data[...])

    def part(self, hits: slice | NDArray[np.int64]) -> StoredColumn:
        """The column of some of the hits."""
        if _HIT not in self.dims:
            return self
        if not isinstance(hits, slice):
            return StoredColumn(self.dims, self.values[hits], self.attrs)
        first, stop, _ = hits.indices(self.shape[0])
        return replace(self, first=self.first + first, stop=self.first + stop)


@dataclass(frozen=True)
class HitTable:
    """Variables, coordinates among them, and global attributes.

    Attributes:
        variables: columns by their names. If a column has "hit", it is its first dimension.
        coords: names of the columns that are coordinates.
        attrs: global attributes.
    """

    variables: Mapping[str, StoredColumn]
    coords: frozenset[str]
    attrs: dict[str, Any]

    @classmethod
    def of(
        cls, data: Mapping[str, tuple[Any, ...]], coordinates: Mapping[str, tuple[Any, ...]], attrs: Mapping[str, Any]
    ) -> HitTable:
        """A table from dimensions, values and attributes of every variable, as xarray takes them."""
        return cls(_columns({**data, **coordinates}), frozenset(coordinates), dict(attrs))

    @classmethod
    def from_xarray(cls, dataset: xarray.Dataset) -> HitTable:
        """A table from a Dataset, in memory."""
        columns = {str(name): (column.dims, column.values, column.attrs) for name, column in dataset.variables.items()}
        data = {name: column for name, column in columns.items() if name not in dataset.coords}
        return cls.of(data, {name: columns[name] for name in columns if name not in data}, dataset.attrs)

    @property
    def sizes(self) -> dict[str, int]:
        return {
            name: size
            for column in self.variables.values()
            for name, size in zip(column.dims, column.shape, strict=True)
        }

    def __contains__(self, name: str) -> bool:
        return name in self.variables

    @overload
    def __getitem__(self, name: str) -> StoredColumn: ...

    @overload
    def __getitem__(self, name: list[str]) -> HitTable: ...

    def __getitem__(self, name: str | list[str]) -> StoredColumn | HitTable:
        """A column, or a table of some columns with all coordinates."""
        if isinstance(name, str):
            return self.variables[name]
        kept = {*name, *self.coords}
        return replace(self, variables={key: column for key, column in self.variables.items() if key in kept})

    def isel(self, *, hit: slice | NDArray[np.int64]) -> HitTable:
        """Some of the hits."""
        return replace(self, variables={name: column.part(hit) for name, column in self.variables.items()})

    def load(self) -> HitTable:
        """The table in memory."""
        return self.assign(
            {name: (column.dims, column.values, column.attrs) for name, column in self.variables.items()}
        )

    def assign(self, variables: Mapping[str, tuple[Any, ...]]) -> HitTable:
        """The table with new values of these variables. New variables are no coordinates."""
        return replace(self, variables={**self.variables, **_columns(variables)})

    def assign_coords(self, variables: Mapping[str, tuple[Any, ...]]) -> HitTable:
        """The table with these coordinates behind all others."""
        kept = self.drop_vars(variables)
        return replace(kept, variables={**kept.variables, **_columns(variables)}, coords=self.coords | {*variables})

    def assign_attrs(self, attrs: Mapping[str, Any]) -> HitTable:
        """The table with these global attributes, which replace its own of the same name."""
        return replace(self, attrs=self.attrs | dict(attrs))

    def drop_vars(self, names: Collection[str]) -> HitTable:
        """The table without these variables. Names that it lacks are ignored."""
        kept = {name: column for name, column in self.variables.items() if name not in names}
        return replace(self, variables=kept, coords=self.coords - {*names})

    def to_xarray(self) -> xarray.Dataset:
        """The Dataset, in memory."""
        import xarray

        columns = {name: (column.dims, column.values, dict(column.attrs)) for name, column in self.variables.items()}
        data = {name: column for name, column in columns.items() if name not in self.coords}
        return xarray.Dataset(
            data, {name: column for name, column in columns.items() if name in self.coords}, self.attrs
        )


def joined(tables: Iterable[HitTable]) -> HitTable:
    """Concatenate tables of the same variables along "hit". Columns without "hit", and attributes, are the first
    table's."""
    first, *others = tables
    columns = {
        name: (column.dims, np.concatenate([column.values, *(other[name].values for other in others)]), column.attrs)
        for name, column in first.variables.items()
        if _HIT in column.dims
    }
    return first.assign(columns)


def _columns(variables: Mapping[str, tuple[Any, ...]]) -> dict[str, StoredColumn]:
    return {
        str(name): StoredColumn((dims,) if isinstance(dims, str) else tuple(dims), np.asarray(values), attrs)
        for name, (dims, values, attrs) in variables.items()
    }
