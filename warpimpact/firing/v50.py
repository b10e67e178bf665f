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

from warpimpact.campaign.text import CampaignError
from warpimpact.scene.input_files import read_rows
from warpimpact.scene.model import Array
from warpimpact.scene.units import PositiveSpeed, brief, quantity
from warpimpact.statistics.quantal import fit_quantal, likelihood_interval, scale_interval

Flags = NDArray[np.bool_]

FOOT = 0.3048
STANDARD_SPANS = {2: 60 * FOOT, 3: 90 * FOOT, 5: 125 * FOOT}
"""Largest span [m/s] of so many stops and as many perforations, as publications quote MIL-STD-662F (1997)."""
FEW_SHOTS = 20
"""Shots below which the 95 % interval contains V50 in 82 to 89 % of simulated tests (docs/firing.md)."""

_VELOCITY = ("velocity", "speed", "v", "impact velocity", "impact speed", "striking velocity", "strike velocity")
_RESULT = ("perforated", "perforation", "complete", "complete penetration", "result", "outcome")
_UNIT = re.compile(r"(?P<name>[a-z ]*?)[ ,:]*(?:\[(?P<square>.*)\]|\((?P<round>.*)\)|(?P<bare>m/s|ft/s|fps))?")
_YES = ("yes", "y", "true", "1", "cp", "complete", "perforated", "perforation")
_NO = ("no", "n", "false", "0", "pp", "partial", "stopped", "stop", "arrested")


class Shots(NamedTuple):
    """Fired shots: velocities [m/s], and whether each perforated."""

    velocity: Array
    perforated: Flags


