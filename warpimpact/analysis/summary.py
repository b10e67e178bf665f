"""The first numbers of a result: how the shots ended, and what comes through the plate."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from warpimpact.analysis.assumptions_view import assumptions_lines
from warpimpact.analysis.estimates import estimated, means_of, slices
from warpimpact.analysis.numbers import ends_of, interval_text, intervals_text
from warpimpact.analysis.survival import draws_note
from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.results.bases import has_base
from warpimpact.results.dataset import finer_pair, is_choice, status_codes
from warpimpact.results.measures import Measure
from warpimpact.scene.display import STORED
from warpimpact.solver.findings import accuracy_text, errors_text
from warpimpact.statistics.intervals import Estimate
from warpimpact.view.view import Column, Section, Table, number, text_of

if TYPE_CHECKING:
    from warpimpact.results.table import Result


@dataclass(frozen=True)
class Spread:
    """Mean and standard deviation over the ``count`` hits that have a quantity; NaN when there are none.

    ``interval`` is the 95 % interval of the mean, NaN if the hits give none. ``parameters``, ``numerics`` and
    ``assumptions`` are those of the mean's `Estimate`.
    """

    count: int
    mean: float
    standard_deviation: float
    interval: tuple[float, float] = (math.nan, math.nan)
    parameters: tuple[float, float] | None = None
    numerics: float | None = None
    assumptions: Mapping[str, float] = field(default_factory=dict)

    @classmethod
    def of(cls, estimate: Estimate) -> Spread:
        """The spread of an estimate. The standard deviation is that of the hits themselves (ddof = 0)."""
        interval = estimate.low, estimate.high
        beside = estimate.parameters, estimate.numerics, estimate.assumptions
        return cls(estimate.count, estimate.value, estimate.spread, interval, *beside)

    @property
    def estimate(self) -> Estimate:
        """The estimate of the mean."""
        return Estimate(
            value=self.mean,
            low=self.interval[0],
            high=self.interval[1],
            count=self.count,
            spread=self.standard_deviation,
            parameters=self.parameters,
            numerics=self.numerics,
            assumptions=self.assumptions,
        )

    def times(self, factor: float) -> Spread:
        """The spread in another unit."""
        return Spread.of(self.estimate.times(factor))


@dataclass(frozen=True)
class Summary:
    """Outcome counts by status, and the spread of what left the rear face.

    Velocities are in m/s, angles in degrees; ``tilt`` is keyed by the stand-off [m]. ``base_depth`` [m] is that of
    `results.bases.base_depth`, None if no layer is behind the plate. ``broken`` counts the cores whose bending stress
    passed their strength, whatever their status; None if cores have no strength.
    """

    counts: dict[str, int]
    residual_velocity: Spread
    deflection: Spread
    tilt: dict[float, Spread]
    base_depth: Spread | None = None
    broken: int | None = None


def promise_text(dataset: Result) -> str | None:
    """The errors of the numerics in words, and whether the fidelity keeps its promise; None for an older result."""
    attributes = dataset.attrs
    if attr.NUMERICS_GIVEN not in attributes or attr.LIMIT in attributes:
        return None
    given = json.loads(attributes[attr.NUMERICS_GIVEN])
    if attr.RESIDUAL_VELOCITY_ERROR not in attributes:
        return f"promises nothing, as {_fixed_by(attributes)} is given"
    if attr.LEVEL_FOR in attributes:
        return _level_for(attributes)
    asked = json.loads(attributes[attr.ACCURACY])
    stated = accuracy_text(asked, layered=attr.STATUS_ERROR in attributes)
    velocity, tilt = attributes[attr.RESIDUAL_VELOCITY_ERROR], attributes[attr.TILT_ERROR]
    depth, status = (attributes.get(name, math.nan) for name in (attr.DEPTH_ERROR, attr.STATUS_ERROR))
    errors = f"estimated errors: {errors_text(velocity, tilt, depth, status)}"
    name = "the campaign" if given.get("accuracy") else given["fidelity"]
    if attributes[attr.PROMISE_KEPT]:
        return f"{name} keeps its promise ({stated}); {errors}"
    return f"{name} does not keep its promise ({stated}) at the level that it may use; {errors}"


def numerics_sentence(dataset: Result) -> str:
    """A sentence about the errors of the numerics."""
    promise = promise_text(dataset)
    return f"Numerics: {promise}." if promise else "The error of the numerics is not known."


def _fixed_by(told: Mapping[str, Any]) -> str:
    """The key of the campaign that fixes the resolution of a result without a pilot."""
    given = json.loads(told[attr.NUMERICS_GIVEN])
    fixed = ("level", "time_step", "travel", "patches_axial", "patches_around", "grid_spacing")
    return f"numerics.{next((name for name in fixed if given.get(name) is not None), 'scheme')}"


def _level_for(told: Mapping[str, Any]) -> str:
    """What the level of a run with a stop rule was chosen for."""
    velocity, tilt = told[attr.RESIDUAL_VELOCITY_ERROR], told[attr.TILT_ERROR]
    depth, status = (told.get(name, math.nan) for name in (attr.DEPTH_ERROR, attr.STATUS_ERROR))
    errors = f"single hits may err by {errors_text(velocity, tilt, depth, status)}"
    exact = told[attr.PROMISE_KEPT] or told.get(attr.STOP_REASON) == "half_width"
    which = "found" if exact else "not exact enough"
    level = json.loads(told[attr.RESOLUTION])["level"]
    return f"level {level} {which} for {told[attr.LEVEL_FOR]}; {errors}"


def breaks_promise(dataset: Result) -> bool:
    """Whether the numerics of a result are less exact than promised."""
    return bool(dataset.attrs.get(attr.PROMISE_KEPT) == 0)


_DEPTH, _BROKEN = Measure.parse("mean(base_depth)"), Measure.parse("P(broken)")


def summary(dataset: Result) -> Summary:
    """Summarise a hit map; velocity, deflection and tilt count only the cores that passed the plate."""
    codes, standoffs = status_codes(dataset), dataset[v.STANDOFF].values.tolist()
    velocity, deflection, *tilt = means_of((v.RESIDUAL_VELOCITY, v.DEFLECTION, v.TILT), standoffs)
    estimates = estimated(dataset, [velocity, deflection, *tilt])
    (depth,) = estimated(dataset, [_DEPTH]).values() if has_base(dataset) else (None,)
    broken = estimated(dataset, [_BROKEN])[_BROKEN] if v.BROKEN in dataset else None
    counts = np.zeros(len(codes), dtype=int)
    for part in slices(dataset[[v.STATUS]]):
        counts += (part[v.STATUS].values[:, None] == list(codes.values())).sum(axis=0)
    return Summary(
        counts=dict(zip(codes, counts.tolist(), strict=True)),
        residual_velocity=Spread.of(estimates[velocity]),
        deflection=Spread.of(estimates[deflection]),
        tilt={at: Spread.of(estimates[measure]) for at, measure in zip(standoffs, tilt, strict=True)},
        base_depth=None if depth is None else Spread.of(depth),
        broken=None if broken is None else round(broken.value * broken.count) if broken.count else 0,
    )


_SAMPLINGS = {
    "sobol": "Intervals are those of independent shots, as a rule too wide; hits.replicates = 16 gives valid ones.",
    "grid": "Intervals are those of independent shots, which the hits of a grid are not.",
    "list": "Intervals are those of independent shots, which the hits of a list may not be.",
}


def sampling_note(dataset: Result) -> str:
    """A note on the intervals of a result that its sampling needs, or none."""
    attributes = dataset.attrs
    if is_choice(dataset):
        return (
            f"These are {dataset.sizes['hit']} chosen hits of a larger result. All numbers describe them alone, and "
            "intervals are those of independent shots."
        )
    return _SAMPLINGS.get(attributes.get(attr.SAMPLING, ""), "") if attributes.get(attr.REPLICATES, 1) == 1 else ""


def summary_text(dataset: Result) -> str:
    """The summary as text, without statuses that did not occur."""
    result, hits = summary(dataset), dataset.sizes["hit"]
    counts = {name.replace("_", " "): count for name, count in result.counts.items() if count}
    if result.broken is not None:
        counts["broken"] = result.broken
    shares = Table(
        (Column(), number(digits="d"), number(digits=".1%")),
        [(name, count, count / hits) for name, count in counts.items()],
    )
    spreads = [
        ("residual velocity", "m/s", result.residual_velocity),
        ("deflection", "°", result.deflection),
        *((f"tilt at {standoff * 1e3:g} mm", "°", tilt) for standoff, tilt in result.tilt.items()),
    ]
    if (depth := result.base_depth) is not None and depth.count:
        spreads.append(("depth in the base", "mm", depth.times(1e3)))
    columns = (
        *(Column(), number("mean", digits=".2f"), Column()),
        *(Column("95 % interval"), number("spread", digits=".1f"), Column()),
    )
    rows = [
        (name, spread.mean, unit, _intervals(spread), spread.standard_deviation, _counted(spread.count, hits))
        for name, unit, spread in spreads
    ]
    notes = (numerics_note(dataset), levels_note(dataset), draws_note(dataset))
    moved = assumptions_lines(dataset)
    return text_of([Section([shares, Table(columns, rows), *moved, *stop_lines(dataset), *filter(None, notes)])])


def _counted(count: int, hits: int) -> str:
    """Words for the hits behind a mean; empty where it is over all hits."""
    return "no core behind the plate" if not count else f"of {count} hits" if count < hits else ""


def numerics_note(dataset: Result) -> str:
    """How the shift of a result's numbers by the numerics is known, or why it is unknown."""
    if hits := hits_at_two_levels(dataset):
        return f"numerics ±: from {hits} of the hits, which were computed at a finer level, too."
    return f"numerics ± is not known: {_why_not_known(dataset)}."


