"""The likelihood of measured shots, with the hit points integrated out (docs/identification.md).

    L = mean over points h of N(measured | computed at h, σ² + δ²)

The points cover the cell of the plate, or the measured place with its uncertainty. σ is the uncertainty of the
measurement and δ the discrepancy of the model. A core that ends otherwise than the measured one counts as 0, and so
does a set whose scene is not possible; a computation that failed does not count at all. Given the parameters, shots are
independent, as are the discrepancies of their numbers.

Every set of parameters has points of its own, at random shifts. Their mean estimates the likelihood without bias, and
Markov chains with such estimates have the exact posterior (C. Andrieu, G. O. Roberts, Annals of Statistics 37 (2009)
697).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import xarray
from numpy.typing import NDArray
from pydantic import ValidationError

from warpimpact.identification.fit import COLUMN_OF, UNITS_OF_EXPOSURE, Fit, MeasuredShot, columns_of
from warpimpact.measures.measure import STATUSES
from warpimpact.records import variables as v
from warpimpact.records.outcomes import Outcomes
from warpimpact.records.variables import failures
from warpimpact.scene import IDENTITY, Hits, Plate, Sampler, Scene, Shots, Symmetry
from warpimpact.scene.model import Array
from warpimpact.scene.sampling import irreducible_part, symmetries
from warpimpact.solver.device import Worker
from warpimpact.solver.limit import Limits, LimitSpec, limits
from warpimpact.solver.simulate import in_threads, simulate_many

MIRRORS = {str(one): one.mirror for one in (v.RESIDUAL_VELOCITY, v.DEFLECTION, v.TILT, v.PITCH, v.YAW, v.TOTAL_YAW)}
"""Factor of a symmetry that a mirror image applies to a measured number; None if it does not change."""
HIT_REPLICATES = 8
"""Parts of the hit points, every eighth point each. Their spread gives the standard error of ln L."""
POINT_STEPS = 0.7548776662466927, 0.5698402909980532
"""Steps from one point to the next along y and z, as shares of the part of the cell, modulo 1. They are the powers of
the root of x³ = x + 1, whose points leave no wide gaps (M. Roberts, "The unreasonable effectiveness of quasirandom
sequences", 2018)."""


SCORES = ("log_likelihood", "noise", "misfit", "hit_y", "hit_z")
"""How well sets of parameters explain shots: ln L, −inf where no computed core ended as the measured one; its standard
error by the number of hit points; smallest Σ (computed − measured)²/σ² over the points, infinite where L is 0; and a
hit point [m], drawn by its contribution to L."""


class HitPoints(NamedTuple):
    """The points over which a shot is integrated at sets of parameters that share a scene.

    Attributes:
        shots: the computed shots, set after set, shape [sets · points].
        group: symmetries whose images of the points cover the whole cell.
        cell: extent of the cell along y and z [m].
    """

    shots: Shots
    group: tuple[Symmetry, ...]
    cell: tuple[float, float]


def evaluate(
    fit: Fit, points: Array, uniform: Array, worker: Worker, report: Callable[[float], object] = lambda share: None
) -> xarray.Dataset:
    """Score every shot of a fit at sets of parameters: the variables SCORES along set and shot.

    The score of a set does not depend on the other sets.

    Args:
        points: standard normal numbers, shape [sets, parameters].
        uniform: uniform numbers of each set, shape [sets, 2 + shots]: the shift of its hit points along y and z, and
            for each shot the number that draws a hit.
        report: not called, as a task is short.
    """
    scores = np.zeros((len(SCORES), len(points), len(fit.shots)))
    scores[0], scores[2] = -np.inf, np.inf
    scales = fit.discrepancies(points)
    for alike in group_shots(fit):
        runs = [*_runs(fit, fit.shots[alike[0]], points, uniform[:, :2])]
        scenes = [(scene, hits.shots) for _, scene, hits in runs]
        for (rows, _, hits), outcomes in zip(runs, _outcomes(fit, alike, scenes, worker), strict=True):
            spread = {kind: scale[rows] for kind, scale in scales.items()}
            for place in alike:
                scores[:, rows, place] = score_shot(fit.shots[place], hits, outcomes, spread, uniform[rows, 2 + place])
    return xarray.Dataset({name: (("set", "shot"), values) for name, values in zip(SCORES, scores, strict=True)})


def group_shots(fit: Fit) -> list[list[int]]:
    """Places of the shots that share their runs, because they differ in their measurements alone."""
    places_of: dict[str, list[int]] = {}
    for place, shot in enumerate(fit.shots):
        key = repr((shot.hit, shot.impact, shot.scatter, shot.tables, sorted(shot.own)))
        places_of.setdefault(key, []).append(place)
    return [*places_of.values()]


def hit_points(fit: Fit, shot: MeasuredShot, plate: Plate, shifts: Array) -> HitPoints:
    """The points of a shot; `shifts` are uniform numbers that move those of each set, shape [sets, 2]."""
    turned = any(name != "velocity" for name, _ in shot.scatter.given)
    solid = plate.open_area == 0.0 and plate.size is None
    exact = shot.hit is not None and all(isinstance(at, float) for _, at in shot.hit)
    alone = not shot.scatter.given and (solid or exact)
    count, seed = 1 if alone else fit.file.sampling.hits, fit.file.sampling.seed
    shots = Sampler(shot.impact, Hits(count=count, seed=seed, replicates=1), plate, shot.scatter).shots(0, count)
    shares = np.mod(shifts[:, None] + np.arange(count)[:, None] * POINT_STEPS, 1.0).reshape(-1, 2).T
    group: tuple[Symmetry, ...] = (IDENTITY,)
    cell = plate.sampled_cell
    if shot.hit is not None:
        hit_y, hit_z = shot.hit.at(*shares)
    else:
        group = group if turned or alone else symmetries(plate, shot.impact)
        (low_y, high_y), (low_z, high_z) = irreducible_part(group)
        hit_y, hit_z = (
            side * (low + (high - low) * share)
            for side, low, high, share in zip(cell, (low_y, low_z), (high_y, high_z), shares, strict=True)
        )
    number = np.tile(np.arange(count), len(shifts))
    return HitPoints(replace(shots[number], hit_y=hit_y, hit_z=hit_z), group, cell)


def _runs(
    fit: Fit, shot: MeasuredShot, points: Array, shifts: Array
) -> Iterator[tuple[NDArray[np.int64], Scene, HitPoints]]:
    """Numbers of the sets of parameters that share a scene, the scene, and its points. Sets whose scene is not possible
    are left out."""
    by_place = {
        parameter.place: parameter.at(points[:, column])
        for column, parameter in enumerate(fit.parameters)
        if parameter.is_of_scene and parameter.place not in shot.own
    }
    # The literal scheme counts steps, so its interval may not differ from shot to shot.
    varying = {*COLUMN_OF} if fit.file.numerics.scheme == "nodal" else {*COLUMN_OF, *UNITS_OF_EXPOSURE}
    of_scene = {place: column for place, column in by_place.items() if place not in varying}
    keys = np.stack([np.zeros(len(points)), *of_scene.values()], axis=-1)
    _, which = np.unique(keys, axis=0, return_inverse=True)
    for scene_number in range(which.max() + 1):
        rows = np.flatnonzero(which.reshape(-1) == scene_number)
        own_scene = by_place if len(rows) == 1 else of_scene  # a single set needs no columns
        try:
            scene = fit.scene_of(shot, {place: float(column[rows[0]]) for place, column in own_scene.items()})
        except ValidationError:
            continue
        plate = scene.target.layers[0]
        own = hit_points(fit, shot, plate, shifts[rows])
        columns = columns_of({at: column[rows] for at, column in by_place.items() if at not in own_scene}, plate)
        each = len(own.shots) // len(rows)  # sets have equal numbers of shots, one set after the other
        of_shots: dict[str, Any] = {name: np.repeat(column, each) for name, column in columns.items()}
        yield rows, scene, own._replace(shots=replace(own.shots, **of_shots))


def _outcomes(fit: Fit, alike: Sequence[int], scenes: Sequence[tuple[Scene, Shots]], worker: Worker) -> list[Outcomes]:
    """The outcomes that the observations of shots need: at impact velocity, limit velocities, or both."""
    measured = [fit.shots[place] for place in alike]
    limited = [observation.is_limit for shot in measured for observation in shot.observations]
    numerics = fit.file.numerics
    if not any(limited):
        return simulate_many(scenes, numerics, worker)

    def limit(number: int, share: Worker) -> Limits:
        return limits(*scenes[number], LimitSpec.of(scenes[number][0]), numerics, share)

    searched = [*in_threads(limit, len(scenes), worker)]
    alone = all(limited) and not any(shot.status for shot in measured)
    outcomes = [one.outcomes for one in searched] if alone else simulate_many(scenes, numerics, worker)
    return [result.assign(limit_velocity=one.value) for result, one in zip(outcomes, searched, strict=True)]


def score_shot(
    shot: MeasuredShot, points: HitPoints, outcomes: Outcomes, discrepancy: Mapping[str, Array], uniform: Array
) -> Array:
    """The scores of one shot, shape [scores, sets].

    Args:
        outcomes: of the shots of `points`.
        discrepancy: standard deviations by kind, each of shape [sets].
        uniform: a uniform number of each set, which draws its hit.
    """
    sets, images = len(uniform), len(points.group)
    status = outcomes.status.reshape(sets, -1)
    counted = ~failures(status)
    possible = counted if shot.status is None else counted & (status == STATUSES[shot.status])
    squares, misfit = (np.zeros((*status.shape, images)) for _ in range(2))
    for number in shot.observations:
        mirror = MIRRORS.get(number.name)
        signs = [1.0 if mirror is None else float(getattr(symmetry, mirror)) for symmetry in points.group]
        missed = number.miss(number.of(outcomes).reshape(*status.shape, 1) * np.array(signs))
        spread = np.hypot(number.std, discrepancy[number.kind])[:, None, None]
        squares += (missed / spread) ** 2 + 2.0 * np.log(np.sqrt(2.0 * np.pi) * spread)
        misfit += (missed / number.std) ** 2
    possible = possible[..., None] & ~np.isnan(squares)
    log = np.where(possible, -0.5 * squares, -np.inf).reshape(sets, -1)
    highest = log.max(axis=1)
    relative = np.exp(log - np.where(np.isfinite(highest), highest, 0.0)[:, None])
    sums = relative.reshape(*status.shape, images).sum(axis=2)
    with np.errstate(divide="ignore", invalid="ignore"):
        log_likelihood = highest + np.log(sums.sum(axis=1) / (np.maximum(counted.sum(axis=1), 1) * images))
        replicates = min(HIT_REPLICATES, status.shape[1])
        parts = sums.reshape(sets, -1, replicates).sum(axis=1)
        noise = np.full(sets, np.nan)  # one replicate says nothing of it
        if replicates > 1:
            noise = parts.std(axis=1, ddof=1) / parts.mean(axis=1) / np.sqrt(HIT_REPLICATES)
    ends = np.cumsum(relative, axis=1)
    drawn = np.minimum((ends <= uniform[:, None] * ends[:, -1:]).sum(axis=1), log.shape[1] - 1)
    row, (computed, image) = np.arange(sets), np.divmod(drawn, images)
    at = row * status.shape[1] + computed
    places = np.array([one.image(points.shots.hit_y[at], points.shots.hit_z[at], points.cell) for one in points.group])
    nearest = np.where(possible, misfit, np.inf).reshape(sets, -1).min(axis=1)
    return np.array([log_likelihood, np.nan_to_num(noise), nearest, *places[image, :, row].T])
