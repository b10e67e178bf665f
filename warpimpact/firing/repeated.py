"""A firing test that is fired many times at a target, as one Dataset (`results/firing.py`)."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray

from warpimpact.firing.directions import Sector
from warpimpact.firing.estimators import Reports, reported
from warpimpact.firing.fire import Firings
from warpimpact.firing.fired_shots import fired, perforation, proof_shots
from warpimpact.firing.plan import FiringTest, Proof
from warpimpact.firing.procedures import Procedure
from warpimpact.firing.requirements import requirement_line
from warpimpact.firing.response import Response
from warpimpact.firing.rules import fair_places
from warpimpact.records.variable import Variable
from warpimpact.results import attributes as attr
from warpimpact.results import firing as f
from warpimpact.results.dataset import dataset_of
from warpimpact.results.kinds import FIRING
from warpimpact.scene.model import Array
from warpimpact.statistics.acceptance import acceptance

QUANTILES = (0.5, 0.05, 0.01)
"""Shares of perforations whose velocities are given: V50, V05, V01."""
_CURVE_POINTS = 81


def simulate_test(
    test: FiringTest,
    response: Response | None,
    attributes: dict[str, Any] | None = None,
    sector: Sector | None = None,
) -> xarray.Dataset:
    """Fire a test many times at a target whose response is known.

    Args:
        response: None where the test asks for directions alone.
        attributes: further global attributes, such as the cost of the search of limits.

    Raises:
        ValueError: the rules of fair hits leave no place.
    """
    columns: dict[Variable, Any] = {}
    told: dict[str, Any] = {
        attr.KIND: FIRING.mark,
        attr.TITLE: test.title,
        attr.HISTORY: attr.history_line("test"),
        f.TEST: test.text,
        f.SETTINGS: test.model_dump_json(exclude_none=True),
        f.REQUIREMENT: requirement_line(test),
        attr.WARPIMPACT_VERSION: attr.versions()[attr.WARPIMPACT_VERSION],
    }
    if evidence := next((known.evidence for known in (response, sector) if known is not None and known.evidence), ""):
        told[attr.EVIDENCE] = evidence
    for more_columns, more in (_fired(test, response), _directions(test, sector)):
        columns, told = columns | more_columns, told | more
    return dataset_of(columns, f.FIXED | told | (attributes or {}))


def _directions(test: FiringTest, sector: Sector | None) -> tuple[dict[Variable, Any], dict[str, Any]]:
    directions = test.directions
    if directions is None or sector is None:
        return {}, {}
    columns = {
        f.AZIMUTH: np.degrees(directions.azimuth),
        f.ELEVATION: np.degrees(directions.elevation),
        f.DIRECTION_SHARE: sector.share,
        f.DIRECTION_LOW: sector.low,
        f.DIRECTION_HIGH: sector.high,
        f.DIRECTION_OBLIQUITY: np.degrees(directions.obliquities()),
        f.DIRECTION_WEIGHT: directions.weights(),
        f.DIRECTION_HITS: sector.hits.astype(np.int32),
        f.DIRECTION_FAILED: sector.failed.astype(np.int32),
    }
    mean = sector.mean
    return columns, {f.MEAN: mean.value, f.MEAN_INTERVAL: np.array([mean.low, mean.high])}


def _fired(test: FiringTest, response: Response | None) -> tuple[dict[Variable, Any], dict[str, Any]]:
    """Columns and attributes of the response, the tests and the proof."""
    if response is None:
        return {}, {}
    fair_places(test.fair_hit, response)
    velocity = _grid(response, test.proof)
    columns = _response(response, velocity)
    attributes: dict[str, Any] = {
        f.TRUE_V50: response.quantile(0.5),
        f.TRUE_SPREAD: response.spread,
        f.UNFAIR_YAW: 1.0 - len(fair_places(test.fair_hit, response)) / len(response),
        f.UNFAIR_VELOCITY: test.gun.unfair,
    }
    if response.cell is not None:
        attributes[f.CELL] = np.array(response.cell)
    if test.procedure is not None:
        firings = fired(test, test.procedure, response)
        columns |= _tests(firings, reported(firings, test.procedure, test.estimator))
        if test.precision is not None:
            columns |= _sizes(test, test.procedure, response)
    if test.proof is not None:
        columns |= _proof(test, test.proof, response, velocity)
        attributes |= {f.PROOF_SHOTS: proof_shots(test.proof), f.PROOF_ALLOWED: test.proof.allowed}
        attributes |= {f.PROOF_VELOCITY: test.proof.velocity}
    return columns, attributes


def _grid(response: Response, proof: Proof | None) -> Array:
    """Velocities of the curves, from where nothing perforates to where all does. The proof's velocity is among them."""
    finite = response.changes[np.isfinite(response.changes)]
    of_proof = [] if proof is None or proof.velocity is None else [proof.velocity]
    low, high = np.min([*finite, *of_proof]), np.max([*finite, *of_proof])
    margin = 0.05 * max(high - low, 0.02 * high)
    return np.unique([*np.linspace(max(1.0, low - margin), high + margin, _CURVE_POINTS), *of_proof])


