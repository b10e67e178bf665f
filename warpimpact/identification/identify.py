"""From a fit to its posterior: rounds of sets of parameters, kept on the disk as they come."""

from __future__ import annotations

import threading
import warnings
from collections.abc import Callable
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from warpimpact.identification.crew import Batch, Crew, crew_of
from warpimpact.identification.fit import Fit, Sampling
from warpimpact.identification.likelihood import Score
from warpimpact.identification.parameters import FitError
from warpimpact.identification.posterior import Sampled, to_datatree
from warpimpact.results import attributes as attr
from warpimpact.results.files import write_tree
from warpimpact.runs.describe import made_by
from warpimpact.runs.store import Store, content_of, stored
from warpimpact.statistics.importance import LARGEST_K, ImportanceSampler

Array = NDArray[np.float64]

FIRST, FIRST_SHARE = 192, 0.25
"""Sets of the first round, which is drawn from the prior, and the largest share of all sets that they may be."""
GROWTH = 0.1
"""Sets of a later round, as a share of all before it; at least half of the first round."""
DISCREPANCIES = 8
"""Scales of discrepancy per set of parameters: they need no runs of their own."""
BATCH = 16
"""Sets per file on the disk."""
FARTHEST = 5.0
"""Standard deviations, discrepancy included, by which the best set of the prior may miss a number."""


