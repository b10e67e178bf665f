"""Hits of a campaign by finite elements: one by one on a CPU, many together on a GPU."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence

import numpy as np
import xarray
from numpy.typing import NDArray

from warpimpact.campaign.campaign import Campaign
from warpimpact.continuum.many_hits import MOST
from warpimpact.measures.hits import failed
from warpimpact.measures.references import ELEMENTS, split_pictures
from warpimpact.records import attributes as attr
from warpimpact.records import variables as v
from warpimpact.results.dataset import joined
from warpimpact.runs.compute import compute_hits, manifest, shots_of, with_campaign
from warpimpact.runs.options import RunOptions, RunProgress
from warpimpact.runs.pipeline import Computed, Pipeline, open_pipeline
from warpimpact.runs.store import Key, Store

Numbers = NDArray[np.int64]


def finite_elements_to_file(
    campaign: Campaign, store: Store, *, numbers: Sequence[int] | None = None, options: RunOptions = RunOptions()
) -> None:
    """Compute hits of a campaign by finite elements, as its table [continuum] says, into a result file.

    Args:
        numbers: of the hits in the campaign; None is all of them.
        store, options: as in `run_to_file`.

    Raises:
        ValueError: the continuum does not compute this campaign.
        OutputError, DeviceError, ClusterError, Interrupted: as in `run_to_file`.
    """
    every = np.array(range(len(campaign.sampler())) if numbers is None else numbers)
    solid = campaign.references.get("solid") if campaign.output.solid_reference else None
    content = manifest(campaign) | {"continuum": campaign.continuum.as_text, "numbers": every.tolist()}
    campaign.continuum.method.check(campaign.scene)
    with open_pipeline(store, content, options) as pipeline:
        if pipeline.chunks.is_complete:
            return
        result = finite_element_hits(pipeline, campaign, every)
        references = {} if solid is None else {"solid": finite_element_hits(pipeline, solid, every[:1], name="solid")}
        hits, nodes = split_pictures(result)
        pipeline.write(Computed([hits], references=references, nodes=nodes), store)


def finite_element_hits(
    pipeline: Pipeline, campaign: Campaign, numbers: Numbers, *, name: str = ELEMENTS, retried: bool = False
) -> xarray.Dataset:
    """Hits of a campaign by its finite elements, as a result. A hit is saved when it has ended.

    Args:
        numbers: of the hits, ascending.
        name: of the part with the hits, which also has the elements that compute them.
        retried: whether hits that fail on draft elements are computed again on standard ones.
    """
    elements, chunks, total = campaign.continuum, pipeline.chunks, len(numbers)
    part = f"{name}_{hashlib.sha256(elements.as_text.encode()).hexdigest()[:8]}"
    if (words := check_finite_elements(pipeline, campaign, numbers)) and name == ELEMENTS:
        pipeline.options.warn(words)
    left = np.setdiff1d(numbers, [*chunks.numbers(part)])
    together = 1 if pipeline.computer.made_by[attr.DEVICE] == "cpu" else MOST
    some = (left[first : first + together] for first in range(0, len(left), together))
    tasks = (((part, int(of[0])), (campaign, of, elements.method)) for of in some)
    resumed = done = total - len(left)

    def save(key: Key, result: xarray.Dataset) -> None:
        nonlocal done
        share = {attr.COMPUTE_TIME: result.attrs[attr.COMPUTE_TIME] / result.sizes[v.HIT]}
        for hit in result[v.HIT].values:
            chunks.save((key[0], int(hit)), result.sel({v.HIT: [hit]}).assign_attrs(share))
        done += result.sizes[v.HIT]

    def report(underway: Sequence[int] = ()) -> None:
        pipeline.options.progress(RunProgress(min(done + sum(underway), total), total, done, resumed))

    report()
    for _ in pipeline.computer.map(compute_hits, tasks, report, save=save, per_core=True):
        report()
    result = _result([hit for one in numbers if (hit := chunks.load((part, int(one)))) is not None], campaign)
    bad = failed(result)
    if not retried or not bad.any() or elements.fidelity != "draft" or elements.spacing is not None:
        return result
    finer = campaign.computed_by(elements.model_copy(update={"fidelity": "standard"}))
    return joined([result.isel(hit=~bad), finite_element_hits(pipeline, finer, numbers[bad])])


def check_finite_elements(pipeline: Pipeline, campaign: Campaign, numbers: Numbers) -> str:
    """What one of some hits takes on a CPU, in words; empty if that is little, or on a GPU.

    Raises:
        TooLong, MemoryError: as in `MeshCost.check`.
    """
    if pipeline.computer.made_by[attr.DEVICE] != "cpu":
        return ""
    some = shots_of(campaign, numbers[:: max(1, len(numbers) // 16)])
    cost = campaign.continuum.method.estimate_cost(campaign.scene, some)
    return cost.check(min(pipeline.computer.threads, len(numbers)))


def _result(hits: Sequence[xarray.Dataset], campaign: Campaign) -> xarray.Dataset:
    """Computed hits as a result, with what is known of the elements."""
    elements, seconds = campaign.continuum, float(sum(hit.attrs[attr.COMPUTE_TIME] for hit in hits))
    attributes = {
        attr.CONTINUUM: elements.as_text,
        attr.NUMERICS: elements.words(len(campaign.target.layers)),
        attr.PRECISION: "single",
        attr.CATALOGUE_NAMES: "\n".join(f"{entry.name}: {entry.evidence}" for entry in elements.entries),
        attr.COMPUTE_TIME: seconds,
        attr.HITS_PER_SECOND: len(hits) / seconds,
    }
    if touching := campaign.target.touching_layers(elements.layers):
        attributes[attr.TOUCHING_LAYERS] = touching
    return with_campaign(joined(hits), campaign, attributes)
