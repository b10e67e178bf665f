"""Keys of caches: models by their fields."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Generic, TypeVar

from warpimpact.scene.model import Model

Value = TypeVar("Value", bound=Model)


@dataclass(frozen=True, eq=False)
class Key(Generic[Value]):
    """A model as the key of a cache. Two keys are equal if their models have the same fields. A model that reads a file
    equals itself only, because the file may have changed between two readings."""

    value: Value

    @property
    def _reads(self) -> bool:
        return "file" in type(self.value).model_fields

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Key):
            return False
        return self.value is other.value or (not self._reads and bool(self.value == other.value))

    def __hash__(self) -> int:
        return id(self.value) if self._reads else hash(self.value)
