"""What a value is likely to be: bounds that no campaign has to keep, but that a slip of units leaves."""

import math
from collections.abc import Iterable, Mapping
from typing import NamedTuple

from .display import UNITS


class Implausible(UserWarning):
    """A value that is possible, but probably not what was meant."""


class Bounds(NamedTuple):
    """Usual values of a quantity in SI or radians.

    Attributes:
        unit: SI unit.
        meant: units that may have been left out, with the factor from what was read to what was meant.
    """

    low: float
    high: float
    unit: str
    meant: tuple[tuple[str, float], ...] = ()

    def warning(self, place: str, value: float) -> str | None:
        """A sentence about a value beyond the bounds, None for a usual one; zero is usual."""
        if value == 0.0 or self.low <= abs(value) <= self.high:
            return None
        usual = f"up to {self._shown(self.high)}"
        if self.low > 0.0:
            usual = f"{self.low * UNITS[self.unit].factor:g} to {self._shown(self.high)}"
        read = self._shown(value) if self.unit == "rad" else f"{value:g} {self.unit}".rstrip()
        sentence = f"{place}: read as {read}, but {usual} is usual"
        advice = "but a hit list is in SI" if place.startswith("hits.file") else "which needs its unit"
        for unit, factor in self.meant:
            if self.low <= abs(value) * factor <= self.high:
                return f'{sentence}; "{value:g} {unit}" was probably meant, {advice}'
        return sentence

    def _shown(self, value: float) -> str:
        return UNITS[self.unit].text(math.degrees(value) if self.unit == "rad" else value)


_MM, _DEG = 1e-3, math.radians(1.0)
_LENGTHS = (("mm", 1e-3), ("cm", 1e-2), ("um", 1e-6))


def _length(low: float, high: float) -> Bounds:
    """Bounds given in millimetres."""
    return Bounds(low * _MM, high * _MM, "m", _LENGTHS)


USUAL = {
    "core.length": _length(2.0, 300.0),
    "core.diameter": _length(1.0, 60.0),
    "core.mass": Bounds(5e-5, 1.0, "kg", (("g", 1e-3), ("mg", 1e-6))),
    "core.density": Bounds(500.0, 25_000.0, "kg/m^3", (("g/cm^3", 1e3),)),
    "plate.thickness": _length(0.1, 200.0),
    "plate.size": _length(5.0, 20_000.0),
    "plate.resistance": Bounds(1e7, 2e10, "Pa", (("MPa", 1e6), ("GPa", 1e9))),
    "plate.shear_coefficient": Bounds(0.0, 1.0, ""),
    "plate.degradation_interval": Bounds(1e-9, 1e-3, "s", (("us", 1e-6), ("ns", 1e-9))),
    "plate.degradation_length": _length(0.01, 20.0),
    "plate.degradation_depth": _length(0.1, 200.0),
    "plate.density": Bounds(500.0, 25_000.0, "kg/m^3", (("g/cm^3", 1e3),)),
    "plate.pattern.cell": _length(0.5, 500.0),
    "layer.gap": _length(0.05, 3_000.0),
    "impact.velocity": Bounds(20.0, 3000.0, "m/s", (("km/s", 1e3),)),
    "impact.azimuth": Bounds(0.0, 360.0 * _DEG, "rad"),
    "impact.pitch": Bounds(0.0, 60.0 * _DEG, "rad"),
    "impact.yaw": Bounds(0.0, 60.0 * _DEG, "rad"),
    "impact.spin": Bounds(0.0, 1e5, "rad/s"),
    "output.standoffs": _length(5.0, 100_000.0),
}
"""By the place in a campaign."""


def hit_bounds(period: tuple[float, float], size: tuple[float, float] | None) -> Bounds:
    """Usual coordinates of listed hits [m]: within a few cells from the origin, or on a finite plate."""
    return _length(0.0, 1e3 * (10.0 * max(period) if size is None else 0.5 * max(size)))


def implausible(values: Iterable[tuple[str, str, float]], usual: Mapping[str, Bounds] = USUAL) -> list[str]:
    """A sentence for every value that is probably not what was meant.

    Args:
        values: the place to name, the place in `usual`, and the value.
        usual: bounds.
    """
    warnings = (usual[kind].warning(place, value) for place, kind, value in values if kind in usual)
    return [warning for warning in warnings if warning is not None]
