"""The target of a firing test: its response, from a file or from a search of limits."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from warpimpact.campaign.campaign import Campaign
from warpimpact.campaign.text import CampaignError
from warpimpact.firing.directions import Sector, protect
from warpimpact.firing.plan import FiringTest
from warpimpact.firing.requirements import with_threat
from warpimpact.firing.response import (
    Response,
    known_response,
    normal_response,
    response_of_limits,
    response_of_sweep,
)
from warpimpact.results import files
from warpimpact.results import firing as f
from warpimpact.results import variables as v
from warpimpact.results.kinds import SWEEP
from warpimpact.runs.executor import Executor
from warpimpact.runs.progress import Follow
from warpimpact.runs.questions import answered
from warpimpact.runs.run import run_to_file
from warpimpact.runs.shards import manifest
from warpimpact.runs.store import stored
from warpimpact.studies.limit import LimitMap


def known_target(test: FiringTest) -> Response | None:
    """The response of a target that needs no search; None if the target is a campaign.

    Raises:
        CampaignError: the file that the target names gives no response.
        ResultError: the file is no result.
    """
    target = test.target
    if target.mean is not None and target.deviation is not None:
        return normal_response(target.mean, target.deviation)
    if target.velocities is not None and target.shares is not None:
        return known_response(target.velocities, target.shares)
    if target.limits is not None:
        with _told_of(target.limits):
            return response_of_limits(files.read(target.limits))
    if target.sweep is not None:
        with _told_of(target.sweep):
            return response_of_sweep(files.read(target.sweep, SWEEP), target.layer)
    return None


@contextmanager
def _told_of(path: Path) -> Iterator[None]:
    """Raise an error that names the file if it has no response."""
    try:
        yield
    except files.ResultError:
        raise
    except ValueError as error:
        raise CampaignError(f"{path}: {error}") from None


def target_campaign(test: FiringTest, count: int | None = None) -> Campaign:
    """The campaign whose limits are searched: that of the target, with `count` hits, up to the layer that must hold.

    Raises:
        CampaignError: it has no such layer, or its limits cannot be searched.
    """
    target = test.target
    assert target.campaign is not None
    listed = Campaign.from_toml(target.campaign).hits.listed is not None
    campaign = Campaign.from_toml(target.campaign, count=None if listed else count or target.count)
    if target.layer is not None:
        if target.layer > len(campaign.layer):
            raise CampaignError(
                f"got target.layer = {target.layer}, but the layers are 0 (the plate) to {len(campaign.layer)}"
            )
        campaign = campaign.model_copy(update={"layer": campaign.layer[: target.layer]})
    return with_threat(campaign, test)


def response_of(
    test: FiringTest,
    output: Path,
    *,
    executor: Executor,
    count: int | None = None,
    resume: bool = False,
    overwrite: bool = False,
    progress: Follow | None = None,
    tell: Callable[[str], object] = warnings.warn,
) -> tuple[Response | None, dict[str, Any]]:
    """The response of the target of a test; None where the test asks for directions alone.

    The limits of a campaign are searched into OUTPUT_limits.nc, which `warpimpact inspect` and a test's `target.limits`
    take.

    Args:
        count: number of hits of the campaign, instead of that in the file.

    Returns:
        The response, and attributes on the cost of the search.
    """
    if not test.needs_limits:
        return None, {}
    if (known := known_target(test)) is not None:
        return known, {}
    campaign, limits = target_campaign(test, count), output.with_name(f"{output.stem}_limits.nc")
    computation = LimitMap.of(campaign, tolerance=test.target.tolerance)
    run_to_file(
        campaign,
        limits,
        device=executor,
        computation=computation,
        resume=resume,
        overwrite=overwrite,
        progress=progress,
        tell=tell,
    )
    dataset = files.read(limits)
    with _told_of(limits):
        response = response_of_limits(dataset)
    return response, {f.SEARCH: float(dataset[v.LIMITS["velocity"].runs].values.mean())}


@contextmanager
def directions_of(
    test: FiringTest,
    output: Path,
    *,
    executor: Executor,
    resume: bool = False,
    overwrite: bool = False,
    progress: Callable[[int, int], object] = lambda done, total: None,
    tell: Callable[[str], object] = warnings.warn,
) -> Iterator[Sector | None]:
    """Compute the directions of a test; None if it asks for none. Results are saved in `output`.parts as they come. The
    caller writes the output before the block ends; `resume` replaces it, too.
    """
    if test.directions is None:
        yield None
        return
    campaign = target_campaign(test)
    content = manifest(campaign, executor.made_by) | {"directions": test.directions.model_dump(mode="json")}
    with stored(output, content, "test", resume=resume, overwrite=overwrite or resume, tell=tell) as store:
        yield answered(protect(campaign, test.directions, progress), executor, store)
