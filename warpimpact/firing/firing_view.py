"""The view of a simulated firing test: the target, the reports of the tests, and the meaning of the plan of a proof."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray

from warpimpact.analysis.evidence_lines import evidence_lines
from warpimpact.results import attributes as attr
from warpimpact.results import firing as f
from warpimpact.statistics.acceptance import acceptance, shown_stop_probability
from warpimpact.statistics.intervals import Estimate, estimate_of
from warpimpact.view.view import Column, Section, Table, number


@dataclass(frozen=True)
class ProcedureVerdict:
    """How far tests of a procedure can be trusted.

    Attributes:
        known: share of the tests that report a V50.
        bias, deviation: mean and standard deviation of the reported minus the true V50 [m/s].
        spread: median of the reported spread [m/s].
        coverage: share of the reported intervals that contain the true V50; None where no test reports one.
        open: share of the reported intervals that are open on a side.
        passed: share of the tests that report the required V50; None where none is required.
    """

    known: Estimate
    bias: float
    deviation: float
    spread: float
    coverage: Estimate | None
    open: float
    passed: Estimate | None


def verdict(dataset: xarray.Dataset, required: float | None = None, by: str = "v50") -> ProcedureVerdict | None:
    """How far the tests of a file can be trusted; None if no procedure was fired."""
    if f.V50 not in dataset:
        return None
    v50, spread, low, high = (dataset[name].values for name in (f.V50, f.SPREAD, f.V50_LOW, f.V50_HIGH))
    true, known = float(dataset.attrs[f.TRUE_V50]), ~np.isnan(v50)
    bounded = ~np.isnan(low) & ~np.isnan(high)
    held = (low <= true) & (true <= high)
    coverage = estimate_of("share", held[bounded].astype(float)) if bounded.any() else None
    reached = v50 if by == "v50" else low
    passed = None if required is None else estimate_of("share", (np.nan_to_num(reached, nan=-np.inf) >= required) * 1.0)
    return ProcedureVerdict(
        estimate_of("share", known.astype(float)),
        float(np.mean(v50[known]) - true) if known.any() else np.nan,
        float(np.std(v50[known])) if known.any() else np.nan,
        float(np.median(spread[known])) if known.any() else np.nan,
        coverage,
        float((np.isinf(low) | np.isinf(high))[bounded].mean()) if bounded.any() else 0.0,
        passed,
    )


def share_text(estimate: Estimate) -> str:
    """A share with its interval."""
    return f"{100 * estimate.value:.3g} % ({100 * estimate.low:.3g} to {100 * estimate.high:.3g} %)"


def firing_view(dataset: xarray.Dataset) -> list[Section]:
    """The view of a firing test: its target, what the tests report, and the answers to its questions."""
    attributes, test = dataset.attrs, json.loads(dataset.attrs[f.SETTINGS])
    required = test.get("required") or {}
    worth = verdict(dataset, required.get("v50"), required.get("by", "v50"))
    return [
        Section([attributes[f.DISCLAIMER], *filter(None, [attributes[f.REQUIREMENT]])], str(attributes[attr.TITLE])),
        *([_target(dataset)] if f.SHARE in dataset else []),
        *([_reported(dataset, worth, test)] if worth is not None else []),
        *([Section([_size(dataset, test["precision"])])] if f.SIZE in dataset else []),
        *([_proof(dataset, test["proof"])] if f.PASS in dataset else []),
        *([_directions(dataset)] if f.DIRECTION_SHARE in dataset else []),
        Section(evidence_lines(dataset)),
    ]


def _directions(dataset: xarray.Dataset) -> Section:
    """P(perforation) by azimuth and elevation, and its mean."""
    share, hits = dataset[f.DIRECTION_SHARE], dataset[f.DIRECTION_HITS].values
    low, high = dataset.attrs[f.MEAN_INTERVAL]
    weight = json.loads(dataset.attrs[f.SETTINGS])["directions"]["weight"].replace("_", " ")
    columns = [number("elevation", "°", ".4g")]
    columns += [number(f"{azimuth:.4g}°", digits=".3f") for azimuth in share[f.AZIMUTH].values]
    rows = [(at, *share.sel(elevation=at).values) for at in share[f.ELEVATION].values[::-1]]
    failed = int(dataset[f.DIRECTION_FAILED].values.sum())
    mean = (
        f"mean, weighted by {weight}: {float(dataset.attrs[f.MEAN]):.4g}, 95 % interval {low:.4g} to "
        f"{high:.4g}; {hits.sum()} hits, {hits.min()} to {hits.max()} in a direction"
    )
    title = "P(perforation) by direction: azimuth along, elevation down"
    return Section([Table(columns, rows), mean + (f", {failed} failed" if failed else "")], title)


def _target(dataset: xarray.Dataset) -> Section:
    """Quantiles of the limit velocities of the target, and the shots that the rules refuse."""
    searched = f.CHANGES in dataset
    columns = [Column("target"), number("velocity", "m/s", ".5g"), *([Column("95 % interval")] if searched else [])]
    names = (f.QUANTILE, f.QUANTILE_VELOCITY, f.QUANTILE_LOW, f.QUANTILE_HIGH)
    rows: list[tuple[Any, ...]] = []
    for share, value, low, high in zip(*(dataset[name].values for name in names), strict=True):
        ends = [f"{end:.5g}" if np.isfinite(end) else "open" for end in (low, high)]
        rows.append((f"V{100 * share:02.0f}", value, f"{ends[0]} to {ends[1]}")[: len(columns)])
    notes = [f"Half the distance from V16 to V84 is {float(dataset.attrs[f.TRUE_SPREAD]):.3g} m/s."]
    if searched:
        runs = dataset.attrs.get(f.SEARCH)
        several = int((np.isfinite(dataset[f.CHANGES].values).sum(axis=1) > 1).sum())
        cost = "" if runs is None else f", {float(runs):.3g} runs of a hit"
        notes.append(f"{dataset.sizes['place']} hits{cost}" + (f"; {several} have several limits" if several else ""))
    notes += [
        f"The {rule} refuses {100 * float(dataset.attrs[name]):.3g} % of the shots."
        for name, rule in ((f.UNFAIR_YAW, "yaw"), (f.UNFAIR_VELOCITY, "velocity window"))
        if dataset.attrs[name] > 0.0
    ]
    return Section([Table(columns, rows), *notes])


def _reported(dataset: xarray.Dataset, worth: ProcedureVerdict, test: dict[str, Any]) -> Section:
    """The reports of the tests, beside the truth."""
    tests, shots = dataset.sizes["test"], dataset[f.SHOTS].values
    shot_count = f"{shots.min()}" if np.ptp(shots) == 0 else f"{shots.min()} to {shots.max()}, mean {shots.mean():.3g},"
    notes = [f"reports a V50 in {share_text(worth.known)} of the tests"] if worth.known.value < 1.0 else []
    notes += [
        f"reported V50: {worth.bias:+.3g} m/s off on average, standard deviation {worth.deviation:.3g} m/s",
        f"reported spread: median {worth.spread:.3g} m/s, of {float(dataset.attrs[f.TRUE_SPREAD]):.3g} m/s",
    ]
    if worth.coverage is not None:
        confidence = 100 * float((test.get("estimator") or {}).get("confidence", 0.95))
        notes.append(
            f"reported {confidence:g} % interval of V50: contains the true V50 in {share_text(worth.coverage)} of the "
            f"tests; open in {100 * worth.open:.3g} %"
        )
    if worth.passed is not None:
        required = test["required"]["v50"]
        notes.append(f"required V50 of {required:g} m/s: reported in {share_text(worth.passed)} of the tests")
    return Section(notes, f"{test['procedure']['name']}: {tests} tests of {shot_count} shots")


def _size(dataset: xarray.Dataset, precision: dict[str, Any]) -> str:
    """Number of shots that a test needs for the required precision."""
    within, share = float(precision["within"]), float(precision["share"])
    enough = np.flatnonzero(dataset[f.SIZE_WITHIN].values >= share)
    what = f"V50 within ± {within:g} m/s in {100 * share:g} % of the tests"
    if not len(enough):
        best = 100 * float(dataset[f.SIZE_WITHIN].values.max())
        return f"{what}: not with {int(dataset[f.SIZE].values.max())} shots ({best:.3g} % at best)"
    return f"{what}: {float(dataset[f.SIZE_SHOTS].values[enough[0]]):.3g} shots"


def _proof(dataset: xarray.Dataset, proof: dict[str, Any]) -> Section:
    """What a pass of the proof shows, and how often this target passes."""
    shots, allowed = int(dataset.attrs[f.PROOF_SHOTS]), int(dataset.attrs[f.PROOF_ALLOWED])
    velocity = float(dataset.attrs[f.PROOF_VELOCITY])
    stop, confidence = float(proof["stop_probability"]), float(proof["confidence"])
    row = int(np.abs(dataset[f.VELOCITY].values - velocity).argmin())
    perforation = float(dataset[f.PROOF_PERFORATION][row])
    passed, same = (float(dataset[name][row]) for name in (f.PASS, f.PASS_SAME_PLACE))
    consumer = float(acceptance(shots, allowed, 1.0 - stop))
    good = 1.0 - perforation >= stop
    risk = ("producer's", "rejects", 1.0 - passed) if good else ("consumer's", "accepts", passed)
    shown = 100 * shown_stop_probability(shots, allowed, confidence)
    sentences = [
        f"a pass shows P(stop) >= {shown:.3g} % at {100 * confidence:g} % confidence, if every shot may hit any place",
        f"a target of P(stop) = {100 * stop:g} % passes in {100 * consumer:.3g} % of the tests",
        f"this target: P(stop) = {100 * (1.0 - perforation):.4g} %; the plan {risk[1]} it in {100 * risk[2]:.3g} % of "
        f"the tests ({risk[0]} risk)",
        f"if all shots of a test hit the same place, it passes in {100 * same:.3g} % of the tests, in place of "
        f"{100 * passed:.3g} %",
    ]
    return Section(sentences, f"proof: {shots} shots at {velocity:g} m/s, at most {allowed} perforate")
