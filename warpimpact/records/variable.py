"""A variable of a Dataset: its name with what is known of it."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from enum import IntEnum
from typing import Any, Literal, TypeAlias

import numpy as np

Mirror: TypeAlias = Literal["polar", "axial", "along_y", "along_z"]

HITS, AT_STANDOFF, VECTORS = ("hit",), ("hit", "standoff"), ("hit", "axis")
IN_LAYER, BEHIND_LAYER = ("hit", "layer"), ("hit", "layer", "layer_standoff")
"""Dimensions of what is recorded of a shot."""
MAIN = ("run", "inspect", "plot", "report")
"""Commands that show the main variables."""


class Variable(str):
    """Name of a variable, which is its key in a Dataset, with its metadata.

    Attributes:
        dims: names of its dimensions.
        units: as CF writes them; "degree" where the package itself computes in radians.
        long_name: what it is, for people.
        flags: the codes that it may hold, if it holds codes (CF: flag_values, flag_meanings).
        field: name of what it is filled from: a field of shots or history, or a member of the kernels' struct.
        shown_by: commands that show it by default. Other commands show it on request, or they show all variables.
        mirror: the factors of `Symmetry` by which it changes under a mirror image; None where it stays.
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
        """A copy in another process is the plain name. It finds the same entries."""
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
        """Whether it has one number with a unit per hit, or one per hit and stand-off. Maps and measures need this."""
        return self.flags is None and self.units != "1" and self.dims in {HITS, AT_STANDOFF}
