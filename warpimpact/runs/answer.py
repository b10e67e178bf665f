"""From a map by the fast law and hits by finite elements to one answer: means of draws, and the draws themselves.

Some hits are in every draw. The others have fewer draws, from which their means come, so that a map of a million hits
takes neither much longer nor much more memory. References get answers of their own, by the same draws of materials.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
import xarray
from numpy.typing import NDArray
from scipy.cluster.vq import kmeans2
from scipy.spatial.distance import cdist

from warpimpact.campaign.campaign import Campaign
from warpimpact.campaign.elements import with_layers
from warpimpact.continuum.front import law_errors
from warpimpact.measures import draws as of_draws
from warpimpact.measures.hits import hit_numbers, shot_variables
from warpimpact.measures.references import DRAWS, ELEMENTS, LAW, NAMES, split_pictures
from warpimpact.records import variables as v
from warpimpact.results.dataset import joined
from warpimpact.runs.bending import StressRatio
from warpimpact.runs.compute import numerics_of, shots_of
from warpimpact.runs.draws import (
    MapModel,
    draw_others,
    element_features,
    exit_states,
    law_exits,
    march_draws,
    means_of,
    mesh_shifts,
    packed,
    seed_of,
    strength_factors,
    with_means,
)
from warpimpact.runs.finite_elements import finite_element_hits
from warpimpact.runs.pipeline import Computed, Pipeline
from warpimpact.scene.exit_state import FEATURES
from warpimpact.solver.accuracy import spread_places
from warpimpact.solver.fast_law import FastLaw

Numbers = NDArray[np.int64]

CONSIDERED = 2**12
"""Most hits of a map from which the elements' hits are chosen."""
_DIGITS = 6
"""Digits of their inputs, in standard deviations, that count for the choice."""


class _Sizes(NamedTuple):
    """How much is drawn.

    Attributes:
        hits: most hits that are in every draw.
        others: draws of all other hits together.
        fewest: of each of these.
        task: draws of hits in a task.
        per_core: whether each core computes a task; a march through a base has all of them.
    """

    hits: int
    others: int
    fewest: int
    task: int
    per_core: bool


_FREE = _Sizes(512, 2**16, 4, 2**15, per_core=True)
_TO_BASE, _TO_BASE_BY_LAW = (_Sizes(hits, 2**13, 1, 2**13, per_core=False) for hits in (256, 64))
"""A draw that goes on through a base takes as long as a hit of a map; one that flies on, next to nothing."""


def answered(pipeline: Pipeline, campaign: Campaign, law: Computed, elements: xarray.Dataset | None) -> Computed:
    """The answer from a map by the fast law and some of its hits by finite elements; its references get theirs, too.

    Args:
        law: its references are those of the fast law.
        elements: None without any; the error of the fast law is then that of the stored plates (law_error.json).
    """
    front = _front_layers(campaign, elements)
    answer = _answer(pipeline, campaign, law, elements, front, "map")
    references, nodes = dict(law.references), dict(answer.nodes)
    for name in (one for one in NAMES if one in references):
        own, of_elements = references[name], None
        its = campaign.references[name].computed_by(campaign.continuum)
        if elements is not None and name != "base_alone":
            places = spread_places(own.sizes[v.HIT], min(own.sizes[v.HIT], elements.sizes[v.HIT]))
            of_elements = finite_element_hits(pipeline, its, hit_numbers(own)[places].astype(np.int64), name=name)
        own_front = front if of_elements is not None else _front_layers(its, None)
        of_it = _answer(pipeline, its, Computed([own]), of_elements, own_front, name)
        references[name] = joined(of_it.chunks).drop_vars(v.PERFORATED)
        nodes |= {f"{name}/{DRAWS}": of_it.nodes[DRAWS]} if of_it.nodes else {}
    if elements is not None:
        references[ELEMENTS], pictures = split_pictures(elements)
        nodes |= pictures
    return Computed(answer.chunks, law.attributes, references, nodes)


def _front_layers(campaign: Campaign, elements: xarray.Dataset | None) -> int:
    """Number of layers behind which cores have drawn states: those of the elements; without any, those in front of a
    base where they have holes. Solid layers are as uncertain as their strength."""
    layers = with_layers(campaign).layers or len(campaign.target.layers)
    if elements is None and all(layer.open_area == 0.0 for layer in campaign.target.layers[:layers]):
        return 0
    return layers


