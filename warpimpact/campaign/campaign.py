"""Campaign: one TOML file, validated once, as one immutable value, and its references."""

import json
import math
import re
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property, partial
from itertools import chain
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple, Self

import numpy as np
from pydantic import BaseModel, Field, PrivateAttr, ValidationInfo, model_validator

from warpimpact.errors import CampaignError, Implausible
from warpimpact.measures.measure import Measure
from warpimpact.measures.vocabulary import BASE, STRENGTH
from warpimpact.records.kinds import CAMPAIGN
from warpimpact.solver.fast_law import FastLaw

from ..catalogue.catalogue import Catalogue
from ..catalogue.entries import Material
from ..catalogue.strength import Resistance
from ..records.variables import BENDING_VARIABLES, BROKEN_VARIABLES, DEPTH, FRAGMENT_VARIABLES
from ..scene import (
    AnyCore,
    Hits,
    Impact,
    Interaction,
    Layer,
    Plate,
    Sampler,
    Scatter,
    Scene,
    Shots,
    Symmetry,
    Target,
    exclusions,
    symmetries_used,
)
from ..scene.bullet import Bullet
from ..scene.flow import Flow
from ..scene.input_files import InputFile
from ..scene.model import Model
from ..scene.quantities import BY_LAYER
from ..scene.sampling import unsymmetric
from ..scene.scatter import check_range
from ..scene.shots import FARTHEST_HIT
from ..scene.target import MOST_LAYERS
from ..scene.units import Title, quoted
from .names import catalogue_of, with_bullet, with_core, with_materials, with_scatter, with_velocity
from .plausible import check_plausible, implausible_notes
from .resistance import SAME, resistance_under
from .tables import ContinuumTable, Output, Stop
from .text import as_campaign_error, parsed, read_text

_MOST_LENGTHS = 1000
"""Most degradation lengths in the radius of a core, whose surface has patches of about this length."""
ALLOW_ADVICE = "; allow_implausible = true has it computed as it is"
"""Advice to the writer of a file with an implausible value."""
CORES_STAYED_WHOLE = "the cores of both published shots stayed whole at bending stresses of some 4.2 to 5.6 GPa"
_PLATE_NAME = re.compile(r"\w[\w .+-]{,79}")
"""Names of plates; the result files get the same names."""


STEEL = 6500.0, 9000.0
"""Densities of cores that are of steel [kg/m³]; the shapes of some are not known well."""


class Bodies(NamedTuple):
    """A bullet as finite elements compute it: `bullet` and `core` of the table [continuum]."""

    bullet: Literal["core", "whole"] | Bullet
    core: Literal["rigid", "deformable"] | Flow

    @property
    def are_as_fired(self) -> bool:
        """Whether it is a whole bullet whose core deforms."""
        return self.bullet != "core" and self.core != "rigid"


class ReferenceOf(Model):
    """The target whose shots a reference has.

    Attributes:
        name: "solid" or "base_alone".
        plate, layer, scatter, irreducible: of the campaign that the reference belongs to.
    """

    name: Literal["solid", "base_alone"]
    plate: Plate
    layer: tuple[Layer, ...]
    scatter: Scatter
    irreducible: bool

    def at_reference(self, reference: Target, shots: Shots) -> Shots:
        """Shots of the campaign as they are at the target of the reference."""
        if self.name == "solid":
            return _at_solid(Target(layers=(self.plate, *self.layer)), reference, shots)
        return _at_base_alone(len(self.layer), shots)


