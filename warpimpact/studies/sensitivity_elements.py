"""What stays open of finite elements: some hits with other friction, strength and size of the elements.

The hits of all changes are the same, so the mean of their differences is known far better than a mean.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from warpimpact.campaign.tables import FiniteElements
from warpimpact.results.measures import Measure
from warpimpact.scene.flow import Continuum
from warpimpact.scene.model import Array
from warpimpact.statistics.correction import FEWEST_ACCURATE, correct, corrected_event, corrected_mean

FRICTIONS = (0.0, 0.06)
"""Least and largest friction between core and target at which limit velocities were met (docs/continuum.md)."""
STRENGTH_ERROR = 0.05
"""Standard error of a strength, as a share, where the catalogue knows none."""


class ElementShifts(NamedTuple):
    """What stays open of a measure, in its display unit.

    Attributes:
        shifts: mean of the paired differences to the elements as given, by the name of the change.
        half_width: of the interval of the measure, corrected by the elements as given; NaN with too few sound hits.
    """

    shifts: dict[str, float]
    half_width: float


def element_changes(elements: FiniteElements) -> dict[str, Continuum]:
    """The finite elements with one thing otherwise, by the name of the change."""
    given, errors = elements.solver, [entry.strength_error or STRENGTH_ERROR for entry in elements.entries]
    changes = {f"elements: friction {mu:g}": given.model_copy(update={"friction": mu}) for mu in FRICTIONS}
    for sign, end in ((-1.0, "low"), (1.0, "high")):
        flows = tuple(flow.scaled(1.0 + sign * error) for flow, error in zip(given.flows, errors, strict=True))
        changes[f"elements: strength at its {end} end"] = given.model_copy(update={"flows": flows})
    if given.fidelity == "draft" and given.spacing is None:
        changes["elements: standard size"] = given.model_copy(update={"fidelity": "standard"})
    return {name: changed for name, changed in changes.items() if changed != given}


def element_shifts(measure: Measure, by_elements: Mapping[str, Array], fast_at: Array, fast: Array) -> ElementShifts:
    """What the changes leave open of a measure that is a mean.

    Args:
        by_elements: values of the hits by elements, NaN where one does not count, by change; "" is as given.
        fast_at: values of the same hits by the fast law.
        fast: values of all hits by the fast law.
    """
    factor, own = measure.display.factor, measure.averaged(by_elements[""])
    differences = {name: measure.averaged(values) - own for name, values in by_elements.items() if name}
    shifts = {
        name: factor * float(np.nanmean(of_hits)) if np.isfinite(of_hits).any() else np.nan
        for name, of_hits in differences.items()
    }
    fast_at, fast = measure.averaged(fast_at), measure.averaged(fast)
    both = np.isfinite(own) & np.isfinite(fast_at)
    if both.sum() < FEWEST_ACCURATE:
        return ElementShifts(shifts, np.nan)
    correction = correct(own[both], fast_at[both, None], fast[np.isfinite(fast), None])
    corrected = corrected_event(correction) if measure.is_binary else corrected_mean(correction)
    return ElementShifts(shifts, factor * corrected.half_width)


def elements_note(moves: Mapping[str, ElementShifts]) -> str:
    """A sentence on measures that inputs of the elements move by more than their intervals; empty without any."""
    parts = []
    for title, of_measure in moves.items():
        beyond = [
            f"{name.removeprefix('elements: ')} {shift:+.3g}"
            for name, shift in of_measure.shifts.items()
            if abs(shift) > of_measure.half_width
        ]
        if beyond:
            parts.append(f"{title} (± {of_measure.half_width:.2g}): {', '.join(beyond)}")
    return (
        f"Inputs of finite elements move results by more than the interval of a correction: {'; '.join(parts)}."
        if parts
        else ""
    )
