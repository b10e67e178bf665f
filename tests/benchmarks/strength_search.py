"""How strength factors are searched: the factor of a plate that just stops a core at its published limit velocity."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd

from tests.benchmarks.tensile import flow_from_tensile_test
from tests.validation.limit_rows import PUBLISHED
from warpimpact.kernels.status import Status
from warpimpact.scene.flow import Flow

FRICTION = 0.03
"""Between core and target."""
HELD = (Status.ARRESTED, Status.RICOCHETED)
COARSE = 0.25
"""Size of the elements of a search over the core's radius, a quarter of the thickness at most. It takes a sixth of the
time of a draft, whose elements have a sixth of the radius."""
WIDTH, MOST_HITS, NEAR, AIM, SLOPE = 0.06, 6, 0.88, -0.03, 0.9
"""A search ends at a bracket of this width in ln factor, after so many hits, or with a core that passed and left this
share of its energy or more. The next hit aims this far beside the expected factor, in ln factor; the slope of ln energy
over ln factor that is expected before two hits have passed."""


def estimate(hits: pd.DataFrame) -> float:
    """Factor at which the plate takes all of the core's energy, from the hits that passed; NaN if none has.

    Args:
        hits: columns factor, status, and energy, the share of the core's energy that the plate took.
    """
    passed = hits[hits["status"] == Status.PERFORATED].sort_values("factor").iloc[-2:]
    strong = hits["factor"][hits["status"].isin(HELD)].min()
    if passed.empty:
        return math.nan
    factor, energy = passed[["factor", "energy"]].to_numpy().T
    slope = SLOPE
    if len(passed) == 2 and np.log(factor[1] / factor[0]) > 0.5 * WIDTH:
        slope = float(np.clip(np.diff(np.log(energy))[0] / np.diff(np.log(factor))[0], 0.5 * SLOPE, 1.5 * SLOPE))
    passing = factor[-1] * energy[-1] ** (-1.0 / slope)
    return float(np.sqrt(factor[-1] * strong) if strong < passing else passing)


def next_factor(hits: pd.DataFrame, start: float, width: float = WIDTH) -> float | None:
    """Factor of the next hit of a search; None at its end. Its first one has the factor `start`; `width` as WIDTH."""
    if hits.empty:
        return start
    passed = hits[hits["status"] == Status.PERFORATED]
    weak, near = passed["factor"].max(), passed["energy"].max()
    strong = hits["factor"][hits["status"].isin(HELD)].min()
    if len(hits) >= MOST_HITS or near >= NEAR or np.log(strong / weak) <= width:
        return None
    if passed.empty:
        return float(hits["factor"].min() * np.exp(-2.0 * width))
    tried = min(estimate(hits) * np.exp(AIM), strong * np.exp(0.5 * AIM))
    while np.isclose(hits["factor"], tried, rtol=0.01).any():
        tried = float(np.sqrt(tried * weak)) if tried > 1.02 * weak else tried * np.exp(-AIM)
    return float(tried)


def flow_of(number: int, factor: float) -> Flow:
    """Constants of the plate of a published row by rule, times a factor."""
    row = pd.read_csv(PUBLISHED).iloc[number]
    strengths = (1e6 * float(row[name]) for name in ("plate_yield_MPa", "plate_UTS_MPa"))
    return flow_from_tensile_test(1e3 * float(row["plate_density_g_cm3"]), *strengths).scaled(factor)
