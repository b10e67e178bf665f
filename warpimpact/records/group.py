"""A group of variables that are recorded together, and what a device returned of some shots, which fills them."""

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
    """What a device returned of some shots; members of structs are arrays of the device.

    Attributes:
        status: codes of `Status`, shape [shots].
        contact: the end of contact, the struct `Outcomes` of kernels/structs.py.
        flight: the flight behind the target, the struct `Report` of kernels/free_flight.py.
        bending: the struct `Bending` of kernels/bending.py, shape [shots] on the host; [0] where it is not recorded.
        passage: through the layers, the struct `Passage` of kernels/passage.py; empty if the plate stands alone.
        free: whether a core flies free at each stand-off behind each layer, shape [layers, stand-offs].
    """

    status: NDArray[np.int8]
    contact: Any
    flight: Any
    bending: NDArray[Any]
    passage: Any
    free: NDArray[np.bool_]

    @property
    def failed(self) -> NDArray[np.bool_]:
        """Whether the computation of each shot failed, shape [shots]."""
        return failures(self.status)


def failures(status: NDArray[Any]) -> NDArray[np.bool_]:
    """Whether the computation of each shot failed, by its status; of the shape of `status`."""
    return np.isin(status, [each for each in Status if each.failed])


@dataclass(frozen=True)
class Group(Collection[Variable]):
    """Variables that are recorded together.

    Attributes:
        title: what they are, or when they are recorded, as a heading.
        variables: they, in the order of a file.
        recorded: whether a computation of such shots at a scene records them; False where something else fills them.
        filled: their columns, SI and radians, by their names.
        beside: variables of the Dataset that are no columns of shots and stand beside them.
        whole: whether a result has all of them, and those beside them, or none.
        measured: whether one can ask for their numbers, as in mean(tilt@130mm), and for maps of them.
        exact: whether they stay in double precision where shots are computed in single precision.
    """

    title: str
    variables: tuple[Variable, ...]
    recorded: Callable[[Scene, Shots], bool] = lambda scene, shots: False
    filled: Callable[[Returned], Columns] = lambda returned: {}
    beside: tuple[Variable, ...] = ()
    whole: bool = False
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
