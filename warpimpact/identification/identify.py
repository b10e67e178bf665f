"""From a fit to its posterior: sets of parameters are computed in rounds, and saved as they come."""

from __future__ import annotations

import hashlib
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from warpimpact.identification.aim import aim
from warpimpact.identification.fit import Fit, Sampling
from warpimpact.identification.likelihood import ShotScore
from warpimpact.identification.parameters import FitError
from warpimpact.identification.posterior import Sampled, to_datatree
from warpimpact.identification.scoring import benches, evaluate
from warpimpact.results import attributes as attr
from warpimpact.results.files import write_tree
from warpimpact.runs.choice import opened
from warpimpact.runs.executor import Executor, Job
from warpimpact.runs.questions import Arrays, Question, Round, RoundProgress, answered, packed, unpacked
from warpimpact.runs.store import content_of, stored
from warpimpact.scene.model import Array
from warpimpact.solver.limit import PASSAGES
from warpimpact.solver.prepare import prepare
from warpimpact.solver.worker import Worker
from warpimpact.statistics.importance import LARGEST_K, ImportanceSampler

FIRST, FIRST_SHARE = 192, 0.25
"""Sets of the first round, which is drawn from the prior, and their largest share of all sets."""
ROUND_GROWTH = 0.1
"""Sets of a later round, as a share of all before it; at least half of the first round."""
DISCREPANCIES = 8
"""Scales of discrepancy per set of parameters. They need no runs of their own."""
BATCH = 16
"""Sets per file."""
SCORING = 1e-4
"""Seconds of a core for a hit beside its march, for scenes, places and scores: 0.9e-4 and 1.3e-4 in the fits of
campaigns/fits."""
FARTHEST = 5.0
"""Largest miss of a number in the best set of the prior, in standard deviations including the discrepancy."""


@dataclass(frozen=True)
class FitProgress:
    """The progress of a fit.

    Attributes:
        done, total: sets of parameters; `total` is an upper bound.
        resumed: sets that an earlier call had computed.
        effective, pareto_k: effective size and Pareto k of the weights so far; NaN before the first round ends.
        misfit: smallest sum over shots of Σ (miss/σ)² so far.
    """

    done: int
    total: int
    resumed: int
    effective: float
    pareto_k: float
    misfit: float


Follow = Callable[[FitProgress], None]


def identify_to_file(
    fit: Fit,
    output: Path,
    *,
    device: str | Executor = "auto",
    resume: bool = False,
    overwrite: bool = False,
    progress: Follow | None = None,
    tell: Callable[[str], object] = warnings.warn,
) -> None:
    """Compute the posterior of a fit into a file. Computed sets are on the disk at once, in `output`.parts.

    Raises:
        OutputError: a file cannot be written, must not be overwritten or belongs to another fit.
        FitError: the priors exclude what was measured.
        Interrupted: the user interrupted the fit; what is saved can be resumed.
    """
    with opened(device) as computing:
        content = content_of(fit.text, "fit", fit.folder, computing.made_by)
        with stored(output, content, "fit", resume=resume, overwrite=overwrite, tell=tell) as store:
            if store is not None:
                tree = to_datatree(fit, answered(sampled(fit, progress), computing, store), computing.made_by)
                tree.attrs[attr.FINGERPRINT] = store.parts.fingerprint
                write_tree(tree, output)


def sampled(fit: Fit, progress: Follow | None = None) -> Question[Sampled]:
    """Draw sets of parameters in rounds until they reach the required effective size, or all are drawn.

    Raises:
        FitError: the priors exclude what was measured.
    """
    plan = fit.sampling
    sampler = ImportanceSampler(len(fit.parameters), shared(fit), plan.seed)
    scored = _Scored(fit, progress or (lambda now: None))
    checked = False
    for count in rounds(plan):
        points = sampler.propose(count)
        log_likelihood = yield from scored.round(points)
        sampler.tell(log_likelihood)
        weights = sampler.weighed()
        if not checked and scored.done >= FIRST_SHARE * plan.sets - plan.shared:
            _check_reach(fit, scored.scores())
            checked = True
        effective = weights.effective(DISCREPANCIES)
        scored.tell(effective, weights.pareto_k)
        if effective >= plan.effective and weights.pareto_k <= LARGEST_K:
            break
    return Sampled(sampler.points, scored.scores(), sampler.weighed(), DISCREPANCIES)


def shared(fit: Fit) -> list[tuple[int, int]]:
    """Numbers of parameters that blocks of draws share, with the size of the blocks: first the parameters that need a
    scene of their own, then all that need runs."""
    scenes = sum(not parameter.is_column for parameter in fit.parameters)
    return [(scenes, fit.sampling.shared * DISCREPANCIES), (len(fit.scene_parameters), DISCREPANCIES)]


