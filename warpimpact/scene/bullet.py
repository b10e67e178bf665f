"""The bullet around a core: its outline, jacket and filler (docs/continuum.md)."""

from __future__ import annotations

from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator
from scipy.optimize import brentq

from .core import Core
from .flow import Flow
from .model import Array, Model
from .units import NonNegativeLength, Number, PositiveLength, PositiveMass, Title

BORE, BORE_SHARE = 0.8e-3, 0.6
"""Radius of what is empty in front of the core, as elements to the axis would be too thin [m]; at most a share of the
outline's radius there."""
LEAST_FILLER = 0.25
"""Least share that the filler has of what lies between core and outline."""
MOST_CLOSED = 0.06
"""Share by which the densities of jacket and filler may change so that they have the mass of the bullet."""
THINNEST_WALL = 0.1e-3
"""Least wall of a jacket that closes a mass [m]."""
STATIONS = 4001


class Bullet(Model):
    """A core in filler and jacket: a tangent ogive with a flat nose, then a cylinder. It has no boat-tail.

    Stations are counted from the flat nose. Behind the core, filler and jacket are a tube.

    Attributes:
        mass: of the whole bullet [kg].
        diameter: of its cylinder [m].
        crh: radius of its ogive in diameters.
        flat_radius: of the flat nose [m].
        core_place: how far the tip of the core lies behind the nose [m].
        base: how far jacket and filler reach behind the core [m].
        wall: of the jacket [m]; by default it follows from the mass. If it is given, the densities follow.
        jacket, filler: names of their materials, or constants.
    """

    mass: PositiveMass
    diameter: PositiveLength
    crh: Annotated[Number, Field(ge=0.5)]
    flat_radius: PositiveLength = 1.0e-3
    core_place: NonNegativeLength
    base: PositiveLength = 1.0e-3
    wall: PositiveLength | None = None
    jacket: Title | Flow = "jacket brass"
    filler: Title | Flow = "lead"

    @model_validator(mode="after")
    def _has_a_nose(self) -> Self:
        if not self.flat_radius < 0.5 * self.diameter:
            raise ValueError(
                f"got flat_radius = {self.flat_radius:g} m, but it must be less than half the diameter, "
                f"{0.5 * self.diameter:g} m"
            )
        return self

    @property
    def nose_length(self) -> float:
        """From the flat nose to the shoulder [m]."""
        curvature, off = self.crh * self.diameter, 0.5 * self.diameter - self.flat_radius
        return float(np.sqrt(curvature**2 - (curvature - off) ** 2))

    def length(self, core: Core) -> float:
        """From nose to base [m]."""
        return self.core_place + core.length + self.base

    def outline(self, station: Array) -> Array:
        """Outer radius at stations [m]."""
        curvature, to_shoulder = self.crh * self.diameter, np.maximum(self.nose_length - station, 0.0)
        return np.asarray(np.sqrt(curvature**2 - to_shoulder**2) - curvature + 0.5 * self.diameter)

    def radii(self, core: Core, station: Array) -> tuple[Array, Array, Array]:
        """Inner radius of the filler, that between filler and jacket, and the outer one at stations [m]."""
        outer, along = self.outline(station), np.minimum(station - self.core_place, core.length)
        radius = np.where(along >= 0.0, np.asarray(core.radius(np.maximum(along, 0.0))), 0.0)
        inner = np.maximum(radius, np.minimum(BORE, BORE_SHARE * outer))
        between = np.maximum(outer - (self.wall or 0.0), inner + LEAST_FILLER * (outer - inner))
        return inner, between, outer

    def masses(self, core: Core) -> tuple[float, float]:
        """Of filler and jacket, by the densities of their constants [kg]."""
        station = np.linspace(0.0, self.length(core), STATIONS)
        inner, between, outer = self.radii(core, station)
        filler, jacket = (np.trapezoid(np.pi * of, station) for of in (between**2 - inner**2, outer**2 - between**2))
        return float(self.flows[0].density * filler), float(self.flows[1].density * jacket)

    @property
    def flows(self) -> tuple[Flow, Flow]:
        """Constants of filler and jacket.

        Raises:
            ValueError: their names are not replaced by constants.
        """
        if not isinstance(self.jacket, Flow) or not isinstance(self.filler, Flow):
            raise ValueError("got names of the materials of jacket and filler, but their constants are needed")
        return self.filler, self.jacket

    def closed(self, core: Core) -> Bullet:
        """The bullet with a wall and with constants of jacket and filler that give it its mass.

        Raises:
            ValueError: no wall does, or the densities would change too much; or the core does not fit in.
        """
        station = np.linspace(0.0, self.length(core), STATIONS)
        if (self.outline(station) <= 1.02 * self.radii(core, station)[0]).any():
            raise ValueError("bullet: got a core that is wider than the bullet, or reaches out of its nose")
        soft, bullet = self.mass - core.mass_properties.mass, self

        def excess(wall: float) -> float:
            return sum(self.model_copy(update={"wall": wall}).masses(core)) - soft

        if self.wall is None:
            thickest = 0.5 * self.diameter
            if excess(THINNEST_WALL) * excess(thickest) > 0.0:
                low, high = sorted(1e3 * (excess(wall) + self.mass) for wall in (THINNEST_WALL, thickest))
                raise ValueError(
                    f"bullet.mass: got {1e3 * self.mass:.4g} g, but with walls of {1e3 * THINNEST_WALL:g} mm and more "
                    f"it is between {low:.4g} and {high:.4g} g"
                )
            bullet = self.model_copy(update={"wall": float(brentq(excess, THINNEST_WALL, thickest))})
        factor = soft / sum(bullet.masses(core))
        if not abs(factor - 1.0) < MOST_CLOSED:
            raise ValueError(
                f"bullet.mass: got {1e3 * self.mass:.4g} g, but core, jacket and filler have "
                f"{1e3 * (sum(bullet.masses(core)) + core.mass_properties.mass):.4g} g; leave out bullet.wall"
            )
        return bullet.scaled(factor)

    def scaled(self, factor: float) -> Bullet:
        """The bullet with densities of jacket and filler times a factor."""
        filler, jacket = (one.model_copy(update={"density": factor * one.density}) for one in self.flows)
        return self.model_copy(update={"jacket": jacket, "filler": filler})
