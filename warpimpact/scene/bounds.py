"""Usual and possible ranges of quantities, which a wrong unit usually leaves."""

import math
from typing import NamedTuple

from .display import UNITS


class Implausible(UserWarning):
    """A possible value that is probably a mistake."""


class Bounds(NamedTuple):
    """Usual range of a quantity in SI or radians, outside which there is a warning, and its possible range.

    Attributes:
        low, high: usual range.
        unit: SI unit.
        meant: units that may have been left out, with the factor from the value read to the value meant.
        least, most: possible range, outside which a value is refused.
        why: reason for the possible range.
    """

    low: float
    high: float
    unit: str
    meant: tuple[tuple[str, float], ...] = ()
    least: float = 0.0
    most: float = math.inf
    why: str = ""

    def warning(self, place: str, value: float) -> str | None:
        """A sentence about an unusual value, None for a usual one; zero is usual."""
        return self._beyond(place, value, (self.low, self.high), "usual")

    def refusal(self, place: str, value: float) -> str | None:
        """A sentence about an impossible value, None for a possible one; zero is possible."""
        return self._beyond(place, value, (self.least, self.most), f"allowed: {self.why}")

    def _beyond(self, place: str, value: float, ends: tuple[float, float], what: str) -> str | None:
        if value == 0.0 or ends[0] <= abs(value) <= ends[1]:
            return None
        read = self._shown(value) if self.unit == "rad" else f"{value:g} {self.unit}".rstrip()
        least = f"{ends[0] * UNITS[self.unit].factor:g}" if ends[0] else "up"
        return f"{place}: read as {read}, but {least} to {self._shown(ends[1])} is {what}{self._slip(place, value)}"

    def _slip(self, place: str, value: float) -> str:
        """What was probably meant."""
        advice = "but a hit list is in SI" if place.startswith("hits.file") else "which needs its unit"
        for unit, factor in self.meant:
            if self.low <= abs(value) * factor <= self.high:
                return f'; "{value:g} {unit}" was probably meant, {advice}'
        return ""

    def _shown(self, value: float) -> str:
        return UNITS[self.unit].text(math.degrees(value) if self.unit == "rad" else value)


_MM, _DEG = 1e-3, math.radians(1.0)
_LENGTHS = (("mm", 1e-3), ("cm", 1e-2), ("um", 1e-6))
_STRESSES, _DENSITIES = (("MPa", 1e6), ("GPa", 1e9)), (("g/cm^3", 1e3),)
_OF_MATTER = "metals have up to 22,600 kg/m^3, and foams from 10 on"


def _length(low: float, high: float, most: float = math.inf, why: str = "") -> Bounds:
    """Bounds given in millimetres."""
    return Bounds(low * _MM, high * _MM, "m", _LENGTHS, 0.0, most * _MM, why)


USUAL = {
    "core.length": _length(2.0, 300.0, 1_000.0, "the longest rods that guns fire are shorter"),
    "core.diameter": _length(1.0, 60.0, 1_000.0, "no gun has a larger bore"),
    "core.mass": Bounds(5e-5, 1.0, "kg", (("g", 1e-3), ("mg", 1e-6))),
    "core.density": Bounds(500.0, 25_000.0, "kg/m^3", _DENSITIES, 10.0, 25_000.0, _OF_MATTER),
    "core.mean_density": Bounds(1_000.0, 25_000.0, "kg/m^3", (), 10.0, 25_000.0, _OF_MATTER),
    "plate.thickness": _length(0.1, 200.0, 1_000.0, "no bullet goes through a metre of anything"),
    "plate.size": _length(5.0, 20_000.0, 50_000.0, "no plate is larger; an unbounded one has no size"),
    "plate.resistance": Bounds(
        1e7, 2e10, "Pa", _STRESSES, 2e4, 2e11, "gelatine resists more than the least, and diamond less than the most"
    ),
    "plate.shear_coefficient": Bounds(0.0, 1.0, ""),
    "plate.degradation_interval": Bounds(
        1e-9, 1e-3, "s", (("us", 1e-6), ("ns", 1e-9)), most=0.1, why="any passage is over by then"
    ),
    "plate.degradation_length": _length(0.01, 20.0, 100.0, "a core weakens a plate about itself"),
    "plate.density": Bounds(500.0, 25_000.0, "kg/m^3", _DENSITIES, 10.0, 25_000.0, _OF_MATTER),
    "plate.pattern.cell": _length(0.5, 500.0, 2_000.0, "a plate with its holes as far apart is a solid one to a core"),
    "plate.pattern.rotation": Bounds(0.0, 360.0 * _DEG, "rad", most=360.0 * _DEG, why="a turn has 360 deg"),
    "layer.gap": _length(0.05, 3_000.0),
    "impact.velocity": Bounds(
        20.0, 3000.0, "m/s", (("km/s", 1e3),), 1.0, 10_000.0, "a fall from 5 cm is faster, and no gun is as fast"
    ),
    "impact.azimuth": Bounds(0.0, 360.0 * _DEG, "rad"),
    "impact.pitch": Bounds(0.0, 60.0 * _DEG, "rad"),
    "impact.yaw": Bounds(0.0, 60.0 * _DEG, "rad"),
    "impact.spin": Bounds(0.0, 1e5, "rad/s", most=1e6, why="a core would burst"),
    "output.standoffs": _length(5.0, 100_000.0, 1_000_000.0, "nothing behind a target is as far"),
}
"""Bounds by the place in a campaign. Most quantities have no smallest possible value, since foils, slow cores and
shallow depths may be studied. Listed hits may lie anywhere, since a pattern repeats."""


def hit_bounds(period: tuple[float, float], size: tuple[float, float] | None) -> Bounds:
    """Usual coordinates of listed hits [m]: within a few cells from the origin, or on a finite plate."""
    return _length(0.0, 1e3 * (10.0 * max(period) if size is None else 0.5 * max(size)))
