"""From a campaign to its answer, in memory or as a file: a map by the fast law, hits by finite elements, and draws.

A run into a file survives interrupts and can be resumed.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import xarray

from warpimpact.campaign.campaign import Campaign
from warpimpact.campaign.elements import continuum_table
from warpimpact.campaign.tables import Stop
from warpimpact.campaign.text import as_campaign_error
from warpimpact.measures.hits import failed
from warpimpact.measures.measure import Measure, estimate_from, shift_of
from warpimpact.measures.references import FINER, finer_pair, with_references
from warpimpact.records import attributes as attr
from warpimpact.records import variables as v
from warpimpact.runs.answer import CONSIDERED, answered, spread_hits
from warpimpact.runs.compute import (
    block_size,
    chunk_size,
    compute_hits,
    described,
    find_resolution,
    limit_of_reference,
    manifest,
    numerics_of,
    reference_shots,
)
from warpimpact.runs.correct import add_elements
from warpimpact.runs.finite_elements import check_finite_elements, finite_element_hits
from warpimpact.runs.options import RunOptions, RunProgress
from warpimpact.runs.pipeline import Computed, Pipeline, open_pipeline
from warpimpact.runs.store import PILOT, Chunks, Key, Store
from warpimpact.solver.limit import LimitSpec
from warpimpact.statistics.intervals import Array, Estimate, SamplingDesign, looks

REFERENCE_HITS, REFERENCE_LIMITS = 2**12, 256
"""Most hits, and most limits, of a reference."""
NUMERICS_SHARE = 0.5
"""Share of a half width that the numerics may take before more hits are of no use."""


def run(
    campaign: Campaign | str | Path,
    *,
    limit: LimitSpec | None = None,
    references: bool = False,
    options: RunOptions = RunOptions(),
) -> xarray.DataTree:
    """Compute the answer of a campaign, in memory: one entry per hit (results/dataset.py).

    Its root has the means of all draws; by the names of its nodes it has what the fast law alone says, the hits by
    elements, the draws, and references with draws of their own. `run(campaign.solid())` computes its solid reference.

    Args:
        campaign: the campaign, or its file.
        limit: the limit that is searched for every hit; without it, the end of every hit is computed.
        references: compute some hits of its references, too, with which `inspect` and `compare` then compare it.
        options: where to compute.

    Raises:
        CampaignError: the file is no campaign, or has a value that is not allowed.
        DeviceError, ClusterError: as in `RunOptions.computer`.
        Cancelled: by `options.cancel`.
    """
    campaign = _with_table(campaign if isinstance(campaign, Campaign) else Campaign.from_toml(campaign))
    with open_pipeline(Store(), {}, options) as pipeline:
        return _computed(pipeline, campaign, limit, references).result()


def run_to_file(
    campaign: Campaign | str | Path,
    store: Store | str | Path,
    *,
    limit: LimitSpec | None = None,
    references: bool | None = None,
    options: RunOptions = RunOptions(),
) -> None:
    """Compute the answer of a campaign into a file. Computed hits are soon on the disk, in FILE.parts.

    A result that is resumed, but has fewer hits by finite elements than the campaign wants, gets the others.

    Args:
        campaign, limit, options: as in `run`.
        store: the file, which appears when it is complete; or a `Store`, which continues or replaces an earlier one.
        references: as in `run`; by default as the campaign has it.

    Raises:
        OutputError, Interrupted: as in `Store.open`.
        CampaignError, DeviceError, ClusterError, Cancelled: as in `run`.
    """
    campaign = _with_table(campaign if isinstance(campaign, Campaign) else Campaign.from_toml(campaign))
    store = Store.at(store)
    wanted = campaign.output.solid_reference if references is None else references
    with options.opened() as options:
        with open_pipeline(store, manifest(campaign, limit), options) as pipeline:
            if not pipeline.chunks.is_complete:
                pipeline.write(_computed(pipeline, campaign, limit, wanted), store)
                return
        if campaign.continuum.hits and limit is None:
            add_elements(store, campaign, continuum_hits=campaign.continuum.hits, options=options)


def _with_table(campaign: Campaign) -> Campaign:
    """The campaign with its finite elements completed, if it wants hits by them."""
    return campaign.computed_by(continuum_table(campaign)) if campaign.continuum.hits else campaign


def _computed(pipeline: Pipeline, campaign: Campaign, limit: LimitSpec | None, references: bool) -> Computed:
    """The answer of a campaign, or its limits by the fast law."""
    count = campaign.continuum.hits if limit is None else None
    if count:
        numbers = np.linspace(0, len(campaign.sampler()) - 1, count, dtype=np.int64)
        check_finite_elements(pipeline, campaign, np.unique(numbers))  # refused before anything is computed
    law = compute_map(pipeline, campaign, limit, references=references)
    if limit is not None:
        return law
    with as_campaign_error(f"{campaign.title}: "):
        elements = None
        if count:
            chosen = spread_hits(law.first_hits(CONSIDERED), count)
            elements = finite_element_hits(pipeline, campaign, chosen, retried=True).sortby(v.HIT)
        return answered(pipeline, campaign, law, elements)


def compute_map(
    pipeline: Pipeline,
    campaign: Campaign,
    limit: LimitSpec | None = None,
    *,
    references: bool = False,
    part: str = "map",
) -> Computed:
    """The hits of a campaign by the fast law, or their limits. Each chunk is saved as it comes.

    Args:
        references: whether some hits of its references are computed, too.
        part: of the chunks.
    """
    chunks, sampler = pipeline.chunks, campaign.sampler()
    pilot = _pilot(pipeline, campaign, limit)
    numerics = numerics_of(campaign, pilot, limited=limit is not None)
    size = chunk_size(campaign, numerics, pipeline.computer.made_by[attr.DEVICE], limited=limit is not None)
    watch = RunMonitor(campaign, chunks, size, pilot, part)

    def tasks() -> Iterator[tuple[Key, tuple[Any, ...]]]:
        for number in range(watch.count):
            if number not in watch.seconds and not watch.stop:
                hits = np.arange(number * size, min((number + 1) * size, len(sampler)))
                yield (part, number), (campaign, hits, numerics, limit)

    def save(key: Key, chunk: xarray.Dataset) -> None:
        if key[1] == 0:
            chunk = described(chunk, campaign, pilot, limit)
        elif campaign.stop is None:  # what has no hits is in the first
            chunk = chunk.drop_vars([name for name, of in chunk.variables.items() if "hit" not in of.dims])
        chunks.save(key, chunk)
        watch.add(key[1], chunk)

    def report(done: Sequence[int] = ()) -> None:
        pipeline.options.progress(watch.progress(sum(done)))

    report()
    with closing(pipeline.computer.map(compute_hits, tasks(), report, save=save)) as results:
        for _ in results:
            report()
            if watch.stop:
                break
    of_references = _references(pipeline, campaign, limit, pilot) if references else {}
    if v.STATUS in pilot:
        of_references[FINER] = pilot
    every = _Saved(chunks, part, watch.count)
    seconds = sum(watch.seconds[number] for number in range(watch.count))
    rate = {attr.COMPUTE_TIME: seconds, attr.HITS_PER_SECOND: watch.hits(watch.count) / seconds}
    return Computed(every, attr.with_units(rate) | watch.stop, of_references)


class _Saved:
    """Saved chunks of a part, which are loaded one by one each time they are iterated."""

    def __init__(self, chunks: Chunks, part: str, count: int) -> None:
        self._chunks, self._part, self._count = chunks, part, count

    def __iter__(self) -> Iterator[xarray.Dataset]:
        every = (self._chunks.load((self._part, number)) for number in range(self._count))
        return (one for one in every if one is not None)


def _pilot(pipeline: Pipeline, campaign: Campaign, limit: LimitSpec | None) -> xarray.Dataset:
    """What the pilot of a campaign finds; empty if the campaign fixes the resolution."""
    if campaign.numerics.explicit is not None:
        return xarray.Dataset()

    def report(levels: Sequence[int]) -> None:
        now = RunProgress(0, len(campaign.sampler()), piloting=True, level=next(iter(levels), None))
        pipeline.options.progress(now)

    return pipeline.compute((PILOT, 0), find_resolution, campaign, limit, tick=report)


def _references(
    pipeline: Pipeline, campaign: Campaign, limit: LimitSpec | None, pilot: xarray.Dataset
) -> dict[str, xarray.Dataset]:
    """Some hits of the references of a campaign, by their names, at the resolution of the campaign."""
    datasets = dict[str, xarray.Dataset]()
    for name, reference in campaign.references.items():
        searched = limit_of_reference(limit, campaign, name)
        if limit is None or searched is not None:
            shots = reference_shots(reference, REFERENCE_HITS if limit is None else REFERENCE_LIMITS)
            numerics = numerics_of(reference, pilot, limited=limit is not None)
            hits = np.arange(len(shots))
            dataset = pipeline.compute((name, 0), compute_hits, reference, hits, numerics, searched)
            datasets[name] = described(dataset, reference, pilot, searched)
    return datasets


class RunMonitor:
    """Follows a run: finished and failed shots, computing time, and whether its stop rule is met.

    The rule takes the chunks in the order of their shots, so that a run ends with the same shots however it was
    computed.

    Args:
        size: number of shots of a chunk.
        pilot: what the pilot found; empty without one.
        part: of the chunks.

    Attributes:
        count: the number of chunks, fewer once the stop rule is met.
        seconds: computing times of the finished chunks, by their numbers.
        stop: attributes on how the stop rule ended the run; empty as long as it goes on.
    """

    def __init__(self, campaign: Campaign, chunks: Chunks, size: int, pilot: xarray.Dataset, part: str = "map") -> None:
        self._total, self._size = len(campaign.sampler()), size
        self.count, self.seconds, self.stop = -(-self._total // self._size), dict[int, float](), dict[str, Any]()
        self._chunks, self._part, self._pilot, self._next, self._failed = chunks, part, pilot, 0, 0
        self._rule, self._replicates, self._values = campaign.stop, campaign.hits.scramblings, list[Array]()
        self._estimates = dict[Measure, Estimate]()
        self._shift: float | None = None
        step = max(1, block_size(campaign) // size)
        self._looks = {min(step * look, self.count) for look in looks(campaign.hits.sampling, -(-self.count // step))}
        for number in sorted(chunks.numbers(part)):
            if (chunk := chunks.load((part, number))) is not None:
                self.add(number, chunk)
        self._resumed = self._saved

    def hits(self, chunks: int) -> int:
        """Number of shots of the first chunks."""
        return min(chunks * self._size, self._total)

    def add(self, number: int, chunk: xarray.Dataset) -> None:
        """Take in a finished chunk, which is saved."""
        self.seconds[number] = chunk.attrs[attr.COMPUTE_TIME]
        self._failed += int(failed(chunk).sum())
        while self._rule is not None and not self.stop and self._next in self.seconds:
            following = self._chunks.load((self._part, self._next))
            assert following is not None
            if self._next == 0:  # the pilot's hits are in the first chunk
                pilot = self._pilot
                levels = finer_pair(with_references(following, {FINER: pilot})) if pilot.attrs else None
                shift = shift_of(self._rule.measure, levels, self._rule.confidence)
                self._shift = None if levels is None and np.isnan(shift) else shift
            self._values.append(self._rule.measure.values(following))
            self._next += 1
            if self._next in self._looks:
                self._look(self._rule)

    def _look(self, rule: Stop) -> None:
        """Find whether the rule ends the run after the hits so far."""
        design: SamplingDesign = {"replicates": self._replicates, "confidence": rule.confidence}
        estimate = estimate_from(rule.measure, np.concatenate(self._values), **design)
        wanted, shift = rule.measure.shown(rule.half_width), self._shift or 0.0
        met, left = estimate.half_width + shift <= wanted, max(wanted - shift, 0.0)
        # The half width is about proportional to 1/√hits.
        in_reach = self.hits(self._next) * estimate.half_width**2 <= left**2 * self._total
        no_use = not met and not in_reach and estimate.half_width <= (1.0 - NUMERICS_SHARE) * wanted
        self._estimates = {rule.measure: estimate}
        if met or no_use or self._next == self.count:
            self.count = self._next
            self.stop = {
                attr.STOP_QUANTITY: rule.quantity,
                attr.STOP_REASON: "half_width" if met else "numerics" if no_use else "max_count",
                **({} if self._shift is None else {attr.ESTIMATE_NUMERICS: self._shift}),
                attr.ESTIMATE: estimate.value,
                attr.ESTIMATE_INTERVAL: [estimate.low, estimate.high],
                attr.ESTIMATE_UNITS: rule.measure.display.stored,
                attr.CONFIDENCE: rule.confidence,
            }

    @property
    def _saved(self) -> int:
        return sum(self.hits(number + 1) - self.hits(number) for number in self.seconds)

    def progress(self, underway: int = 0) -> RunProgress:
        """The progress of the run, with shots of unfinished chunks."""
        saved, total = self._saved, self._total
        done = saved if saved == total else min(saved + underway, total - 1)
        return RunProgress(done, total, saved, self._resumed, self._failed, self._estimates)
