"""A campaign's map by the fast law, corrected by finite elements at some hits: runs, and one file of all of them."""

from __future__ import annotations

import shutil
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import xarray
from numpy.typing import NDArray
from pydantic import ValidationError
from scipy.cluster.vq import kmeans2

from warpimpact.analysis.correction import is_corrected, with_correction
from warpimpact.campaign.campaign import Campaign
from warpimpact.campaign.tables import FiniteElements
from warpimpact.campaign.text import CampaignError
from warpimpact.continuum.one_hit import cost_of
from warpimpact.continuum.simulate import check_continuum
from warpimpact.results import attributes as attr
from warpimpact.results import files
from warpimpact.results import variables as v
from warpimpact.results.dataset import failed, hit_numbers, joined
from warpimpact.results.files import OutputError, ResultError
from warpimpact.results.references import ELEMENTS, references_of
from warpimpact.runs.compute import numerics_of, shots_of
from warpimpact.runs.computer import computer
from warpimpact.runs.run import Follow, RunProgress, continuum_to_file, run_to_file
from warpimpact.scene.model import complaint
from warpimpact.scene.scene import NEAR_EDGES, Interaction

STRENGTH_RATIO = 2.8 / 2.6
"""Y of the law with free surfaces over that of the paper's law, at which both were compared with finite elements."""
_CONSIDERED = 2**12
"""Most hits of a map from which the elements' hits are chosen."""
_DIGITS = 6
"""Digits of their inputs, in standard deviations, that count for the choice."""


def correct_to_file(
    campaign: Campaign,
    output: Path,
    *,
    hits: int,
    device: str = "auto",
    workers: int | None = None,
    scheduler: str | None = None,
    resume: bool = False,
    overwrite: bool = False,
    progress: Follow = lambda now: None,
    warn: Callable[[str], object] = warnings.warn,
) -> None:
    """Compute the map of a campaign, the same hits by a second law, some of them by finite elements, and the corrected
    map, into one file. Each of these runs is in the folder `output`.runs until all have ended.

    A hit that fails on draft elements is computed again on standard ones.

    Args:
        hits: number of hits by finite elements, spread over the map.
        device, workers, scheduler, resume, overwrite, progress, warn: as in `run_to_file`.

    Raises:
        CampaignError: a layer has no material with constants of the continuum, or the continuum cannot compute it.
        OutputError, DeviceError, ClusterError, Interrupted: as in `run_to_file`.
    """
    campaign = campaign.computed_by(elements_of(campaign))
    folder = output.with_name(output.name + ".runs")
    replaces = folder / "replaces"  # a run that was to overwrite goes on to do so
    if resume and not folder.exists() and _is_complete(output, campaign, hits):
        return
    if folder.exists() and not (resume or overwrite):
        how = "continue it with --resume or begin anew with --overwrite"
        raise OutputError(f"{folder}: contains an unfinished computation; {how}")
    if output.exists() and not (overwrite or replaces.exists()):
        raise OutputError(f"{output}: exists already; name another file or give --overwrite")
    folder.mkdir(parents=True, exist_ok=True)
    if overwrite:
        replaces.touch()
    with computer(device, workers=workers, scheduler=scheduler) as computing:

        def compute(name: str, of: Campaign, numbers: NDArray[np.int64] | None = None) -> xarray.Dataset:
            """The result of one run, computed unless it is there."""
            path = folder / f"{name}.nc"
            again = not resume
            if numbers is None:
                run_to_file(of, path, device=computing, resume=resume, overwrite=again, progress=progress, warn=warn)
            else:
                continuum_to_file(
                    of,
                    path,
                    hits=tuple(numbers.tolist()),
                    device=computing,
                    resume=resume,
                    overwrite=again,
                    progress=lambda done, resumed, total: progress(RunProgress(done, total, done, resumed)),
                    warn=warn,
                )
            return files.read(path)

        fast = compute("fast", campaign)
        second = compute("free_surface", second_law(campaign, fast))
        numbers = spread_hits(fast, hits)
        by_elements = campaign.model_copy(
            update={"output": campaign.output.model_copy(update={"solid_reference": False})}
        )
        try:
            elements = compute("elements", by_elements, numbers)
            again = hit_numbers(elements)[failed(elements)]
            if len(again) and campaign.continuum.fidelity == "draft" and campaign.continuum.spacing is None:
                finer = campaign.continuum.model_copy(update={"fidelity": "standard"})
                repeated = compute("elements_again", by_elements.computed_by(finer), again)
                elements = joined([elements.isel(hit=~failed(elements)), repeated]).sortby(v.HIT)
        except ValueError as error:
            raise CampaignError(f"{campaign.title}: {error}") from None
    files.write(with_correction(fast, second, elements), output)
    shutil.rmtree(folder)


