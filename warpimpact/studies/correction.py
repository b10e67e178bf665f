"""A campaign's map by the fast law, corrected by finite elements at some hits: runs, and one file of all of them."""

from __future__ import annotations

import shutil
import warnings
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

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
from warpimpact.errors import CampaignError, Interrupted, OutputError, ResultError, TooLong
from warpimpact.measures.hits import failed, hit_numbers, shot_variables
from warpimpact.measures.references import ELEMENTS, SECOND_LAW, references_of, with_references
from warpimpact.records import attributes as attr
from warpimpact.records import variables as v
from warpimpact.results import files
from warpimpact.results.dataset import joined
from warpimpact.runs.compute import numerics_of, shots_of
from warpimpact.runs.computer import Computer, computer
from warpimpact.runs.replay import check_inputs, shots_in
from warpimpact.runs.run import ProgressCallback, RunProgress, continuum_to_file, run_to_file
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


def correct_to_file(campaign: Campaign, output: Path, *, hits: int, **options: Any) -> None:
    """Compute the map of a campaign into a file, and correct it there (`correct_result`).

    Args:
        hits: number of hits by finite elements, spread over the map.
        options: device, workers, scheduler, resume, overwrite, progress and warn of `run_to_file`.

    Raises:
        CampaignError: a layer has no material with constants of the continuum, or the continuum cannot compute it.
        OutputError, DeviceError, ClusterError, Interrupted: as in `run_to_file`.
    """
    campaign = campaign.computed_by(elements_of(campaign))
    _check_unfinished(output, **options)  # before the map is computed
    run_to_file(campaign, output, **options)
    try:
        correct_result(output, campaign, hits=hits, **options)
    except Interrupted as error:
        error.saved = error.saved or f"the map by the fast law is saved in {output}; continue with --resume"
        raise


def correct_result(
    path: Path,
    campaign: Campaign,
    *,
    hits: int,
    device: str | Computer = "auto",
    workers: int | None = None,
    scheduler: str | None = None,
    resume: bool = False,
    overwrite: bool = False,
    progress: ProgressCallback = lambda now: None,
    warn: Callable[[str], object] = warnings.warn,
) -> None:
    """Correct the map of a result by finite elements at some of its hits. The file is replaced when all have ended.

    The same hits are computed by a second law, too. What the result has by the second law or by the same elements
    counts, and is not computed again. A hit that fails on draft elements is computed again on standard ones. Each run
    is in the folder `path`.runs until all have ended.

    Args:
        path: the result of a run.
        campaign: its campaign, with the finite elements to compute by.
        hits: number of hits by finite elements, spread over the map.
        device, workers, scheduler, resume, progress, warn: as in `run_to_file`.
        overwrite: compute hits again that the result has by finite elements, and begin anew.

    Raises:
        ResultError: the result is no whole map by the fast law, or has other shots than the campaign.
        CampaignError, OutputError, DeviceError, ClusterError, Interrupted: as in `correct_to_file`.
    """
    fast = files.read(path)
    if attr.CONTINUUM in fast.attrs or not np.array_equal(hit_numbers(fast), np.arange(fast.sizes[v.HIT])):
        raise ResultError(f"{path}: is no whole map of warpimpact run, but only such a map is corrected")
    check_inputs(fast, campaign)
    shots_in(fast, campaign)
    if overwrite:
        fast = with_references(fast, {name: of for name, of in references_of(fast).items() if name != ELEMENTS})
    known = _known(fast, ELEMENTS, {attr.CONTINUUM: campaign.continuum.as_text})
    if known is None and ELEMENTS in references_of(fast):
        warn(f"{path}: has hits by other finite elements, which are replaced")
    elif known is not None and known.sizes[v.HIT] >= hits and is_corrected(fast):
        shutil.rmtree(path.with_name(path.name + ".runs"), ignore_errors=True)  # of a kill after the file was written
        return
    folder = _check_unfinished(path, resume=resume, overwrite=overwrite)
    folder.mkdir(exist_ok=True)
    again: dict[str, Any] = {"resume": resume, "overwrite": not resume, "warn": warn}
    try:
        with computer(device, workers=workers, scheduler=scheduler) as machine:
            result = _corrected(fast, campaign, folder, hits, known, progress, again | {"device": machine})
    except KeyboardInterrupt as error:
        if _is_removed(folder):
            raise
        saved = f"what is computed is saved in {folder}; continue with --resume"
        raise Interrupted("interrupted", saved=saved) from error
    except Exception:
        _is_removed(folder)
        raise
    files.write(result, path)
    shutil.rmtree(folder)


