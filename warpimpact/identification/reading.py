"""Reads a fit: one TOML file, validated; a mistake becomes one sentence, a doubt a warning."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path as FilePath
from typing import Any

import numpy as np
from pydantic import ValidationError

from warpimpact.campaign.problems import sentence
from warpimpact.campaign.text import parsed, read_text
from warpimpact.identification.fit import Fit, MeasuredShot, Sampling
from warpimpact.identification.hits import CLASSES, read_hit
from warpimpact.identification.measured import read_measured
from warpimpact.identification.parameters import (
    FitError,
    Parameter,
    corners,
    dotted,
    read_distribution,
    read_priors,
    with_medians,
)
from warpimpact.results.measures import Measure, place_of_standoff
from warpimpact.scene import Core, Impact, Numerics, Plate, Record, Scatter, Scene
from warpimpact.scene import exclusions as asked
from warpimpact.scene.distributions import Distribution
from warpimpact.scene.model import Model
from warpimpact.scene.quantities import QUANTITIES
from warpimpact.scene.units import Angle, Speed, Title, quantity, quoted
from warpimpact.solver.columns import Path
from warpimpact.solver.limit import check_arrests

_TABLES = ("core", "plate", "interaction")
_KEYS = ("title", *_TABLES, "record", "numerics", "prior", "discrepancy", "selection", "sampling", "shot")
_SHOT_KEYS = ("name", "hit", "impact", "measured", *_TABLES)
_MOST_SHOTS = 256
DISCREPANCY = {
    "velocity": (Speed, {"distribution": "truncated_normal", "mean": 0, "std": 10, "low": 0, "high": 50}),
    "angle": (
        Angle,
        {"distribution": "truncated_normal", "mean": "0 deg", "std": "5 deg", "low": "0 deg", "high": "25 deg"},
    ),
}
"""Quantity of a scale of discrepancy, and its prior where none is given: half of a normal distribution."""


def read_fit(path: str | FilePath) -> Fit:
    """Read a fit file; file names in it count from its folder.

    Raises:
        FitError: the file has a value that is not allowed.
        CampaignError: it is missing, or is not TOML.
    """
    path = FilePath(path)
    return fit_from(read_text(path), str(path), path.parent)


def fit_from(text: str, name: str, folder: FilePath) -> Fit:
    """Read a fit from its text; `name` is what errors call it."""
    data = parsed(text, name)
    _known(data, _KEYS, name)
    given, prior = data.get("shot"), data.get("prior", {})
    if not isinstance(given, list) or not given:
        raise FitError(f"{name}: shot: is missing, but a fit needs a table [[shot]] per measured shot")
    if len(given) > _MOST_SHOTS:
        raise FitError(f"{name}: shot: got {len(given)} shots, but a fit takes at most {_MOST_SHOTS}")
    if not isinstance(prior, dict) or not prior:
        raise FitError(f"{name}: prior: is missing, but a fit needs a prior of what it is to find")
    tables = {table: _table(data, table, name) for table in _TABLES}
    parameters = read_priors(prior, tables, name)
    tables = with_medians(tables, prior, parameters)
    record = _model(Record, data.get("record", {}), f"{name}: record")
    settings = _table(data, "numerics", name)
    if named := next((key for key in ("fidelity", "accuracy") if key in settings), None):
        raise FitError(f"{name}: numerics.{named}: a fit has no pilot; give level = 0 to 9, or single settings")
    numerics = _model(Numerics, {"level": 0} | settings, f"{name}: numerics")
    shots = tuple(_shot(one, tables, record, f"{name}: shot[{place}]", parameters) for place, one in enumerate(given))
    selection = tuple(_condition(one, record, f"{name}: selection") for one in _selection(data, name))
    if any(one.variable == "bending_stress" for one in selection):
        record = record.model_copy(update={"bending": True})
    kinds = {one.kind for shot in shots for one in shot.observations}
    scales, fixed = _discrepancy(_table(data, "discrepancy", name), kinds, name)
    fit = Fit(
        title=_model(_Titled, {"title": data.get("title", "")}, name).title,
        text=text,
        folder=folder,
        parameters=tuple(sorted((*parameters, *scales), key=lambda one: one.is_column)),
        discrepancy=fixed,
        selection=selection,
        record=record,
        numerics=numerics,
        sampling=_model(Sampling, data.get("sampling", {}), f"{name}: sampling"),
        shots=shots,
        warnings=tuple(_doubts(shots, parameters)),
    )
    _check_scenes(fit, name)
    return fit


class _Titled(Model):
    title: Title


def _known(table: Mapping[str, Any], allowed: tuple[str, ...], place: str) -> None:
    unknown = [key for key in table if key not in allowed]
    if unknown:
        raise FitError(f"{place}: got the unknown key {quoted(unknown[0])}; allowed are {', '.join(allowed)}")


def _table(data: Mapping[str, Any], key: str, place: str) -> dict[str, Any]:
    """A table of a fit, empty where it is missing."""
    table = data.get(key, {})
    if not isinstance(table, dict):
        raise FitError(f"{place}: {key}: got {quoted(table)}, but it must be a table")
    return table


def _selection(data: Mapping[str, Any], place: str) -> list[Any]:
    conditions = data.get("selection", [])
    if not isinstance(conditions, list):
        raise FitError(f"{place}: selection: got {quoted(conditions)}, but it must be a list of conditions")
    return conditions


def _model(kind: Any, data: Any, place: str) -> Any:
    try:
        return kind.model_validate(data)
    except ValidationError as error:
        raise FitError(f"{place}: {sentence(error, data)}") from None


def _shot(given: Any, tables: Mapping[str, Any], record: Record, place: str, parameters: list[Parameter]) -> Any:
    if not isinstance(given, dict):
        raise FitError(f"{place}: got {quoted(given)}, but it must be a table")
    _known(given, _SHOT_KEYS, place)
    impact = dict(_table(given, "impact", place))
    scattered = {key: value for key, value in impact.items() if isinstance(value, dict)}
    for key, value in scattered.items():
        if key not in QUANTITIES or QUANTITIES[key].table != "impact":
            raise FitError(f"{place}: impact.{key}: got {quoted(value)}, but no such quantity of an impact scatters")
        kind = QUANTITIES[key].type
        median = float(read_distribution(quantity(kind), value, f"{place}: impact.{key}").quantile(np.array(0.5)))
        impact[key] = quantity(kind).as_read(median)
    observations, status = read_measured(given.get("measured"), record.standoffs, f"{place}: measured")
    limits = [one.value for one in observations if one.is_limit]
    if limits:  # at which its search begins
        impact.setdefault("velocity", limits[0])
    own = {table: _table(given, table, place) for table in _TABLES if table in given}
    return MeasuredShot(
        name=str(given.get("name", place.partition(": ")[2])),
        hit=read_hit(given.get("hit", "unknown"), f"{place}: hit"),
        impact=_model(Impact, impact, f"{place}: impact"),
        scatter=_model(Scatter, scattered, f"{place}: impact"),
        tables=_merged(tables, own),
        own=frozenset(one.path for one in parameters if _gives(own, one.path)),
        observations=observations,
        status=status,
    )


def _merged(tables: Any, own: Any) -> Any:
    """Tables with a shot's own values over those of the fit; a table with another shape replaces the fit's."""
    if not (isinstance(tables, Mapping) and isinstance(own, Mapping)) or own.get("shape", tables.get("shape")) != (
        tables.get("shape")
    ):
        return own
    return {**tables, **{key: _merged(tables.get(key), value) for key, value in own.items()}}


def _gives(tables: Any, path: Path) -> bool:
    """Whether nested tables have a value at a path."""
    for part in path:
        if isinstance(part, int):
            return isinstance(tables, list)
        if not isinstance(tables, Mapping) or part not in tables:
            return False
        tables = tables[part]
    return True


def _condition(text: Any, record: Record, place: str) -> Measure:
    """A condition such as "perforated" or "bending_stress < 1.5 GPa"."""
    try:
        measure = Measure.parse(f"P({text})")
        if measure.standoff is not None:
            place_of_standoff(record.standoffs, measure.standoff)
    except ValueError as error:
        raise FitError(f'{place}: {error}; a condition is "perforated" or "bending_stress < 1.5 GPa"') from None
    return measure


def _discrepancy(given: Any, kinds: set[str], name: str) -> tuple[list[Parameter], dict[str, float]]:
    """Scales of discrepancy that are unknown, and those that are fixed."""
    _known(given, tuple(DISCREPANCY), f"{name}: discrepancy")
    scales, fixed = list[Parameter](), dict[str, float]()
    for kind, (unit, default) in DISCREPANCY.items():
        value, read = given.get(kind, default), quantity(unit)
        place = f"{name}: discrepancy.{kind}"
        if isinstance(value, dict):
            prior: Distribution = read_distribution(read, value, place)
            if prior.quantile(np.array(2.0**-31)) < 0.0:
                raise FitError(f"{place}: got a prior that reaches below 0, but a scale is at least 0")
            if kind in kinds:
                scales.append(Parameter(("discrepancy", kind), f"discrepancy_{kind}", read.unit, prior))
            continue
        try:
            fixed[kind] = read(value)
        except ValueError as error:
            raise FitError(f"{place}: {error}") from None
        if fixed[kind] < 0.0:
            raise FitError(f"{place}: got {quoted(value)}, but it must be at least 0")
    return scales, fixed


def _doubts(shots: tuple[MeasuredShot, ...], parameters: list[Parameter]) -> list[str]:
    """Sentences about data that a fit can take, but that say less than they seem to."""
    told, before = list[str](), dict[str, str]()
    for shot in shots:
        if (first := before.get(content := repr(shot.content))) is None:
            before[content] = shot.name
        else:
            told.append(
                f'shots "{first}" and "{shot.name}" are the same in every number: they count twice, as two measurements'
            )
    numbers = sum(len(shot.observations) + (shot.status is not None) for shot in shots)
    if numbers < len(parameters):
        told.append(
            f"got {numbers} measured number{'s' if numbers > 1 else ''} against {len(parameters)} parameters: the "
            "posterior keeps its prior in most directions"
        )
    return told


def _check_scenes(fit: Fit, name: str) -> None:
    """Refuse priors that reach scenes which are not possible."""
    checked = set[tuple[str, frozenset[Path], bool]]()
    for place, shot in enumerate(fit.shots):
        where = f"{name}: shot[{place}]"
        try:
            scene = fit.scene_of(shot)
            asked.check_together({asked.BENDING: fit.record.bending, asked.NODAL: fit.numerics.scheme == "nodal"})
        except ValueError as error:
            told = sentence(error, dict(shot.tables)) if isinstance(error, ValidationError) else str(error)
            raise FitError(f"{where}: {told}") from None
        _check_hit(shot, scene, where)
        has_limit = any(one.is_limit for one in shot.observations)
        if has_limit and fit.record.bending:
            raise FitError(f"{where}: limit_velocity and a selection by bending_stress cannot be combined")
        key = repr(shot.tables), shot.own, has_limit  # what the scenes below follow from
        if key in checked:
            continue
        checked.add(key)
        for values in corners(fit.scene_parameters):
            try:
                reached = fit.scene_of(shot, values)
                if has_limit:
                    check_arrests(reached)
            except ValueError as error:
                told = sentence(error, dict(shot.tables)) if isinstance(error, ValidationError) else str(error)
                at = ", ".join(f"{dotted(path)} = {value:.4g}" for path, value in values.items())
                raise FitError(
                    f"{where}: the priors reach {at} (SI), which is not possible: {told}; bound them, as uniform or "
                    "truncated_normal do"
                ) from None


def _check_hit(shot: MeasuredShot, scene: Scene, where: str) -> None:
    if isinstance(shot.hit, str) and not _some(shot.hit, scene.target.layers[0], scene.core):
        raise FitError(f'{where}: hit: got "{shot.hit}", but no place of this plate is')


def _some(hit: str, plate: Plate, core: Core) -> bool:
    """Whether any place of a cell is of a class."""
    y, z = (np.linspace(-0.5, 0.5, 65)[1:] * side for side in plate.sampled_cell)
    return bool(CLASSES[hit](plate, core, *np.meshgrid(y, z, indexing="ij")).any())
