"""How shots ended: columns by name, filled from what a device returned."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from warpimpact.kernels.status import Status
from warpimpact.records import variables as r
from warpimpact.records.variables import failures, has_passed
from warpimpact.scene import Scene, Shots
from warpimpact.scene.units import count_text

Which = slice | NDArray[np.int64] | NDArray[np.bool_]


class Returned(NamedTuple):
    """Results of a device for some shots; the members of structs are arrays on the device.

    Attributes:
        status: codes of `Status`, shape [shots].
        contact: the end of contact, the struct `Outcomes` of kernels/structs.py.
        flight: the flight behind the target, the struct `Report` of kernels/free_flight.py.
        bending: the struct `Bending` of kernels/bending.py, shape [shots] on the host; [0] if it is not recorded.
        passage: through the layers, the struct `Passage` of kernels/layers.py; empty if the plate stands alone.
    """

    status: NDArray[np.int8]
    contact: Any
    flight: Any
    bending: NDArray[Any]
    passage: Any


def columns_of(scene: Scene, shots: Shots, returned: Returned) -> dict[str, NDArray[Any]]:
    """All columns that a scene records, SI and radians; NaN where a value does not exist, or the computation failed."""
    status, contact, flight, bending, passage = returned
    failed, arrested = failures(status), (status == Status.ARRESTED)[:, None]
    columns = {r.STATUS: status} | {name: _doubles(getattr(flight, name.field)) for name in r.FLIGHT_VARIABLES}
    ends = {
        r.EXIT_VELOCITY: np.where(arrested, 0.0, _doubles(contact.velocity)),
        r.EXIT_AXIS: _doubles(contact.axis),
        r.EXIT_POSITION: _doubles(contact.position),
    }
    columns |= {name: np.where(failed[:, None], np.nan, values) for name, values in ends.items()}
    if scene.record.bending:
        moment, stress = bending["moment"], bending["stress"]
        bent = {  # a core that touches nothing has no section
            r.LARGEST_BENDING_MOMENT: moment,
            r.BENDING_SECTION: np.where(moment > 0.0, bending["moment_station"], np.nan),
            r.BENDING_STRESS: stress,
            r.BENDING_STRESS_SECTION: np.where(stress > 0.0, bending["stress_station"], np.nan),
        }
        if scene.core.strength is not None or shots.strength is not None:
            bent[r.BROKEN] = bending["broken"]
            for name in (r.BROKEN_TIME, r.BROKEN_X, r.BROKEN_SECTION):  # the time is the middle of a step
                bent[name] = np.where(bending["broken"] == 0, np.nan, bending[name.field])
        columns |= {name: np.where(failed, np.nan, values).astype(np.float64) for name, values in bent.items()}
    if len(scene.target.layers) > 1:
        for name in r.LAYER_VARIABLES:
            kind = np.int8 if name in (r.LAYER_STATUS, r.STOPPED_IN) else np.float64
            columns[name] = getattr(passage, name.field.removeprefix("layer_")).numpy().astype(kind)
    return {str(name): values for name, values in columns.items()}


def _doubles(array: Any) -> NDArray[np.float64]:
    """An array of a device on the host, in double precision."""
    return np.asarray(array.numpy(), dtype=np.float64)


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
    def joined(cls, parts: Iterable[Self]) -> Self:
        """Outcomes with the same columns, one after the other."""
        columns = [vars(part) for part in parts]
        return cls(**{name: np.concatenate([part[name] for part in columns]) for name in columns[0]})

    def __getattr__(self, name: str) -> NDArray[Any]:
        titles = [title for title, record in r.RECORDS.items() if name in record]
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
        return f"{type(self).__name__} of {count_text(len(self), 'shot')}: {', '.join(vars(self))}"

    @property
    def perforated(self) -> NDArray[np.bool_]:
        """Whether each core passed the target, or touched nothing of it."""
        return has_passed(self.status)

    def assign(self, **columns: NDArray[Any]) -> Self:
        """A copy with these columns added or replaced."""
        return type(self)(**vars(self) | columns)

    def with_rows(self, which: Which, other: Self) -> Self:
        """A copy in which some shots have the outcomes of `other`."""
        columns = {name: values.copy() for name, values in vars(self).items()}
        for name, values in columns.items():
            values[which] = getattr(other, name)
        return type(self)(**columns)
