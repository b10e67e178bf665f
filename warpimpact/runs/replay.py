"""Replay: one hit of a result, computed again with its history."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import xarray

from warpimpact.campaign.campaign import Campaign
from warpimpact.campaign.inputs import campaign_in
from warpimpact.continuum.finite_elements import FiniteElements
from warpimpact.continuum.replay import replay_continuum
from warpimpact.errors import ResultError
from warpimpact.measures.hits import hit_numbers, outcome_variables, shot_variables
from warpimpact.measures.references import Result, as_dataset, law_of
from warpimpact.records import attributes as attr
from warpimpact.records import variables as v
from warpimpact.results.dataset import shots_dataset, to_dataset, values_of
from warpimpact.results.history import history_dataset
from warpimpact.runs.compute import numerics_of, shots_of
from warpimpact.scene import Scene, Shots
from warpimpact.solver import replay as solver

DEVICE_ROUNDING = {v.RESIDUAL_VELOCITY: 0.1, v.DEFLECTION: 0.5, v.TILT: 0.5}
"""Largest change of an outcome by the rounding of another device [m/s, degree]. Between single and double precision,
6144 hits on the slotted plate (825, 300 and 200 m/s) differ by at most 0.012 m/s and 0.04 degrees."""
_OF_A_MAP = (attr.COUNT, attr.COMPUTE_TIME, attr.CONTINUUM, attr.HITS_PER_SECOND)


def replay(result: Result, hit: int, *, folder: str | Path = ".", snapshots: int = 6) -> xarray.Dataset:
    """Compute one hit of a result again, on the CPU, from the campaign that the result contains.

    Args:
        result: of `run`.
        hit: number of the hit in the whole result, also if `result` is a choice of its hits.
        folder: folder of the files that the campaign names, if it names any.
        snapshots: number of instants at which the history shows the resistance left in the plate; 0 costs least.

    Returns:
        The Dataset of `history_dataset`. Its attribute `agreement` compares its end with the stored
        outcome: "bit-identical", as on the same CPU; "within rounding", as after another device; or "different".

    Raises:
        ResultError: there is no such hit, or the campaign and its files now give another hit.
        CampaignError: the campaign in the result cannot be read, for example because a file that it names is missing.
    """
    result = as_dataset(law_of(result))
    numbers = hit_numbers(result)
    if hit not in numbers:
        choice = "hits" if np.ptp(numbers) + 1 == len(numbers) else f"{len(numbers)} of the hits"
        raise ResultError(f"hit: got {hit}, but the result has {choice} {numbers.min()} to {numbers.max()}")
    stored, campaign = result.isel(hit=int(np.flatnonzero(numbers == hit)[0])), campaign_in(result, Path(folder))
    scene, double = campaign.scene, campaign.numerics.precision == "double"
    shots = shots_in(result.isel(hit=numbers == hit), campaign)
    if attr.CONTINUUM in result.attrs:
        settings, double = json.loads(result.attrs[attr.CONTINUUM]), True
        method = FiniteElements.model_validate({name: value for name, value in settings.items() if name != "materials"})
        again = replay_continuum(scene, shots, method, snapshots)
    else:
        numerics = numerics_of(campaign, result, limited=attr.LIMIT in result.attrs)
        again = solver.replay(scene, shots, numerics=numerics, snapshots=snapshots)
    period, number = campaign.sampler().cell, np.array([hit])
    end = to_dataset(scene, shots, again.outcomes, period=period, attributes={}, numbers=number, double=double)
    end = end.isel(hit=0)
    attributes = {name: value for name, value in result.attrs.items() if name not in _OF_A_MAP} | {
        attr.HISTORY: f"{result.attrs[attr.HISTORY]}\n{attr.history_line('replay')}",
        attr.HIT: hit,
        attr.AGREEMENT: _agreement(end, stored),
        **attr.versions(),
        attr.DEVICE: "cpu",
    }
    return history_dataset(scene, end, again, attributes=attributes)


def _at_its_limit(scene: Scene, shots: Shots, result: xarray.Dataset) -> Shots:
    """The shots at their limits, of a result of limits with one hit; else as given."""
    if (quantity := result.attrs.get(attr.LIMIT)) is None:
        return shots
    stored = result.isel(hit=0)
    if quantity == "velocity":
        return replace(shots, velocity=np.full(1, float(stored[v.IMPACT_VELOCITY])))
    layer = int(stored.attrs[attr.LIMIT_LAYER])
    values = {name: values_of(scene.target, stored, name)[layer] for name in ("thickness", "resistance")}
    if values["resistance"] == scene.target.value("resistance", layer):  # the shot has the resistance of the scene
        del values["resistance"]
    return shots.assign({name: np.full(1, value) for name, value in values.items()}, layer)


def shots_in(result: xarray.Dataset, campaign: Campaign) -> Shots:
    """The shots of a result, ascending, as its campaign gives them.

    Raises:
        ResultError: they are not those that the result has.
    """
    numbers, given = hit_numbers(result), len(campaign.sampler())
    if numbers.max() >= given:
        last = f"the last one of the campaign and the files it names is {given - 1}"
        raise ResultError(f"hit: got {numbers.max()}, but {last}")
    shots = _at_its_limit(campaign.scene, shots_of(campaign, numbers), result)
    drawn = shots_dataset(campaign.scene, shots)
    for name in dict.fromkeys((*drawn, *shot_variables(result))):
        if name not in drawn or name not in result:
            raise ResultError(f"{name}: one of the result and its campaign has it for every hit, the other has not")
        stored, now = result[name].values, drawn[name].values
        differs = ~((stored == now) | (np.isnan(stored) & np.isnan(now))).reshape(len(numbers), -1).all(axis=1)
        if differs.any():
            place = int(differs.argmax())
            raise ResultError(
                f"hit {numbers[place]}: {name} is {stored[place]} in the result, but the campaign and the files it "
                f"names give {now[place]}"
            )
    return shots


def _same(dataset: xarray.Dataset, other: xarray.Dataset, names: tuple[str, ...]) -> bool:
    """Whether variables agree in every bit. NaN equals NaN."""
    return all(np.array_equal(dataset[name], other[name], equal_nan=True) for name in names)


def _agreement(end: xarray.Dataset, stored: xarray.Dataset) -> str:
    if stored[v.PERFORATED].dtype.kind == "f":  # a share of draws, of a map without its node of the law
        return "not known"
    names = tuple(name for name in outcome_variables(end) if name in stored)
    if _same(end, stored, names):
        return "bit-identical"
    close = all(
        np.allclose(end[name], stored[name], rtol=0.0, atol=tolerance, equal_nan=True)
        for name, tolerance in DEVICE_ROUNDING.items()
    )
    exact = tuple(name for name in names if end[name].dtype.kind != "f")
    agrees = close and _same(end, stored, exact) and _same(end.isnull(), stored.isnull(), names)
    return "within rounding" if agrees else "different"