def hits_at_two_levels(dataset: Result) -> int:
    """Number of hits of a result that were computed at a finer level, too, for the shift by the numerics."""
    pair = finer_pair(dataset[[v.STATUS, *(name for name in v.GROUPS["finer"] if name in dataset)]])
    return 0 if pair is None else pair[0].sizes["hit"]


def _why_not_known(dataset: Result) -> str:
    if v.FINER_HIT in dataset:
        return "none of these hits was computed at a finer level, too"
    if attr.NUMERICS_GIVEN in dataset.attrs and attr.RESOLUTION not in dataset.attrs:
        given = _fixed_by(dataset.attrs)
        return f"{given} is given, so no hits were computed at a finer level (numerics.fidelity in its place does that)"
    return "the result has no hits at a finer level"


def levels_note(dataset: Result) -> str:
    """A note where the means of a result need another level than its single hits; else empty."""
    attributes = dataset.attrs
    if attr.LEVEL_SHIFTS not in attributes or attr.RESOLUTION not in attributes or attr.LEVEL_FOR in attributes:
        return ""
    standoffs = dataset[v.STANDOFF].values.tolist()[-1:]
    means = estimated(dataset, means_of((v.RESIDUAL_VELOCITY, v.TILT), standoffs)).values()
    open_by = [estimate.half_width for estimate in means]
    level, shifts = json.loads(attributes[attr.RESOLUTION])["level"], json.loads(attributes[attr.LEVEL_SHIFTS])
    enough = [int(at) for at, by in shifts.items() if all(a <= 0.5 * b for a, b in zip(by, open_by, strict=False))]
    if enough and min(enough) < level:
        by = _shifts_text(shifts[str(min(enough))])
        return f"For the means alone level {min(enough)} is enough (numerics.level): it shifts them by at most {by}."
    if any(a > b for a, b in zip(shifts.get(str(level), ()), open_by, strict=False)):
        by = _shifts_text(shifts[str(level)])
        return (
            f"The numerics may shift the means by more than the hits leave open, by {by}: a stricter numerics.accuracy "
            "tells more of them than more hits."
        )
    return ""


