"""Target: the plate and the layers behind it (docs/model.md §8)."""

from itertools import accumulate
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, field_validator

from .model import Array, Model
from .plate import Plate
from .units import Length

_WIDEST_GAP = 10.0
"""[m]. Positions are exact to a micrometre within such a gap, and air is left out."""
MOST_LAYERS = 64


class Layer(Plate):
    """A plate behind another one: a base armour, a second perforated plate, a liner.

    Attributes:
        gap: air in front of it [m]; 0 is a laminate.
        offset: place (y, z) of its origin, and so of its pattern and its rim, in the plane of the plate [m].
    """

    gap: Annotated[Length, Field(ge=0, le=_WIDEST_GAP)] = 0.0
    offset: tuple[Length, Length] = (0.0, 0.0)


def value_in(plate: Plate, name: str) -> float:
    """A quantity of a layer by the name that it scatters under; a plate in front has no offset."""
    if name.startswith("offset"):
        return plate.offset["yz".index(name[-1])] if isinstance(plate, Layer) else 0.0
    return float(getattr(plate, name))


class Target(Model):
    """What is shot at. Nothing couples its layers but the core.

    Attributes:
        plate: the plate, with its front face at x = 0.
        layers: what stands behind it, in order.
    """

    plate: Plate
    layers: Annotated[tuple[Layer, ...], Field(fail_fast=True, max_length=MOST_LAYERS)] = ()

    @field_validator("plate")
    @classmethod
    def _stands_in_front(cls, plate: Plate) -> Plate:
        if isinstance(plate, Layer):
            raise ValueError("got a Layer, but what stands in front is a Plate")
        return plate

    @property
    def plates(self) -> tuple[Plate, ...]:
        """Everything in order: layer 0 is the plate."""
        return (self.plate, *self.layers)

    @property
    def named(self) -> list[tuple[str, Plate]]:
        """Everything in order, with its place in a campaign."""
        return [("plate", self.plate), *((f"layer[{k}]", layer) for k, layer in enumerate(self.layers))]

    def fronts(self, thickness: list[Array]) -> list[Array]:
        """Front faces of all layers [m], if their thicknesses [m] are these, of their shapes."""
        behind = zip(thickness[:-1], self.layers, strict=True)
        return list(accumulate((h + layer.gap for h, layer in behind), initial=np.zeros_like(thickness[0])))

    @property
    def faces(self) -> NDArray[np.float64]:
        """Front and rear faces of all layers [m], shape [layers, 2]."""
        thickness = [np.array(plate.thickness) for plate in self.plates]
        fronts = np.array(self.fronts(thickness))
        return np.stack([fronts, fronts + np.array(thickness)], axis=1)

    @property
    def depth(self) -> float:
        """From the front face to the rear face of the last layer, gaps included [m]."""
        return float(self.faces[-1, 1])

    @property
    def areal_density(self) -> float:
        """Mass per area of all layers [kg/m²]."""
        return sum(plate.areal_density for plate in self.plates)

    @property
    def solid(self) -> Plate:
        """One plate without holes, of the material of the plate and of the areal density of all layers."""
        solid = self.plate.solid
        behind = sum(layer.areal_density for layer in self.layers)
        return solid.model_copy(update={"thickness": solid.thickness + behind / solid.density}) if behind else solid
