"""Confirmation of the front with fresh hits: a search selects lucky hits, so its own numbers are biased."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpimpact.campaign.text import CampaignError
from warpimpact.optimisation.design import Design
from warpimpact.optimisation.evaluate import HitJob, Report, columns_of, levels_of
from warpimpact.optimisation.objectives import Candidate, results_of, weights_of
from warpimpact.optimisation.search import Searched, front_of
from warpimpact.runs.questions import Question
from warpimpact.scene.model import Array

CONFIRM_FIDELITY = "standard"
"""Fidelity of the pilots of the designs of the front, unless the campaign fixes a resolution."""


@dataclass(frozen=True)
class Confirmed:
    """The front by fresh hits.

    Attributes:
        numbers: numbers of its designs in the search.
        candidates: its designs, then the references, with fresh hits.
        columns: numbers of their hits, shape [candidates, threats, columns, hits].
        on_front: whether each design is still on the front and within the bounds by fresh hits.
    """

    numbers: NDArray[np.int64]
    candidates: tuple[Candidate, ...]
    columns: Array
    on_front: NDArray[np.bool_]


Follow = Callable[[int, int, str], object]
"""Called with the number of targets done, the number of all targets, and what is computed of them."""


def confirm(design: Design, searched: Searched, follow: Follow) -> Question[Confirmed]:
    """Compute the front and the references with fresh hits at the standard fidelity."""
    numbers = spread(searched.front, design.search.confirmed)
    targets = [searched.candidates[number] for number in numbers] + references(design)
    seed, count = fresh_seed(design), design.search.confirm_hits if design.columns else 1
    threats = len(design.threats)

    def report(what: str) -> Report:
        return lambda done: follow(int(done / threats), len(targets), what)

    jobs = [
        HitJob(target.tables, threat, count, CONFIRM_FIDELITY, seed)
        for target in (targets if design.columns else ())
        for threat in range(threats)
    ]
    levels = yield from levels_of(design, jobs, report("pilots for fresh hits"))
    jobs = [replace(job, level=level) for job, level in zip(jobs, levels, strict=True)]
    found = yield from columns_of(design, jobs, report("fresh hits"))
    columns = np.array(found).reshape(len(targets), threats, len(design.columns), count)
    candidates = [
        replace(
            target,
            levels=tuple(levels[number * threats : (number + 1) * threats]),
            results=results_of(design, target.weights, of_target),
        )
        for number, (target, of_target) in enumerate(zip(targets, columns, strict=True))
    ]
    on_front = np.isin(np.arange(len(numbers)), front_of(design, candidates[: len(numbers)]))
    return Confirmed(numbers, tuple(candidates), columns, on_front)


def spread(front: NDArray[np.int64], most: int) -> NDArray[np.int64]:
    """At most `most` designs at even distances along a front, including both ends."""
    places = np.linspace(0, len(front) - 1, min(most, len(front)))
    return np.asarray(front[np.round(places).astype(np.int64)])


def fresh_seed(design: Design) -> int:
    """Seed of hits that the search has not computed."""
    return int(np.random.SeedSequence(design.search.seed, spawn_key=(24,)).generate_state(1)[0] >> 1)


def references(design: Design) -> list[Candidate]:
    """The reference targets, before their hits are computed.

    Raises:
        CampaignError: a reference is no campaign; the message names it.
    """
    targets = []
    for place, reference in enumerate(design.references):
        tables: dict[str, Any] = dict(design.base) | {"plate": dict(reference.plate)}
        if reference.layer is not None:
            tables["layer"] = [dict(layer) for layer in reference.layer]
        try:
            campaign = design.campaign(tables)
        except CampaignError as error:
            text = str(error).removeprefix(f"{design.name}: ")
            raise CampaignError(f'{design.name}: references[{place}] "{reference.name}": {text}') from None
        targets.append(Candidate(np.zeros(0), tables, weights_of(campaign.target)))
    return targets
