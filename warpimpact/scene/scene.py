"""Scene: one core, its target, how the material resists (docs/model.md §4), and what is recorded of a shot."""

from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self, TypeAlias

import numpy as np
from pydantic import Field, field_validator, model_validator

from .core import AnyCore, Core
from .exclusions import BENDING, MASS_PROPERTIES, STRENGTH, check_together
from .model import Model
from .target import Plate, Target
from .units import NonNegativeNumber, PositiveLength, PositiveNumber


class FreeSurface(Model):
    """How material near a face or an edge resists less, and steep surfaces are pressed harder (docs/model.md §4.9).

    r is the radius of the core at a surface element, H the thickness of the layer. The numbers were fitted to finite
    elements without friction and weakening, with `quadratic` = 1 beside them (docs/continuum.md).

    Attributes:
        reach: λ; A·Y is divided by 1 + r / λH.
        attack: c; c·A·Y·sin α is added, α the angle between the surface and the velocity of the core.
        cover: k; the element presses by 1 − exp(−k b / r), b the length of material ahead of it along its normal in the
            plane of the layer.
        carried: s; of the material behind the element, which the core pushes ahead of itself, this share adds to b.
        gap: t; of the distance from there to an element in a hole, this share is taken off.
    """

    reach: PositiveNumber = 1.0
    attack: NonNegativeNumber = 1.45
    cover: PositiveNumber = 1.7
    carried: NonNegativeNumber = 0.35
    gap: NonNegativeNumber = 0.05


class Interaction(Model):
    """σ = static·Y + linear·√(ρY)·v_n + quadratic·ρ·v_n², v_n the normal speed of the element.

    The default is the paper's constant stress Y; (A, 0, B) is Poncelet's law, (A, C, B) the three-term
    law of spherical cavity expansion.

    Attributes:
        static: A, share of the resistance Y.
        linear: C, of √(ρY)·v_n.
        quadratic: B, of ρ·v_n².
        onset: κ, closing speed over which contact sets in, as a share of the speed v of the centre of mass. Normal
            stress, friction and exposure are multiplied by min(1, v_n / (κ v)). With 0 contact sets in at once; the
            outcome of a wall with friction that slides along itself, such as a shank, then depends on the numerics.
        free_surface: how material near faces and edges resists less; without it, it does not.
    """

    static: NonNegativeNumber = 1.0
    linear: NonNegativeNumber = 0.0
    quadratic: NonNegativeNumber = 0.0
    onset: NonNegativeNumber = 0.005
    free_surface: FreeSurface | None = None


NEAR_EDGES = Interaction(quadratic=1.0, free_surface=FreeSurface())
"""The law with free surfaces as it was fitted, with the inertia of what is pushed aside."""


def coefficients(static: Any, linear: Any, quadratic: Any, resistance: Any, density: float) -> tuple[Any, Any, Any]:
    """(a0 [Pa], a1 [Pa s/m], a2 [Pa s²/m²]) of σ = a0 + a1·v_n + a2·v_n² in undegraded material, from A, C, B, Y [Pa]
    and ρ [kg/m³]. All but the density may be arrays of shapes that broadcast."""
    return static * resistance, linear * np.sqrt(density * resistance), quadratic * density


class Record(Model):
    """Additional records of every shot.

    Attributes:
        standoffs: distances behind the rear face of the target at which the attitude is reported [m], increasing.
        standoff_point: point of the core at which stand-offs are measured.
        bending: whether the largest bending moment and stress of each core are reported.
    """

    standoffs: Annotated[tuple[PositiveLength, ...], Field(fail_fast=True, max_length=64)] = ()
    standoff_point: Literal["centre_of_mass", "nose"] = "centre_of_mass"
    bending: Annotated[bool, Field(strict=True)] = False

    @field_validator("standoffs")
    @classmethod
    def _increase(cls, standoffs: tuple[float, ...]) -> tuple[float, ...]:
        for before, after in pairwise(standoffs):
            if after <= before:
                raise ValueError(f"got {after:g} m after {before:g} m, but stand-offs must increase")
        return standoffs

    def ahead(self, core: Core) -> float:
        """Distance of the stand-off point ahead of the centre of mass [m]."""
        return core.mass_properties.centre_of_mass if self.standoff_point == "nose" else 0.0

    def check(self, core: Core) -> None:
        """Refuse records that are impossible for a core: the bending moment if it overrides its mass properties, a
        strength without it, and stand-offs at which it may still be in the target.

        Raises:
            ValueError: the message names the fault and what is allowed.
        """
        overridden = ("centre_of_mass", "inertia_axial", "inertia_transverse")
        given = [f"core.{name}" for name in overridden if getattr(core, name) is not None]
        strength = core.strength is not None
        check_together({BENDING: self.bending, STRENGTH: strength, MASS_PROPERTIES: bool(given) and given[0]})
        needed = core.bounding_radius + self.ahead(core)
        first = min(self.standoffs, default=needed)
        if first < needed:
            raise ValueError(
                f"got {type(self).__name__.lower()}.standoffs of {first:g} m, "
                f"but a core of this size is certain to be out of the target only from {needed:.4g} m"
            )


if TYPE_CHECKING:
    AnyTarget: TypeAlias = Target | Any  # what a scene holds, or what it takes: a plate, or layers
else:
    AnyTarget = Target


class Scene(Model):
    """Core, target and records. Outcomes depend on the scene, the shots and the numerics only.

    Attributes:
        core: the rigid core.
        target: the layers; a plate or a tuple of layers is also accepted.
        interaction: stress on the surface of the core.
        record: additional records of every shot.
    """

    core: AnyCore
    target: AnyTarget
    interaction: Interaction = Interaction()
    record: Record = Record()

    @field_validator("target", mode="before")
    @classmethod
    def _of_layers(cls, target: Any) -> Any:
        if isinstance(target, Plate):
            return Target(layers=(target,))
        return Target(layers=target) if isinstance(target, tuple | list) else target

    @model_validator(mode="after")
    def _record_is_possible(self) -> Self:
        self.record.check(self.core)
        return self
