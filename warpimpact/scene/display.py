"""Units: how a result stores a quantity, and how every text and figure shows it."""

from dataclasses import dataclass

MM = 1e3
"""Millimetres in a metre."""


@dataclass(frozen=True)
class Unit:
    """How a result stores a quantity, and how people see it.

    Attributes:
        stored: unit in the form of the CF conventions.
        shown: unit as people write it.
        factor: factor from the stored to the shown value.
    """

    stored: str
    shown: str
    factor: float = 1.0

    @property
    def suffix(self) -> str:
        """The unit behind a number."""
        return self.shown if self.shown in ("", "°") else f" {self.shown}"

    def text(self, value: float, form: str = "g") -> str:
        """A stored value with its unit."""
        return f"{self.factor * value:{form}}{self.suffix}"


UNITS = {
    "": Unit("1", ""),
    "m": Unit("m", "mm", 1e3),
    "kg": Unit("kg", "g", 1e3),
    "s": Unit("s", "µs", 1e6),
    "Pa": Unit("Pa", "GPa", 1e-9),
    "N m": Unit("N m", "N m"),
    "J": Unit("J", "J"),
    "kg m^2": Unit("kg m2", "kg m²"),
    "kg/m^3": Unit("kg m-3", "kg/m³"),
    "kg/m^2": Unit("kg m-2", "kg/m²"),
    "J/m^2": Unit("J m-2", "J/mm²", 1e-6),
    "m/s": Unit("m s-1", "m/s"),
    "rad": Unit("degree", "°"),
    "rad/s": Unit("rad s-1", "rad/s"),
}
"""Units by the SI unit in which a quantity is computed."""
STORED = {unit.stored: unit for unit in UNITS.values()}
"""Units by the unit in a result."""
