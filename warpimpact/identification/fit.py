"""A fit: measured shots, their scenes, and priors of the unknown numbers, from a file or from hits by finite elements.

A parameter is an unknown number at a dotted place of the scene, such as "plate.pattern.spacing.0". Priors are in SI and
radians. A mistake in the file becomes one sentence.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, get_args

import numpy as np
from scipy.special import ndtr

from warpimpact.campaign.inputs import campaign_in
from warpimpact.campaign.names import catalogue_of, with_core, with_materials, with_scatter
from warpimpact.campaign.places import set_value
from warpimpact.campaign.plausible import check_plausible
from warpimpact.campaign.resistance import resistance_under
from warpimpact.campaign.text import as_campaign_error, parsed, read_text
from warpimpact.catalogue.catalogue import Catalogue
from warpimpact.errors import CampaignError
from warpimpact.identification.fit_file import (
    FitFile,
    HitPlace,
    Observation,
    ShotTable,
    Table,
    distribution_in,
    is_distribution,
)
from warpimpact.measures.hits import failed, hit_numbers
from warpimpact.records import attributes as attr
from warpimpact.records import variables as v
from warpimpact.records.kinds import FIT
from warpimpact.results import files
from warpimpact.scene import AnyCore, Impact, Interaction, Plate, Scatter, Scene, units
from warpimpact.scene.model import Array, Model
from warpimpact.scene.quantities import OF_THE_SCENE, QUANTITIES
from warpimpact.scene.scatter import EDGE, Distribution, check_range
from warpimpact.solver.limit import check_arrests
from warpimpact.solver.resolution import decay_rate

COLUMN_OF = {f"{QUANTITIES[name].table}.{name}": name for name in OF_THE_SCENE}
"""Name of the column of Shots by the place of its quantity."""
UNITS_OF_EXPOSURE = ("plate.degradation_interval", "plate.degradation_distance")
"""β per Δt_β is the same law as β^(Δt₀/Δt_β) per Δt₀, so these become a degradation of the shot."""
TABLES: dict[str, Any] = {"plate": Plate, "interaction": Interaction, "core": AnyCore}
"""Tables of the scene whose numbers may be parameters."""
VELOCITY_ERROR, NEAR_ERROR, FAR_ERROR = 5.0, "5 deg", "10 deg"
"""Uncertainty of finite elements by their numerics: of a velocity [m/s], and of a tilt at the first stand-off and at
the others (docs/continuum.md)."""
PRIORS: dict[str, Any] = {
    "resistance": {"distribution": "uniform", "low": "0.3 GPa", "high": "6 GPa"},
    "shear_coefficient": {"distribution": "uniform", "low": 0, "high": 0.2},
    "degradation": {"distribution": "uniform", "low": 0.6, "high": 1.0},
}
"""Priors of Y, η and β, the parameters of a fit to hits by finite elements."""


@dataclass(frozen=True)
class Parameter:
    """An unknown number of the scene, or the scale of a discrepancy.

    Attributes:
        place: dotted place, such as "plate.pattern.spacing.0" or "discrepancy.velocity".
        name: short name, such as "spacing_y".
        quantity: reader of its values, with their unit.
        prior: distribution in SI and radians.
    """

    place: str
    name: str
    quantity: Any
    prior: Distribution

    def at(self, normal: Array) -> Array:
        """Values at standard normal numbers, of their shape. If these are normal, the values follow the prior."""
        return self.prior.quantile(np.clip(ndtr(normal), EDGE, 1.0 - EDGE))

    @property
    def is_of_scene(self) -> bool:
        """Whether it is a number of the scene, and no discrepancy."""
        return not self.place.startswith("discrepancy.")

    @property
    def is_column(self) -> bool:
        """Whether its values may differ from shot to shot of one computation."""
        return self.place in COLUMN_OF or self.place in UNITS_OF_EXPOSURE or not self.is_of_scene


@dataclass(frozen=True)
class MeasuredShot:
    """A fired shot and its measurements.

    Attributes:
        hit: place of its hit; None if unknown.
        impact, scatter: how the core arrived, and the uncertainty of that.
        tables: tables of its scene, with the medians of the priors.
        own: places of the values that the shot itself gives, for which no prior counts.
        observations: measured numbers.
        status: how it ended; None if not reported.
    """

    name: str
    hit: HitPlace | None
    impact: Impact
    scatter: Scatter
    tables: dict[str, Any]
    own: frozenset[str]
    observations: tuple[Observation, ...]
    status: str | None


@dataclass(frozen=True)
class Fit:
    """Measured shots, and what is unknown.

    Attributes:
        file: tables of the file; `text` is its text, and names in it count from `folder`.
        parameters: unknown numbers of the scene, and the scales of discrepancy that the observations need. Those that
            need a scene of their own come first.
    """

    file: FitFile
    text: str
    folder: Path
    parameters: tuple[Parameter, ...]
    shots: tuple[MeasuredShot, ...]

    @property
    def scene_parameters(self) -> tuple[Parameter, ...]:
        return tuple(parameter for parameter in self.parameters if parameter.is_of_scene)

    def discrepancies(self, points: Array) -> dict[str, Array]:
        """Scales of the model's error by kind of observation, each of shape [sets].

        Args:
            points: standard normal numbers, shape [sets, parameters].
        """
        fixed = {kind: scale for kind, scale in self.file.discrepancy if not isinstance(scale, Distribution)}
        scales = {kind: np.full(len(points), scale) for kind, scale in fixed.items()}
        for column, one in enumerate(self.parameters):
            if not one.is_of_scene:
                scales[one.place.removeprefix("discrepancy.")] = one.at(points[:, column])
        return scales

    def scene_of(self, shot: MeasuredShot, values: Mapping[str, float] | None = None) -> Scene:
        """The scene of a shot at these values of the parameters, by place, at the medians of the others.

        Raises:
            ValidationError: such a scene is not possible.
        """
        tables, values, context = deepcopy(shot.tables), values or {}, {"folder": self.folder}
        for unknown in self.scene_parameters:
            if unknown.place in values and unknown.place not in shot.own:
                set_value(tables, unknown.place, unknown.quantity.as_read(float(values[unknown.place])), "fit")
        tables["target"] = Plate.model_validate(tables.pop("plate"), context=context)
        return Scene.model_validate(tables | {"record": self.file.record}, context=context)


def read_fit(path: str | Path) -> Fit:
    """Read a fit file; file names in it count from its folder.

    Raises:
        CampaignError: the file is missing, is not TOML, or has a value that is not allowed.
    """
    path = Path(path)
    return fit_from(read_text(path), str(path), path.parent)


def fit_from(text: str, name: str, folder: Path) -> Fit:
    """Read a fit from its text; `name` is the name of the file in errors."""
    data = parsed(text, name, FIT)
    with as_campaign_error(tables=data, file=name):
        catalogue, file = catalogue_of(data, folder), FitFile.model_validate(data)
        if not file.shot:
            raise ValueError("shot: a fit needs a table [[shot]]")
        tables = deepcopy(with_core(file.tables, catalogue))
    parameters = [*_read_priors(file.prior, "", tables, name)]
    names = [one.name for one in parameters]
    parameters = [
        one if names.count(one.name) == 1 else replace(one, name=one.place.replace(".", "_")) for one in parameters
    ]
    fit = Fit(file, text, folder, tuple(parameters), ())
    shots = tuple(
        _shot(fit, shot, [*data["shot"][k]["measured"]], tables, f"{name}: shot[{k}]", catalogue)
        for k, shot in enumerate(file.shot)
    )
    kinds = {one.kind for shot in shots for one in shot.observations}
    for kind, quantity in (("velocity", units.Speed), ("angle", units.Angle)):
        if kind in kinds and isinstance(scale := getattr(file.discrepancy, kind), Distribution):
            parameters.append(Parameter(f"discrepancy.{kind}", f"discrepancy_{kind}", units.quantity(quantity), scale))
    return replace(fit, parameters=tuple(sorted(parameters, key=lambda one: one.is_column)), shots=shots)


def _read_priors(node: Any, place: str, tables: Table, name: str) -> Iterator[Parameter]:
    """The parameters of a part of the table [prior]; their medians, and known entries of lists, go into the tables."""
    where = f"{name}: prior.{place}"
    if place and is_distribution(node):
        with as_campaign_error(f"{where}: "):
            read = _reader(place, tables)
            parameter = Parameter(place, _short_name(place), read, distribution_in(read, node))
            key = place.rpartition(".")[2]
            if key in QUANTITIES and place == f"{QUANTITIES[key].table}.{key}":
                check_range(key, *parameter.prior.ends)
        set_value(tables, place, read.as_read(float(parameter.prior.quantile(np.array(0.5)))), name)
        yield parameter
    elif isinstance(node, Mapping):
        for key, inner in node.items():
            yield from _read_priors(inner, f"{place}.{key}".strip("."), tables, name)
    elif isinstance(node, list) and any(map(is_distribution, node)):
        set_value(tables, place, [*node], name)
        for index, inner in enumerate(node):
            if is_distribution(inner):
                yield from _read_priors(inner, f"{place}.{index}", tables, name)
    else:
        raise CampaignError(
            f"{where}: got {units.quoted(node)}, but a prior is a distribution such as "
            '{ distribution = "uniform", low = 1, high = 2 }; a known value belongs in the table of the scene'
        )


def _short_name(place: str) -> str:
    *_, before, last = place.split(".")
    if not last.isdecimal():
        return last
    return f"{before}_{'yz'[int(last)] if before in ('spacing', 'size') and last in '01' else last}"


def _reader(place: str, tables: Table) -> Any:
    """The reader of the quantity at a place of the scene.

    Raises:
        ValueError: no number stands there.
    """
    table, *path = place.split(".")
    if table not in TABLES:
        raise ValueError(f'got the table "{table}", but a prior belongs in one of {", ".join(TABLES)}')
    annotation, node, reader = TABLES[table], tables.get(table, {}), None
    for part in path:
        if part.isdecimal():  # an entry of a list
            reader = next(filter(None, map(units.reader_in, _parts(annotation))), None)
            break
        node = node if isinstance(node, Mapping) else {}
        models = [kind for kind in _parts(annotation) if isinstance(kind, type) and issubclass(kind, Model)]
        shape = node.get("shape", "none")
        named = [model for model in models if getattr(model.model_fields.get("shape"), "default", None) == shape]
        fields = next((model.model_fields for model in named or models), {})
        if part not in fields:
            raise ValueError(f'got the unknown key "{part}"; {units.hint(part, fields)}')
        annotation, node = units.typed(fields[part]), node.get(part, {})
        reader = units.reader_in(annotation)
    if reader is None:
        raise ValueError("is no number, but only a number can have a prior")
    return reader


def _parts(annotation: Any) -> Iterator[Any]:
    """A type and all types in it."""
    yield annotation
    for inner in get_args(annotation):
        yield from _parts(inner)


def _shot(
    fit: Fit, given: ShotTable, measured: Sequence[str], tables: Table, place: str, catalogue: Catalogue
) -> MeasuredShot:
    """A shot; `measured` are the names of its measured numbers in their order. A scene is refused that is not possible
    at the medians of the priors, or that stops no core if a limit is measured."""
    record = fit.file.record
    with as_campaign_error(f"{place}: "):  # known values of the plate's material; a prior overrides them
        resolved, materials = with_materials(_merged(tables, with_core(given.tables, catalogue)), catalogue)
        impact = with_scatter({"impact": given.impact})
    with as_campaign_error(f"{place}.measured."):
        numbers = [one for name in measured for one in given.measured.observations(name, len(record.standoffs))]
    limits = [number.value for number in numbers if number.is_limit]
    if limits:  # the search of limits begins at these values
        impact["impact"].setdefault("velocity", limits[0])
    with as_campaign_error(f"{place}.impact: ", impact["impact"]):
        arrival = Impact.model_validate(impact["impact"])
    shot = MeasuredShot(
        name=given.name or place.partition(": ")[2],
        hit=given.hit,
        impact=arrival,
        scatter=Scatter(**impact.get("scatter", {})),
        tables=resolved,
        own=frozenset(one.place for one in fit.parameters if _has(given.tables, one.place)),
        observations=tuple(numbers),
        status=given.measured.status,
    )
    with as_campaign_error(f"{place}: ", resolved):
        scene = fit.scene_of(shot)
        for material in materials.values():
            of_plate = scene.interaction, material, scene.core, scene.target.layers[0], shot.impact.obliquity
            resolved["plate"]["resistance"] = resistance_under(*of_plate, catalogue).median
        check_plausible(scene.core, scene.target, scene.record, shot.impact, catalogue=catalogue)
        if limits:
            weakest = [one for one in fit.parameters if "degradation" in one.place]
            check_arrests(fit.scene_of(shot, {one.place: one.prior.ends[0] for one in weakest}))
    return shot


def _merged(tables: Any, of_shot: Any) -> Any:
    """Tables of the fit, overridden by a shot's own values. A table with another shape replaces the fit's table."""
    is_table = isinstance(tables, Mapping) and isinstance(of_shot, Mapping)
    if not is_table or of_shot.get("shape", tables.get("shape")) != tables.get("shape"):
        return of_shot
    return {**tables, **{key: _merged(tables.get(key), value) for key, value in of_shot.items()}}


def _has(tables: Any, place: str) -> bool:
    """Whether nested tables have a value at a place."""
    for part in place.split("."):
        if isinstance(tables, list):
            return True
        if not isinstance(tables, Mapping) or part not in tables:
            return False
        tables = tables[part]
    return True


def columns_of(values: Mapping[str, Array], plate: Plate) -> dict[str, Array]:
    """Columns of Shots for some values, each of their shape.

    Args:
        values: values by place. Places that make no column are left out.
        plate: plate of the scene. Its degradation and unit of exposure hold where no value replaces them.
    """
    columns = {name: values[place] for place, name in COLUMN_OF.items() if place in values}
    for place in UNITS_OF_EXPOSURE:
        if place in values:
            base = columns.get("degradation", np.full_like(values[place], plate.degradation))
            columns["degradation"] = np.exp(decay_rate(base, 1.0) * plate.degradation_unit / values[place])
    return columns


# --- Hits by finite elements as measured shots ---


def fit_of_result(path: Path) -> Fit:
    """The fit of Y, η and β to the hits of a result by finite elements, whose hit points are known.

    Raises:
        ResultError, CampaignError: the file is no such result, has layers behind its plate, or no hit that passed the
            plate.
    """
    result = files.read(path).to_dataset()
    if attr.CONTINUUM not in result.attrs:
        raise CampaignError(
            f"{path}: is an answer for a map; a fit takes hits by finite elements alone (warpimpact continuum "
            "CAMPAIGN.toml), or a fit file"
        )
    campaign_in(result, path.parent)  # its files are still those of the hits
    tables = parsed(result.attrs[attr.CAMPAIGN], f"the campaign in {path}")
    passed = ~failed(result) & ~np.isnan(result[v.TILT].values).any(axis=1)
    if tables.get("layer") or not passed.any():
        raise CampaignError(f"{path}: a fit is of one plate, and of hits that passed it")
    numbers, impact = hit_numbers(result), {variable.field: variable for variable in v.SHOT_VARIABLES}
    errors = [NEAR_ERROR, *[FAR_ERROR] * result.sizes[v.STANDOFF]][: result.sizes[v.STANDOFF]]
    shots = [
        {
            "name": f"hit {numbers[place]}",
            "hit": {"y": float(hit[v.HIT_Y]), "z": float(hit[v.HIT_Z])},
            "impact": {name: float(hit[variable]) for name, variable in impact.items()},
            "measured": {
                "residual_velocity": {"value": float(hit[v.RESIDUAL_VELOCITY]), "std": VELOCITY_ERROR},
                "tilt": {"value": hit[v.TILT].values.tolist(), "std": errors},
            },
        }
        for place in np.flatnonzero(passed)
        for hit in [result.isel(hit=place)]
    ]
    fit: dict[str, Any] = {
        "title": f"{tables['title']}: by finite elements",
        **{key: tables[key] for key in ("core", "interaction", "catalogue") if key in tables},
        "plate": {key: value for key, value in tables["plate"].items() if key not in (*PRIORS, "material")},
        "record": {
            "standoffs": result[v.STANDOFF].values.tolist(),
            "standoff_point": result.attrs[attr.STANDOFF_POINT],
        },
        "prior": {"plate": PRIORS},
        "shot": shots,
    }
    return fit_from(json.dumps(fit), str(path), path.parent)
