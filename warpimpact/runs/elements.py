"""Hits of a campaign by finite elements: one by one on a CPU, many together on a GPU."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence

import numpy as np
import xarray
from numpy.typing import NDArray

from warpimpact.campaign.campaign import Campaign
from warpimpact.continuum.many_hits import MOST
from warpimpact.measures.hits import failed
from warpimpact.records import attributes as attr
from warpimpact.records import variables as v
from warpimpact.results.dataset import joined
from warpimpact.runs.compute import compute_hits, manifest, shots_of, with_campaign
from warpimpact.runs.options import RunOptions, RunProgress
from warpimpact.runs.pipeline import Answer, Pipeline, open_pipeline
from warpimpact.runs.store import Key, Store
from warpimpact.solver.method import Method

Numbers = NDArray[np.int64]


def elements_to_file(
    campaign: Campaign, store: Store, *, hits: Sequence[int] | None = None, options: RunOptions = RunOptions()
) -> None:
    """Compute hits of a campaign by finite elements, as its table [continuum] says, into a result file.

    Args:
        hits: by their numbers in the campaign; None is all of them.
        store, options: as in `run_to_file`.

    Raises:
        ValueError: the continuum does not compute this campaign.
        OutputError, DeviceError, ClusterError, Interrupted: as in `run_to_file`.
    """
    numbers = np.array(range(len(campaign.sampler())) if hits is None else hits)
    solid = campaign.references.get("solid") if campaign.output.solid_reference else None
    content = manifest(campaign) | {"continuum": campaign.continuum.as_text, "numbers": numbers.tolist()}
    campaign.continuum.method.check(campaign.scene)
    with open_pipeline(store, content, options) as pipeline:
        if pipeline.chunks.is_complete:
            return
        wanted = {"elements": (campaign, numbers)} | ({} if solid is None else {"solid": (solid, numbers[:1])})
        computed = hits_by_elements(pipeline, wanted)
        pipeline.write(Answer([computed.pop("elements")], references=computed), store)


def hits_by_elements(
    pipeline: Pipeline, wanted: Mapping[str, tuple[Campaign, Numbers]], *, retried: bool = False
) -> dict[str, xarray.Dataset]:
    """Hits of some campaigns by the finite elements of each. A hit is saved when it has ended.

    Args:
        wanted: campaigns with the numbers of their hits, ascending, by name.
        retried: whether hits that fail on draft elements are computed again on standard ones.

    Returns:
        A result of each that has hits, by its name.
    """
    wanted = {name: of for name, of in wanted.items() if len(of[1])}
    if not wanted:
        return {}
    chunks, together = pipeline.chunks, 1 if pipeline.computer.made_by[attr.DEVICE] == "cpu" else MOST
    parts = {name: f"{name}_{_digest(campaign)}" for name, (campaign, _) in wanted.items()}
    if words := check_elements(pipeline, *next(iter(wanted.values()))):
        pipeline.options.warn(words)
    tasks, total, done = dict[Key, tuple[Campaign, Numbers, Method]](), 0, 0
    for name, (campaign, numbers) in wanted.items():
        left = np.setdiff1d(numbers, [*chunks.numbers(parts[name])])
        total, done = total + len(numbers), done + len(numbers) - len(left)
        for first in range(0, len(left), together):
            tasks[parts[name], int(left[first])] = campaign, left[first : first + together], campaign.continuum.method
    resumed = done

    def save(key: Key, result: xarray.Dataset) -> None:
        nonlocal done
        share = {attr.COMPUTE_TIME: result.attrs[attr.COMPUTE_TIME] / result.sizes[v.HIT]}
        for hit in result[v.HIT].values:
            chunks.save((key[0], int(hit)), result.sel({v.HIT: [hit]}).assign_attrs(share))
        done += result.sizes[v.HIT]

    def report(underway: Sequence[int] = ()) -> None:
        pipeline.options.progress(RunProgress(min(done + sum(underway), total), total, done, resumed))

    report()
    for _ in pipeline.computer.map(compute_hits, tasks.items(), report, save=save, per_core=True):
        report()
    results = {name: _result(pipeline, parts[name], *of) for name, of in wanted.items()}
    again = _failed_drafts(results, wanted) if retried else {}
    for name, result in hits_by_elements(pipeline, again).items():
        results[name] = joined([results[name].isel(hit=~failed(results[name])), result])
    return results


def _failed_drafts(
    results: Mapping[str, xarray.Dataset], wanted: Mapping[str, tuple[Campaign, Numbers]]
) -> dict[str, tuple[Campaign, Numbers]]:
    """What is wanted again: hits that failed on draft elements, on standard ones."""
    again = {}
    for name, (campaign, numbers) in wanted.items():
        elements = campaign.continuum
        if elements.fidelity == "draft" and elements.spacing is None:
            finer = campaign.computed_by(elements.model_copy(update={"fidelity": "standard"}))
            again[name] = finer, numbers[failed(results[name])]
    return again


def _digest(campaign: Campaign) -> str:
    """What a part is called after, because its bits depend on it: the elements that compute it."""
    return hashlib.sha256(campaign.continuum.as_text.encode()).hexdigest()[:8]


def check_elements(pipeline: Pipeline, campaign: Campaign, numbers: Numbers) -> str:
    """What one of some hits takes on a CPU, in words; empty if that is little, or on a GPU.

    Raises:
        TooLong, MemoryError: as in `MeshCost.check`.
    """
    if pipeline.computer.made_by[attr.DEVICE] != "cpu":
        return ""
    some = shots_of(campaign, numbers[:: max(1, len(numbers) // 16)])
    cost = campaign.continuum.method.estimate_cost(campaign.scene, some)
    return cost.check(min(pipeline.computer.threads, len(numbers)))


def _result(pipeline: Pipeline, part: str, campaign: Campaign, numbers: Numbers) -> xarray.Dataset:
    """Computed hits as a result, with what is known of the elements."""
    hits = [hit for number in numbers if (hit := pipeline.chunks.load((part, int(number)))) is not None]
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
