"""The front of a search by finite elements: every design's map is corrected, and so are the references' maps."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w
import xarray

from warpimpact.analysis.correction import corrected_estimate
from warpimpact.campaign.campaign import Campaign
from warpimpact.optimisation.design import Bound, Design, Objective, target_weights
from warpimpact.optimisation.front import campaign_tables
from warpimpact.results import files
from warpimpact.results.dataset import with_interval
from warpimpact.studies.correction import correct_to_file

Ends = tuple[float, float, float]


def correct_front(
    design: Design, dataset: xarray.Dataset, folder: Path, progress: Callable[[int, int, str], object], **how: Any
) -> xarray.Dataset:
    """The front of a search with the corrected objectives and bounds of its designs and references.

    The corrected maps of design_00.toml, … are in `folder` as design_00.nc, …; those that are there are taken.

    Args:
        dataset: the Dataset of `optimise`.
        progress: as in `optimise`.
        how: device, resume, overwrite and warn of `correct_to_file`.

    Raises:
        CampaignError: a plate has no material with constants of the continuum.
        OutputError, DeviceError, Interrupted: as in `optimise`.
    """
    plan = design.file.search
    tables = [design.tables(dataset.value.values[int(k)]) for k in dataset.front_design.values]
    targets = {Path(name).stem: of for name, of in zip(dataset.front_file.values, tables, strict=True)}
    for place, reference in enumerate(design.file.references):
        targets[f"reference_{place:02d}"] = reference.tables(design.base)
    folder.mkdir(parents=True, exist_ok=True)
    ends = []
    for place, (name, of) in enumerate(targets.items()):
        results = []
        for threat, _ in enumerate(design.file.threats):
            text = tomli_w.dumps(campaign_tables(design, of, threat, name))
            path = folder / (f"{name}_{threat}.nc" if threat else f"{name}.nc")
            correct_to_file(
                Campaign.from_text(text, name=name, folder=design.folder, count=plan.confirm_hits),
                path,
                hits=int(plan.elements or 0),
                progress=lambda now, name=name, place=place: progress(
                    place, len(targets), f"{name} corrected by finite elements, {now.done} of {now.total} hits"
                ),
                **how,
            )
            results.append(files.read(path))
        weights = target_weights(design.campaign(of).target)
        ends.append([corrected_goal(goal, weights, results, design) for goal in design.goals])
    numbers = np.array(ends).reshape(-1, len(design.goals), 3)
    meaning = "objective or bound, corrected by finite elements"
    of_front = with_interval("front_corrected", ("front", "goal"), numbers[: len(tables)], "1", meaning)
    of_references = with_interval("reference_corrected", ("reference", "goal"), numbers[len(tables) :], "1", meaning)
    return dataset.assign(of_front | of_references).assign_attrs({"elements": plan.elements})


def corrected_goal(
    goal: Objective | Bound, weights: dict[str, float], results: Sequence[xarray.Dataset], design: Design
) -> Ends:
    """A goal with the ends of its interval, from the corrected results of a target by each threat; NaN where elements
    say nothing of it."""
    measure = goal.spec
    if measure.kind == "target":
        return (weights[measure.name],) * 3
    known = [None if measure.is_limit else corrected_estimate(result, measure) for result in results]
    estimates = [one for one in known if one is not None]
    if len(estimates) < len(results):
        return (math.nan,) * 3
    if goal.threats == "worst":
        worst = max(estimates, key=lambda one: goal.sign * one.value)
        return worst.value, worst.low, worst.high
    weight = np.array([threat.weight for threat in design.file.threats])
    shared = [*zip(weight / weight.sum(), estimates, strict=True)]
    mean = float(sum(share * one.value for share, one in shared))
    below, above = (  # the errors of different threats are independent
        math.hypot(*(share * (getattr(one, end) - one.value) for share, one in shared)) for end in ("low", "high")
    )
    return mean, mean - below, mean + above
