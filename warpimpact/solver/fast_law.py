"""The fast law as a method: rigid cores, and a resistance at each point of their surface (docs/model.md)."""

from typing import Self

from warpimpact.scene import Scene, Shots
from warpimpact.solver.accuracy import pilot_of, pilot_size, spread
from warpimpact.solver.device import Worker
from warpimpact.solver.marching import FastLawComputation
from warpimpact.solver.prepare import prepare
from warpimpact.solver.settings import FastLawSettings


class FastLaw(FastLawSettings):
    """The fast law (docs/model.md), at an accuracy or a level of resolution.

    For an accuracy, a pilot finds the level. A campaign has these fields as its table [numerics].

    Attributes:
        fidelity: the name of an accuracy: 90 % of the hits are within 5 m/s and 5° ("draft"), 1 m/s and 1°
            ("standard"), or 0.2 m/s and 0.2° ("reference"). By default "standard", and BASE_ACCURACY at several layers.
        accuracy: errors in numbers, in place of a fidelity.
        level: of the ladder of resolutions, 0 (coarse) to 9, in place of an accuracy: no pilot runs, and no error is
            estimated. A single setting below has the same effect; the other settings are then those of the level, or of
            the coarsest level that a pilot would try.
        scheme: "consistent", or "nodal" for the paper's literal scheme (docs/model.md §4).
        time_step: length of a step [s].
        travel: path per time step at impact velocity, as a share of the thickness of the plate, in place of time_step.
        patches_axial, patches_around: surface patches per length of the core and around it. The consistent scheme takes
            shorter patches behind the widest station. With a multiple of 4 around the core, mirrored shots have exactly
            mirrored outcomes.
        grid_spacing: spacing of the plate grid [m].
        precision: of the arithmetic.
        layout: of the work on a CUDA device. "simple" computes a shot per thread. "block" computes a shot per block of
            32 threads, with its window of the plate in shared memory; no device has measured it yet. It computes the
            consistent scheme in single precision, without the bending moment.
    """

    def resolve(self, scene: Scene, shots: Shots, worker: Worker) -> Self:
        """Fix the resolution: as it is given, or at the level that a pilot of some of the shots finds.

        Raises:
            ValueError: as in `pilot_of`.
        """
        if self.explicit is not None:
            return self
        return self.at_level(pilot_of(scene, spread(shots, pilot_size(self.required)), self, worker).level)

    def prepare(self, scene: Scene, shots: Shots, worker: Worker) -> FastLawComputation:
        """Make every choice for some shots, the resolution first; errors as in solver/prepare.py."""
        return FastLawComputation(prepare(scene, shots, self.resolve(scene, shots, worker)), worker)
