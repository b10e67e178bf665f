"""The target of a firing test: its response, from a file of the test or from a search of limits."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from warpimpact.campaign.campaign import Campaign
from warpimpact.campaign.text import CampaignError
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
from warpimpact.results.checks import SWEEP
from warpimpact.runs.progress import Follow
from warpimpact.runs.run import run_to_file
from warpimpact.runs.team import local_team
from warpimpact.studies.limit import LimitMap


def known_target(test: FiringTest) -> Response | None:
    """The response of a target that needs no search; None of a campaign.

    Raises:
        CampaignError: the file that the target names says no such thing.
        ResultError: it is no result.
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
    """Tell that a file has no response as an error of it."""
    try:
        yield
    except files.ResultError:
        raise
    except ValueError as error:
        raise CampaignError(f"{path}: {error}") from None


def target_campaign(test: FiringTest, count: int | None = None) -> Campaign:
    """The campaign whose limits are searched: that of the target, with so many hits, up to the layer that must hold.

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


def searched_target(
    campaign: Campaign,
    output: Path,
    *,
    tolerance: float,
    device: str = "auto",
    resume: bool = False,
    overwrite: bool = False,
    progress: Follow | None = None,
    tell: Callable[[str], object] = warnings.warn,
) -> tuple[Response, dict[str, Any]]:
    """Search the limits of a campaign into a file, which `warpimpact inspect` and a test's `target.limits` take.

    Args:
        tolerance: how far the ends of a limit may lie apart [m/s].
        output, device, resume, overwrite, progress, tell: as in `run_to_file`.

    Returns:
        The response, and attributes that say what the search took.
    """
    team = local_team(campaign, device, LimitMap.of(campaign, tolerance=tolerance))
    run_to_file(campaign, output, team=team, resume=resume, overwrite=overwrite, progress=progress, tell=tell)
    dataset = files.read(output)
    with _told_of(output):
        response = response_of_limits(dataset)
    return response, {f.SEARCH: float(dataset[v.LIMITS["velocity"].runs].values.mean())}
