"""The shots of a simulated test: those of its procedure, and those of its proof."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warpimpact.firing.fire import Firings, fire, uniform
from warpimpact.firing.plan import FiringTest, Proof
from warpimpact.firing.procedures import Procedure
from warpimpact.firing.response import Response
from warpimpact.firing.rules import drawn_places, fair_places
from warpimpact.scene.model import Array
from warpimpact.statistics.acceptance import fewest_shots

_PLACES, _VELOCITIES, _NODES = 1, 2, 64
"""Keys of the random numbers of places and of velocities; number of equally probable velocities of a proof's shot."""


def drawn_shots(test: FiringTest, procedure: Procedure, response: Response) -> tuple[NDArray[np.int64], Array]:
    """Places of the shots of all tests, and their velocities minus those aimed at [m/s], shape [tests, shots] each."""
    tests, most = test.tests, procedure.most
    places = drawn_places(test.fair_hit, response, uniform(test.seed, _PLACES, tests, most), test.seed)
    return places, test.gun.errors(uniform(test.seed, _VELOCITIES, tests, most))


def fired(test: FiringTest, procedure: Procedure, response: Response) -> Firings:
    """The shots of all tests."""
    return fire(procedure, response, *drawn_shots(test, procedure, response))


def proof_shots(proof: Proof) -> int:
    """Shots of a proof: the given number, or the fewest that show what a pass shall show."""
    return proof.shots or fewest_shots(proof.allowed, proof.stop_probability, proof.confidence)


def perforation(test: FiringTest, response: Response, velocity: Array) -> Array:
    """Probability that a fair shot of a proof perforates, with the gun's scatter, shape [velocities, fair places]."""
    errors = test.gun.errors((np.arange(_NODES) + 0.5) / _NODES)
    return response.by_place(velocity, errors)[:, fair_places(test.fair_hit, response)]