def _is_complete(output: Path, campaign: Campaign, hits: int) -> bool:
    """Whether a file is the corrected map of this campaign by so many hits of elements."""
    try:
        result = files.read(output)
    except ResultError:
        return False
    same = result.attrs.get(attr.CAMPAIGN) == campaign.text and result.attrs.get(attr.COUNT) == campaign.hits.count
    return same and is_corrected(result) and references_of(result)[ELEMENTS].sizes[v.HIT] == hits


def elements_of(campaign: Campaign) -> FiniteElements:
    """The finite elements of a campaign, with the materials of its layers where its table names none."""
    settings = campaign.continuum
    if not settings.materials:
        names = [layer.material for layer in campaign.target.layers]
        if None in names:
            place = "plate" if names[0] is None else f"layer {names.index(None)}"
            raise CampaignError(
                f"{place}.material: not given, but finite elements need one; or give continuum.materials"
            )
        try:
            settings = FiniteElements.model_validate(settings.model_dump() | {"materials": tuple(names)})
        except ValidationError as error:
            raise CampaignError(f"continuum.materials: {complaint(error.errors(include_url=False)[0])}") from None
    return settings


def elements_offer(campaign: Campaign, hits: int = 16) -> str:
    """A sentence on what a correction of a map would take by so many hits, or why it cannot be corrected."""
    try:
        continuum = elements_of(campaign).solver
        check_continuum(campaign.scene, continuum)
    except ValueError as error:
        return f"For a correction by finite elements: {error}."
    numbers = np.linspace(0, len(campaign.sampler()) - 1, 8, dtype=np.int64)
    seconds = hits * cost_of(campaign.scene, shots_of(campaign, numbers), continuum).seconds
    duration = f"{seconds:.1g} s" if seconds < 100.0 else f"{seconds / 60.0:.0f} min"
    return f"--elements {hits} corrects the map in some {duration} of a core."


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
    return campaign.model_copy(
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


def spread_hits(result: xarray.Dataset, count: int) -> NDArray[np.int64]:
    """Numbers of hits that are spread over the cell and over what scatters: those nearest the centres of clusters.

    They depend on the inputs of the shots alone, so plates under the same shots get the same ones, whatever their
    cells.
    """
    some = result.isel(hit=slice(_CONSIDERED))
    named = [some[name].values.astype(float) for name in (v.HIT_Y, v.HIT_Z, *v.shot_variables(some))]
    points = np.column_stack([column for column in named if np.ptp(column) > 0.0] or named[:1])
    points = (points - points.mean(axis=0)) / np.maximum(points.std(axis=0), np.finfo(float).tiny)
    points = points.round(_DIGITS)  # the same in cells of any size
    centres, _ = kmeans2(points, min(count, len(points)), minit="++", seed=1)
    chosen: list[int] = []
    for centre in centres:
        distance = np.sum((points - centre) ** 2, axis=1)
        distance[chosen] = np.inf
        chosen.append(int(np.argmin(distance)))
    return np.sort(hit_numbers(some)[chosen])
