"""A campaign's map by the fast law, corrected by finite elements at some hits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import xarray
from numpy.typing import NDArray
from pydantic import ValidationError
from scipy.cluster.vq import kmeans2
from scipy.spatial.distance import cdist

from warpimpact.analysis.correction import is_corrected, with_correction
from warpimpact.campaign.campaign import Campaign
from warpimpact.campaign.tables import ContinuumTable
from warpimpact.campaign.text import as_campaign_error
from warpimpact.continuum.handover import layers_before_base
from warpimpact.errors import CampaignError, OutputError, ResultError, TooLong
from warpimpact.measures.hits import hit_numbers, shot_variables
from warpimpact.measures.references import ELEMENTS, SECOND_LAW, node_hits
from warpimpact.records import attributes as attr
from warpimpact.records import variables as v
from warpimpact.results import files
from warpimpact.results.dataset import joined
from warpimpact.runs.compute import manifest, numerics_of, shots_of
from warpimpact.runs.finite_elements import check_finite_elements, finite_element_hits
from warpimpact.runs.options import RunOptions
from warpimpact.runs.pipeline import open_pipeline
from warpimpact.runs.replay import check_inputs, shots_in
from warpimpact.runs.run import compute_map
from warpimpact.runs.store import Store
from warpimpact.scene.interaction import NEAR_EDGES, Interaction
from warpimpact.scene.model import complaint
from warpimpact.scene.shots import Shots
from warpimpact.scene.target import layer_name
from warpimpact.scene.units import duration_text

STRENGTH_RATIO = 2.8 / 2.6
"""Y of the law with free surfaces over that of the paper's law, at which both were compared with finite elements."""
USUAL_HITS = 16
"""Hits by finite elements that correct a map, where nothing says how many."""
_CONSIDERED = 2**12
"""Most hits of a map from which the elements' hits are chosen."""
_DIGITS = 6
"""Digits of their inputs, in standard deviations, that count for the choice."""


def run_corrected(
    campaign: Campaign,
    store: Store | str | Path = Store(),
    *,
    continuum_hits: int,
    options: RunOptions = RunOptions(),
) -> xarray.DataTree:
    """Compute the map of a campaign, and correct it by finite elements at some of its hits (`correct_result`).

    Args:
        store: the file, as in `run_to_file`; by default nothing is written.
        continuum_hits: number of hits by finite elements, spread over the map.
        options: where to compute.

    Returns:
        The corrected map.

    Raises:
        CampaignError: a layer has no material with constants of the continuum, or the continuum cannot compute it.
        OutputError, DeviceError, ClusterError, Interrupted: as in `run_to_file`.
    """
    campaign, store = campaign.computed_by(continuum_table(campaign)), Store.at(store)
    with options.opened() as options:
        with open_pipeline(store, manifest(campaign), options) as pipeline:
            if not pipeline.chunks.is_complete:
                numbers = np.linspace(0, len(campaign.sampler()) - 1, continuum_hits, dtype=np.int64)
                check_finite_elements(pipeline, campaign, np.unique(numbers))  # refused before anything is computed
                whole = compute_map(pipeline, campaign, references=campaign.output.solid_reference).result()
                fast = whole.to_dataset()
                second = compute_map(pipeline, second_law(campaign, fast), part=SECOND_LAW).map()
                with as_campaign_error(f"{campaign.title}: "):
                    elements = finite_element_hits(pipeline, campaign, spread_hits(fast, continuum_hits), retried=True)
                result = with_correction(whole, second, elements.sortby(v.HIT))
                if store.path is not None:
                    pipeline.write(result, store)
                return result
        assert store.path is not None
        correct_result(store, campaign, continuum_hits=continuum_hits, options=options)
        return files.read(store.path)


def correct_result(
    store: Store, campaign: Campaign, *, continuum_hits: int, options: RunOptions = RunOptions()
) -> None:
    """Correct the map of a result by finite elements at some of its hits. The file is replaced when all have ended.

    The same hits are computed by a second law, too. What the result has by the second law or by the same elements
    counts, and is not computed again. A hit that fails on draft elements is computed again on standard ones.

    Args:
        store: the result of a run. With `overwrite` hits are computed again that it has by finite elements.
        campaign: its campaign, with the finite elements to compute by.
        continuum_hits: number of hits by finite elements, spread over the map.
        options: where to compute.

    Raises:
        ResultError: the result is no whole map by the fast law, or has other shots than the campaign.
        CampaignError, OutputError, DeviceError, ClusterError, Interrupted: as in `run_corrected`.
    """
    path = store.path
    assert path is not None
    whole = files.read(path)
    fast = whole.to_dataset()
    if attr.CONTINUUM in fast.attrs or not np.array_equal(hit_numbers(fast), np.arange(fast.sizes[v.HIT])):
        raise ResultError(f"{path}: is no whole map of warpimpact run, but only such a map is corrected")
    check_inputs(fast, campaign)
    shots_in(fast, campaign)
    if store.overwrite:
        whole = whole.filter(lambda node: node.name != ELEMENTS)
    known = _known(whole, ELEMENTS, {attr.CONTINUUM: campaign.continuum.as_text})
    if known is None and ELEMENTS in whole.children:
        options.warn(f"{path}: has hits by other finite elements, which are replaced")
    is_enough = known is not None and known.sizes[v.HIT] >= continuum_hits and is_corrected(whole)
    content = manifest(campaign) | {"corrects": path.name}
    if is_enough:
        if store.folder.exists():  # chunks of a kill after the file was written go, those of another run stay
            with suppress(OutputError), open_pipeline(replace(store, resume=True), content, options, replaces=True):
                pass
        return
    with open_pipeline(store, content, options, replaces=True) as pipeline:
        if (second := _known(whole, SECOND_LAW)) is None:
            second = compute_map(pipeline, second_law(campaign, fast), part=SECOND_LAW).map()
        there = [] if known is None else hit_numbers(known).tolist()
        elements = [] if known is None else [known]
        if len(numbers := np.setdiff1d(spread_hits(fast, continuum_hits, there), there)):
            with as_campaign_error(f"{campaign.title}: "):
                elements.append(finite_element_hits(pipeline, campaign, numbers, retried=True))
        files.write(with_correction(whole, second, joined(elements).sortby(v.HIT)), path)