class Campaign(Model):
    """What is shot at what, where, how finely it is computed and what is reported.

    Attributes:
        title: one line, which figures and reports show.
        core: the rigid core.
        bullet: what is about the core, for finite elements; that of a threat where the catalogue knows it.
        plate: what it is shot at.
        layer: what stands behind the plate, in order: a table `[[layer]]` each.
        impact: how the core arrives.
        hits: where it hits.
        interaction: stress on the surface of the core.
        numerics: how finely the shots are computed.
        output: what is reported.
        scatter: distributions of values that scatter. A file has them in the places of the values.
        catalogue: TOML file with threats and materials of your own, tables `[[threat]]` and `[[material]]`.
        stop: when the run ends, instead of a count. By default, its hits are then those of the irreducible part of the
            cell.
        allow_implausible: compute also with values that no core or target has, such as a plate of 4 m: they are else
            refused, as a slip of units.
        continuum: how `warpimpact continuum` computes its hits.
        reference_of: the target whose shots it has; only of a reference, and in no file that a user writes.
    """

    title: Title
    core: AnyCore
    bullet: Bullet | None = None
    plate: Plate
    layer: Annotated[tuple[Layer, ...], Field(fail_fast=True, max_length=MOST_LAYERS)] = ()
    impact: Impact
    hits: Hits
    interaction: Interaction = Interaction()
    numerics: FastLaw = FastLaw()
    output: Output = Output()
    scatter: Scatter = Scatter()
    catalogue: InputFile | None = None
    stop: Stop | None = None
    allow_implausible: Annotated[bool, Field(strict=True)] = False
    continuum: ContinuumTable = ContinuumTable()
    reference_of: ReferenceOf | None = None
    _source: str = PrivateAttr("")
    _changed: Sampler | None = PrivateAttr(None)

    @property
    def text(self) -> str:
        """The TOML file as it was read; of a campaign made or changed in Python, its values as JSON.

        It does not contain what `with_shots` changes.
        """
        return self._source or self.model_dump_json()

    @classmethod
    def from_toml(cls, path: str | Path, *, count: int | None = None, needs_velocity: bool = True) -> Self:
        """Read a campaign file; file names in it count from its folder.

        Args:
            path: the TOML file.
            count: number of hits, instead of the file's.
            needs_velocity: whether the shots need a velocity. Where it is searched, a threat without one will do.

        Raises:
            CampaignError: the file is missing, is not TOML, or has a value that is not allowed.
        """
        path = Path(path)
        text = read_text(path)
        return cls.from_text(text, name=str(path), folder=path.parent, count=count, needs_velocity=needs_velocity)

    @classmethod
    def from_text(
        cls, text: str, *, name: str, folder: Path, count: int | None = None, needs_velocity: bool = True
    ) -> Self:
        """Read a campaign from its text, TOML, or the JSON of a campaign made in Python. Errors have its name; those
        of a text without a name give no advice for a file. Files that it names count from the folder.

        Raises:
            CampaignError: the text is not TOML, or has a value that is not allowed.
        """
        data = parsed(text, name or "design", CAMPAIGN)
        for key, is_several in (("plate", isinstance(data.get("plate"), list)), ("sweep", "sweep" in data)):
            if is_several:
                command = {"plate": "compare"}.get(key, key)
                raise CampaignError(f"{key}: this takes one; warpimpact {command} {name} runs all of them", name)
        if count is not None:
            _override_count(data, count)
        with as_campaign_error(file=name):
            catalogue = catalogue_of(data, folder)
            data = with_bullet(with_core(data, catalogue), catalogue)
            data = with_velocity(data, catalogue, is_needed=needs_velocity)
            data, materials = with_materials(with_scatter(data), catalogue)
        context = {"folder": folder, "materials": materials, "tables": data, "advice": ALLOW_ADVICE if name else ""}
        with as_campaign_error(tables=data, file=name):
            campaign = cls.model_validate(data, context=context)
        campaign._source = text
        return campaign

    @cached_property
    def scene(self) -> Scene:
        """Core, target, interaction and records."""
        return Scene(core=self.core, target=self.target, interaction=self.interaction, record=self.output)

    @cached_property
    def target(self) -> Target:
        """The plate and the layers behind it."""
        return Target(layers=(self.plate, *self.layer))

    def computed_by(self, elements: ContinuumTable) -> Self:
        """The campaign, with its text, but with these settings for hits by finite elements."""
        return BaseModel.model_copy(self, update={"continuum": elements})

    def with_continuum_hits(self, hits: int | None) -> Self:
        """The campaign with so many hits by finite elements in its answer; None is the fast law alone."""
        return self.computed_by(self.continuum.model_copy(update={"hits": hits}))

    @property
    def symmetries(self) -> tuple[Symmetry, ...]:
        """Symmetries that give the rest of the cell from its hits; the identity alone without `hits.irreducible`."""
        return symmetries_used(self.impact, self.hits, self.plate)

    def sampler(self) -> Sampler:
        """The sampler of its shots."""
        if self._changed is not None:
            return self._changed
        if (of := self.reference_of) is None:
            return Sampler(self.impact, self.hits, self.plate, self.scatter)
        hits = BaseModel.model_copy(self.hits, update={"irreducible": of.irreducible})
        own = Sampler(self.impact, hits, of.plate, of.scatter)
        return ChangedSampler(own, partial(of.at_reference, self.target))

    @property
    def references(self) -> dict[str, Self]:
        """Its references: "solid" if it is not solid itself, and "base_alone" if it has layers."""
        is_solid = not self.layer and self.target.solid == self.target
        return ({} if is_solid else {"solid": self.solid()}) | ({"base_alone": self.base_alone()} if self.layer else {})

    def solid(self) -> Self:
        """The campaign with a solid plate as heavy as its own; of layers, a solid add-on before the same base.

        A Y of the catalogue becomes that of the new thickness. The shots have the places and conditions of this
        campaign; where thicknesses scatter, each solid plate is as heavy as that of its shot.
        """

        def of_its_thickness(plate: Plate, solid: Plate) -> Plate:
            known = None if solid == plate else self.catalogue_resistance(plate, solid.thickness)
            return solid if known is None else solid.model_copy(update={"resistance": known.median})

        return self._reference("solid", tuple(map(of_its_thickness, self.target.layers, self.target.solid.layers)))

    def base_alone(self) -> Self:
        """The campaign with its last layer alone; the shots have the places and conditions of this campaign."""
        last = len(self.layer)
        own = {name: getattr(self.scatter, name)[last:] for name in BY_LAYER if not name.startswith("offset")}
        scatter = BaseModel.model_copy(self.scatter, update={"offset_y": (), "offset_z": ()} | own)
        return self._reference("base_alone", self.target.base_alone.layers, scatter=scatter)

    def with_shots(self, change: Callable[[Shots], Shots]) -> Self:
        """The campaign with its shots changed, such as by a factor of their resistance.

        Its text does not contain the change, so its results can neither be replayed nor get hits by elements later.
        """
        changed = BaseModel.model_copy(self)
        changed._changed = ChangedSampler(self.sampler(), change)
        return changed

    @property
    def is_changed(self) -> bool:
        """Whether its shots are not those of its values, because of `with_shots`."""
        return self._changed is not None

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """As of any model.

        Raises:
            CampaignError: `with_shots` has changed the shots, which belong to the values as they are.
        """
        if self.is_changed:
            raise CampaignError("its shots were changed by with_shots; change the values of a campaign first")
        return super().model_copy(update=update, deep=deep)

    def _reference(self, name: Literal["solid", "base_alone"], layers: tuple[Plate, ...], **changed: Any) -> Self:
        of = ReferenceOf.model_construct(
            name=name, plate=self.plate, layer=self.layer, scatter=self.scatter, irreducible=self.hits.irreducible
        )
        changed |= {"plate": layers[0], "layer": layers[1:], "reference_of": of}
        changed["hits"] = BaseModel.model_copy(self.hits, update={"irreducible": False})  # not that of its own plate
        reference = BaseModel.model_copy(self, update=changed)
        for cached in ("scene", "target"):  # of this campaign
            reference.__dict__.pop(cached, None)
        reference._source = ""
        if self.is_changed or self.reference_of is not None:  # values do not give the shots of a reference of these
            reference._changed = ChangedSampler(self.sampler(), partial(of.at_reference, reference.target))
        return reference

    def catalogue_resistance(self, plate: Plate, thickness: float | None = None) -> Resistance | None:
        """The resistance of a plate, or of one of another thickness [m], by the catalogue; None where Y is the
        user's."""
        material = Catalogue.of(self.catalogue).all(Material).get(str(plate.material))
        if material is None:
            return None

        given = self._resistance(material, plate)
        if not math.isclose(given.median, plate.resistance, rel_tol=SAME):
            return None
        if thickness is None:
            return given
        return self._resistance(material, plate.model_copy(update={"thickness": thickness}))

    def _resistance(self, material: Material, plate: Plate) -> Resistance:
        """What the catalogue knows of Y of a plate."""
        catalogue = Catalogue.of(self.catalogue)
        return resistance_under(self.interaction, material, self.core, plate, self.impact.obliquity, catalogue)

    def lacking(self, measure: Measure, *, by_law: bool = False) -> str:
        """Keys that the campaign needs for a measure of its hits, or of those by the fast law alone, and does not have;
        empty if it lacks none."""
        has = {"layered": bool(self.layer), "bending": self.output.bending, "breakable": self.has_strength}
        has["deforms"] = self.bodies.core != "rigid" and self.continuum.hits is not None and not by_law
        return lacking(measure, self.output.standoffs, **has)

    @property
    def bodies(self) -> Bodies:
        """What finite elements compute of its bullet, where the table [continuum] does not say so, too."""
        table = self.continuum
        bullet = table.bullet or ("core" if self.bullet is None else "whole")
        is_steel = STEEL[0] < self.core.mass_properties.mass / self.core.volume < STEEL[1]
        deforms = bullet != "core" and is_steel and not self.output.bending
        return Bodies(bullet, table.core or ("deformable" if deforms else "rigid"))

    @property
    def _breaks_by_elements(self) -> bool:
        """Whether finite elements use its strength: there are hits by them, or [continuum] has such a core."""
        is_used = self.continuum.hits is not None or self.continuum.core is not None
        return is_used and self.bodies.core != "rigid"

    def _take_resistances(self, materials: dict[int, Material]) -> None:
        """Replace Y of layers whose materials are given by their numbers."""
        layers = list(self.target.layers)
        for k, material in materials.items():
            known = self._resistance(material, layers[k])
            layers[k] = BaseModel.model_copy(layers[k], update={"resistance": known.median})
        object.__setattr__(self, "plate", layers[0])
        object.__setattr__(self, "layer", tuple(layers[1:]))
        del self.__dict__["target"]  # of the former layers

    @property
    def has_strength(self) -> bool:
        """Whether its cores may break."""
        return self.core.strength is not None or "strength" in (self.hits.listed or {})

    @model_validator(mode="before")
    @classmethod
    def _stop_bounds_the_count(cls, values: Any) -> Any:
        stop, hits = values.get("stop"), values.get("hits")
        if isinstance(stop, dict) and isinstance(hits, dict) and "max_count" in stop:
            return values | {"hits": {"count": stop["max_count"]} | hits}
        return values

    @model_validator(mode="after")
    def _agrees(self, info: ValidationInfo) -> Self:
        """Check what two tables must agree on, with the resistances of the materials that a file names."""
        context: dict[str, Any] = info.context or {}
        tables = context.get("tables", {})
        if materials := context.get("materials"):
            self._take_resistances(materials)
        if not self.allow_implausible:  # first, as a slip of units breaks other rules, too
            try:
                catalogue = Catalogue.of(self.catalogue)
                check_plausible(self.core, self.target, self.output, self.impact, self.hits, catalogue, tables)
            except ValueError as error:
                raise ValueError(f"{error}{context.get('advice', ALLOW_ADVICE)}") from None
        if self.stop is not None:
            object.__setattr__(self, "hits", self._hits_of_a_stop())
            self._check_stop(self.stop)
        self._check_options()
        self._check_hits()
        self._check_shots()
        self._check_lengths()
        self.output.check(self.core)
        for doubt in implausible_notes(self.scene, self.impact, self.hits, tables):
            warnings.warn(doubt, Implausible, stacklevel=2)
        return self

    def _hits_of_a_stop(self) -> Hits:
        """Hits in the irreducible part of the cell by default, where an answer costs least (tests/benchmarks)."""
        hits = self.hits
        chosen = "irreducible" in hits.model_fields_set or hits.area != "cell" or hits.file is not None
        if chosen or any(unsymmetric(self.scatter, self.layer).values()):
            return hits  # without symmetry every hit is computed
        return hits.model_copy(update={"irreducible": hits.sampling in ("sobol", "random")})

    def _check_options(self) -> None:
        """Check all options that exclude or need each other (scene/exclusions.py)."""
        stop, hits, numerics = self.stop, self.hits, self.numerics
        exclusions.check_together(
            unsymmetric(self.scatter, self.layer)
            | {
                exclusions.STOP: stop is not None,
                exclusions.UNEVEN: hits.sampling in ("grid", "list") and f'hits.sampling = "{hits.sampling}"',
                exclusions.ONE_SCRAMBLING: hits.sampling == "sobol" and hits.scramblings == 1,
                exclusions.IRREDUCIBLE: hits.irreducible,
                exclusions.LISTED_STRENGTH: "strength" in (hits.listed or {}) and not self._breaks_by_elements,
                exclusions.LAYERS: bool(self.layer),
                exclusions.BENDING: self.output.bending,
                exclusions.STRENGTH: self.has_strength and not self._breaks_by_elements,
                exclusions.NODAL: numerics.scheme == "nodal",
                exclusions.FREE_SURFACE: self.interaction.free_surface is not None,
                exclusions.BLOCK: numerics.layout == "block",
                exclusions.DOUBLE: numerics.precision == "double",
            }
        )

    def _check_stop(self, stop: Stop) -> None:
        if self.hits.count != stop.max_count:
            raise ValueError(
                f"hits.count = {self.hits.count} and stop.max_count = {stop.max_count} cannot be combined: "
                "[stop] sets the number of hits; leave out hits.count"
            )
        if keys := self.lacking(stop.measure, by_law=True):
            raise ValueError(f'stop.quantity = "{stop.quantity}" needs {keys}')

    def _check_hits(self) -> None:
        covered, listed = self.hits.covered(self.plate), self.hits.listed or {}
        places = [listed[name] for name in ("hit_y", "hit_z") if name in listed] or 0.5 * np.array(covered)
        farthest = float(np.abs(places).max())
        # Cells of the plate have 32-bit numbers, counted from the origin.
        cell = min(self.plate.degradation_length / 25.0, (self.numerics.grid_spacing or math.inf) / 5.0)
        allowed = min(FARTHEST_HIT, 2**30 * cell)
        if farthest > allowed:
            raise ValueError(
                f"got hits up to {farthest:.6g} m from the origin, but they are exact up to {allowed:.4g} m; a pattern "
                "repeats, so take hits near the origin"
            )

    def _check_shots(self) -> None:
        ranges = {name: distribution.ends for (name, _), distribution in self.scatter.given.items()}
        for name, column in (self.hits.listed or {}).items():
            ranges[name] = (float(column.min()), float(column.max()))
            try:
                check_range(name, *ranges[name])
            except ValueError as error:
                raise ValueError(f"got hits.file with a column {name} that {error}") from None
        largest = {name: max(map(abs, ranges.get(name, (value,)))) for name, value in self.impact}
        for name in ("pitch", "yaw") if ranges else ():  # the axis is built from projected angles, which flip at 90°
            if largest[name] + largest["obliquity"] >= math.pi / 2:
                raise ValueError(
                    f"got shots with {name} up to {math.degrees(largest[name]):.4g} deg and obliquity up to "
                    f"{math.degrees(largest['obliquity']):.4g} deg, but their sum must stay below 90 deg"
                )

    def _check_lengths(self) -> None:
        radius, shortest = self.core.max_radius, min(plate.degradation_length for plate in self.target.layers)
        if radius > _MOST_LENGTHS * shortest:
            raise ValueError(
                f"got degradation_length = {shortest:g} m, but a core of radius {radius:g} m needs at least "
                f"{radius / _MOST_LENGTHS:.4g} m"
            )


