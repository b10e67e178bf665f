"""The state of a core at the end of contact, from the device to the host."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpimpact.kernels.status import Status

Array = NDArray[np.float64]


def exits(contact: Any, status: NDArray[np.int8]) -> dict[str, Array]:
    """The state of every core at the end of contact; NaN where the computation failed."""
    failed, arrested = (status >= Status.UNFINISHED)[:, None], (status == Status.ARRESTED)[:, None]
    state = {
        "exit_velocity": np.where(arrested, 0.0, _doubles(contact.velocity)),
        "exit_axis": _doubles(contact.axis),
        "exit_position": _doubles(contact.position),
    }
    return {name: np.where(failed, np.nan, values) for name, values in state.items()}


def _doubles(array: Any) -> Array:
    return np.asarray(array.numpy(), dtype=np.float64)
