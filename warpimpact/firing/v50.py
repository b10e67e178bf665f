"""V50 of fired shots, by maximum likelihood and by MIL-STD-662F, from a CSV file or from arrays."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from warpimpact.campaign.text import as_campaign_error
from warpimpact.errors import CampaignError
from warpimpact.scene.input_files import read_rows
from warpimpact.scene.model import Array
from warpimpact.scene.quantities import USUAL
from warpimpact.scene.units import PositiveSpeed, count_text, quantity, shorten
from warpimpact.statistics.quantal import fit_quantal, likelihood_interval, scale_interval

FOOT = 0.3048
STANDARD_SPANS = {2: 60 * FOOT, 3: 90 * FOOT, 5: 125 * FOOT}
"""Largest span [m/s] of so many stops and as many cores that pass, as publications quote MIL-STD-662F (1997)."""
FEW_SHOTS = 20
"""Shots below which the 95 % interval contains V50 in 82 to 89 % of simulated tests (docs/firing.md)."""

_HEADERS = {
    "velocities": ("velocity", "speed", "v", "impact velocity", "impact speed", "striking velocity", "strike velocity"),
    "results": ("perforated", "perforation", "complete", "complete penetration", "result", "outcome"),
}
_UNIT = re.compile(r"(?P<name>[a-z ]*?)[ ,:]*(?:\[(?P<square>.*)\]|\((?P<round>.*)\)|(?P<bare>m/s|ft/s|fps))?")
_YES = ("yes", "y", "true", "1", "cp", "complete", "perforated", "perforation")
_NO = ("no", "n", "false", "0", "pp", "partial", "stopped", "stop", "arrested")


class Shots(NamedTuple):
    """Fired shots: velocities [m/s], and whether each core passed."""

    velocity: Array
    perforated: NDArray[np.bool_]


@dataclass(frozen=True)
class V50:
    """V50 of fired shots [m/s]. NaN stands for what the shots do not determine.

    Attributes:
        value, low, high: V50 by maximum likelihood (probit) with its 95 % interval by the likelihood ratio; an end is
            infinite where the shots do not bound it.
        spread, spread_low, spread_high: standard deviation of the response, with its interval.
        standard, pairs, span: V50 by MIL-STD-662F, the mean of so many fastest stops and as many slowest complete
            penetrations, and the span of their velocities. It takes the most pairs within the span of the standard.
        fastest_stop, slowest_perforation: velocities of a stop and of a complete penetration; infinite without one.
        shots, perforations: numbers of shots, and of complete penetrations.
    """

    value: float
    low: float
    high: float
    spread: float
    spread_low: float
    spread_high: float
    standard: float
    pairs: int
    span: float
    fastest_stop: float
    slowest_perforation: float
    shots: int
    perforations: int

    @property
    def lines(self) -> list[str]:
        """V50, spread, V50 by the standard, and what the shots do not determine: a sentence each."""
        value, spread = f"not determined by {count_text(self.shots, 'shot')}", "not determined"
        if not math.isnan(self.value):
            value = f"{self.value:.4g} m/s, 95 % interval {_interval(self.low, self.high, 4)}"
        spread = spread if math.isnan(self.spread) else f"{self.spread:.3g} m/s"
        if not math.isnan(self.spread_low):
            spread += f", 95 % interval {_interval(self.spread_low, self.spread_high, 3)}"
        if 0.0 < (width := self.fastest_stop - self.slowest_perforation) < math.inf:
            spread += f"; zone of mixed results {width:.3g} m/s"
        spans = ", ".join(f"{pairs} + {pairs} shots within {span:.3g} m/s" for pairs, span in STANDARD_SPANS.items())
        standard = f"none, no {spans}"
        if self.pairs:
            standard = (
                f"{self.standard:.4g} m/s, mean of {self.pairs} stops and {self.pairs} complete penetrations within "
                f"{self.span:.3g} m/s (allowed {STANDARD_SPANS[self.pairs]:.3g} m/s)"
            )
        by = (f"V50 by maximum likelihood: {value}", f"spread: {spread}", f"V50 by MIL-STD-662F: {standard}")
        return [*by, self.undetermined]

    def __str__(self) -> str:
        return "\n".join(self.lines)

    @property
    def undetermined(self) -> str:
        """What the shots do not determine."""
        stop, perforation = self.fastest_stop, self.slowest_perforation
        shots = count_text(self.shots, "shot")
        if self.perforations == self.shots:
            return f"Every core of {shots} passed. V50 lies below about {perforation:.5g} m/s. Fire slower shots."
        if not self.perforations:
            return f"No core of {shots} passed. V50 lies above about {stop:.5g} m/s. Fire faster shots."
        if math.isnan(self.value):
            return "Fast cores pass no more often than slow ones. Fire over a wider range of velocities."
        if math.isnan(self.spread):
            where = f"between {stop:.5g} and {perforation:.5g} m/s" if stop < perforation else f"near {stop:.5g} m/s"
            return (
                f"No stopped core was faster than one that passed: V50 lies {where}, and the spread is not determined."
            )
        if math.isinf(self.low) or math.isinf(self.high):
            return "The interval of V50 is open: fire more shots near V50."
        if self.shots < FEW_SHOTS:
            return f"Fewer than {FEW_SHOTS} shots: 82 to 89 % of such intervals contain V50 (docs/firing.md)."
        return "V50 and spread are determined."


def _interval(low: float, high: float, digits: int) -> str:
    ends = [f"{end:.{digits}g}" if math.isfinite(end) else "open" for end in (low, high)]
    return f"{ends[0]} to {ends[1]} m/s"


def v50(velocity: ArrayLike, perforated: ArrayLike) -> V50:
    """Compute V50 of fired shots.

    Args:
        velocity: of every shot [m/s].
        perforated: whether each core passed (complete penetration), true or false, 1 or 0.

    Raises:
        ValueError: the arrays differ in length, are empty, or have other values.
    """
    speed, answers = np.asarray(velocity, dtype=float), np.asarray(perforated)
    if speed.ndim != 1 or speed.shape != answers.shape or not len(speed):
        raise ValueError(f"got {speed.shape} velocities and {answers.shape} answers. Give one answer for each shot.")
    if not (np.isfinite(speed) & (speed > 0.0)).all():
        raise ValueError("velocity: a value is not a finite number above 0.")
    if not np.isin(answers, (0, 1)).all():
        raise ValueError("perforated: a value is neither true nor false, 1 nor 0.")
    through, fitted, standard = answers.astype(bool), (math.nan,) * 6, (math.nan, 0, math.nan)
    stops, perforations = speed[~through].tolist(), speed[through].tolist()
    if np.ptp(speed) > 0.0:
        sample = speed[None], through[None], np.ones((1, len(speed)), dtype=bool)
        fit = fit_quantal(*sample)
        low, high = (float(end[0]) for end in likelihood_interval(*sample, fit))
        fitted = (float(fit.location[0]), low, high, float(fit.scale[0]), *scale_interval(speed, through, fit))
    for pairs, span in STANDARD_SPANS.items():
        if (chosen := within_span(stops, perforations, pairs, span + 1e-9)) is not None:
            standard = float(np.mean(chosen)), pairs, max(chosen) - min(chosen)
    ends = max(stops, default=-math.inf), min(perforations, default=math.inf)
    return V50(*fitted, *standard, *ends, len(speed), len(perforations))


def within_span(stops: Sequence[float], perforations: Sequence[float], pairs: int, span: float) -> list[float] | None:
    """The fastest stops and the slowest complete penetrations, if enough of them lie within the span."""
    if min(len(stops), len(perforations)) < pairs:
        return None
    chosen = sorted(stops)[-pairs:] + sorted(perforations)[:pairs]
    return chosen if max(chosen) - min(chosen) <= span else None


def read_shots(path: Path) -> Shots:
    """Read fired shots from a CSV file with a column of velocities and one of results.

    Columns are separated by commas, semicolons or tabs. With the last two a comma may be the decimal sign. Velocities
    are in m/s, or in the unit of their header or cell. Other columns are ignored.

    Raises:
        CampaignError: the message names the file, the line and its fault.
    """
    with as_campaign_error():
        rows = [*read_rows(path)]
    if len(rows) < 2:
        raise CampaignError(f"{path}: has no shots. Give a header, velocity,perforated, and a row for each shot.")
    (_, header), *cells = rows
    (velocity, unit), (result, _) = (_column(path, header, what) for what in _HEADERS)
    shots = []
    for number, row in cells:
        with as_campaign_error(f"{path}, line {number}: "):
            if len(row) <= max(velocity, result) or any(row[len(header) :]):
                raise ValueError(f"has columns: {len(row)}, the header {len(header)}. Decimal commas need semicolons.")
            text, answer = row[velocity], row[result].strip().lower()
            with as_campaign_error("velocity: "):
                speed = quantity(PositiveSpeed)(text if re.search(r"[a-df-zA-DF-Z/]", text) else f"{text} {unit}")
                if speed <= 0.0:
                    raise ValueError(f'got "{text}", but it must be greater than 0')
                if (slip := USUAL["impact.velocity"].complaint(f'got "{text}"', speed, usual=True)) is not None:
                    raise ValueError(slip)
            if answer not in (*_YES, *_NO):
                allowed = f"{', '.join(_YES[:6])} or {', '.join(_NO[:6])}"
                raise ValueError(f'got the result "{shorten(answer)}". Give {allowed}.')
        shots.append((speed, answer in _YES))
    return Shots(np.array([speed for speed, _ in shots]), np.array([through for _, through in shots], dtype=bool))


def _column(path: Path, header: Sequence[str], what: str) -> tuple[int, str]:
    """Place of the column of velocities or results, and its unit."""
    columns = []
    for place, name in enumerate(header):
        match = _UNIT.fullmatch(name.lower().replace("_", " ").strip())
        if match and match["name"].strip() in _HEADERS[what]:
            columns.append((place, (match["square"] or match["round"] or match["bare"] or "m/s").strip()))
    if len(columns) != 1:
        raise CampaignError(
            f'{path}: got the header "{shorten(",".join(header))}" with {len(columns)} columns of {what}. Give one '
            f"column, named {', '.join(_HEADERS[what])}."
        )
    return columns[0]