class ChangedSampler(Sampler):
    """The shots of another sampler, changed."""

    def __init__(self, of: Sampler, change: Callable[[Shots], Shots]) -> None:
        self._of, self._change, self.cell = of, change, of.cell

    def __len__(self) -> int:
        return len(self._of)

    def shots(self, first: int, count: int) -> Shots:
        return self._change(self._of.shots(first, count))


def _at_solid(target: Target, solid: Target, shots: Shots) -> Shots:
    """Shots at a solid reference, whose add-on is as heavy as that of each shot."""
    columns: dict[str, Any] = {}
    for name in ("thickness", "resistance"):
        if (column := shots.columns.get(name)) is not None:
            values = [(target.value(name, k), solid.value(name, k)) for k in range(column.shape[1])]
            columns[name] = column * np.array([1.0 if old == new else new / old for old, new in values])
    return replace(shots, **columns)


def _at_base_alone(last: int, shots: Shots) -> Shots:
    """Shots at the same places of the face of the base alone, which is the last layer."""
    columns: dict[str, Any] = {
        name: shots.columns[name][:, last] if shots.varies(name, last) else None for name in BY_LAYER
    }
    columns |= dict.fromkeys(("offset_y", "offset_z"))
    return replace(shots, **columns)


def _override_count(data: dict[str, Any], count: int) -> None:
    """Replace the number of hits of the file; with a stop rule this is the largest number."""
    table, key = ("stop", "max_count") if isinstance(data.get("stop"), dict) else ("hits", "count")
    if isinstance(data.setdefault(table, {}), dict):
        data[table][key] = count
    if table == "stop" and isinstance(data.get("hits"), dict):
        data["hits"].pop("count", None)


