"""Entries of the catalogue."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import Field, TypeAdapter, ValidationError, ValidationInfo, field_validator

from warpimpact.catalogue.strength import Z_90, Resistance
from warpimpact.scene import AnyCore, Core, Interaction, units
from warpimpact.scene.bullet import Bullet
from warpimpact.scene.model import Model, sentence

CORE: TypeAdapter[Core] = TypeAdapter(AnyCore)
OBLIQUITY: TypeAdapter[float] = TypeAdapter(units.Obliquity)
Name = Annotated[units.Title, Field(min_length=1, max_length=80)]
Share = Annotated[units.Number, Field(ge=0, le=1)]


class Velocity(Model):
    """A velocity that a standard asks for.

    Attributes:
        standard: its name and level.
        value: impact velocity [m/s].
        tolerance: largest deviation from it [m/s]; None where it is not known.
        range: distance of the muzzle [m]; None where it is not known.
    """

    standard: Name
    value: units.PositiveSpeed
    tolerance: units.Speed | None = None
    range: units.PositiveLength | None = None


class Threat(Model):
    """A bullet by the name under which it is known, and its core.

    Attributes:
        name: as `[core] threat` gives it.
        aliases: other names of it; one that several entries have lists them.
        shape: the core, which a file gives as the table `core`; None where it is not known.
        core_density: of the material of the core [kg/m³]; the mass that it gives is shown beside the published one.
        core_mass: published [kg].
        core_material, core_hardness: in words.
        bullet_mass: of the whole bullet [kg].
        bullet: what is about the core; None where it is not known.
        velocities: what standards ask for; the first one is taken unless the campaign names another.
        known: source by property.
        assumed: assumption in place of an unknown value, by property.
    """

    name: Name
    aliases: tuple[Name, ...] = ()
    shape: AnyCore | None = Field(None, alias="core")
    core_density: units.PositiveDensity | None = None
    core_mass: units.PositiveMass | None = None
    core_material: units.Title = ""
    core_hardness: units.Title = ""
    bullet_mass: units.PositiveMass | None = None
    bullet: Bullet | None = None
    velocities: tuple[Velocity, ...] = ()
    known: dict[str, units.Title]
    assumed: dict[str, units.Title] = Field(default_factory=dict)

    @field_validator("shape", mode="before")
    @classmethod
    def _reads_its_core(cls, core: Any, info: ValidationInfo) -> Any:
        if not isinstance(core, dict):
            return core
        try:
            return CORE.validate_python(core | {"threat": info.data.get("name")})
        except ValidationError as error:
            raise ValueError(sentence(error, core)) from None

    @classmethod
    def _keys(cls) -> list[str]:
        return [field.alias or name for name, field in cls.model_fields.items()]

    @property
    def core(self) -> AnyCore:
        """The core.

        Raises:
            ValueError: it is not known.
        """
        if self.shape is None:
            raise ValueError(f'the catalogue does not know the core of "{self.name}": give a core of your own')
        return self.shape

    @property
    def velocity(self) -> float:
        """Impact velocity of the first standard [m/s].

        Raises:
            ValueError: none is known.
        """
        if not self.velocities:
            raise ValueError(f'the catalogue has no velocity of "{self.name}"; give one')
        return self.velocities[0].value

    @property
    def evidence(self) -> str:
        """State of the evidence in words, behind the name."""
        return ("" if self.shape else "core not known; ") + evidence(self.known, self.assumed)


class Material(Model):
    """A material of plates, with the law that its strength was found with.

    The resistance of a material of the package follows from all published rows (`Catalogue.resistance`); here it stands
    in short: for one projectile at normal incidence, Y·(h / d)^thickness_exponent, with the thickness h and the largest
    diameter d of the core. The resistance of a material of a user's file is just that.

    Attributes:
        name: as `[plate] material` gives it.
        aliases: as in `Threat`.
        density: [kg/m³].
        resistance: Y of a plate as thick as the core is wide [Pa].
        resistance_low, resistance_high: ends of its 90 % interval [Pa].
        thickness_exponent: how Y grows with the thickness.
        shear_coefficient, linear, quadratic, onset: η, C, B and κ of the law.
        rows: published limit velocities that it was found from, by projectile.
        sources: keys of their sources.
        thickness_low, thickness_high, calibres_low, calibres_high, obliquity_low, obliquity_high: range of these rows;
            calibres are thickness over the diameter of the core.
        misfit, misfit_p90: median and 90th percentile of the relative error of limit velocities that were left out.
        coverage: share of them inside their 90 % interval.
        hardness: Vickers hardness; None where it is not known.
        known, assumed: as in `Threat`.
    """

    name: Name
    aliases: tuple[Name, ...] = ()
    density: units.PositiveDensity
    resistance: units.PositiveStress
    resistance_low: units.PositiveStress | None = None
    resistance_high: units.PositiveStress | None = None
    thickness_exponent: units.Number = 0.0
    shear_coefficient: units.NonNegativeNumber = 0.05
    linear: units.NonNegativeNumber = 0.0
    quadratic: units.NonNegativeNumber = 0.0
    onset: units.NonNegativeNumber = 0.005
    rows: dict[str, Annotated[int, Field(ge=1)]] = Field(default_factory=dict)
    sources: tuple[units.Title, ...] = ()
    thickness_low: units.Length = 0.0
    thickness_high: units.Length | None = None
    calibres_low: units.NonNegativeNumber = 0.0
    calibres_high: units.NonNegativeNumber | None = None
    obliquity_low: units.Obliquity = 0.0
    obliquity_high: units.Obliquity | None = None
    misfit: Share | None = None
    misfit_p90: units.NonNegativeNumber | None = None
    coverage: Share | None = None
    hardness: units.NonNegativeNumber | None = None
    known: dict[str, units.Title] = Field(default_factory=dict)
    assumed: dict[str, units.Title] = Field(default_factory=dict)

    @property
    def law(self) -> Interaction:
        """The law that the resistance was found with."""
        return Interaction(**{name: value for name, value in self if name in Interaction.model_fields})

    def resistance_at(self, calibres: float) -> Resistance:
        """Resistance of a plate by the numbers of the entry alone, with its thickness in diameters of the core."""
        median = float(self.resistance * calibres**self.thickness_exponent)
        if self.resistance_low is None or self.resistance_high is None:
            return Resistance(median)
        return Resistance(median, math.log(self.resistance_high / self.resistance_low) / (2.0 * Z_90))

    def table(self, given: Mapping[str, Any], resistance: float) -> dict[str, Any]:
        """The table of a plate of the material and of this resistance [Pa], under the keys that are given."""
        base = {"resistance": resistance, "shear_coefficient": self.shear_coefficient, "density": self.density}
        return base | dict(given) | {"material": self.name}

    @property
    def count(self) -> int:
        """Rows of all projectiles."""
        return sum(self.rows.values())

    @property
    def evidence(self) -> str:
        """State of the evidence in words, behind the name."""
        misfit = "" if self.misfit is None else f", cross-validated error {self.misfit:.1%} (median)"
        kind = "limit velocity" if self.count == 1 else "limit velocities"
        rows = f"{self.count} {kind}{misfit}; " if self.count else ""
        return rows + evidence(self.known, self.assumed)


def evidence(known: dict[str, str], assumed: dict[str, str]) -> str:
    """Names of the properties of an entry that are assumed, or known second-hand only."""
    second_hand = [name for name, source in known.items() if "second-hand" in source]
    groups = {"assumed": list(assumed), "quoted at second hand": second_hand}
    parts = [f"{how}: {', '.join(names).replace('_', ' ')}" for how, names in groups.items() if names]
    return "; ".join(parts) or "nothing assumed"
