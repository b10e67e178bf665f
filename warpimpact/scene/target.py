"""Target: layers, of which the plate is number 0 (docs/model.md §8)."""

from collections.abc import Sequence
from itertools import accumulate
from typing import Annotated, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, field_validator

from .model import Array, Model
from .plate import Plate
from .units import Length

_WIDEST_GAP = 10.0
"""Largest gap [m]: within it positions are exact to a micrometre. Air has no effect on the core."""
MOST_LAYERS = 64
"""Largest number of layers behind the plate."""


def layer_name(number: int) -> str:
    """The name of a layer: number 0 is the plate, the first table [[layer]] is "layer 1"."""
    return f"layer {number}" if number else "plate"


class Layer(Plate):
    """A plate behind another one: a base armour, a second perforated plate, a liner.

    Attributes:
        gap: air in front of it [m]; 0 is a laminate.
        offset: place (y, z) of its origin, and so of its pattern and its rim, in the plane of the plate [m].
    """

    gap: Annotated[Length, Field(ge=0, le=_WIDEST_GAP)] = 0.0
    offset: tuple[Length, Length] = (0.0, 0.0)


class Target(Model):
    """The layers that are shot at, front to back. Only the core couples them.

    Attributes:
        layers: the plate, whose front face is at x = 0, and the layers behind it. A `Plate` behind another layer
    touches it."""

    layers: Annotated[tuple[Plate | Layer, ...], Field(fail_fast=True, min_length=1, max_length=1 + MOST_LAYERS)]

    @field_validator("layers")
    @classmethod
    def _begins_at_the_origin(cls, layers: tuple[Plate, ...]) -> tuple[Plate, ...]:
        if isinstance(front := layers[0], Layer) and (front.gap, *front.offset) != (0.0, 0.0, 0.0):
            raise ValueError(
                f"got gap = {front.gap:g} m and offset = {front.offset} m of the first layer, but it has its front "
                "face and its origin at 0: give a Plate"
            )
        return layers

    @property
    def named(self) -> list[tuple[str, Plate]]:
        """The layers in order, each with its name."""
        return [(layer_name(k), layer) for k, layer in enumerate(self.layers)]

    @property
    def gaps(self) -> tuple[float, ...]:
        """Air in front of each layer [m]."""
        return tuple(layer.gap if isinstance(layer, Layer) else 0.0 for layer in self.layers)

    def value(self, name: str, layer: int) -> float:
        """A quantity of a layer by its name in `Scatter`."""
        plate = self.layers[layer]
        if name.startswith("offset"):
            return plate.offset["yz".index(name[-1])] if isinstance(plate, Layer) else 0.0
        return float(getattr(plate, name))

    def fronts(self, thickness: Sequence[Array]) -> list[Array]:
        """Front faces of all layers [m] for these thicknesses [m]; the shapes are those of the thicknesses."""
        behind = zip(thickness[:-1], self.gaps[1:], strict=True)
        return list(accumulate((h + gap for h, gap in behind), initial=np.zeros_like(thickness[0])))

    @property
    def faces(self) -> NDArray[np.float64]:
        """Front and rear faces of all layers [m], shape [layers, 2]."""
        thickness = [np.array(layer.thickness) for layer in self.layers]
        fronts = np.array(self.fronts(thickness))
        return np.stack([fronts, fronts + np.array(thickness)], axis=1)

    @property
    def depth(self) -> float:
        """Distance from the front face to the rear face of the last layer, gaps included [m]."""
        return float(self.faces[-1, 1])

    @property
    def areal_density(self) -> float:
        """Mass per area of all layers [kg/m²]."""
        return sum(layer.areal_density for layer in self.layers)

    @property
    def add_on(self) -> tuple[Plate, ...]:
        """The layers in front of the base, which is the last of several layers. A plate alone is its own add-on."""
        return self.layers[:-1] or self.layers

    @property
    def weights(self) -> dict[str, float]:
        """Masses per area [kg/m²] that texts and figures distinguish, by their names there."""
        if len(self.layers) == 1:
            return {"areal density": self.areal_density}
        add_on = sum(layer.areal_density for layer in self.add_on)
        return {"add-on": add_on, "base": self.layers[-1].areal_density, "whole target": self.areal_density}

    @property
    def solid(self) -> Self:
        """The target whose add-on, or whose plate if it stands alone, has no holes, the same materials and the same
        weight."""
        solid = tuple(layer.solid for layer in self.add_on)
        return self.model_copy(update={"layers": (*solid, *self.layers[len(solid) :])})

    @property
    def base_alone(self) -> Self:
        """The base at its place without the other layers."""
        base = Plate(**{name: getattr(self.layers[-1], name) for name in Plate.model_fields})
        return self.model_copy(update={"layers": (base,)})
