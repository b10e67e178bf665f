"""Plate: a thickness of resisting material with holes (MODEL §3, §4)."""

from typing import Annotated, Self

import numpy as np
from pydantic import Field

from .model import Array, Model
from .patterns import AnyPattern, BoolArray, NoPattern
from .units import (
    NonNegativeNumber,
    NonNegativeStress,
    Number,
    PositiveDensity,
    PositiveLength,
    PositiveTime,
)


class Plate(Model):
    """An unbounded, or with `size` a rectangular, perforated plate.

    Attributes:
        thickness: h [m].
        resistance: Y, the stress that the material puts against the core [Pa].
        shear_coefficient: η, friction per normal stress.
        degradation: β, what is left of Y after `degradation_interval` of contact; 1 means all of it.
        degradation_interval: Δt_β [s].
        degradation_length: ℓ, how far around a contact the material weakens [m].
        density: [kg/m³].
        pattern: shape and lattice of the holes.
        size: extent along y and z of a finite plate centred on the origin [m]; None is unbounded.
    """

    thickness: PositiveLength
    resistance: NonNegativeStress
    shear_coefficient: NonNegativeNumber = 0.0
    degradation: Annotated[Number, Field(ge=0, le=1)] = 1.0
    degradation_interval: PositiveTime = 1e-6
    degradation_length: PositiveLength = 0.5e-3
    density: PositiveDensity = 7850.0
    pattern: AnyPattern = NoPattern()
    size: tuple[PositiveLength, PositiveLength] | None = None

    @property
    def open_area(self) -> float:
        """Share of holes in a unit cell."""
        return self.pattern.open_area

    def is_solid(self, y: Array, z: Array) -> BoolArray:
        """Whether points y, z [m] lie on the plate and in none of its holes; bool, of their broadcast shape."""
        half_y, half_z = (0.5 * side for side in self.size or (np.inf, np.inf))
        return (np.abs(y) <= half_y) & (np.abs(z) <= half_z) & ~self.pattern.is_hole(y, z)

    @property
    def sampled_cell(self) -> tuple[float, float]:
        """Extent (y, z) of the cell that hits are spread over [m]: the unit cell, or a plate smaller than it."""
        cell_y, cell_z = self.pattern.period
        return (cell_y, cell_z) if self.size is None else (min(cell_y, self.size[0]), min(cell_z, self.size[1]))

    @property
    def solid(self) -> Self:
        """The plate without holes of the same areal density, of the same material."""
        return self.model_copy(update={"thickness": self.thickness * (1.0 - self.open_area), "pattern": NoPattern()})

    @property
    def areal_density(self) -> float:
        """Mass per area of the perforated plate, averaged over a unit cell [kg/m²]."""
        return self.density * self.thickness * (1 - self.open_area)