def _known(result: xarray.DataTree, name: str, attributes: Mapping[str, str] | None = None) -> xarray.Dataset | None:
    """The hits of a node, if this version of warpimpact made it with these attributes; else None."""
    hits = node_hits(result, name)
    wanted = {**attr.versions(), **(attributes or {})}
    if hits is None or any(hits.attrs.get(key) != value for key, value in wanted.items()):
        return None
    return hits


def continuum_table(campaign: Campaign) -> ContinuumTable:
    """The finite elements of a campaign: where its table does not say so, those of all layers but a solid base behind a
    gap, and of the materials of these layers."""
    settings = _with_layers(campaign)
    if not settings.materials:
        names = _materials(campaign, settings.layers)
        if None in names:
            place = layer_name(names.index(None))
            raise CampaignError(
                f"{place}.material: not given, but finite elements need one; or give continuum.materials, "
                "or --material to warpimpact continuum"
            )
        try:
            settings = ContinuumTable.model_validate(settings.model_dump() | {"materials": tuple(names)})
        except ValidationError as error:
            raise CampaignError(f"continuum.materials: {complaint(error.errors(include_url=False)[0])}") from None
    with as_campaign_error():
        settings.method.check(campaign.scene)
    return settings


def _with_layers(campaign: Campaign) -> ContinuumTable:
    """The finite elements of a campaign, with their number of layers where it is not that of all."""
    settings, target = campaign.continuum, campaign.target
    before = layers_before_base(campaign.scene.core, target)
    if settings.layers is None and before < len(target.layers):
        settings = settings.model_copy(update={"layers": before})
    return settings


def _materials(campaign: Campaign, layers: int | None) -> list[str | None]:
    """Names of the materials of the first layers; None is all layers."""
    return [layer.material for layer in campaign.target.layers[:layers]]


def correction_offer(campaign: Campaign, continuum_hits: int = USUAL_HITS) -> str:
    """A sentence on what a correction by so many hits takes, or needs."""
    try:
        method = continuum_table(campaign).method
    except ValueError:
        return f"{_remedy(campaign)} to correct this map by finite elements."
    shots = shots_of(campaign, np.linspace(0, len(campaign.sampler()) - 1, 8, dtype=np.int64))
    cost = method.estimate_cost(campaign.scene, shots)
    try:
        cost.check(threads=1)
    except (TooLong, MemoryError) as error:
        return f"No correction by finite elements: {error}."
    duration = duration_text(continuum_hits * cost.seconds)
    return f"--elements {continuum_hits} corrects the map, in about {duration} of one CPU core."


def _remedy(campaign: Campaign) -> str:
    """What to do to a campaign that finite elements refuse."""
    if campaign.continuum.materials:  # not as many as layers, or layers without room behind them
        return "Change the table [continuum]"
    names = _materials(campaign, _with_layers(campaign).layers)
    if None in names:
        return f"Name {layer_name(names.index(None))}.material"
    return "Give continuum.materials with constants of your own"


def second_law(campaign: Campaign, fast: xarray.Dataset) -> Campaign:
    """The campaign at the hits and the resolution of a result, under the law with free surfaces, without friction and
    weakening; under the plain law, if it has free surfaces already."""
    near = campaign.interaction.free_surface is None
    law = (NEAR_EDGES if near else Interaction()).model_copy(update={"onset": campaign.interaction.onset})
    ratio = STRENGTH_RATIO if near else 1.0 / STRENGTH_RATIO
    plate, *layer = (
        one.model_copy(update={"resistance": ratio * one.resistance, "shear_coefficient": 0.0, "degradation": 1.0})
        for one in campaign.target.layers
    )
    hits = campaign.hits
    if campaign.stop is not None:
        hits = hits.model_copy(update={"count": fast.sizes[v.HIT]})
    second = campaign.model_copy(
        update={
            "plate": plate,
            "layer": tuple(layer),
            "interaction": law,
            "hits": hits,
            "stop": None,
            "numerics": numerics_of(campaign, fast, limited=False),
            "output": campaign.output.model_copy(update={"solid_reference": False, "exit_state": False}),
        }
    )
    return second.with_shots(partial(_under_second_law, ratio))


def _under_second_law(ratio: float, shots: Shots) -> Shots:
    """Shots whose own resistances, frictions and weakening are those of the law, too."""
    resistance = None if shots.resistance is None else ratio * shots.resistance
    return replace(shots, resistance=resistance, shear_coefficient=None, degradation=None)


def spread_hits(result: xarray.Dataset, count: int, known: Sequence[int] = ()) -> NDArray[np.int64]:
    """Numbers of hits that are spread over the cell and over what scatters: those nearest the centres of clusters.

    They depend on the inputs of the shots alone, so plates under the same shots get the same ones, whatever their
    cells.

    Args:
        count: number of hits; fewer if the result has fewer.
        known: numbers of some of them, which stay.
    """
    some = result.isel(hit=slice(_CONSIDERED))
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
