"""What a fit will compute, and its approximate time, before it begins."""

from __future__ import annotations

import numpy as np

from warpimpact.identification.aim import aim
from warpimpact.identification.fit import Fit
from warpimpact.identification.identify import DISCREPANCIES, rounds
from warpimpact.identification.scoring import benches
from warpimpact.solver.limit import PASSAGES
from warpimpact.solver.prepare import prepare

SCORING = 1e-4
"""Seconds of a core for a hit beside its march, for scenes, places and scores: 0.9e-4 and 1.3e-4 in the fits of
campaigns/fits."""


def core_seconds(fit: Fit) -> float:
    """Approximate time that a core takes for all sets of a fit if the sampling does not end early [s]."""
    of_a_set = 0.0
    for bench in benches(fit):
        scene = fit.scene_of(bench.shot)
        hits = aim(bench.shot, scene.target.layers[0], scene.core, fit.sampling, np.zeros((1, 2))).computed
        measured = (observation for place in bench.which for observation in fit.shots[place].observations)
        passages = PASSAGES if any(observation.is_limit for observation in measured) else 1
        of_a_set += len(hits) * (SCORING + passages * prepare(scene, hits[:1], fit.numerics).seconds)
    return of_a_set * sets_of(fit)


def sets_of(fit: Fit) -> int:
    """Largest number of sets of parameters."""
    return sum(rounds(fit.sampling)) // DISCREPANCIES


def extent_of(fit: Fit, cores: int | None) -> str:
    """A sentence about the most that a fit will compute.

    Args:
        cores: number of cores that will compute; None where unknown, and then no time is given.
    """
    sentence = f"computes at most {sets_of(fit)} sets of parameters, {fit.sampling.hits} hits of each shot"
    if cores is None:
        return sentence
    seconds = core_seconds(fit) / cores
    time = f"{seconds:.0f} s" if seconds < 90.0 else f"{seconds / 60.0:.2g} min"
    return f"{sentence}: roughly {time} on {cores} core{'s' if cores > 1 else ''}"
