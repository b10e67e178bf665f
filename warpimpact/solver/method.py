"""What a method of computing hits is; the fast law and finite elements are two (docs/contributing.md)."""

from typing import Protocol

from warpimpact.records.outcomes import Outcomes
from warpimpact.records.variables import Variable
from warpimpact.scene import Scene, Shots
from warpimpact.solver.device import Worker
from warpimpact.solver.marching import Progress
from warpimpact.solver.prepare import Cost


class Computation(Protocol):
    """Shots of a scene, which a method has prepared for a worker."""

    @property
    def variables(self) -> tuple[Variable, ...]:
        """Variables of the outcomes beside those that every method gives."""

    @property
    def is_double(self) -> bool:
        """Whether the outcomes are in double precision."""

    @property
    def cost(self) -> Cost:
        """What a shot takes, foreseen."""

    def build(self) -> None:
        """Compile and load the kernels, which `compute` does else."""

    def compute(self, progress: Progress | None = None) -> Outcomes:
        """Compute every shot; `progress` is called repeatedly with (shots done, all shots)."""


class Method(Protocol):
    """How hits are computed; frozen, and it can be pickled."""

    def prepare(self, scene: Scene, shots: Shots, worker: Worker) -> Computation:
        """Check the scene, and make every choice for its shots.

        Raises:
            ValueError: the method does not compute this scene.
            TooLong, MemoryError: a shot takes too long, or more memory than is free.
            DeviceError: the device is absent.
        """