def _response(response: Response, velocity: Array) -> dict[Variable, Any]:
    shares = [response.estimate(float(speed)) for speed in velocity]
    quantiles = [response.quantile_estimate(share) for share in QUANTILES]
    columns: dict[Variable, Any] = {
        f.VELOCITY: velocity,
        f.SHARE: [share.value for share in shares],
        f.SHARE_LOW: [share.low if response.cell else np.nan for share in shares],
        f.SHARE_HIGH: [share.high if response.cell else np.nan for share in shares],
        f.QUANTILE: np.array(QUANTILES),
        f.QUANTILE_VELOCITY: [quantile.value for quantile in quantiles],
        f.QUANTILE_LOW: [quantile.low for quantile in quantiles],
        f.QUANTILE_HIGH: [quantile.high for quantile in quantiles],
    }
    if response.cell is not None:
        columns |= {f.CHANGES: response.changes, f.HIT_Y: response.hit_y, f.HIT_Z: response.hit_z, f.YAW: response.yaw}
        columns |= {f.OUTLINE_Y: response.outline[0], f.OUTLINE_Z: response.outline[1]}
    return columns


def _tests(firings: Firings, reports: Reports) -> dict[Variable, Any]:
    used = firings.used
    return {
        f.SHOT_VELOCITY: np.where(used, firings.velocity, np.nan),
        f.SHOT_PERFORATED: np.where(used, firings.perforated, -1).astype(np.int8),
        f.SHOT_PLACE: np.where(used, firings.place, -1).astype(np.int32),
        f.V50: reports.v50,
        f.SPREAD: reports.spread,
        f.V50_LOW: reports.low,
        f.V50_HIGH: reports.high,
        f.SHOTS: reports.shots.astype(np.int32),
    }


def _sizes(test: FiringTest, procedure: Procedure, response: Response) -> dict[Variable, Any]:
    """Share of exact tests for each size that was asked for. A test without a V50 is not exact."""
    precision, true = test.precision, response.quantile(0.5)
    assert precision is not None
    sizes = sorted(precision.sizes)
    longest = fired(test, procedure.of_size(sizes[-1]), response) if procedure.prefixes else None
    rows = []
    for size in sizes:
        sized = procedure.of_size(size)
        firings = fired(test, sized, response) if longest is None else longest.first(size)
        v50 = reported(firings, sized, test.estimator.without_interval).v50
        known = v50[~np.isnan(v50)]
        mean, deviation = (float(known.mean()), float(known.std())) if len(known) else (np.nan, np.nan)
        within = float((np.abs(known - true) <= precision.within).sum()) / len(v50)
        rows.append((float(firings.used.sum(axis=1).mean()), within, mean - true, deviation))
    names = (f.SIZE_SHOTS, f.SIZE_WITHIN, f.SIZE_BIAS, f.SIZE_DEVIATION)
    return {f.SIZE: np.array(sizes, dtype=np.int32), **dict(zip(names, zip(*rows, strict=True), strict=True))}


def _proof(test: FiringTest, proof: Proof, response: Response, velocity: Array) -> dict[Variable, Any]:
    """The operating characteristic of a plan at this target, and that of shots that all hit the same place."""
    shots, allowed = proof_shots(proof), proof.allowed
    by_place = perforation(test, response, velocity)
    return {
        f.PROOF_PERFORATION: by_place.mean(axis=1),
        f.PASS: acceptance(shots, allowed, by_place.mean(axis=1)),
        f.PASS_SAME_PLACE: acceptance(shots, allowed, by_place).mean(axis=-1),
    }