def lacking(
    measure: Measure, standoffs: Sequence[float] | None, *, layered: bool, bending: bool, breakable: bool, deforms: bool
) -> str:
    """Keys that a campaign needs for a measure of its hits and does not have; empty if it lacks none.

    It may have layers behind the plate, record bending, and have cores with a strength, or that deform by finite
    elements. Its stand-offs [m] are None where they are not known yet, but some are computed.
    """
    quantity = measure.quantity
    needed = "" if quantity.need is None else quantity.need.name
    if needed in (BASE.name, DEPTH) and not layered:
        return BASE.keys
    if needed in FRAGMENT_VARIABLES and deforms:
        return ""
    if needed in set(FRAGMENT_VARIABLES) - set(BROKEN_VARIABLES):
        return 'continuum.core = "deformable" and continuum.hits'
    if needed in BROKEN_VARIABLES and not (bending and breakable):
        return f"{STRENGTH.keys} ({CORES_STAYED_WHOLE})"
    if needed in BENDING_VARIABLES and not bending:
        return "output.bending = true"
    if not quantity.has_standoff or standoffs is None:
        return ""
    if not standoffs:
        return "output.standoffs"
    if measure.standoff is None or np.isclose(measure.standoff, standoffs, rtol=1e-9, atol=0.0).any():
        return ""
    return f"{measure.standoff:g} m in output.standoffs, which are {', '.join(f'{at:g} m' for at in standoffs)}"