def rounds(plan: Sampling) -> list[int]:
    """Number of draws of each round; the first is drawn from the prior. Rounds are whole blocks."""
    blocks = plan.sets // plan.shared
    counts = [max(1, int(min(FIRST / plan.shared, FIRST_SHARE * blocks)))]
    while (left := blocks - sum(counts)) > 0:
        counts.append(min(left, max(1, counts[0] // 2, int(ROUND_GROWTH * sum(counts)))))
    return [count * plan.shared * DISCREPANCIES for count in counts]


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


class _Scored:
    """Scores sets of parameters in batches. A batch is a job of a round."""

    def __init__(self, fit: Fit, follow: Follow) -> None:
        self._fit, self._follow = fit, follow
        self._batches: list[list[ShotScore]] = []
        self.done = 0
        self._progress = FitProgress(0, sets_of(fit), 0, np.nan, np.nan, np.inf)

    def round(self, points: Array) -> Question[Array]:
        """Score the sets of one round; returns the logarithms of their likelihoods, shape [sets]."""
        size, first, before = BATCH * DISCREPANCIES, len(self._batches), self._progress
        batches = [points[place : place + size] for place in range(0, len(points), size)]
        sets = [len(batch) // DISCREPANCIES for batch in batches]

        def tell(now: RoundProgress) -> None:
            misfits = [
                float(np.sum([shot.misfit for shot in unpacked(ShotScore, arrays)], axis=0).min())
                for arrays in now.results.copy().values()
            ]
            self._progress = replace(
                before,
                done=before.done + sum(sets[place] for place in now.results),
                resumed=before.resumed + sum(sets[place] for place in [*now.results][: now.resumed]),
                misfit=min([before.misfit, *misfits]),
            )
            self._follow(self._progress)

        results = yield Round(
            [Job(_batch_scored, (self._fit, batch, first + place)) for place, batch in enumerate(batches)],
            [hashlib.sha256(batch.tobytes()).hexdigest() for batch in batches],
            tell,
        )
        self.done += len(points) // DISCREPANCIES
        scores = [unpacked(ShotScore, arrays) for arrays in results]
        self._batches += scores
        return np.concatenate([np.sum([shot.log_likelihood for shot in batch], axis=0) for batch in scores])

    def scores(self) -> list[ShotScore]:
        """One score per shot over all sets so far."""
        return [ShotScore.joined([batch[place] for batch in self._batches]) for place in range(len(self._fit.shots))]

    def tell(self, effective: float, pareto_k: float) -> None:
        """Report the effective size and Pareto k of the weights after a round."""
        self._progress = replace(self._progress, effective=effective, pareto_k=pareto_k)
        self._follow(self._progress)


def _batch_scored(fit: Fit, points: Array, number: int, *, worker: Worker, report: Callable[[float], object]) -> Arrays:
    """Scores of the sets of a batch. Its number is the seed of the places of its hits."""
    return packed(evaluate(fit, points, worker, seed=number))


def _check_reach(fit: Fit, scores: list[ShotScore]) -> None:
    """Refuse priors all of whose sets are far from the measurements.

    Raises:
        FitError: the message names the shot and how far the nearest set is.
    """
    for shot, score in zip(fit.shots, scores, strict=True):
        sets = len(score.misfit)
        if not np.isfinite(score.misfit).any():
            raise FitError(
                f'the priors exclude shot "{shot.name}": in {sets} sets of parameters no core ended as it did'
            )
        if not shot.observations:
            continue
        nearest = int(score.misfit.argmin())
        largest = {kind: fit.discrepancy.get(kind, 0.0) for kind in ("velocity", "angle")} | {
            str(parameter.path[1]): float(parameter.prior.quantile(np.array(0.99)))
            for parameter in fit.parameters
            if parameter.path[0] == "discrepancy"
        }
        missed = [
            (
                abs(float(observation.miss(score.best[nearest, place])))
                / np.hypot(observation.std, largest[observation.kind]),
                observation,
                place,
            )
            for place, observation in enumerate(shot.observations)
        ]
        worst, number, place = max(missed, key=lambda miss: miss[0])
        if worst > FARTHEST:
            raise FitError(
                f'the priors exclude shot "{shot.name}": the nearest of {sets} sets of parameters has {number.label} = '
                f"{number.shown(score.best[nearest, place]):.4g} instead of {number.shown(number.value):.4g}, "
                f"{worst:.3g} standard deviations off with the largest discrepancy that its prior "
                "expects; widen the priors"
            )