@dataclass(frozen=True)
class V50:
    """V50 of fired shots [m/s]. NaN stands for what the shots do not determine.

    Attributes:
        value, low, high: V50 by maximum likelihood (probit) with its 95 % interval by the likelihood ratio; an end is
            infinite where the shots do not bound it.
        spread, spread_low, spread_high: standard deviation of the response, with its interval.
        standard, pairs, span: V50 by MIL-STD-662F, the mean of so many fastest stops and as many slowest perforations,
            and the span of their velocities. It takes the most pairs that lie within the span of the standard.
        fastest_stop, slowest_perforation: infinite if there is none.
        shots, perforations: numbers of shots.
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
        return [self._value, self._spread, self._standard, self.undetermined]

    def __str__(self) -> str:
        return "\n".join(self.lines)

    @property
    def undetermined(self) -> str:
        """What the shots do not determine."""
        stop, perforation = self.fastest_stop, self.slowest_perforation
        if self.perforations == self.shots:
            return f"All {self.shots} shots perforated. V50 lies below about {perforation:.5g} m/s. Fire slower shots."
        if not self.perforations:
            return f"None of {self.shots} shots perforated. V50 lies above about {stop:.5g} m/s. Fire faster shots."
        if math.isnan(self.value):
            return "Fast shots perforate no more often than slow ones. Fire over a wider range of velocities."
        if math.isnan(self.spread):
            where = f"between {stop:.5g} and {perforation:.5g} m/s" if stop < perforation else f"near {stop:.5g} m/s"
            return f"No stop is faster than a perforation: V50 lies {where}, and the spread is not determined."
        if math.isinf(self.low) or math.isinf(self.high):
            return "The interval of V50 is open: fire more shots near V50."
        if self.shots < FEW_SHOTS:
            return f"Fewer than {FEW_SHOTS} shots: 82 to 89 % of such intervals contain V50 (docs/firing.md)."
        return "V50 and spread are determined."

    @property
    def _value(self) -> str:
        if math.isnan(self.value):
            return f"V50 by maximum likelihood: not determined by {self.shots} shots"
        return f"V50 by maximum likelihood: {self.value:.4g} m/s, 95 % interval {_interval(self.low, self.high, 4)}"

    @property
    def _spread(self) -> str:
        width = self.fastest_stop - self.slowest_perforation
        zone = f"; zone of mixed results {width:.3g} m/s" if 0.0 < width < math.inf else ""
        if math.isnan(self.spread_low):
            return f"spread: not determined{zone}"
        known = "not determined" if math.isnan(self.spread) else f"{self.spread:.3g} m/s"
        return f"spread: {known}, 95 % interval {_interval(self.spread_low, self.spread_high, 3)}{zone}"

    @property
    def _standard(self) -> str:
        if self.pairs:
            allowed = STANDARD_SPANS[self.pairs]
            return (
                f"V50 by MIL-STD-662F: {self.standard:.4g} m/s, mean of {self.pairs} stops and {self.pairs} "
                f"perforations within {self.span:.3g} m/s (allowed {allowed:.3g} m/s)"
            )
        spans = ", ".join(f"{pairs} + {pairs} shots within {span:.3g} m/s" for pairs, span in STANDARD_SPANS.items())
        return f"V50 by MIL-STD-662F: none, no {spans}"


def _interval(low: float, high: float, digits: int) -> str:
    ends = [f"{end:.{digits}g}" if math.isfinite(end) else "open" for end in (low, high)]
    return f"{ends[0]} to {ends[1]} m/s"


def v50(velocity: ArrayLike, perforated: ArrayLike) -> V50:
    """Compute V50 of fired shots.

    Args:
        velocity: of every shot [m/s].
        perforated: whether each shot perforated, true or false, 1 or 0.

    Raises:
        ValueError: the arrays differ in length, are empty, or have other values.
    """
    speed, answers = np.asarray(velocity, dtype=float), np.asarray(perforated)
    if speed.ndim != 1 or speed.shape != answers.shape or not len(speed):
        raise ValueError(f"got {speed.shape} velocities and {answers.shape} answers. Give one answer for each shot.")
    if not np.isfinite(speed).all() or not (speed > 0.0).all():
        raise ValueError("velocity: a value is not a finite number above 0.")
    if not np.isin(answers, (0, 1)).all():
        raise ValueError("perforated: a value is neither true nor false, 1 nor 0.")
    through = answers.astype(bool)
    stops, perforations = speed[~through].tolist(), speed[through].tolist()
    fitted = (math.nan,) * 6
    if np.ptp(speed) > 0.0:
        sample = speed[None], through[None], np.ones((1, len(speed)), dtype=bool)
        fit = fit_quantal(*sample)
        low, high = (float(end[0]) for end in likelihood_interval(*sample, fit))
        fitted = (float(fit.location[0]), low, high, float(fit.scale[0]), *scale_interval(speed, through, fit))
    ends = max(stops, default=-math.inf), min(perforations, default=math.inf)
    return V50(*fitted, *_by_standard(stops, perforations), *ends, len(speed), len(perforations))


def _by_standard(stops: list[float], perforations: list[float]) -> tuple[float, int, float]:
    """Mean, pairs and span of the most pairs that MIL-STD-662F allows; NaN and 0 pairs if none."""
    for pairs in sorted(STANDARD_SPANS, reverse=True):
        chosen = within_span(stops, perforations, pairs, STANDARD_SPANS[pairs] + 1e-9)
        if chosen is not None:
            return float(np.mean(chosen)), pairs, max(chosen) - min(chosen)
    return math.nan, 0, math.nan


def within_span(stops: Sequence[float], perforations: Sequence[float], pairs: int, span: float) -> list[float] | None:
    """The fastest stops and the slowest perforations, if there are enough and they lie within the span."""
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
    try:
        rows = list(read_rows(path))
    except ValueError as error:
        raise CampaignError(str(error)) from None
    if len(rows) < 2:
        raise CampaignError(f"{path}: has no shots. Give a header, velocity,perforated, and a row for each shot.")
    (_, header), *rows = rows
    columns = _columns(path, header)
    shots = [_shot(f"{path}, line {number}", row, columns) for number, row in rows]
    return Shots(np.array([speed for speed, _ in shots]), np.array([through for _, through in shots], dtype=bool))


def _columns(path: Path, header: Sequence[str]) -> tuple[int, str, int]:
    """Places of the velocities and the results, and the unit of the velocities."""
    units, names = list[str](), list[str]()
    for name in header:
        match = _UNIT.fullmatch(name.lower().replace("_", " ").strip())
        names.append(match["name"].strip() if match else "")
        units.append((match["square"] or match["round"] or match["bare"] or "m/s").strip() if match else "")
    places = []
    for what, known in (("velocities", _VELOCITY), ("results", _RESULT)):
        found = [place for place, name in enumerate(names) if name in known]
        if len(found) != 1:
            raise CampaignError(
                f'{path}: got the header "{brief(",".join(header))}" with {len(found)} columns of {what}. '
                f"Give one column, named {', '.join(known)}."
            )
        places += found
    return places[0], units[places[0]], places[1]


def _shot(place: str, cells: Sequence[str], columns: tuple[int, str, int]) -> tuple[float, bool]:
    """Velocity [m/s] of a row, and whether the shot perforated."""
    velocity, unit, result = columns
    if len(cells) <= max(velocity, result):
        raise CampaignError(f"{place}: has {len(cells)} columns, fewer than the header.")
    text = cells[velocity]
    try:
        speed = quantity(PositiveSpeed)(text if re.search(r"[a-zA-Z]{2}|/", text) else f"{text} {unit}")
    except ValueError as error:
        raise CampaignError(f"{place}: velocity: {error}") from None
    if speed <= 0.0:
        raise CampaignError(f'{place}: velocity: got "{text}", but it must be greater than 0')
    answer = cells[result].strip().lower()
    if answer not in (*_YES, *_NO):
        raise CampaignError(
            f'{place}: got the result "{brief(cells[result])}". Give {", ".join(_YES[:6])} or {", ".join(_NO[:6])}.'
        )
    return speed, answer in _YES
