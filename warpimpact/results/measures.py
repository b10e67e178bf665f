"""Measures: numbers of a Dataset that a user can ask for (means, quantiles, probabilities), and their tallies."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Self, Unpack

import numpy as np
from numpy.typing import NDArray

from warpimpact.kernels.status import OF_SHOTS
from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.results.dataset import failed, images, is_choice, passed, shots_at_a_plate
from warpimpact.scene.display import STORED, Unit
from warpimpact.scene.units import Angle, Energy, Length, Moment, Number, Speed, Stress, Time, quantity, quoted
from warpimpact.statistics.intervals import Dealing, Dealt, Estimate, Estimating
from warpimpact.statistics.shifts import shift_of_mean, shift_of_quantile, shift_of_share, shift_of_yes

if TYPE_CHECKING:
    from warpimpact.results.table import Result

Array = NDArray[np.float64]

_KINDS: dict[str, Any] = {
    quantity(kind).display.stored: kind for kind in (Speed, Angle, Energy, Time, Moment, Stress, Length, Number)
}
"""Types of the quantities that have these units in the Dataset."""
_VARIABLES = {str(one): one for one in v.HIT_NUMBERS if one not in (*v.SHOT_VARIABLES, v.EDGE_DISTANCE)}
MEASURED = tuple(_VARIABLES)
_SIGNED = {v.PITCH, v.YAW, v.BROKEN_X}
"""Those that may be negative."""
STATUSES = {status.name.lower(): status for status in OF_SHOTS if not status.failed}

_VARIABLE = r"(?P<variable>[a-z_]+)(?:\s*@\s*(?P<standoff>[^<>,]+?))?"
_FORMS = {
    "mean": re.compile(rf"mean\(\s*{_VARIABLE}\s*\)"),
    "quantile": re.compile(rf"quantile\(\s*{_VARIABLE}\s*,\s*(?P<share>[\d.eE+-]+)\s*\)"),
    "probability": re.compile(rf"P\(\s*{_VARIABLE}\s*(?P<relation>[<>])\s*(?P<limit>.+?)\s*\)"),
    "share": re.compile(r"P\(\s*(?P<variable>[a-z_]+)\s*\)"),
}


@dataclass(frozen=True)
class Measure:
    """One number of a result.

    Attributes:
        text: as the user wrote it.
        kind: "mean", "quantile", "probability" (of a variable beyond a limit) or "share" (of a status, or of broken
            cores).
        variable: of the Dataset, or the status of a share.
        standoff: distance behind the rear face [m], if the variable depends on it.
        share: share of the values below a quantile.
        above, limit: side and limit of a probability, in the units of the Dataset.

    A share, and what is asked of limits, counts all shots except those whose computation failed. The other kinds count
    the cores that passed the plate.
    """

    text: str
    kind: str
    variable: str
    standoff: float | None = None
    share: float = 0.5
    above: bool = True
    limit: float = 0.0

    @classmethod
    def parse(cls, text: str) -> Self:
        """Read ``mean(v)``, ``quantile(v, 0.05)``, ``P(v > limit)`` or ``P(status)``; v may be ``tilt@130mm``.

        Raises:
            ValueError: says what is allowed.
        """
        for kind, form in _FORMS.items():
            if (match := form.fullmatch(text.strip())) is not None:
                return cls._from(text, kind, match.groupdict())
        raise ValueError(
            f"got {quoted(text)}, but it must be of the form mean(residual_velocity), "
            "quantile(residual_velocity, 0.05), P(tilt@130mm > 30 deg) or P(perforated)"
        )

    @classmethod
    def _from(cls, text: str, kind: str, parts: dict[str, str]) -> Self:
        name, allowed = parts["variable"], (*STATUSES, str(v.BROKEN)) if kind == "share" else MEASURED
        if name not in allowed:
            raise ValueError(f'got "{name}", but it must be one of {", ".join(allowed)}')
        if kind == "share":
            return cls(text, kind, name)
        variable = _VARIABLES[name]
        has_standoff = "standoff" in variable.dims
        if has_standoff != (parts["standoff"] is not None):
            raise ValueError(
                f'got "{name}", which {"needs a" if has_standoff else "has no"} stand-off, as in tilt@130mm'
            )
        standoff = quantity(Length)(parts["standoff"]) if has_standoff else None
        if kind == "quantile":
            share = quantity(Number)(parts["share"])
            if not 0.0 < share < 1.0:
                raise ValueError(f"got the quantile {share:g}, but it must lie between 0 and 1")
            return cls(text, kind, name, standoff, share=share)
        if kind == "probability":
            limit = _shown(variable.units, quantity(_KINDS[variable.units])(parts["limit"]))
            return cls(text, kind, name, standoff, above=parts["relation"] == ">", limit=limit)
        return cls(text, kind, name, standoff)

    @property
    def place(self) -> str:
        """Where it is measured, such as " at 130 mm"; empty where it has no stand-off."""
        return f" at {self.standoff * 1e3:g} mm" if self.standoff else ""

    @property
    def least(self) -> float:
        """What no value is below."""
        return -math.inf if self.variable in _SIGNED else 0.0

    @property
    def is_binary(self) -> bool:
        """Whether the values of single shots are 0 or 1."""
        return self.kind in ("probability", "share")

    @property
    def units(self) -> str:
        """Those of the Dataset; "1" for a probability."""
        return "1" if self.is_binary else _VARIABLES[self.variable].units

    @property
    def display(self) -> Unit:
        """How its values are shown."""
        return STORED[self.units]

    def in_units(self, value: object) -> float:
        """SI value of a difference of this measure that a user wrote."""
        return quantity(_KINDS[self.units])(value)

    def shown(self, value: float) -> float:
        """An SI value in the units of the Dataset."""
        return _shown(self.units, value)

    def values(self, dataset: Result) -> Array:
        """The number of every shot, shape [hits]; NaN for a shot that does not count.

        Raises:
            ValueError: the result does not have the stand-off.
        """
        if self.kind == "share" and self.variable == v.BROKEN:
            return np.asarray(dataset[v.BROKEN].values, dtype=np.float64)  # NaN of a failed shot
        if self.kind == "share":
            return np.where(failed(dataset), np.nan, dataset[v.STATUS].values == STATUSES[self.variable])
        column = np.asarray(dataset[self.variable].values)
        if self.standoff is not None:
            column = column[:, place_of_standoff(dataset[v.STANDOFF].values, self.standoff)]
        counts = ~failed(dataset) if self.variable in v.LIMIT_VARIABLES else passed(dataset)
        values = np.where(counts, column.astype(np.float64), np.nan)
        if self.kind == "mean":
            return np.where(np.isinf(values), np.nan, values)  # a limit beyond the largest value tried
        if self.kind != "probability":
            return values
        return np.where(np.isnan(values), np.nan, self._beyond(values) > 0.0)

    def _beyond(self, values: Array) -> Array:
        """How far values are on the side of the limit that counts."""
        return values - self.limit if self.above else self.limit - values

    def numbers(self, dataset: Result) -> Array:
        """As `values`; of a probability how far each shot is on the side that counts."""
        if self.kind != "probability":
            return self.values(dataset)
        return self._beyond(replace(self, kind="quantile").values(dataset))


def place_of_standoff(distances: Sequence[float] | Array, standoff: float) -> int:
    """Place of a stand-off [m] among those that there are.

    Raises:
        ValueError: it is none of them.
    """
    found = np.flatnonzero(np.isclose(distances, standoff, rtol=1e-9, atol=0.0))
    if not len(found):
        known = ", ".join(f"{distance * 1e3:g} mm" for distance in distances) or "not given"
        raise ValueError(f"got {standoff * 1e3:g} mm, but the stand-offs are {known}")
    return int(found[0])


def _shown(units: str, value: float) -> float:
    return math.degrees(value) if units == "degree" else value


class Tally:
    """Gathers a measure over shots, in the order of their numbers.

    Means and probabilities keep a few numbers in all; a quantile keeps one number per shot.

    Args:
        dealt: `replicates`, `images` and `confidence` as in `Dealt`.
    """

    def __init__(self, measure: Measure, **dealt: Unpack[Estimating]) -> None:
        kind = "share" if measure.is_binary else measure.kind
        self.measure, self._dealt = measure, Dealt(kind, share=measure.share, **dealt)

    def add(self, dataset: Result) -> None:
        """Add the next shots."""
        self._dealt.add(self.measure.values(dataset))

    def estimate(self) -> Estimate:
        """The estimate from the shots so far."""
        return self._dealt.estimate().within(self.measure.least)


def shift_of(measure: Measure, levels: tuple[Result, Result] | None, confidence: float = 0.95) -> float | None:
    """How far the numerics may shift a measure, by hits of a result at two levels (`finer_pair`); None without them."""
    if levels is None:
        return None
    dealt: Estimating = {**dealing(levels[0]), "replicates": 1, "confidence": confidence}
    coarse, fine = (measure.numbers(level) for level in levels)
    match measure.kind:
        case "quantile":
            return shift_of_quantile(coarse, fine, measure.share, **dealt)
        case "probability":
            return shift_of_share(coarse, fine, **dealt)
        case "share":
            return shift_of_yes(coarse, fine, **dealt)
    return shift_of_mean(coarse, fine, **dealt)


def dealing(dataset: Result) -> Dealing:
    """Arguments of `Dealt` that fit the sampling of a result. The shots at one plate count as one, like images. Chosen
    hits are no longer dealt out in turn."""
    if is_choice(dataset):
        return {"replicates": 1, "images": 1}
    together = images(dataset) * shots_at_a_plate(dataset)
    return {"replicates": int(dataset.attrs.get(attr.REPLICATES, 1)), "images": together}
