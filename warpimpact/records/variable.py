"""A variable of a Dataset: its name with its metadata."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from enum import IntEnum
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from warpimpact.kernels.status import Status

Mirror: TypeAlias = Literal["along_y", "along_z"]

HITS, AT_STANDOFF, VECTORS = ("hit",), ("hit", "standoff"), ("hit", "axis")
IN_LAYER = ("hit", "layer")
"""Dimensions of the variables of shots."""
MAIN = ("run", "inspect", "plot", "report")
"""Commands that show the main variables by default."""


class Variable(str):
    """Name of a variable, which is its key in a Dataset, with its metadata.

    Attributes:
        dims: names of its dimensions.
        units: as CF writes them; "degree" where the package itself computes in radians.
        long_name: description for people.
        flags: codes that it may hold (CF: flag_values, flag_meanings); None for numbers.
        field: name of its source: a field of shots or history, or a member of the kernels' struct.
        shown_by: commands that show it by default; other commands show it on request, or show all variables.
        mirror: factor of `Symmetry` that a mirror image applies to it; None for a vector, or if it does not change.
    """

    dims: tuple[str, ...]
    units: str
    long_name: str
    flags: Iterable[IntEnum] | None
    field: str
    shown_by: frozenset[str]
    mirror: Mirror | None

    def __new__(
        cls,
        name: str,
        dims: tuple[str, ...],
        units: str,
        long_name: str,
        *,
        flags: Iterable[IntEnum] | None = None,
        field: str | None = None,
        shown_by: Collection[str] = (),
        mirror: Mirror | None = None,
    ) -> Variable:
        self = super().__new__(cls, name)
        self.dims, self.units, self.long_name, self.flags = dims, units, long_name, flags
        self.field, self.shown_by, self.mirror = field or name, frozenset(shown_by), mirror
        return self

    def __reduce__(self) -> tuple[type[str], tuple[str]]:
        """Pickled, it is the plain name, which finds the same entries."""
        return str, (str(self),)

    @property
    def attributes(self) -> dict[str, Any]:
        """CF attributes of the variable in the Dataset."""
        attributes: dict[str, Any] = {"units": self.units, "long_name": self.long_name}
        if self.flags is not None:
            attributes["flag_values"] = np.array(list(self.flags), dtype=np.int8)
            attributes["flag_meanings"] = " ".join(flag.name.lower() for flag in self.flags)
        return attributes

    @property
    def is_number_of_hit(self) -> bool:
        """Whether it has one number with a unit per hit, or per hit and stand-off, as maps and measures need."""
        return self.flags is None and self.units != "1" and self.dims in {HITS, AT_STANDOFF}


def failures(status: NDArray[Any]) -> NDArray[np.bool_]:
    """Whether the computation of each shot failed, by its status; same shape."""
    return np.isin(status, [code for code in Status if code.failed])


def has_passed(status: NDArray[Any]) -> NDArray[np.bool_]:
    """Whether each core passed, or touched nothing, by its status; same shape."""
    return np.isin(status, [Status.PERFORATED, Status.UNTOUCHED])
