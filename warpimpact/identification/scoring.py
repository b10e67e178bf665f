"""Runs of a fit: the outcomes of every measured shot at some sets of parameters, and their score."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from warpimpact.identification.aim import HitPoints, aim
from warpimpact.identification.between import with_images
from warpimpact.identification.fit import Fit, MeasuredShot
from warpimpact.identification.hit_places import HitPlace
from warpimpact.identification.likelihood import Compared, Data, ShotScore
from warpimpact.records.outcomes import Outcomes
from warpimpact.scene import Scene, Shots
from warpimpact.scene.model import Array
from warpimpact.solver.columns import COLUMN_OF, UNITS_OF_EXPOSURE, Path, columns_of
from warpimpact.solver.limit import Limits, limit_velocity
from warpimpact.solver.many import side_by_side, simulate_many
from warpimpact.solver.worker import Worker

SHOTS_AT_A_TIME = 2**15
"""Most shots of a computation, images not counted. Their outcomes take some ten megabytes."""
SCORED = 2**14
"""Points, images counted, that are scored together, so that they fit into a cache."""


@dataclass(frozen=True)
class Bench:
    """Measured shots that share their runs, because they differ only in their measurements and in the class of their
    hit.

    Attributes:
        shot: one of the shots.
        which: their places in the fit.
    """

    shot: MeasuredShot
    which: tuple[int, ...]


class Run(NamedTuple):
    """Shots of a bench at some sets of parameters that share a scene.

    Attributes:
        which: numbers of the sets, shape [computed sets, equal sets]; equal sets differ in the scales of discrepancy
            alone.
        scene: the scene, with medians of the quantities that differ from set to set.
        aim: the points of the computed sets, without a class.
        shots: the computed shots.
    """

    which: NDArray[np.int64]
    scene: Scene
    aim: HitPoints
    shots: Shots


def benches(fit: Fit) -> list[Bench]:
    """Group the shots of a fit by the runs that they share."""
    places_of: dict[str, list[int]] = {}
    for place, shot in enumerate(fit.shots):
        hit = shot.hit if isinstance(shot.hit, HitPlace) else "cell"
        key = repr((hit, shot.impact, shot.scatter, shot.tables, sorted(map(str, shot.own))))
        places_of.setdefault(key, []).append(place)
    return [Bench(fit.shots[places[0]], tuple(places)) for places in places_of.values()]


def computed(fit: Fit, bench: Bench, points: Array, worker: Worker, *, seed: int = 0) -> Iterator[tuple[Run, Outcomes]]:
    """Compute a bench at sets of parameters: runs with the outcomes of their shots.

    Args:
        points: standard normal numbers, one column per parameter of the fit, shape [sets, parameters].
        seed: seed of the places of the hits.
    """
    runs = list[Run]()
    for run in _runs(fit, bench, points, seed):
        runs.append(run)
        if sum(len(some.shots) for some in runs) >= SHOTS_AT_A_TIME:
            yield from zip(runs, _outcomes(fit, bench, runs, worker), strict=True)
            runs = []
    yield from zip(runs, _outcomes(fit, bench, runs, worker), strict=True)


def _runs(fit: Fit, bench: Bench, points: Array, seed: int) -> Iterator[Run]:
    alike = _alike(points[:, [parameter.path[0] != "discrepancy" for parameter in fit.parameters]])
    by_path = {
        parameter.path: parameter.at(points[alike[:, 0], column])
        for column, parameter in enumerate(fit.parameters)
        if parameter.path[0] != "discrepancy" and parameter.path not in bench.shot.own
    }
    # The literal scheme counts steps, so its interval may not differ from shot to shot.
    varying = {*COLUMN_OF} if fit.numerics.scheme == "nodal" else {*COLUMN_OF, *UNITS_OF_EXPOSURE}
    of_scene = {path: column for path, column in by_path.items() if path not in varying}
    shifts = np.random.default_rng(np.random.SeedSequence(fit.sampling.seed, spawn_key=(4, seed))).random(
        (len(alike), 2)
    )
    per_call = max(1, SHOTS_AT_A_TIME // fit.sampling.hits)
    for rows in _of_one_scene(of_scene, len(alike)):
        own_scene = by_path if len(rows) == 1 else of_scene  # a single set needs no columns
        scene = fit.scene_of(bench.shot, {path: float(column[rows[0]]) for path, column in own_scene.items()})
        for first in range(0, len(rows), per_call):
            chosen = rows[first : first + per_call]
            targets = aim(bench.shot, scene.target.layers[0], scene.core, fit.sampling, shifts[chosen])
            own = {path: column[chosen] for path, column in by_path.items() if path not in own_scene}
            columns = columns_of(own, scene.target.layers[0])
            each = len(targets.computed) // len(chosen)  # sets have equal numbers of shots, one set after the other
            of_shots: dict[str, Any] = {name: np.repeat(column, each) for name, column in columns.items()}
            yield Run(alike[chosen], scene, targets, replace(targets.computed, **of_shots))


def _alike(points: Array) -> NDArray[np.int64]:
    """Indices of equal sets, shape [different sets, equal sets]; every set is alone if the groups differ in size."""
    _, which, counts = np.unique(points, axis=0, return_inverse=True, return_counts=True)
    if (counts != counts[0]).any():
        return np.arange(len(points))[:, None]
    rows: NDArray[np.int64] = np.argsort(which.reshape(-1), kind="stable").reshape(-1, counts[0])
    return rows


def _outcomes(fit: Fit, bench: Bench, runs: Sequence[Run], worker: Worker) -> list[Outcomes]:
    """The outcomes that the observations of a bench need: at impact velocity, limit velocities, or both."""
    measured = [fit.shots[place] for place in bench.which]
    observations = [observation for shot in measured for observation in shot.observations]
    limited = any(observation.is_limit for observation in observations)
    other = (
        fit.selection
        or any(shot.status for shot in measured)
        or not all(observation.is_limit for observation in observations)
    )
    scenes = [(run.scene, run.shots) for run in runs]
    outcomes = simulate_many(scenes, fit.numerics, worker) if other or not limited else []

    def limit(number: int, share: Worker, _: Any) -> Limits:
        return limit_velocity(*scenes[number], numerics=fit.numerics, device=share.device, threads=share.threads)

    if limited:
        limits = side_by_side(limit, len(scenes), worker)
        outcomes = [
            result.assign(limit_velocity=limit.value)
            for result, limit in zip(outcomes or [limit.outcomes for limit in limits], limits, strict=True)
        ]
    return outcomes


def _of_one_scene(of_scene: Mapping[Path, Array], count: int) -> Iterator[NDArray[np.int64]]:
    """Groups of rows that share one scene."""
    if not of_scene:
        yield np.arange(count)
        return
    _, which = np.unique(np.stack(list(of_scene.values()), axis=-1), axis=0, return_inverse=True)
    which = which.reshape(-1)
    for scene_number in dict.fromkeys(which.tolist()):
        yield np.flatnonzero(which == scene_number)


def data_of(fit: Fit, shot: MeasuredShot) -> Data:
    """The measurements of a shot, with the condition under which it was measured."""
    return Data(shot.observations, shot.status, fit.selection, fit.record.standoffs)


def discrepancies(fit: Fit, points: Array) -> dict[str, Array]:
    """Standard deviation of the discrepancy by kind at sets of parameters, each of shape [sets]."""
    scales = {kind: np.full(len(points), value) for kind, value in fit.discrepancy.items()}
    for column, parameter in enumerate(fit.parameters):
        if parameter.path[0] == "discrepancy":
            scales[str(parameter.path[1])] = parameter.at(points[:, column])
    return scales


def evaluate(fit: Fit, points: Array, worker: Worker, *, seed: int) -> list[ShotScore]:
    """Score every shot of a fit at sets of parameters.

    Args:
        points: standard normal numbers, shape [sets, parameters].
        seed: seed of the places of the hits, and of the kept hits.

    Returns:
        One score per shot, over the sets.
    """
    scales = discrepancies(fit, points)
    scored: dict[int, list[tuple[NDArray[np.int64], ShotScore]]] = {place: [] for place in range(len(fit.shots))}
    rng = np.random.default_rng(np.random.SeedSequence(fit.sampling.seed, spawn_key=(1, seed)))
    for bench in benches(fit):
        for run, outcomes in computed(fit, bench, points, worker, seed=seed):
            unfolded, changes = with_images(outcomes, run.aim.group), dict[tuple[Any, ...], Array]()
            for place in bench.which:
                shot = fit.shots[place]
                targets = run.aim.of(shot.hit, run.scene.target.layers[0], run.scene.core)
                numbers = tuple(
                    (observation.name, observation.standoff, observation.is_limit and place)
                    for observation in shot.observations
                )
                compared = Compared.of(data_of(fit, shot), targets, unfolded, changes.get(numbers))
                changes[numbers] = compared.changes
                scored[place] += _scored(compared, run.which, scales, rng)
    return [_in_order(parts) for parts in scored.values()]


def _scored(
    compared: Compared, which: NDArray[np.int64], scales: Mapping[str, Array], rng: np.random.Generator
) -> Iterator[tuple[NDArray[np.int64], ShotScore]]:
    """Score the sets of a run in parts that fit into a cache; yield their indices and their score."""
    alike, at_a_time = which.shape[1], max(1, SCORED // compared.counts.shape[1])
    for first in range(0, which.size, at_a_time):
        chosen = which.reshape(-1)[first : first + at_a_time]
        chosen_scales = {kind: scale[chosen] for kind, scale in scales.items()}
        yield chosen, compared.score(chosen_scales, rng, np.arange(first, first + len(chosen)) // alike)


def _in_order(parts: list[tuple[NDArray[np.int64], ShotScore]]) -> ShotScore:
    order = np.argsort(np.concatenate([which for which, _ in parts]), kind="stable")
    return ShotScore.joined([score for _, score in parts])[order]
