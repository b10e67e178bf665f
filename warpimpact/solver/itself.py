"""Keys of caches: models that equal themselves only."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Generic, TypeVar

Value = TypeVar("Value")


@dataclass(frozen=True, eq=False)
class Itself(Generic[Value]):
    """A value that equals itself only, because a file that it reads may have changed since another one read it."""

    value: Value

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Itself) and self.value is other.value

    def __hash__(self) -> int:
        return id(self.value)
