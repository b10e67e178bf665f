"""Which designs of a search are best by their answers: what `warpimpact run` says of a design by each threat.

A search computes its designs by the fast law, whose error is not known there. The answer of a confirmed design says
what it is, and that of its neighbours is taken to be alike. So the front is chosen anew after each few answers.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import tomli_w
import xarray
from numpy.typing import NDArray

from warpimpact.campaign.campaign import Campaign
from warpimpact.measures.draws import estimate_of_draws
from warpimpact.measures.estimates import measure_data
from warpimpact.measures.measure import Measure
from warpimpact.optimisation.design import (
    Bound,
    Design,
    Objective,
    campaign_from,
    campaign_tables,
    is_irreducible,
    target_weights,
)
from warpimpact.records import attributes as attr
from warpimpact.records import variables as v
from warpimpact.results import files
from warpimpact.runs.compute import limit_spec
from warpimpact.runs.options import RunOptions
from warpimpact.runs.run import run, run_to_file
from warpimpact.runs.store import Store
from warpimpact.scene.model import Array
from warpimpact.solver.limit import LimitSpec
from warpimpact.statistics.comparisons import ROUNDED, shifted_numbers
from warpimpact.statistics.intervals import Estimate

Results = dict[str, xarray.DataTree]
"""Results of a target by one threat by what their files' names end with: "" is the map, the others are limits."""


class ConfirmedTarget(NamedTuple):
    """A target by its answers.

    Attributes:
        ends: goals with the ends of their intervals, shape [goals, 3].
        threats: which threat each goal is of, mostly; "" if of all threats, or of none.
        hits: places of the hits by the first threat and the numbers behind the first goal; None without any.
    """

    ends: Array
    threats: list[str]
    hits: xarray.Dataset | None


def objectives_and_excesses(design: Design, results: Array) -> tuple[Array, Array]:
    """Objectives to minimise, and by how much each bound is exceeded, of designs with these goals, shape [designs, …].

    An objective is infinite where no hit counts. An excess is a share of the limit, 0 where the bound is kept to
    rounding, and 1 where no hit counts.
    """
    signed, count = np.array([goal.sign for goal in design.goals]) * results, len(design.file.objectives)
    limits = np.array([bound.sign * bound.limit for bound in design.file.bounds])
    shares = np.nan_to_num((signed[:, count:] - limits) / np.where(limits, np.abs(limits), 1.0), nan=1.0)
    objectives = np.nan_to_num(signed[:, :count], nan=np.inf, posinf=np.inf, neginf=-np.inf)
    return objectives, np.where(shares > ROUNDED, shares, 0.0)


def nondominated(design: Design, results: Array) -> NDArray[np.int64]:
    """Numbers of the designs within the bounds that no other one dominates, sorted by the first objective.

    Of designs that agree in seven digits the first counts.
    """
    import moocore

    objectives, excesses = objectives_and_excesses(design, results)
    within = np.flatnonzero(np.isfinite(objectives).all(axis=1) & ~excesses.any(axis=1))
    if not len(within):
        return within
    rounded = np.array([[float(f"{number:.7g}") for number in row] for row in objectives[within]])
    front = within[moocore.is_nondominated(rounded)]
    return np.asarray(front[np.lexsort(objectives[front].T[::-1])])


