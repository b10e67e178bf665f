"""Target: layers of resisting material with holes, of which the plate is number 0 (docs/model.md §3, §4, §8)."""

from collections.abc import Sequence
from functools import cached_property
from itertools import accumulate
from typing import Annotated, Any, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, Field, ModelWrapValidatorHandler, field_validator, model_validator

from . import units
from .exclusions import AREAL_DENSITY, BY_PATH, BY_TIME, THICKNESS, check_together
from .geometry import BoolArray
from .model import Array, Model
from .pattern import NoPattern
from .shapes import AnyPattern
from .units import Length

INTERVAL = 1.0e-6
"""Default of Δt_β if Δs_β is not given [s], as in the paper's rows (docs/model.md §4)."""

BULGE = 5.0e-3
"""How far a layer bulges towards the next one while a core passes it [m]; 3.5 to 4.0 mm at layers of 4 mm of steel, by
finite elements."""


class _Weight(BaseModel):
    areal_density: units.PositiveArealDensity


class Plate(Model):
    """A perforated plate. It is unbounded, or rectangular if `size` is given.

    Attributes:
        thickness: thickness h of the material, along x [m].
        areal_density: mass per area of the plate with its holes [kg/m²], in place of the thickness.
        resistance: Y, the stress of the material against the core [Pa].
        shear_coefficient: η, friction per normal stress.
        degradation: β, share of Y that remains after contact for `degradation_interval` or over
            `degradation_distance`, through the whole thickness; with 1 the material does not weaken.
        degradation_interval: Δt_β [s], by default 1 us; None if exposure counts the path.
        degradation_distance: Δs_β, a path of the centre of mass [m]; None if exposure counts the time. By path, the law
            has no rate: outcomes depend on Y/v² alone.
        degradation_length: ℓ, distance from a contact in the plane of the plate within which the material weakens [m].
        density: of the material [kg/m³].
        material: name in the catalogue. In a file it gives resistance, shear_coefficient and density, and the law of
            [interaction]; a key beside it overrides its value. In Python it is a name alone: `catalogue.plate` gives
            the plate of a material.
        size: extent along y and z of a finite plate centred on the origin [m]; without it the plate is unbounded.
        pattern: shape and lattice of the holes; the rim cuts holes.
    """

    thickness: units.PositiveLength
    resistance: units.NonNegativeStress
    shear_coefficient: units.NonNegativeNumber = 0.0
    degradation: Annotated[units.Number, Field(ge=0, le=1)] = 1.0
    degradation_interval: units.PositiveTime | None = None
    degradation_distance: units.PositiveLength | None = None
    degradation_length: units.PositiveLength = 0.5e-3
    density: units.PositiveDensity = 7850.0
    material: units.Title | None = None
    size: tuple[units.PositiveLength, units.PositiveLength] | None = None
    pattern: AnyPattern = NoPattern()

    @model_validator(mode="wrap")
    @classmethod
    def _completed(cls, values: Any, read: ModelWrapValidatorHandler[Self]) -> Self:
        """Read the keys that stand for others: an areal density, and the default of the exposure."""
        if not isinstance(values, dict):
            return read(values)
        given = {BY_TIME: "degradation_interval", BY_PATH: "degradation_distance", AREAL_DENSITY: "areal_density"}
        used: dict[str, str | bool] = {option: values.get(key) is not None for option, key in given.items()}
        check_together({THICKNESS: "thickness" in values, **used})
        if not used[BY_TIME] and not used[BY_PATH]:
            values = values | {"degradation_interval": INTERVAL}
        if not used[AREAL_DENSITY]:
            return read(values)
        rest = {name: value for name, value in values.items() if name != "areal_density"}
        weight = _Weight(areal_density=values["areal_density"]).areal_density
        plate = read(rest | {"thickness": 1.0})
        object.__setattr__(plate, "thickness", weight / plate.areal_density)  # which was that of 1 m
        return plate

    @model_validator(mode="after")
    def _lists_whole_holes(self) -> Self:
        """Refuse a hole that the rim cuts and that the next cell of listed holes brings in at the opposite rim."""
        if self.size is not None and self.pattern.is_listed:
            cell, size = np.array(self.pattern.period), np.array(self.size)
            beyond = self.pattern.farthest - 0.5 * cell > 0.5 * np.abs(cell - size) + 1e-9 * cell
            if (beyond & (size <= cell * (1.0 + 1e-9))).any():
                raise ValueError(
                    "got a hole that crosses the edge of a cell as large as the plate, and comes in again at the "
                    "opposite rim; give plate.pattern a larger spacing"
                )
        return self

    @classmethod
    def _keys(cls) -> list[str]:
        return [*super()._keys(), "areal_density"]

    @property
    def degradation_unit(self) -> float:
        """Exposure over which β applies once: Δt_β [s], or Δs_β [m]."""
        return self.degradation_distance or self.degradation_interval or INTERVAL

    @property
    def open_area(self) -> float:
        """Share of holes in a unit cell."""
        return self.pattern.open_area

    @cached_property
    def ligament(self) -> float:
        """Smallest distance between two holes, or between a whole hole and the rim [m]; inf without holes."""
        return self.pattern.ligament(self.size)

    def is_solid(self, y: Array, z: Array) -> BoolArray:
        """Whether points y, z [m] lie on the plate and outside its holes, in their broadcast shape."""
        half_y, half_z = (0.5 * side for side in self.size or (np.inf, np.inf))
        return (np.abs(y) <= half_y) & (np.abs(z) <= half_z) & ~self.pattern.is_hole(y, z)

    def edge_distance(self, y: Array, z: Array) -> Array:
        """Distance of points y, z [m] from the nearest edge of a hole or of the plate, in their broadcast shape:
        positive in material, negative in a hole and off the plate, NaN without an edge."""
        of_holes = self.pattern.edge_distance(y, z)
        if self.size is None:
            return np.where(np.isinf(of_holes), np.nan, of_holes)
        beyond_y, beyond_z = np.abs(y) - 0.5 * self.size[0], np.abs(z) - 0.5 * self.size[1]
        off = np.hypot(np.maximum(beyond_y, 0.0), np.maximum(beyond_z, 0.0))
        return np.where(off > 0.0, -off, np.minimum(of_holes, -np.maximum(beyond_y, beyond_z)))

    @property
    def sampled_cell(self) -> tuple[float, float]:
        """Extent (y, z) of the cell that hits cover [m]: the unit cell, or a smaller plate."""
        cell_y, cell_z = self.pattern.period
        return (cell_y, cell_z) if self.size is None else (min(cell_y, self.size[0]), min(cell_z, self.size[1]))

    @property
    def solid(self) -> Self:
        """The plate without holes, with the same material and areal density."""
        thickness = self.thickness * (1.0 - self.open_area)
        return self.model_copy(update={"thickness": thickness, "pattern": NoPattern()})

    @property
    def areal_density(self) -> float:
        """Mass per area of the perforated plate [kg/m²]: in a unit cell."""
        return self.density * self.thickness * (1 - self.open_area)


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
                f"got gap = {front.gap:g} m or an offset of the first layer, but it starts at 0: give a Plate"
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

    def touching_layers(self, layers: int | None = None) -> str:
        """A sentence where some of the first layers may touch by finite elements."""
        gaps = self.gaps[1:layers]
        if not gaps or min(gaps) >= BULGE:
            return ""
        return (
            f"a gap of {1e3 * min(gaps):.3g} mm closes when a layer bulges, by up to {1e3 * BULGE:.0f} mm; no "
            "published shot tested the contact of layers by finite elements"
        )

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
        fronts = self.fronts(thickness)
        return np.stack([fronts, np.add(fronts, thickness)], axis=1)

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
        solid = [layer.solid for layer in self.add_on]
        return type(self)(layers=(*solid, *self.layers[len(solid) :]))

    @property
    def base_alone(self) -> Self:
        """The base at its place without the other layers."""
        return type(self)(layers=(Plate(**{name: getattr(self.layers[-1], name) for name in Plate.model_fields}),))
