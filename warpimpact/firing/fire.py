"""Fires a procedure many times at a target, each test with its own places and velocities.

The random numbers of shot k of test t depend on the seed, t and k alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpimpact.firing.procedures import Procedure
from warpimpact.firing.response import Response
from warpimpact.firing.steps import Estimated, Optimal, Shot, StepEstimate, Steps
from warpimpact.scene.model import Array
from warpimpact.scene.sampling import stream
from warpimpact.statistics.quantal import d_optimal, fit_quantal, information

Flags = NDArray[np.bool_]

_LEAST = 1.0
"""Slowest velocity of a gun [m/s]."""


@dataclass(frozen=True)
class Firings:
    """The shots of all tests, each of shape [tests, shots].

    Attributes:
        aimed, velocity: velocity aimed at, and velocity of the shot [m/s].
        perforated: whether the shot perforated.
        place: place of the target that it hit.
        used: whether the test had this shot.
    """

    aimed: Array
    velocity: Array
    perforated: Flags
    place: NDArray[np.int64]
    used: Flags

    def first(self, shots: int) -> Firings:
        """The first shots of every test."""
        return Firings(**{name: values[:, :shots] for name, values in vars(self).items()})


def uniform(seed: int, column: int, tests: int, most: int) -> Array:
    """Independent uniform numbers in [0, 1) of one kind for every shot, shape [tests, most]."""
    return np.stack([stream(seed, (column, shot), 0, tests) for shot in range(most)], axis=1)


def fire(procedure: Procedure, response: Response, places: NDArray[np.int64], errors: Array) -> Firings:
    """Fire all tests.

    Args:
        places: place of the response that every shot hits, shape [tests, shots].
        errors: velocity of each shot minus the velocity aimed at [m/s], shape [tests, shots], from `Gun.errors`.
    """
    tests, most = len(places), procedure.most
    aimed, velocity = np.zeros((2, tests, most))
    perforated, used = np.zeros((2, tests, most), dtype=bool)
    procedures = [procedure.steps() for _ in range(tests)]
    asked = {test: next(steps) for test, steps in enumerate(procedures)}
    for shot in range(most):
        _answer_estimates(procedures, asked, (velocity, perforated, used))
        if not asked:
            break
        going = np.array(list(asked))
        aims = _aims([asked[test] for test in going], velocity[going], perforated[going], used[going])
        aimed[going, shot] = np.maximum(aims, _LEAST)
        velocity[going, shot] = np.maximum(aims + errors[going, shot], _LEAST)
        perforated[going, shot] = response.perforates(places[going, shot], velocity[going, shot])
        used[going, shot] = True
        for test in going:
            became = Shot(float(velocity[test, shot]), bool(perforated[test, shot]))
            try:
                asked[test] = procedures[test].send(became)
            except StopIteration:
                del asked[test]
    return Firings(aimed, velocity, perforated, places[:, :most], used)


def _aims(asked: Sequence[float | Optimal | Estimated], velocity: Array, perforated: Flags, used: Flags) -> Array:
    """Velocities to aim at [m/s]. The D-optimal ones are computed together."""
    optimal = np.array([isinstance(velocity, Optimal) for velocity in asked])
    aims = np.array([0.0 if isinstance(velocity, Optimal | Estimated) else velocity for velocity in asked])
    if optimal.any():
        guesses = [velocity for velocity in asked if isinstance(velocity, Optimal)]
        location = np.array([np.nan if guess.location is None else guess.location for guess in guesses])
        scale = np.array([np.nan if guess.scale is None else guess.scale for guess in guesses])
        fired, answers, counts = velocity[optimal], perforated[optimal], used[optimal]
        fitted = np.isnan(location)
        if fitted.any():
            fit = fit_within(fired[fitted], answers[fitted], counts[fitted])
            location[fitted], scale[fitted] = fit
        aims[optimal] = d_optimal(fired, counts, location, scale)
    return aims


def fit_within(velocity: Array, perforated: Flags, used: Flags) -> tuple[Array, Array]:
    """Median and standard deviation of greatest likelihood, kept within the velocities fired and their range, as Neyer
    and 3pod do. Where the odds fall with the velocity, they are the middle and the whole range."""
    slowest = np.where(used, velocity, np.inf).min(axis=1)
    fastest = np.where(used, velocity, -np.inf).max(axis=1)
    fit = fit_quantal(velocity, perforated, used)
    location = np.where(np.isnan(fit.location), 0.5 * (slowest + fastest), fit.location)
    wide = np.where(fit.scale > 0.0, fit.scale, fastest - slowest)
    return np.clip(location, slowest, fastest), np.minimum(wide, fastest - slowest)


def _answer_estimates(
    procedures: Sequence[Steps], asked: dict[int, float | Optimal | Estimated], fired: tuple[Array, Flags, Flags]
) -> None:
    """Send the current fit to the tests that ask for it."""
    asking = [test for test, velocity in asked.items() if isinstance(velocity, Estimated)]
    if not asking:
        return
    velocity, used = fired[0][asking], fired[2][asking]
    location, scale = fit_within(velocity, fired[1][asking], used)
    s0, s1, s2 = information(velocity, used, location, scale)
    for row, test in enumerate(asking):
        sums = float(s0[row]), float(s1[row]), float(s2[row])
        asked[test] = procedures[test].send(StepEstimate(float(location[row]), float(scale[row]), sums))
