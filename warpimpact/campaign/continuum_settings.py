"""The table [continuum] of a campaign: materials, friction and fineness of its hits by finite elements."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, ValidationInfo, field_validator

from ..catalogue.catalogue import FlowEntry, flow_entry, flow_names
from ..scene.flow import Continuum
from ..scene.input_files import input_file
from ..scene.model import Model
from ..scene.target import MOST_LAYERS
from ..scene.units import Number, PositiveLength, Title


class FiniteElements(Model):
    """How `warpimpact continuum` computes the hits of a campaign; its options come before this table.

    Attributes:
        materials: of the layers, the plate first: names of the continuum's catalogue, or TOML files with a set of
            constants each. One serves all layers; without any, the name of the plate's material counts.
        friction: Coulomb's coefficient between core and target, which nobody has measured at these speeds.
        fidelity: size of the elements: "draft", "standard" or "reference".
        spacing: size of the elements [m], in place of a fidelity.
    """

    materials: Annotated[tuple[Title, ...], Field(fail_fast=True, max_length=MOST_LAYERS + 1)] = ()
    friction: Annotated[Number, Field(ge=0, le=1)] = 0.0
    fidelity: Literal["draft", "standard", "reference"] = "draft"
    spacing: PositiveLength | None = None

    @field_validator("materials")
    @classmethod
    def _are_known(cls, names: tuple[str, ...], info: ValidationInfo) -> tuple[str, ...]:
        """Check that every name is in the catalogue, or is a file with a set of constants, whose path becomes
        absolute."""
        paths = tuple(str(input_file(name, info)) if name.endswith(".toml") else name for name in names)
        for name in paths:
            flow_entry(name)
        return paths

    @property
    def entries(self) -> list[FlowEntry]:
        """Entries of the materials.

        Raises:
            ValueError: there are none.
        """
        if not self.materials:
            raise ValueError(
                f"the continuum needs a material: give continuum.materials or --material with one of "
                f"{', '.join(flow_names())}, or a TOML file"
            )
        return [flow_entry(name) for name in self.materials]

    @property
    def solver(self) -> Continuum:
        """These settings for `simulate`, in place of its numerics.

        Raises:
            ValueError: as `entries`.
        """
        given = {"friction": self.friction, "fidelity": self.fidelity, "spacing": self.spacing}
        return Continuum.model_validate({"flows": tuple(entry.flow for entry in self.entries)} | given)

    @property
    def words(self) -> str:
        """The settings in words."""
        size = self.fidelity if self.spacing is None else f"{1e3 * self.spacing:.4g} mm"
        return f"finite elements, {size}, friction {self.friction:g}, {', '.join(e.name for e in self.entries)}"
