"""Hits by finite elements for a result that is there: its answer from then on counts them."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace

import numpy as np
import xarray

from warpimpact.campaign.campaign import Campaign
from warpimpact.campaign.inputs import check_inputs
from warpimpact.campaign.text import as_campaign_error
from warpimpact.errors import OutputError, ResultError
from warpimpact.measures.hits import hit_numbers
from warpimpact.measures.references import DRAWS, ELEMENTS, FINER, NAMES, law_of, node_hits, pictures_of
from warpimpact.records import attributes as attr
from warpimpact.records import variables as v
from warpimpact.results import files
from warpimpact.results.dataset import joined
from warpimpact.runs.answer import answered, spread_hits
from warpimpact.runs.compute import manifest
from warpimpact.runs.finite_elements import finite_element_hits
from warpimpact.runs.options import RunOptions
from warpimpact.runs.pipeline import Computed, open_pipeline
from warpimpact.runs.replay import shots_in
from warpimpact.runs.store import Store


def add_elements(store: Store, campaign: Campaign, *, continuum_hits: int, options: RunOptions = RunOptions()) -> None:
    """Give the map of a result hits by finite elements. The file is replaced when all have ended.

    The hits that the result has by the same elements count, and are not computed again. A hit that fails on draft
    elements is computed again on standard ones.

    Args:
        store: the result of a run. With `overwrite` hits are computed again that it has by finite elements.
        campaign: its campaign, with the finite elements to compute by.
        continuum_hits: number of hits by finite elements, spread over the map.
        options: where to compute.

    Raises:
        ResultError: the result is no whole map of a run, or has other shots than the campaign.
        CampaignError, OutputError, DeviceError, ClusterError, Interrupted: as in `run_to_file`.
    """
    path = store.path
    assert path is not None
    whole = files.read(path)
    fast = law_of(whole).to_dataset()
    if attr.CONTINUUM in fast.attrs or not np.array_equal(hit_numbers(fast), np.arange(fast.sizes[v.HIT])):
        raise ResultError(f"{path}: is no whole map of warpimpact run, which alone takes hits by finite elements")
    check_inputs(fast, campaign)
    shots_in(fast, campaign)
    if store.overwrite:
        whole = whole.filter(lambda node: node.name != ELEMENTS)
    known = _known(whole, ELEMENTS, {attr.CONTINUUM: campaign.continuum.as_text})
    if known is None and ELEMENTS in whole.children:
        options.warn(f"{path}: has hits by other finite elements, which are replaced")
    is_enough = known is not None and known.sizes[v.HIT] >= continuum_hits and DRAWS in whole.children
    content = manifest(campaign) | {"corrects": path.name}
    if is_enough:
        if store.folder.exists():  # chunks of a kill after the file was written go, those of another run stay
            with suppress(OutputError), open_pipeline(replace(store, resume=True), content, options, replaces=True):
                pass
        return
    with open_pipeline(store, content, options, replaces=True) as pipeline, as_campaign_error(f"{campaign.title}: "):
        there = [] if known is None else hit_numbers(known).tolist()
        elements = [] if known is None else [known]
        if len(numbers := np.setdiff1d(spread_hits(fast, continuum_hits, there), there)):
            elements.append(finite_element_hits(pipeline, campaign, numbers, retried=True))
        law = Computed([fast], {}, {name: of for name in (*NAMES, FINER) if (of := node_hits(whole, name)) is not None})
        pipeline.write(answered(pipeline, campaign, law, joined(elements).sortby(v.HIT)), store)


def _known(result: xarray.DataTree, name: str, attributes: Mapping[str, str] | None = None) -> xarray.Dataset | None:
    """The hits of a node, if this version of warpimpact made it with these attributes; else None."""
    hits, pictures = node_hits(result, name), pictures_of(result)
    wanted = {**attr.versions(), **(attributes or {})}
    if hits is None or pictures is None or any(hits.attrs.get(key) != value for key, value in wanted.items()):
        return None
    return hits.merge(pictures, join="exact", combine_attrs="override")
