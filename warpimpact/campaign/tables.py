"""The tables of a campaign that are not of its scene: [output], [stop] and [continuum]."""

import json
from typing import Annotated, Literal

from pydantic import Field, ValidationInfo, ValidatorFunctionWrapHandler, field_serializer, field_validator

from warpimpact.continuum.finite_elements import FiniteElements, FiniteElementSettings
from warpimpact.measures.measure import Measure

from ..catalogue.catalogue import FlowEntry, flow_entry
from ..scene import Record
from ..scene.bullet import Bullet
from ..scene.flow import Flow
from ..scene.input_files import input_file
from ..scene.model import Model
from ..scene.target import MOST_LAYERS, layer_name
from ..scene.units import Number, PositiveLength, Radians, Title, Whole, in_radians, quoted


class Output(Record):
    """What is reported: the records of every shot, with at least one stand-off, and what a run adds.

    Attributes:
        failed_share: share of shots whose computation may fail; a run with more ends with exit code 3.
        solid_reference: compute some hits of its references, too (`Campaign.references`), into groups of the file.
        exit_state: store velocity, axis and position of every core at the end of contact.
    """

    standoffs: Annotated[tuple[PositiveLength, ...], Field(fail_fast=True, max_length=64)] = (0.05, 0.13)
    failed_share: Annotated[Number, Field(ge=0, le=1)] = 0.01
    solid_reference: Annotated[bool, Field(strict=True)] = True
    exit_state: Annotated[bool, Field(strict=True)] = True


class Stop(Model):
    """When a run ends: as soon as a confidence interval is narrow enough.

    Attributes:
        quantity: a measure with an interval, such as `mean(residual_velocity)`, `quantile(tilt@130mm, 0.05)`,
            `worst_tenth(residual_energy_density@130mm)` or `P(perforated)`.
        half_width: largest half width of the interval, SI; that of an angle is given in degrees or with its unit.
        confidence: of the interval.
        max_count: number of shots after which the run ends in any case.
    """

    quantity: str
    half_width: Annotated[float, Field(json_schema_extra={"type": ["number", "string"]})]
    confidence: Annotated[Number, Field(gt=0, lt=1)] = 0.95
    max_count: Annotated[Whole, Field(ge=1, le=2**30)]

    @field_validator("quantity")
    @classmethod
    def _is_a_measure(cls, text: str) -> str:
        measure = Measure.parse(text)
        if measure.is_limit:
            raise ValueError(f"got {quoted(text)}, which warpimpact limit computes, and it takes no [stop]")
        if not measure.has_interval:
            raise ValueError(f"got {quoted(text)}, but a run cannot stop by a number without an interval")
        return text

    @field_validator("half_width", mode="wrap")
    @classmethod
    def _in_si(cls, value: object, _: ValidatorFunctionWrapHandler, info: ValidationInfo) -> float:
        if "quantity" not in info.data:
            raise ValueError(f"got {quoted(value)}, but it needs a valid stop.quantity")
        number = Measure.parse(info.data["quantity"]).in_units(value)
        if number <= 0.0:
            raise ValueError(f"got {quoted(value)}, but it must be greater than 0")
        return number

    @field_serializer("half_width", when_used="json")
    def _as_read(self, value: float) -> float | str:
        return in_radians(value) if isinstance(value, Radians) else value

    @property
    def measure(self) -> Measure:
        """The measure that the quantity names."""
        return Measure.parse(self.quantity)


class ContinuumTable(FiniteElementSettings):
    """The table [continuum]: how hits are computed by finite elements; options of `warpimpact continuum` come first.

    Attributes:
        materials: of the layers, the plate first: names of the continuum's catalogue, or TOML files with a set of
            constants each. One serves all layers; without any, the name of the plate's material counts.
        friction: as in `FiniteElementSettings`; without it, the largest that constants of the materials were made with.
        bullet: "core", the bare core, or "whole", the bullet of the campaign, which `continuum_table` puts in its
            place; by default the whole bullet where the campaign has one.
        core: "rigid", or "deformable", in whose place `continuum_table` puts the constants of CORE_STEEL; by default
            cores of steel deform in whole bullets, unless `output.bending` is recorded.
        hits: number of hits that correct the map of `warpimpact run`; without it, none do.
    """

    materials: Annotated[tuple[Title, ...], Field(fail_fast=True, max_length=MOST_LAYERS + 1)] = ()
    bullet: Literal["core", "whole"] | Bullet | None = None
    core: Literal["rigid", "deformable"] | Flow | None = None
    hits: Annotated[Whole, Field(ge=1, le=2**16)] | None = None

    @field_validator("materials")
    @classmethod
    def _are_known(cls, names: tuple[str, ...], info: ValidationInfo) -> tuple[str, ...]:
        """Check that every name is in the catalogue, or is a file, whose path becomes absolute."""
        paths = tuple(str(input_file(name, info)) if name.endswith(".toml") else name for name in names)
        for name in paths:
            flow_entry(name)
        return paths

    @property
    def entries(self) -> list[FlowEntry]:
        """Entries of the materials, as whole bullets whose cores deform ask for them, if they are computed.

        Raises:
            ValueError: there are none.
        """
        if not self.materials:
            raise ValueError(
                "the continuum needs a material: give continuum.materials or --material with a name of the catalogue, "
                "or a TOML file"
            )
        known = [flow_entry(name) for name in self.materials]
        is_as_fired = isinstance(self.bullet, Bullet) and isinstance(self.core, Flow)
        return [entry.of_whole_bullets for entry in known] if is_as_fired else known

    @property
    def method(self) -> FiniteElements:
        """The method that it describes.

        Raises:
            ValueError: as `entries`.
        """
        entries = self.entries
        settings = {name: getattr(self, name) for name in FiniteElementSettings.model_fields}
        if self.friction is None:
            settings["friction"] = max(entry.friction for entry in entries)
        bullet = self.bullet if isinstance(self.bullet, Bullet) else None
        core = self.core if isinstance(self.core, Flow) else None
        return FiniteElements(flows=tuple(entry.flow for entry in entries), bullet=bullet, core=core, **settings)

    @property
    def _bullet_words(self) -> list[str]:
        """The bullet in words, with the wall that gives it its mass, and whether its core deforms."""
        core = ["core that deforms"] if isinstance(self.core, Flow) else []
        if not isinstance(self.bullet, Bullet):
            return core
        wall = "" if self.bullet.wall is None else f", jacket of {1e3 * self.bullet.wall:.2f} mm"
        return [f"whole bullet of {1e3 * self.bullet.mass:.4g} g{wall}", *core]

    @property
    def as_text(self) -> str:
        """Materials and settings as JSON, as a result has them."""
        settings = json.loads(self.method.model_dump_json())
        return json.dumps({"materials": [entry.name for entry in self.entries], **settings})

    def words(self, layers: int) -> str:
        """The settings in words, at a target of so many layers."""
        size = self.fidelity if self.spacing is None else f"{1e3 * self.spacing:.4g} mm"
        settings = ["finite elements", *self._bullet_words, size, f"friction {self.method.friction:g}"]
        settings += [one.name for one in self.entries]
        behind = [f"{layer_name(number)} by the fast law" for number in range(self.layers or layers, layers)]
        return ", ".join(settings + behind)