def _shifts_text(shifts: Sequence[float]) -> str:
    return " and ".join(f"{shift:.2g}{unit}" for shift, unit in zip(shifts, (" m/s", "°"), strict=False))


_STOPPED = {
    "half_width": "its half width is met",
    "numerics": "more hits are of no use: by what the numerics may shift it, max_count would not meet that half width",
    "max_count": "max_count ended it",
}


def stop_lines(dataset: Result) -> list[str]:
    """What the stop rule asked for; empty without a stop rule."""
    attributes = dataset.attrs
    if attr.STOP_QUANTITY not in attributes:
        return []
    (low, high), unit = attributes[attr.ESTIMATE_INTERVAL], STORED[attributes[attr.ESTIMATE_UNITS]]
    interval = interval_text(unit.factor * low, unit.factor * high, "{:.6g}".format)
    shift = attributes.get(attr.ESTIMATE_NUMERICS, math.nan)
    numerics = "not known" if math.isnan(shift) else f"{unit.factor * shift:.2g}{unit.suffix}"
    return [
        f"{attributes[attr.STOP_QUANTITY]} = {unit.text(attributes[attr.ESTIMATE], '.6g')}, "
        f"{attributes[attr.CONFIDENCE]:.4g} interval {interval}{unit.suffix}, numerics ± {numerics}; "
        f"{_STOPPED[attributes[attr.STOP_REASON]]}"
    ]


def symmetry_text(dataset: Result) -> str:
    """How many hits of a map with `hits.irreducible` were computed, and where the others come from."""
    computed, hits = dataset.attrs[attr.COMPUTED_HITS], dataset.sizes["hit"]
    if computed == hits:
        return f"all {hits} hits computed: plate and shot have no symmetry in common"
    return f"{computed} of {hits} hits computed, the others are their images by {dataset.attrs[attr.SYMMETRIES]}"


def _intervals(spread: Spread) -> str:
    return intervals_text(ends_of(spread.estimate), "{:.2f}".format)
