"""Scene: one core, its target, how the material resists, and what is recorded of a shot."""

from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self, TypeAlias

from pydantic import Field, field_validator, model_validator

from .core import AnyCore, Core
from .interaction import Interaction
from .model import Model
from .plate import Plate
from .target import Target
from .units import PositiveLength


class Record(Model):
    """What is recorded of every shot beside how it ended.

    Attributes:
        standoffs: distances behind the rear face of the target at which the attitude is reported [m], increasing.
        standoff_point: the point of the core that passes them.
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

    def check_bending(self, core: Core) -> None:
        """Refuse to record the bending moment of a core that overrides its mass properties, and a strength without it.

        Raises:
            ValueError: names what the core overrides.
        """
        overridden = ("centre_of_mass", "inertia_axial", "inertia_transverse")
        given = [name for name in overridden if getattr(core, name) is not None]
        if core.strength is not None and not self.bending:
            raise ValueError(
                f"got core.strength without {self._name}.bending = true, but a core breaks by its bending stress"
            )
        if self.bending and given:
            raise ValueError(
                f"got bending = true beside core.{given[0]}, but a bending moment needs the mass of every slice, which "
                "follows from the shape alone"
            )

    def check_standoffs(self, core: Core) -> None:
        """Refuse stand-offs at which a core may still be in the target.

        Raises:
            ValueError: names the first stand-off and the least that is allowed.
        """
        needed = core.bounding_radius
        if self.standoff_point == "nose":
            needed += core.mass_properties.centre_of_mass
        if self.standoffs and self.standoffs[0] < needed:
            raise ValueError(
                f"got {self._name}.standoffs of {self.standoffs[0]:g} m, "
                f"but a core of this size is certain to be out of the target only from {needed:.4g} m"
            )

    @property
    def _name(self) -> str:
        """Name of the field that holds this record."""
        return type(self).__name__.lower()


if TYPE_CHECKING:
    AnyTarget: TypeAlias = Target | Any  # what a scene holds, or what it takes, a plate above all
else:
    AnyTarget = Target


class Scene(Model):
    """What is shot at what, and what is recorded. Outcomes depend on the scene, the shots and the numerics only.

    Attributes:
        core: the rigid core.
        target: what it is shot at; a plate is accepted, too.
        interaction: stress on the surface of the core.
        record: what is recorded of every shot.
    """

    core: AnyCore
    target: AnyTarget
    interaction: Interaction = Interaction()
    record: Record = Record()

    @field_validator("target", mode="before")
    @classmethod
    def _of_a_plate(cls, target: Any) -> Any:
        return Target(plate=target) if isinstance(target, Plate) else target

    @model_validator(mode="after")
    def _record_is_possible(self) -> Self:
        self.record.check_bending(self.core)
        self.record.check_standoffs(self.core)
        return self
