"""How shots ended: columns by name, with the operations that treat all columns the same way."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

from warpimpact.records import registry
from warpimpact.records.variable import came_through

if TYPE_CHECKING:
    from warpimpact.records.variable import Returned
    from warpimpact.scene import Scene, Shots

Which = slice | NDArray[np.int64] | NDArray[np.bool_]


class Outcomes:
    """How the shots ended: arrays as attributes, in SI and radians, the first axis along the shots; NaN if a value does
    not exist. The reference of variables describes each.

    Every computation has `status`, `residual_velocity`, `deflection`, `angular_velocity`, `energy_loss`,
    `contact_duration`, `exit_velocity`, `exit_axis` and `exit_position` (from the hit point), and at each stand-off
    `tilt`, `pitch`, `yaw` and `total_yaw`. Others follow from what the scene records, its core and its target.

    Args:
        columns: by name.
    """

    def __init__(self, **columns: NDArray[Any]) -> None:
        vars(self).update(columns)

    @classmethod
    def collected(cls, scene: Scene, shots: Shots, returned: Returned) -> Self:
        """All columns that a scene records, from the results of a device."""
        groups = (group for group in registry.RECORDS if group.recorded(scene, shots))
        return cls(**{str(name): values for group in groups for name, values in group.filled(returned).items()})

    @classmethod
    def joined(cls, parts: Iterable[Self]) -> Self:
        """Outcomes with the same columns, one after the other."""
        columns = [vars(part) for part in parts]
        return cls(**{name: np.concatenate([part[name] for part in columns]) for name in columns[0]})

    def __getattr__(self, name: str) -> NDArray[Any]:
        titles = [group.title for group in registry.RECORDS if name in group]
        hint = f"it is there {titles[0].lower()}" if titles else f"there are {', '.join(vars(self))}"
        raise AttributeError(f'these outcomes have no "{name}"; {hint}')

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"outcomes are immutable; assign({name}=...) gives a changed copy")

    def __contains__(self, name: str) -> bool:
        return name in vars(self)

    def __len__(self) -> int:
        return len(self.status)

    def __getitem__(self, which: Which) -> Self:
        return type(self)(**{name: values[which] for name, values in vars(self).items()})

    def __repr__(self) -> str:
        return f"{type(self).__name__} of {len(self)} shots: {', '.join(vars(self))}"

    @property
    def perforated(self) -> NDArray[np.bool_]:
        """Whether each core came through the target: it perforated, or touched nothing."""
        return came_through(self.status)

    def assign(self, **columns: NDArray[Any]) -> Self:
        """A copy with these columns added or replaced."""
        return type(self)(**vars(self) | columns)

    def with_rows(self, which: Which, other: Self) -> Self:
        """A copy in which some shots have the outcomes of `other`."""
        columns = {name: values.copy() for name, values in vars(self).items()}
        for name, values in columns.items():
            values[which] = getattr(other, name)
        return type(self)(**columns)