def confirm_designs(
    design: Design, values: Array, law: Array, confirm: Callable[[int, int], ConfirmedTarget]
) -> tuple[dict[int, ConfirmedTarget], Array]:
    """Confirm designs of the front until it has no other ones, or as many as the search allows are confirmed.

    Each round takes half of those that are left at most, because their answers move the front.

    Args:
        values: of the variables of all computed designs, shape [designs, variables].
        law: their goals by the fast law, shape [designs, goals].
        confirm: gives a design by its place among the confirmed ones and its number.

    Returns:
        The confirmed designs by their numbers, and the goals of all designs as far as answers say.
    """
    known, goals = dict[int, ConfirmedTarget](), law
    while left := design.file.search.confirmed - len(known):
        new = [number for number in _wanted(design, values, goals, [*known]).tolist() if number not in known]
        if not new:
            break
        places = np.linspace(0, len(new) - 1, min(len(new), -(-left // 2)))
        for place in np.round(places).astype(int):
            known[new[place]] = confirm(len(known), new[place])
        goals = shifted_goals(design, values, law, {number: one.ends[:, 0] for number, one in known.items()})
    return known, goals


def _wanted(design: Design, values: Array, goals: Array, known: Sequence[int]) -> NDArray[np.int64]:
    """Numbers of the designs on the front. If none keeps the bounds, of one that comes nearest to them: of several, the
    one farthest from those that are known, and first the one with the worst objective, which may protect most."""
    front = nondominated(design, goals)
    if len(front):
        return front
    objectives, excesses = objectives_and_excesses(design, goals)
    over = excesses.sum(axis=1)
    nearest = np.setdiff1d(np.flatnonzero(over <= over.min() + ROUNDED), known)
    if not len(nearest):
        return nearest
    far = design.space.distances(values[nearest], values[[*known]]).min(axis=1) if known else objectives[nearest, 0]
    return nearest[[np.argmax(far)]]


def shifted_goals(design: Design, values: Array, law: Array, answers: Mapping[int, Array]) -> Array:
    """Goals of all designs, which differ from those of the fast law as the answer of the nearest confirmed design does.

    Args:
        values, law: as in `confirm_designs`.
        answers: goals of the confirmed designs, shape [goals], by their numbers.
    """
    numbers, known = np.array([*answers]), np.array([*answers.values()])
    nearest = np.argmin(design.space.distances(values, values[numbers]), axis=1)
    shifted = law.copy()
    for place, goal in enumerate(design.goals):
        if goal.spec.kind != "target":
            of_law, answer = law[numbers[nearest], place], known[nearest, place]
            shifted[:, place] = shifted_numbers(law[:, place], of_law, answer, goal.spec.shown_bounds)
    shifted[numbers] = known
    return shifted


def confirmed_target(
    design: Design, tables: Mapping[str, Any], name: str, words: str, store: Store, options: RunOptions
) -> ConfirmedTarget:
    """A target by its answers.

    Args:
        tables: tables of the target.
        name: of the files with its results, NAME.nc, …, in the folder of the store.
        words: title of the results.
        store: of the search, whose `path` is the folder of the results; None keeps them in memory.
        options: as in `optimise`.
    """
    threats, columns = range(len(design.file.threats)), design.columns
    results = [_results(design, tables, threat, name, words, store, options) for threat in threats] if columns else []
    weights = target_weights(design.campaign(tables).target)
    ends, counting = np.empty((len(design.goals), 3)), list[str]()
    for place, goal in enumerate(design.goals):
        estimate, threat = goal_estimate(design, goal, weights, results)
        ends[place] = estimate.value, estimate.low, estimate.high
        counting.append(threat)
    return ConfirmedTarget(ends, counting, _hits(results[0], columns[0], design) if columns else None)


def _hits(results: Results, column: Measure, design: Design) -> xarray.Dataset:
    """Places of hits, and their numbers."""
    result = results[_ending(column)].to_dataset()
    numbers = column.display.factor * column.values(result)
    return xarray.Dataset({"value": (v.HIT, numbers), **{name: result[name].variable for name in (v.HIT_Y, v.HIT_Z)}})


def answer_campaign(design: Design, tables: Mapping[str, Any], threat: int = 0, words: str = "") -> Campaign:
    """The campaign whose result confirms a target by a threat: fresh hits in the irreducible part of the cell."""
    plan, data = design.file.search, campaign_tables(design, tables, threat, words)
    sampling = {"sampling": "sobol", "count": plan.confirm_hits, "seed": design.fresh_seed}
    area = {key: value for key, value in data["hits"].items() if key == "area"}
    data["hits"] = area | sampling | {"irreducible": is_irreducible(tables)}
    data["output"] = data.get("output", {}) | {"solid_reference": False}
    data.get("continuum", {}).pop("hits", None)  # so that hits can be added to a result later
    campaign = campaign_from(tomli_w.dumps(data), design.name, design.folder)
    return campaign.with_continuum_hits(design.continuum_hits)


def _results(
    design: Design, tables: Mapping[str, Any], threat: int, name: str, words: str, store: Store, options: RunOptions
) -> Results:
    """The results behind the goals of a target by a threat."""
    campaign, results = answer_campaign(design, tables, threat, words), Results()
    for column in design.columns:
        if (ending := _ending(column)) not in results:
            own = _store_of(campaign, store, f"{name}{f'_{threat}' if threat else ''}{ending}.nc")
            limit = limit_of_measure(campaign, column) if column.is_limit else None
            results[ending] = _result(campaign, limit, own, options)
    return results


def _limit(measure: Measure) -> tuple[str, int]:
    """Quantity and layer of the limit behind a measure."""
    return "velocity" if measure.name == "limit_velocity" else "thickness", measure.layer or 0


def limit_of_measure(campaign: Campaign, measure: Measure) -> LimitSpec:
    """The limit behind a measure, with the tolerance of `warpimpact limit`."""
    return limit_spec(campaign, *_limit(measure))


def _ending(measure: Measure) -> str:
    """What the names of files end with that have the results of a measure."""
    return "_limit_{}_{}".format(*_limit(measure)) if measure.is_limit else ""


def _store_of(campaign: Campaign, store: Store, name: str) -> Store:
    """The store of a result in the folder of a store. That of another design, which an earlier confirmation left, is
    replaced."""
    if store.path is None:
        return store
    path, is_other = store.path / name, False
    if path.exists() and not store.overwrite:
        with files.opened(path) as result:
            is_other = result.attrs.get(attr.CAMPAIGN) != campaign.text
    return replace(store, path=path, overwrite=store.overwrite or is_other)


def _result(campaign: Campaign, limit: LimitSpec | None, store: Store, options: RunOptions) -> xarray.DataTree:
    """The answer of a campaign, or its limits, without references."""
    if store.path is None:
        return run(campaign, limit=limit, options=options)
    run_to_file(campaign, store, limit=limit, references=False, options=options)
    return files.read(Path(store.path))


def goal_estimate(
    design: Design, goal: Objective | Bound, weights: Mapping[str, float], results: Sequence[Results]
) -> tuple[Estimate, str]:
    """A goal with its interval, and which threat it is of, mostly; "" if of all threats, or of none.

    Over several threats the worst one counts, or their weighted mean, draw by draw. Limits have no draws: their
    intervals count as independent.

    Args:
        weights: masses per area of the target.
        results: by each threat.
    """
    measure, threats = goal.spec, design.file.threats
    if measure.kind == "target":
        weight = weights[measure.name]
        return Estimate(weight, weight, weight), ""
    known = [next(measure_data(by_threat[_ending(measure)], [measure])) for by_threat in results]
    estimates, draws = [one.estimate for one in known], [one.draws for one in known if one.draws is not None]
    shares = np.array([threat.weight for threat in threats]) / sum(threat.weight for threat in threats)
    values = np.array([one.value for one in estimates])
    worst = int(np.argmax(np.nan_to_num(goal.sign * values, nan=-np.inf)))
    if len(known) == 1:
        return estimates[0], "" if goal.threats == "mean" else threats[0].name
    if len(draws) == len(known):
        both = np.array(draws)  # [threats, own or of a sample, draws]
        if goal.threats == "mean":
            return estimate_of_draws(*np.tensordot(shares, both, 1)), ""
        return estimate_of_draws(*(goal.sign * np.fmax.reduce(goal.sign * both))), threats[worst].name
    if goal.threats == "worst":
        return estimates[worst], threats[worst].name
    ends = np.array([(one.low, one.high) for one in estimates])
    half = np.sqrt(np.sum((shares[:, None] * (ends - values[:, None])) ** 2, axis=0))
    mean = float(shares @ values)
    return Estimate(mean, mean - float(half[0]), mean + float(half[1])), ""


def bound_verdict(bound_sign: float, limit: float, low: float, high: float) -> str:
    """Whether a bound holds with certainty, by the interval of its measure."""
    over = bound_sign * (np.array([low, high]) - limit) / (abs(limit) or 1.0) > ROUNDED
    if np.isnan([low, high]).any() or over.any() != over.all():
        return "open"
    return "breaks its bound" if over.all() else "keeps its bound"
