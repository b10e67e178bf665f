"""Scene: one core, its target, the law by which the material resists, and what is recorded of a shot."""

from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self, TypeAlias

from pydantic import Field, field_validator, model_validator

from .core import AnyCore, Core
from .exclusions import BENDING, MASS_PROPERTIES, check_together
from .interaction import Interaction
from .model import Model
from .target import Plate, Target
from .units import PositiveLength


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
        """Refuse records that are impossible for a core: the bending moment if it overrides its mass properties, and
        stand-offs at which it may still be in the target.

        Raises:
            ValueError: the message names the fault and what is allowed.
        """
        overridden = ("centre_of_mass", "inertia_axial", "inertia_transverse")
        given = [f"core.{name}" for name in overridden if getattr(core, name) is not None]
        check_together({BENDING: self.bending, MASS_PROPERTIES: bool(given) and given[0]})
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
