"""How a shot ended, or a core in one layer of the target: the codes kernels write and the sentences people read."""

from enum import IntEnum

RUNNING = -1
"""Stands in place of a status while a shot has not ended."""
WAITING = -2
"""Stands in its place while a core of the continuum is in front of a layer that has no mesh yet."""

ENTERED = -3
"""Stands in place of the status in a layer while the core touches the layer and has not left it."""


class Status(IntEnum):
    """Outcome of a shot, or of its core in one layer. Codes from UNFINISHED on are failures of the computation, not of
    the plate, except NOT_REACHED, which only a layer can have. The last three belong to the continuum."""

    PERFORATED = 0
    ARRESTED = 1
    RICOCHETED = 2
    UNTOUCHED = 3
    UNFINISHED = 4
    LEFT_WINDOW = 5
    NOT_FINITE = 6
    GAINED_ENERGY = 7
    NOT_REACHED = 8
    UNBALANCED = 9
    HOURGLASSED = 10
    CROWDED = 11

    @property
    def sentence(self) -> str:
        """A sentence about the outcome."""
        return _SENTENCES[self]

    @property
    def failed(self) -> bool:
        """Whether the computation failed, so that the end of the shot is unknown."""
        return self >= Status.UNFINISHED and self is not Status.NOT_REACHED


_SENTENCES = {
    Status.PERFORATED: "The core touched the target and left it through the rear face.",
    Status.ARRESTED: "The core came to rest in the target, or stays between two of its layers.",
    Status.RICOCHETED: "The core touched the target and left it through the front face.",
    Status.UNTOUCHED: "The core passed without touching material.",
    Status.UNFINISHED: "The core was still in the target when the step limit was reached.",
    Status.LEFT_WINDOW: "The core left the largest window of the plate that memory allows.",
    Status.NOT_FINITE: "The motion became infinite or undefined.",
    Status.GAINED_ENERGY: "The rounding errors of the precision added to the energy of the core.",
    Status.NOT_REACHED: "The core did not reach this layer.",
    Status.UNBALANCED: "More of the energy that the core lost is missing, or too much, than finite elements may lose.",
    Status.HOURGLASSED: "Hourglasses of the finite elements took more of the energy than they may.",
    Status.CROWDED: "More faces of finite elements met in one place than the contact has room for.",
}

OF_SHOTS = tuple(status for status in Status if status is not Status.NOT_REACHED)
"""Statuses that a whole shot can have."""