def read_plates(path: str | Path, *, count: int | None = None) -> dict[str, Campaign]:
    """Read a campaign file with several tables `[[plate]]`, each with a `name`; everything else is shared.

    Tables `[[plate.layer]]` stand behind one of the plates, before what tables `[[layer]]` put behind every plate.

    Args:
        path: the TOML file.
        count: number of hits, instead of the file's.

    Returns:
        Name of each plate → its campaign, in the order of the file.

    Raises:
        CampaignError: the file is missing, is not TOML, has only one plate, or contains an invalid value.
    """
    path = Path(path)
    shared = parsed(read_text(path), str(path), CAMPAIGN)
    plates, behind = shared.pop("plate", None), shared.pop("layer", [])
    if not isinstance(plates, list) or len(plates) < 2:
        raise CampaignError(f"{path}: plate: a comparison needs two or more tables [[plate]], each with a name")
    if isinstance(hits := shared.get("hits"), dict):
        shared["hits"] = {"irreducible": False} | hits  # the same hits for plates of different symmetry
    campaigns: dict[str, Campaign] = {}
    for number, plate in enumerate(plates):
        name = plate.get("name") if isinstance(plate, dict) else None
        if not isinstance(name, str) or not _PLATE_NAME.fullmatch(name) or name in campaigns:
            raise CampaignError(
                f"{path}: plate[{number}].name: got {quoted(name)}, but each plate needs its own name: a letter or a "
                "digit, then letters, digits, blanks and the characters _ . + -, 80 at most"
            )
        own: dict[str, Any] = {"plate": {key: value for key, value in plate.items() if key not in ("name", "layer")}}
        listed = (tables if isinstance(tables, list) else [tables] for tables in (plate.get("layer", []), behind))
        if layers := [*chain(*listed)]:  # something else is refused as a layer
            own["layer"] = layers
        if isinstance(shared.get("title"), str):
            own["title"] = f"{shared['title']}: {name}"
        text = json.dumps(shared | own, indent=1, ensure_ascii=False, default=str)
        campaigns[name] = Campaign.from_text(text, name=f'{path}, plate "{name}"', folder=path.parent, count=count)
    return campaigns


def measures_of_runs(
    texts: Sequence[str], campaigns: Mapping[str, Campaign], *, averaged: bool = False
) -> list[Measure]:
    """The measures with these texts, which runs of campaigns, by name, will give.

    Args:
        averaged: whether a worst hit and a number of the target are refused, too.

    Raises:
        CampaignError: a text is no measure, needs limits, or a campaign lacks what it needs.
    """
    measures = []
    for text in texts:
        with as_campaign_error("measure: "):
            measure = Measure.parse(text)
            if averaged and measure.kind in ("target", "worst_point"):
                raise ValueError(f"got {quoted(text)}, but it must be a mean, a quantile or a probability")
            if measure.is_limit:
                raise ValueError(f"got {quoted(text)}, which warpimpact limit computes")
            for name, campaign in campaigns.items():
                if keys := campaign.lacking(measure):
                    raise ValueError(f"{text} needs {keys}{f', which {name} lacks' if name else ''}")
        measures.append(measure)
    return measures