@dataclass(frozen=True)
class FitProgress:
    """How far a fit is.

    Attributes:
        done, total: sets of parameters; `total` is the most that is computed.
        resumed: sets that an earlier call had computed.
        effective, pareto_k: of the weights so far; NaN before the first round ends.
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
    device: str = "auto",
    resume: bool = False,
    overwrite: bool = False,
    progress: Follow | None = None,
    processes: int = 1,
    tell: Callable[[str], object] = warnings.warn,
) -> None:
    """Compute the posterior of a fit into a file; what is computed is on the disk at once, in `output`.parts.

    Args:
        processes: as in `Crew`.
        tell: called with a sentence for what was damaged and is computed again.

    Raises:
        OutputError: something cannot be written, must not be overwritten or is no part of this fit.
        FitError: the priors exclude what was measured.
        Interrupted: by the keyboard; what is saved can be resumed.
    """
    made = made_by(device)
    content = content_of(fit.text, "fit", fit.folder, made)
    with stored(output, content, "fit", resume=resume, overwrite=overwrite, tell=tell) as store:
        if store is not None:
            sampled = sample(fit, device=device, store=store, progress=progress, processes=processes)
            tree = to_datatree(fit, sampled, made)
            tree.attrs[attr.FINGERPRINT] = store.parts.fingerprint
            write_tree(tree, output)


def sample(
    fit: Fit,
    *,
    device: str = "auto",
    store: Store | None = None,
    progress: Follow | None = None,
    processes: int = 1,
) -> Sampled:
    """Draw sets of parameters in rounds until their effective size is what the fit asks for, or all are drawn.

    Args:
        processes: as in `Crew`.
    """
    with crew_of(fit, device, processes) as crew:
        return _sampled(fit, _Work(fit, crew, store, progress or (lambda now: None)))


def _sampled(fit: Fit, work: _Work) -> Sampled:
    plan = fit.sampling
    sampler = ImportanceSampler(len(fit.parameters), shared(fit), plan.seed)
    checked = False
    for count in rounds(plan):
        points = sampler.propose(count)
        sampler.tell(work.round(points))
        weights = sampler.weighed()
        if not checked and work.done >= FIRST_SHARE * plan.sets - plan.shared:
            _check_reach(fit, work.scores())
            checked = True
        effective = weights.effective(DISCREPANCIES)
        work.tell(effective, weights.pareto_k)
        if effective >= plan.effective and weights.pareto_k <= LARGEST_K:
            break
    return Sampled(sampler.points, work.scores(), sampler.weighed(), DISCREPANCIES)


def shared(fit: Fit) -> list[tuple[int, int]]:
    """How many numbers blocks of draws share: those that make a scene of their own, then all that need runs."""
    scenes = sum(not one.is_column for one in fit.parameters)
    return [(scenes, fit.sampling.shared * DISCREPANCIES), (len(fit.scene_parameters), DISCREPANCIES)]


def rounds(plan: Sampling) -> list[int]:
    """Draws of the first round, from the prior, and of the others; whole blocks."""
    blocks = plan.sets // plan.shared
    counts = [max(1, int(min(FIRST / plan.shared, FIRST_SHARE * blocks)))]
    while (left := blocks - sum(counts)) > 0:
        counts.append(min(left, max(1, counts[0] // 2, int(GROWTH * sum(counts)))))
    return [count * plan.shared * DISCREPANCIES for count in counts]


class _Work:
    """Scores sets in batches, and knows what was computed before."""

    def __init__(self, fit: Fit, crew: Crew, store: Store | None, follow: Follow) -> None:
        self._fit, self._crew, self._store, self._follow = fit, crew, store, follow
        self._total = sum(rounds(fit.sampling)) // DISCREPANCIES
        self._batches: list[list[Score]] = []
        self._lock = threading.Lock()
        self._resumed, self.done = 0, 0
        self._effective, self._pareto_k, self._misfit = np.nan, np.nan, np.inf

    def round(self, points: Array) -> Array:
        """Score the sets of one round; ln of their likelihood, shape [sets]."""
        size, scores = BATCH * DISCREPANCIES, dict[int, list[Score]]()
        first = len(self._batches)
        batches = [Batch(first + place // size, points[place : place + size]) for place in range(0, len(points), size)]

        def ended(batch: Batch, found: list[Score]) -> None:
            self._keep(batch, found)
            scores[batch.number] = found
            self._tell_of(batch, found)

        for batch in batches:
            if (known := self._known(batch)) is not None:
                scores[batch.number] = known
                self._tell_of(batch, known, resumed=True)
        self._crew.score([batch for batch in batches if batch.number not in scores], ended)
        found = [scores[batch.number] for batch in batches]
        self._batches += found
        return np.concatenate([np.sum([one.log_likelihood for one in each], axis=0) for each in found])

    def _known(self, batch: Batch) -> list[Score] | None:
        """The scores of a batch that are on the disk."""
        stored = None if self._store is None else self._store.load(batch.number)
        if stored is None or not np.array_equal(stored["points"], batch.points):
            return None
        return [
            Score(**{f.name: stored[f"{f.name}_{place}"] for f in fields(Score)})
            for place in range(len(self._fit.shots))
        ]

    def _tell_of(self, batch: Batch, scores: list[Score], *, resumed: bool = False) -> None:
        """Tell of a batch that is scored; by any thread."""
        with self._lock:
            self.done += len(batch.points) // DISCREPANCIES
            self._resumed += resumed * len(batch.points) // DISCREPANCIES
            self._misfit = min(self._misfit, float(np.sum([one.misfit for one in scores], axis=0).min()))
            self._say()

    def _keep(self, batch: Batch, scores: list[Score]) -> None:
        """Put a batch on the disk."""
        if self._store is not None:
            arrays = {
                f"{f.name}_{place}": getattr(one, f.name) for place, one in enumerate(scores) for f in fields(Score)
            }
            self._store.save(batch.number, {"points": batch.points, **arrays})

    def scores(self) -> list[Score]:
        """One score per shot over all sets so far."""
        return [Score.joined([batch[place] for batch in self._batches]) for place in range(len(self._fit.shots))]

    def tell(self, effective: float, pareto_k: float) -> None:
        self._effective, self._pareto_k = effective, pareto_k
        self._say()

    def _say(self) -> None:
        self._follow(FitProgress(self.done, self._total, self._resumed, self._effective, self._pareto_k, self._misfit))


def _check_reach(fit: Fit, scores: list[Score]) -> None:
    """Refuse priors of which no set comes near what was measured.

    Raises:
        FitError: names the shot and how far the nearest set is.
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
            str(one.path[1]): float(one.prior.quantile(np.array(0.99)))
            for one in fit.parameters
            if one.path[0] == "discrepancy"
        }
        missed = [
            (abs(float(one.miss(score.best[nearest, place]))) / np.hypot(one.std, largest[one.kind]), one, place)
            for place, one in enumerate(shot.observations)
        ]
        worst, one, place = max(missed, key=lambda miss: miss[0])
        if worst > FARTHEST:
            raise FitError(
                f'the priors exclude shot "{shot.name}": the nearest of {sets} sets of parameters has {one.label} = '
                f"{one.shown(score.best[nearest, place]):.4g} instead of {one.shown(one.value):.4g}, {worst:.3g} "
                "standard deviations off with the largest discrepancy that its prior expects; widen the priors"
            )
