"""The view of a simulated firing test: the target, the reports of the tests, and the meaning of the plan of a proof."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pandas as pd
import xarray

from warpimpact.results import attributes as attr
from warpimpact.results import firing as f
from warpimpact.statistics.acceptance import acceptance, shown_stop_probability
from warpimpact.statistics.intervals import estimate_of


def firing_view(dataset: xarray.Dataset) -> dict[str, list[str | pd.DataFrame]]:
    """Sentences and tables on the target of a test, its reports and its proof, by heading."""
    settings = json.loads(dataset.attrs[f.SETTINGS])
    view = {str(dataset.attrs[attr.TITLE]): [dataset.attrs[f.DISCLAIMER], *_target(dataset)]}
    if f.V50 in dataset:
        view[tests_title(dataset)] = [*reported_lines(dataset)]
    return view | (_proof(dataset, settings["proof"]) if f.PASS in dataset else {})


def _target(dataset: xarray.Dataset) -> list[str | pd.DataFrame]:
    """Quantiles of the limit velocities of the target."""
    names = (f.QUANTILE, f.QUANTILE_VELOCITY, f.QUANTILE_LOW, f.QUANTILE_HIGH)
    rows = []
    for share, value, low, high in zip(*(dataset[name].values for name in names), strict=True):
        ends = [f"{end:.5g}" if np.isfinite(end) else "open" for end in (low, high)]
        rows.append((f"V{100 * share:02.0f}", f"{value:.5g}", f"{ends[0]} to {ends[1]}"))
    spread = f"Half the distance from V16 to V84 is {float(dataset.attrs[f.TRUE_SPREAD]):.3g} m/s."
    columns = ["target", "velocity [m/s]", "95 % interval"]
    return [pd.DataFrame(rows, columns=columns).set_index("target"), spread]


def tests_title(dataset: xarray.Dataset) -> str:
    """Procedure, and numbers of tests and of their shots."""
    shots = (dataset[f.SHOT_PERFORATED].values >= 0).sum(axis=1)
    count = f"{shots.min()}" if np.ptp(shots) == 0 else f"{shots.min()} to {shots.max()}, mean {shots.mean():.3g},"
    name = json.loads(dataset.attrs[f.SETTINGS])["procedure"]["name"]
    return f"{name}: {len(shots)} tests of {count} shots"


def reported_lines(dataset: xarray.Dataset) -> list[str]:
    """The reports of the tests, beside the truth."""
    v50, spread, low, high = (dataset[name].values for name in (f.V50, f.SPREAD, f.V50_LOW, f.V50_HIGH))
    true, known, bounded = float(dataset.attrs[f.TRUE_V50]), ~np.isnan(v50), ~np.isnan(low)
    if not known.any():
        return ["no test reports a V50"]
    lines = [] if known.all() else [f"reports a V50 in {_share(known)} of the tests"]
    off = v50[known] - true
    lines.append(f"reported V50: {off.mean():+.3g} m/s off on average, standard deviation {off.std():.3g} m/s")
    if bounded.any():
        is_spread = np.isfinite(spread)
        median = f"{np.median(spread[is_spread]):.3g}" if is_spread.any() else "-"
        held = ((low <= true) & (true <= high))[bounded]
        is_open = (np.isinf(low) | np.isinf(high))[bounded]
        lines += [
            f"reported spread: median {median} m/s, of {float(dataset.attrs[f.TRUE_SPREAD]):.3g} m/s; not determined "
            f"in {_share(~is_spread)}",
            f"reported 95 % interval of V50: contains the true V50 in {_share(held)}; open in {_share(is_open)}",
        ]
    return lines


def _share(answers: np.ndarray[Any, Any]) -> str:
    """A share of the tests with its interval."""
    estimate = estimate_of("share", answers.astype(float))
    return f"{100 * estimate.value:.3g} % ({100 * estimate.low:.3g} to {100 * estimate.high:.3g} %)"


def _proof(dataset: xarray.Dataset, proof: dict[str, Any]) -> dict[str, list[str | pd.DataFrame]]:
    """What a pass of the proof shows, and how often this target passes."""
    shots, allowed, velocity = int(dataset.attrs[f.PROOF_SHOTS]), int(proof["allowed"]), float(proof["velocity"])
    stop, confidence = float(proof["stop_probability"]), float(proof["confidence"])
    row = int(np.abs(dataset[f.VELOCITY].values - velocity).argmin())
    perforation, passed, same = (float(dataset[name][row]) for name in (f.PROOF_PERFORATION, f.PASS, f.PASS_SAME_PLACE))
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
    return {f"proof: {shots} shots at {velocity:g} m/s, at most {allowed} perforate": [*sentences]}
