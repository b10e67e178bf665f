"""A group of variables that are recorded together, and the device's results that fill them."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from warpimpact.kernels.status import Status
from warpimpact.records.variable import Variable

if TYPE_CHECKING:
    from warpimpact.scene import Scene, Shots

Array = NDArray[np.float64]
Columns: TypeAlias = dict[Variable, NDArray[Any]]


class Returned(NamedTuple):
    """Results of a device for some shots; the members of structs are arrays on the device.

    Attributes:
        status: codes of `Status`, shape [shots].
        contact: the end of contact, the struct `Outcomes` of kernels/structs.py.
        flight: the flight behind the target, the struct `Report` of kernels/free_flight.py.
        bending: the struct `Bending` of kernels/bending.py, shape [shots] on the host; [0] if it is not recorded.
        passage: through the layers, the struct `Passage` of kernels/passage.py; empty if the plate stands alone.
    """

    status: NDArray[np.int8]
    contact: Any
    flight: Any
    bending: NDArray[Any]
    passage: Any

    @property
    def failed(self) -> NDArray[np.bool_]:
        """Whether the computation of each shot failed, shape [shots]."""
        return failures(self.status)


def failures(status: NDArray[Any]) -> NDArray[np.bool_]:
    """Whether the computation of each shot failed, by its status; same shape."""
    return np.isin(status, [code for code in Status if code.failed])


@dataclass(frozen=True)
class VariableGroup(Collection[Variable]):
    """Variables that are recorded together.

    Attributes:
        title: heading that says what they are or when they are recorded.
        variables: in the order of a file.
        recorded: whether a computation of these shots at this scene records them; never if something else fills them.
        filled: columns by variable, SI and radians.
        beside: variables of the Dataset without an axis along the shots that go with the group.
        measured: whether measures, as in mean(tilt@130mm), and maps of the variables are allowed.
        exact: whether columns stay in double precision when shots are computed in single precision.
    """

    title: str
    variables: tuple[Variable, ...]
    recorded: Callable[[Scene, Shots], bool] = lambda scene, shots: False
    filled: Callable[[Returned], Columns] = lambda returned: {}
    beside: tuple[Variable, ...] = ()
    measured: bool = True
    exact: bool = False

    def __iter__(self) -> Iterator[Variable]:
        return iter(self.variables)

    def __contains__(self, name: object) -> bool:
        return name in self.variables

    def __len__(self) -> int:
        return len(self.variables)


def doubles(array: Any) -> Array:
    """An array of a device on the host, in double precision."""
    return np.asarray(array.numpy(), dtype=np.float64)