def _corrected(
    fast: xarray.Dataset,
    campaign: Campaign,
    folder: Path,
    hits: int,
    known: xarray.Dataset | None,
    progress: ProgressCallback,
    options: Mapping[str, Any],
) -> xarray.Dataset:
    """The result with its correction, whose runs are in a folder; `known` are hits that it has by these elements."""
    if (second := _known(fast, SECOND_LAW)) is None:
        file = folder / "free_surface.nc"
        run_to_file(second_law(campaign, fast), file, progress=progress, **options)
        second = files.read(file)
    there = [] if known is None else hit_numbers(known).tolist()
    numbers = np.setdiff1d(spread_hits(fast, hits, there), there)

    def follow(done: int, resumed: int, total: int) -> None:
        progress(RunProgress(done, total, done, resumed))

    with as_campaign_error(f"{campaign.title}: "):
        new = _by_elements(campaign, folder, numbers, {"progress": follow, **options}) if len(numbers) else []
    elements = joined([*([] if known is None else [known]), *new]).sortby(v.HIT)
    return with_correction(fast, second, elements)


def _is_removed(folder: Path) -> bool:
    """Whether the folder of a correction that has ended too soon was empty, and is removed."""
    with suppress(OSError):
        folder.rmdir()
    return not folder.exists()


def _check_unfinished(path: Path, *, resume: bool = False, overwrite: bool = False, **_: Any) -> Path:
    """Folder of the runs that correct a result.

    Raises:
        OutputError: an unfinished correction has left it, and is neither continued nor begun anew.
    """
    folder = path.with_name(path.name + ".runs")
    if folder.exists() and not (resume or overwrite):
        how = "continue it with --resume or begin anew with --overwrite"
        raise OutputError(f"{folder}: contains an unfinished computation; {how}")
    return folder


def _by_elements(
    campaign: Campaign, folder: Path, numbers: NDArray[np.int64], options: Mapping[str, Any]
) -> list[xarray.Dataset]:
    """Hits by finite elements, each run in a file of the folder; those that failed on draft elements on standard ones.

    Args:
        options: as in `continuum_to_file`.
    """
    elements = campaign.continuum
    campaign = campaign.model_copy(update={"output": campaign.output.model_copy(update={"solid_reference": False})})
    continuum_to_file(campaign, folder / "elements.nc", hits=tuple(numbers.tolist()), **options)
    result = files.read(folder / "elements.nc")
    bad = failed(result)
    if not bad.any() or elements.fidelity != "draft" or elements.spacing is not None:
        return [result]
    finer = campaign.computed_by(elements.model_copy(update={"fidelity": "standard"}))
    file = folder / "elements_again.nc"
    continuum_to_file(finer, file, hits=tuple(hit_numbers(result)[bad].tolist()), **options)
    return [result.isel(hit=~bad), files.read(file)]


def _known(result: xarray.Dataset, name: str, attributes: Mapping[str, str] | None = None) -> xarray.Dataset | None:
    """A group of a result, if this version of warpimpact made it with these attributes; else None."""
    group = references_of(result).get(name)
    wanted = {**attr.versions(), **(attributes or {})}
    if group is None or any(group.attrs.get(key) != value for key, value in wanted.items()):
        return None
    return group if v.HIT in group.xindexes else group.set_xindex(v.HIT)


def elements_of(campaign: Campaign) -> ContinuumTable:
    """The finite elements of a campaign: where its table does not say so, those of all layers but a solid base behind a
    gap, and of the materials of these layers."""
    settings = _with_layers(campaign)
    if not settings.materials:
        names = _materials(campaign, settings.layers)
        if None in names:
            place = layer_name(names.index(None))
            raise CampaignError(
                f"{place}.material: not given, but finite elements need one; or give continuum.materials or --material"
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


def elements_offer(campaign: Campaign, hits: int = 16) -> str:
    """A sentence on what a correction by so many hits takes, or needs."""
    try:
        method = elements_of(campaign).method
    except ValueError:
        return f"{_remedy(campaign)} to correct this map by finite elements."
    shots = shots_of(campaign, np.linspace(0, len(campaign.sampler()) - 1, 8, dtype=np.int64))
    cost = method.estimate_cost(campaign.scene, shots)
    try:
        cost.check(threads=1)
    except (TooLong, MemoryError) as error:
        return f"No correction by finite elements: {error}."
    duration = duration_text(hits * cost.seconds)
    return f"--elements {hits} corrects the map, in about {duration} of one CPU core."


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
