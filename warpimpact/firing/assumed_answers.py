"""The answers of a test under other assumptions about what nobody measured: the same shots at a target with changed
limits.

The limits under assumptions are those of the search (`runs/assumed.py`), so nothing more is computed of the target.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from warpimpact.analysis.assumptions import AS_GIVEN
from warpimpact.firing.directions import Sector
from warpimpact.firing.estimators import reported
from warpimpact.firing.fire import fire
from warpimpact.firing.fired_shots import drawn_shots, perforation, proof_shots
from warpimpact.firing.plan import FiringTest
from warpimpact.firing.response import Response
from warpimpact.records.variable import Variable
from warpimpact.results import firing as f
from warpimpact.statistics.acceptance import acceptance

MOST_TESTS = 1000
"""Most tests that are fired again under each assumption."""


def assumed(
    test: FiringTest, response: Response | None, sector: Sector | None
) -> tuple[dict[Variable, Any], dict[str, Any]]:
    """Columns and attributes of the answers as given and under each assumption; empty where none is known."""
    notes, by_name = list[str](), dict[str, dict[Variable, float]]()
    if response is not None:
        notes += [response.under_note] if response.under_note else []
        if response.under:
            by_name = _answers(test, {AS_GIVEN: response, **response.assumed()})
    if sector is not None and sector.mean.assumptions:
        notes.append(f"The mean over directions: each assumption alone, on {sector.assumed_hits} of the hits.")
        for name, mean in {AS_GIVEN: sector.mean.value, **sector.mean.assumptions}.items():
            by_name.setdefault(name, {})[f.ASSUMED_MEAN] = mean
    attributes = {f.ASSUMPTIONS_NOTE: " ".join(notes)} if notes else {}
    if not by_name:
        return {}, attributes
    told = {answer for answers in by_name.values() for answer in answers}
    columns: dict[Variable, Any] = {f.ASSUMPTION: np.array(list(by_name), dtype=object)}
    columns |= {
        answer: np.array([answers.get(answer, np.nan) for answers in by_name.values()])
        for answer in f.ASSUMED_ANSWERS
        if answer in told
    }
    return columns, attributes


def _answers(test: FiringTest, responses: Mapping[str, Response]) -> dict[str, dict[Variable, float]]:
    """The answers of the test for every response, by the variables of the file. All responses get the same drawn
    shots."""
    test = test.model_copy(update={"tests": min(test.tests, MOST_TESTS)})
    told = {name: {f.ASSUMED_V50: response.quantile(0.5)} for name, response in responses.items()}
    _add_reported(test, responses, told)
    _add_proof(test, responses, told)
    return told


def _add_reported(test: FiringTest, responses: Mapping[str, Response], told: dict[str, dict[Variable, float]]) -> None:
    """Add the mean of the reported V50, and the share of tests that report the required one."""
    if test.procedure is None:
        return
    required = test.required
    by_end = required is not None and required.by == "lower_end"
    estimator = test.estimator if by_end else test.estimator.without_interval
    places, errors = drawn_shots(test, test.procedure, responses[AS_GIVEN])
    for name, response in responses.items():
        reports = reported(fire(test.procedure, response, places, errors), test.procedure, estimator)
        known = reports.v50[~np.isnan(reports.v50)]
        told[name][f.ASSUMED_REPORTED] = float(known.mean()) if len(known) else np.nan
        if required is not None:
            reached = np.nan_to_num(reports.low if by_end else reports.v50, nan=-np.inf)
            told[name][f.ASSUMED_REQUIRED] = float(np.mean(reached >= required.v50))


def _add_proof(test: FiringTest, responses: Mapping[str, Response], told: dict[str, dict[Variable, float]]) -> None:
    """Add how often a shot of the proof is stopped, and how often the proof is passed."""
    proof = test.proof
    if proof is None or proof.velocity is None:
        return
    for name, response in responses.items():
        perforates = float(perforation(test, response, np.array([proof.velocity])).mean())
        told[name][f.ASSUMED_STOP] = 1.0 - perforates
        told[name][f.ASSUMED_PASS] = float(acceptance(proof_shots(proof), proof.allowed, perforates))