def _answer(
    pipeline: Pipeline, campaign: Campaign, law: Computed, elements: xarray.Dataset | None, front: int, name: str
) -> Computed:
    """The map of an answer, and its nodes LAW and DRAWS.

    Args:
        front: number of layers behind which cores have drawn states.
        name: of the map, for its chunks.
    """
    numbers = np.concatenate([hit_numbers(chunk).astype(np.int64) for chunk in law.chunks])
    first = next(iter(law.chunks))
    method = numerics_of(campaign, first, limited=False)
    sizes = _FREE
    if front < len(campaign.target.layers):
        sizes = _TO_BASE_BY_LAW if elements is None else _TO_BASE
    drawn = numbers[_drawn_places(campaign, numbers, elements, sizes.hits)]
    exits, model = _model(pipeline, campaign, method, elements, front, drawn)
    if exits is None and np.ptp(model.strengths, axis=0).max() == 0.0:  # nothing is known of the error
        return law
    states = np.empty((of_draws.COUNT, len(drawn), FEATURES)) if exits is None else model.draw()
    tasks = list[tuple[Any, ...]]()
    for start in range(0, len(drawn), size := sizes.task // of_draws.COUNT):
        some = slice(start, start + size)
        own = None if exits is None else exits.isel(hit=some)
        tasks.append((drawn[some], method, model, own, states[:, some]))
    part = f"{name}_draws_{model.key}"
    draws = packed(joined(_computed(pipeline, march_draws, campaign, tasks, part, sizes.per_core), v.DRAWN_HIT))
    ratio = None if elements is None else StressRatio.of(law.first_hits(CONSIDERED), elements)
    each = sizes.others // max(1, len(numbers) - len(drawn))
    means, count = means_of(draws), int(np.clip(each, sizes.fewest, of_draws.COUNT))
    draws = draws.drop_vars(v.MEANS_ONLY, errors="ignore")

    def others_of(chunk: xarray.Dataset) -> list[Numbers]:
        """Places of the hits of each task."""
        others, size = np.flatnonzero(~np.isin(hit_numbers(chunk), drawn)), sizes.task // count
        return [others[start : start + size] for start in range(0, len(others), size)]

    def tasks_of(chunk: xarray.Dataset) -> Iterator[tuple[Any, ...]]:
        for few in others_of(chunk):
            known = None if exits is None else exit_states(chunk.isel(hit=few), front)
            yield hit_numbers(chunk)[few].astype(np.int64), method, model, known, count

    every = (task for chunk in law.chunks for task in tasks_of(chunk))
    part = f"{name}_others_{model.key}"
    for _ in _computed(pipeline, draw_others, campaign, every, part, sizes.per_core):
        pass
    drawn_names = (*v.DRAWN, *v.DRAWN_BEHIND, *v.MEANS_ONLY)
    names = (*drawn_names, *v.LAW_ONLY, *((v.BENDING_STRESS, v.BROKEN) if ratio else ()))
    replaced = [one for one in names if one in first and one != v.PERFORATED]
    nodes = {LAW: _Mapped(law.chunks, lambda chunk: xarray.Dataset({one: chunk[one].variable for one in replaced}))}

    def answer_of(chunk: xarray.Dataset) -> xarray.Dataset:
        own = means.isel(hit=np.isin(hit_numbers(means), hit_numbers(chunk)))
        others = (pipeline.chunks.load((part, int(hit_numbers(chunk)[few[0]]))) for few in others_of(chunk))
        parts = [own, *(one for one in others if one is not None)]
        answer = with_means(chunk, joined(parts).sortby(v.HIT)).drop_vars(v.LAW_ONLY, errors="ignore")
        return ratio.mean(answer) if ratio else answer

    if ratio:
        rows = [chunk.isel(hit=np.isin(hit_numbers(chunk), drawn)) for chunk in law.chunks]
        draws = packed(ratio.drawn(draws, joined(rows)))
    return Computed(_Mapped(law.chunks, answer_of), {}, {}, {**nodes, DRAWS: [draws]})


class _Mapped:
    """Chunks that a function makes of others, each time they are iterated."""

    def __init__(self, chunks: Iterable[xarray.Dataset], function: Callable[[xarray.Dataset], xarray.Dataset]) -> None:
        self._chunks, self._function = chunks, function

    def __iter__(self) -> Iterator[xarray.Dataset]:
        return map(self._function, self._chunks)


def _drawn_places(campaign: Campaign, numbers: Numbers, elements: xarray.Dataset | None, most: int) -> Numbers:
    """Places of the hits that are in every draw: the first ones, or some at even distances, and those by elements."""
    count = min(len(numbers), most)
    is_even = campaign.hits.sampling in ("sobol", "random")
    places = np.arange(count) if is_even else spread_places(len(numbers), count)
    if elements is None:
        return places
    return np.union1d(places, np.searchsorted(numbers, hit_numbers(elements)))


def _computed(
    pipeline: Pipeline,
    function: Callable[..., xarray.Dataset],
    campaign: Campaign,
    tasks: Iterable[tuple[Any, ...]],
    part: str,
    per_core: bool,
) -> Iterator[xarray.Dataset]:
    """Results of tasks about consecutive hits, in their order; those that are saved are not computed again."""
    keys = list[tuple[str, int]]()

    def missing() -> Iterator[tuple[tuple[str, int], tuple[Any, ...]]]:
        for task in tasks:
            keys.append((part, int(task[0][0])))
            if pipeline.chunks.load(keys[-1]) is None:
                yield keys[-1], (campaign, *task)

    for _ in pipeline.computer.map(function, missing(), save=pipeline.chunks.save, per_core=per_core):
        pass
    return (one for key in keys if (one := pipeline.chunks.load(key)) is not None)


def _model(
    pipeline: Pipeline,
    campaign: Campaign,
    method: FastLaw,
    elements: xarray.Dataset | None,
    front: int,
    numbers: Numbers,
) -> tuple[xarray.Dataset | None, MapModel]:
    """How cores leave the front layers by both laws, None without such layers, and what draws of a map come from.

    Args:
        numbers: of the hits that are in every draw.
    """
    strengths = strength_factors(campaign, 0 if elements is None else front)
    none, at, shifts = np.empty((0, FEATURES)), np.arange(0), np.zeros(of_draws.COUNT)
    if not front:
        error = law_errors(of_catalogue=False, as_fired=False)
        return None, MapModel(0, numbers, none, none, none, at, None, None, error, 0, strengths, shifts)
    exits = pipeline.computer.call(law_exits, campaign, numbers, method, front, None, elements is not None)
    known, broken, leading = none, None, None
    if elements is not None:
        known = element_features(campaign, elements, front)
        sound = ~np.isnan(known[:, 0])
        known, at = known[sound], np.searchsorted(numbers, hit_numbers(elements)[sound])
        shifts = mesh_shifts(campaign.continuum.fidelity)
        if v.FRAGMENT_MASS in elements:
            shots = shots_of(campaign, hit_numbers(elements).astype(np.int64))
            shares = elements[v.FRAGMENT_MASS].values / shots.value("mass", campaign.scene.core.mass_properties.mass)
            ends = (elements[name].values for name in (v.FRAGMENT_FRONT, v.FRAGMENT_REAR))
            broken, leading = elements[v.BROKEN].values[sound] > 0.0, np.column_stack([shares, *ends])[sound]
    laws = exits["law"].values, exits["second"].values
    holed = [layer for layer in campaign.target.layers[:front] if layer.open_area > 0.0]
    of_catalogue = bool(holed) and all(campaign.catalogue_resistance(layer) is not None for layer in holed)
    error, seed = law_errors(of_catalogue, as_fired=campaign.bodies.are_as_fired), seed_of(campaign)
    return exits, MapModel(front, numbers, *laws, known, at, broken, leading, error, seed, strengths, shifts)


def spread_hits(result: xarray.Dataset, count: int, known: Sequence[int] = ()) -> NDArray[np.int64]:
    """Numbers of hits that are spread over the cell and over what scatters: those nearest the centres of clusters.

    They depend on the inputs of the shots alone, so plates under the same shots get the same ones, whatever their
    cells.

    Args:
        count: number of hits; fewer if the result has fewer.
        known: numbers of some of them, which stay.
    """
    some = result.isel(hit=slice(CONSIDERED))
    named = [some[name].values.astype(float) for name in (v.HIT_Y, v.HIT_Z, *shot_variables(some))]
    points = np.column_stack([column for column in named if np.ptp(column) > 0.0] or named[:1])
    points = (points - points.mean(axis=0)) / np.maximum(points.std(axis=0), np.finfo(float).tiny)
    points, count = points.round(_DIGITS), min(count, len(points))  # the same in cells of any size
    centres, _ = kmeans2(points, count, minit="++", seed=1)
    chosen = np.flatnonzero(np.isin(hit_numbers(some), known)).tolist()
    while len(chosen) < count:
        lonely = np.argmax(np.min(cdist(centres, points[chosen]), axis=1, initial=np.inf))
        distance = np.sum((points - centres[lonely]) ** 2, axis=1)
        distance[chosen] = np.inf
        chosen.append(int(np.argmin(distance)))
    return np.sort(hit_numbers(some)[chosen])
