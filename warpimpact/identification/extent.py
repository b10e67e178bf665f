"""What a fit will compute, and roughly how long that takes, before it begins."""

from __future__ import annotations

import numpy as np

from warpimpact.identification.aim import aim
from warpimpact.identification.fit import Fit
from warpimpact.identification.identify import DISCREPANCIES, rounds
from warpimpact.identification.scoring import Bench, benches
from warpimpact.solver.limit import PASSAGES
from warpimpact.solver.prepare import prepare

SCORING = 1e-4
"""Seconds of a core that a hit takes beside its march, for scenes, places and scores: 0.9e-4 and 1.3e-4 of the fits in
campaigns/fits."""


def core_seconds(fit: Fit) -> float:
    """Time that all sets of a fit take one core, roughly, if the sampling does not end early [s]."""
    of_a_set = 0.0
    for bench in benches(fit):
        scene = fit.scene_of(bench.shot)
        hits = aim(bench.shot, scene.target.layers[0], scene.core, fit.sampling, np.zeros((1, 2))).computed
        passages = PASSAGES if _limited(fit, bench) else 1
        of_a_set += len(hits) * (SCORING + passages * prepare(scene, hits[:1], fit.numerics).seconds)
    return of_a_set * sets_of(fit)


def _limited(fit: Fit, bench: Bench) -> bool:
    """Whether limits of a bench were measured."""
    return any(observation.is_limit for place in bench.which for observation in fit.shots[place].observations)


def sets_of(fit: Fit) -> int:
    """Sets of parameters at most."""
    return sum(rounds(fit.sampling)) // DISCREPANCIES


def extent_of(fit: Fit, cores: int | None) -> str:
    """What a fit will compute at most, in a sentence.

    Args:
        cores: that will compute; None where that is not known, and so no time is told.
    """
    sentence = f"computes at most {sets_of(fit)} sets of parameters, {fit.sampling.hits} hits of each shot"
    if cores is None:
        return sentence
    seconds = core_seconds(fit) / cores
    time = f"{seconds:.0f} s" if seconds < 90.0 else f"{seconds / 60.0:.2g} min"
    return f"{sentence}: roughly {time} on {cores} core{'s' if cores > 1 else ''}"
