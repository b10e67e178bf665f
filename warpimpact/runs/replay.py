"""Replay: one hit of a result, computed again with its history."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray

from warpimpact.campaign.campaign import Campaign
from warpimpact.continuum.replay import replay_continuum
from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.results.dataset import history_dataset, hit_numbers, stored_columns, to_dataset
from warpimpact.results.files import ResultError
from warpimpact.results.layers import values_of
from warpimpact.scene import Numerics, Scene, Shots
from warpimpact.scene.flow import Continuum
from warpimpact.solver import replay as solver
from warpimpact.solver.limit import short_steps

DEVICE_ROUNDING = {v.RESIDUAL_VELOCITY: 0.1, v.DEFLECTION: 0.5, v.TILT: 0.5}
"""Largest change of an outcome by the rounding of another device [m/s, degree]. Between single and double precision,
6144 hits on the slotted plate (825, 300 and 200 m/s) differ by at most 0.012 m/s and 0.04 degrees."""
_OF_A_MAP = (
    *(attr.COUNT, attr.COMPUTE_TIME, attr.CONTINUUM, attr.HITS_PER_SECOND),
    *v.OUTLINE_VARIABLES,
)


def replay(result: xarray.Dataset, hit: int, *, folder: str | Path = ".", snapshots: int = 6) -> xarray.Dataset:
    """Compute one hit of a result again, on the CPU, from the campaign that the result contains.

    Args:
        result: the Dataset of `run`.
        hit: number of the hit in the whole result, also if `result` is a choice of its hits.
        folder: folder of the files that the campaign names, if it names any.
        snapshots: number of instants at which the history shows the resistance left in the plate; 0 costs least.

    Returns:
        The Dataset of `results.history_dataset`. Its attribute `agreement` compares its end with the stored
        outcome: "bit-identical", as on the same CPU; "within rounding", as after another device; or "different".

    Raises:
        ResultError: there is no such hit, or the campaign and its files now give another hit.
        CampaignError: the campaign in the result cannot be read, for example because a file that it names is missing.
    """
    hits, numbers = result.sizes["hit"], hit_numbers(result)
    places = np.flatnonzero(numbers == hit)
    if not len(places):
        choice = "hits" if numbers.max() - numbers.min() + 1 == hits else f"{hits} of the hits"
        raise ResultError(f"hit: got {hit}, but the result has {choice} {numbers.min()} to {numbers.max()}")
    place = int(places[0])
    campaign = campaign_in(result, Path(folder))
    sampler = campaign.sampler()
    if hit >= len(sampler):
        raise ResultError(f"hit: got {hit}, but the campaign and the files it names give only {len(sampler)} hits")
    scene = campaign.scene
    computed = _at_their_limit(scene, sampler.shots(hit, 1), result, place)
    if attr.CONTINUUM in result.attrs:
        settings = json.loads(result.attrs[attr.CONTINUUM])
        continuum = Continuum.model_validate({name: value for name, value in settings.items() if name != "materials"})
        again = replay_continuum(scene, computed, continuum, snapshots)
    else:
        again = solver.replay(scene, computed, numerics=_numerics(campaign, result), snapshots=snapshots)
    period = campaign.hits.covered(campaign.plate)
    double = campaign.numerics.precision == "double" or attr.CONTINUUM in result.attrs
    number = np.array([hit])
    ended = to_dataset(
        scene, computed[-1:], again.outcomes, period=period, attributes={}, numbers=number, double=double
    )
    end = ended.isel(hit=0)
    stored = result.isel(hit=place)
    if not _same(end, stored, (v.HIT_Y, v.HIT_Z, *v.shot_variables(end))):
        raise ResultError(
            f"hit: got {hit}, but the campaign and the files it names now give another shot than the stored one"
        )
    attributes = {name: value for name, value in result.attrs.items() if name not in _OF_A_MAP} | {
        attr.HISTORY: f"{result.attrs[attr.HISTORY]}\n{attr.history_line('replay')}",
        attr.HIT: hit,
        attr.AGREEMENT: _agreement(end, stored),
        **attr.versions(),
        attr.DEVICE: "cpu",
    }
    history = history_dataset(scene, end, again, attributes=attributes)
    return history if again.deformed is None else _with_mesh(history, again.deformed)


def _with_mesh(history: xarray.Dataset, deformed: solver.Deformed) -> xarray.Dataset:
    """The history with the finite elements of the layers as they deform, in the plate frame."""
    home = np.array([0.0, float(history[v.HIT_Y]), float(history[v.HIT_Z])], dtype=np.float32)
    columns: dict[str, Any] = {
        v.ELEMENT_CORNER: deformed.corners,
        v.NODE_POSITION: deformed.position + home,
        v.ELEMENT_LEFT: deformed.left,
        v.ELEMENT_STRAIN: deformed.strain,
    }
    return history.assign(stored_columns(v.MESH_VARIABLES, columns))


def _at_their_limit(scene: Scene, shots: Shots, result: xarray.Dataset, place: int) -> Shots:
    """Shots at their limit, for a result of limits; else as given."""
    if attr.LIMIT not in result.attrs:
        return shots
    layer = int(result.attrs[attr.LIMIT_LAYER])
    if result.attrs[attr.LIMIT] == "velocity":
        return replace(shots, velocity=np.full(len(shots), float(result[v.IMPACT_VELOCITY][place])))
    hit = result.isel(hit=place)
    values = {name: values_of(scene.target, hit, name)[layer] for name in ("thickness", "resistance")}
    given = scene.target.value("resistance", layer)
    if values["resistance"] == given:  # the shot has the resistance of the scene
        del values["resistance"]
    return shots.assign({name: np.full(len(shots), value) for name, value in values.items()}, layer)


def _numerics(campaign: Campaign, result: xarray.Dataset) -> Numerics:
    """The numerics of the hits of a result."""
    has_pilot = attr.RESOLUTION in result.attrs
    numerics = Numerics.model_validate_json(result.attrs[attr.RESOLUTION]) if has_pilot else campaign.numerics
    return short_steps(numerics) if attr.LIMIT in result.attrs else numerics


def campaign_in(result: xarray.Dataset, folder: Path) -> Campaign:
    """The campaign in a result; the files that it names are in a folder.

    Raises:
        ResultError: the result has no campaign.
        CampaignError: the campaign cannot be read.
    """
    if attr.CAMPAIGN not in result.attrs:
        raise ResultError("the result does not contain its campaign")
    count = int(result.attrs[attr.COUNT]) if attr.COUNT in result.attrs else None  # a list of hits has none
    name = "the campaign in the result"
    is_sought = result.attrs.get(attr.LIMIT) == "velocity"
    return Campaign.from_text(
        result.attrs[attr.CAMPAIGN], name=name, folder=folder, count=count, needs_velocity=not is_sought
    )


def _same(dataset: xarray.Dataset, other: xarray.Dataset, names: tuple[str, ...]) -> bool:
    """Whether variables agree in every bit. NaN equals NaN."""
    return all(np.array_equal(dataset[name], other[name], equal_nan=True) for name in names)


def _agreement(end: xarray.Dataset, stored: xarray.Dataset) -> str:
    names = tuple(name for name in v.outcome_variables(end) if name in stored)
    if _same(end, stored, names):
        return "bit-identical"
    close = all(
        np.allclose(end[name], stored[name], rtol=0.0, atol=tolerance, equal_nan=True)
        for name, tolerance in DEVICE_ROUNDING.items()
    )
    return "within rounding" if close and all(_alike(end[name], stored[name]) for name in names) else "different"


def _alike(values: xarray.DataArray, other: xarray.DataArray) -> bool:
    """Whether codes are equal, and numbers stand in the same places."""
    if values.dtype.kind == "f":
        values, other = values.isnull(), other.isnull()
    return bool((values == other).all())
