"""Reads a fit from a TOML file and validates it. A mistake becomes one sentence, a doubt a warning."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path as FilePath
from typing import Annotated, Any

import numpy as np
from pydantic import BeforeValidator, Field, ValidationError

from warpimpact.campaign.materials import catalogue_of, with_cores, with_materials
from warpimpact.campaign.plausible import check_plausible
from warpimpact.campaign.text import parsed, read_text
from warpimpact.catalogue.catalogue import Catalogue
from warpimpact.identification.fit import Fit, MeasuredShot, Sampling
from warpimpact.identification.measured import KINDS, read_hit, read_measured
from warpimpact.identification.parameters import (
    FitError,
    Parameter,
    Path,
    corners,
    dotted,
    read_distribution,
    read_priors,
    with_medians,
)
from warpimpact.results.kinds import FIT
from warpimpact.scene import Impact, Numerics, Record, Scatter
from warpimpact.scene.distributions import EDGE, Distribution
from warpimpact.scene.model import Model
from warpimpact.scene.problems import sentence
from warpimpact.scene.quantities import QUANTITIES
from warpimpact.scene.units import Title, quantity, quoted
from warpimpact.solver.limit import check_arrests

_Table = dict[str, Any]
_MOST_MEASURED = 256
DISCREPANCY: Mapping[str, Any] = {
    "velocity": {"distribution": "truncated_normal", "mean": 0, "std": 10, "low": 0, "high": 50},
    "angle": {"distribution": "truncated_normal", "mean": "0 deg", "std": "5 deg", "low": "0 deg", "high": "25 deg"},
}
"""Default prior of a scale of discrepancy: half of a normal distribution."""


def read_fit(path: str | FilePath) -> Fit:
    """Read a fit file; file names in it count from its folder.

    Raises:
        FitError: the file has a value that is not allowed.
        CampaignError: the file is missing, or is not TOML.
    """
    path = FilePath(path)
    return fit_from(read_text(path), str(path), path.parent)


def _at_a_level(numerics: Any) -> Any:
    """Numerics of level 0 by default. They may not ask for an accuracy."""
    if not isinstance(numerics, dict):
        return numerics
    if named := next((key for key in ("fidelity", "accuracy") if key in numerics), None):
        raise ValueError(f"got {named}, but a fit has no pilot; give level = 0 to 9, or single settings")
    return {"level": 0} | numerics


class _WithScene(Model):
    """Tables of a scene, which are read when their priors are known."""

    core: _Table = Field(default_factory=dict)
    plate: _Table = Field(default_factory=dict)
    interaction: _Table = Field(default_factory=dict)

    @property
    def tables(self) -> dict[str, _Table]:
        return {"core": self.core, "plate": self.plate, "interaction": self.interaction}


class _ShotTable(_WithScene):
    """A table [[shot]] of a fit file; `measured` is read with the stand-offs of the record."""

    name: Title = ""
    hit: Annotated[Any, BeforeValidator(read_hit)] = None
    impact: _Table = Field(default_factory=dict)
    measured: Any = None


class _DiscrepancyTable(Model):
    """A scale for each kind of discrepancy, a number or a prior; None is the default prior."""

    velocity: Any = None
    angle: Any = None


class FitFile(_WithScene):
    """A fit file."""

    title: Title = ""
    record: Record = Record()
    numerics: Annotated[Numerics, BeforeValidator(_at_a_level)] = Numerics(level=0)
    prior: Annotated[_Table, Field(min_length=1)]
    discrepancy: _DiscrepancyTable = _DiscrepancyTable()
    sampling: Sampling = Sampling()
    shot: Annotated[tuple[_ShotTable, ...], Field(min_length=1, max_length=_MOST_MEASURED)]
    catalogue: Any = None


def fit_from(text: str, name: str, folder: FilePath) -> Fit:
    """Read a fit from its text; `name` is the name of the file in errors."""
    data = parsed(text, name, FIT)
    catalogue = catalogue_of(data, name, folder)
    given: FitFile = _model(FitFile, with_cores(data, catalogue, name), name)
    parameters = read_priors(given.prior, given.tables, name)
    tables = with_medians(given.tables, given.prior, parameters)
    shots = tuple(
        _shot(table, tables, given.record, f"{name}: shot[{place}]", parameters, catalogue)
        for place, table in enumerate(given.shot)
    )
    kinds = {observation.kind for shot in shots for observation in shot.observations}
    scales, fixed = _discrepancy(given.discrepancy, kinds, name)
    fit = Fit(
        title=given.title,
        text=text,
        folder=folder,
        parameters=tuple(sorted((*parameters, *scales), key=lambda parameter: parameter.is_column)),
        discrepancy=fixed,
        record=given.record,
        numerics=given.numerics,
        sampling=given.sampling,
        shots=shots,
        warnings=tuple(_doubts(shots, parameters)),
    )
    _check_scenes(fit, name)
    return fit


def _model(kind: Any, data: Any, place: str) -> Any:
    try:
        return kind.model_validate(data)
    except ValidationError as error:
        raise FitError(f"{place}: {sentence(error, data)}") from None


def _shot(
    given: _ShotTable,
    tables: Mapping[str, Any],
    record: Record,
    place: str,
    parameters: list[Parameter],
    catalogue: Catalogue,
) -> MeasuredShot:
    impact = dict(given.impact)
    scattered = {key: value for key, value in impact.items() if isinstance(value, dict)}
    for key, value in scattered.items():
        if key not in QUANTITIES or QUANTITIES[key].table != "impact":
            raise FitError(f"{place}.impact.{key}: got {quoted(value)}, but no such quantity of an impact scatters")
        read = quantity(QUANTITIES[key].type)
        median = float(read_distribution(read, value, f"{place}.impact.{key}").quantile(np.array(0.5)))
        impact[key] = read.as_read(median)
    observations, status = read_measured(given.measured, record.standoffs, f"{place}.measured")
    limits = [observation.value for observation in observations if observation.is_limit]
    if limits:  # the search of limits begins at these values
        impact.setdefault("velocity", limits[0])
    # The known values of the plate's material; a prior overrides them.
    resolved = with_materials(_merged(tables, given.tables) | {"impact": impact}, catalogue, place)
    return MeasuredShot(
        name=given.name or place.partition(": ")[2],
        hit=given.hit,
        impact=_model(Impact, impact, f"{place}.impact"),
        scatter=_model(Scatter, scattered, f"{place}.impact"),
        tables={name: resolved[name] for name in given.tables},
        own=frozenset(parameter.path for parameter in parameters if _gives(given.tables, parameter.path)),
        observations=observations,
        status=status,
    )


def _merged(tables: Any, of_shot: Any) -> Any:
    """Tables of the fit, overridden by a shot's own values. A table with another shape replaces the fit's table."""
    if not (isinstance(tables, Mapping) and isinstance(of_shot, Mapping)) or of_shot.get(
        "shape", tables.get("shape")
    ) != (tables.get("shape")):
        return of_shot
    return {**tables, **{key: _merged(tables.get(key), value) for key, value in of_shot.items()}}


def _gives(tables: Any, path: Path) -> bool:
    """Whether nested tables have a value at a path."""
    for part in path:
        if isinstance(part, int):
            return isinstance(tables, list)
        if not isinstance(tables, Mapping) or part not in tables:
            return False
        tables = tables[part]
    return True


def _discrepancy(given: _DiscrepancyTable, kinds: set[str], name: str) -> tuple[list[Parameter], dict[str, float]]:
    """Scales of discrepancy: the unknown ones as parameters, and the fixed ones by kind."""
    scales, fixed = list[Parameter](), dict[str, float]()
    for kind, unit in KINDS.values():
        value, read = getattr(given, kind), quantity(unit)
        value = DISCREPANCY[kind] if value is None else value
        place = f"{name}: discrepancy.{kind}"
        if isinstance(value, dict):
            prior: Distribution = read_distribution(read, value, place)
            if prior.quantile(np.array(EDGE)) < 0.0:
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
    """Sentences about data that a fit accepts, but that say less than they seem to."""
    doubts, before = list[str](), dict[str, str]()
    for shot in shots:
        if (first := before.get(content := repr(replace(shot, name="")))) is None:
            before[content] = shot.name
        else:
            doubts.append(
                f'shots "{first}" and "{shot.name}" are the same in every number: they count twice, as two measurements'
            )
    numbers = sum(len(shot.observations) + (shot.status is not None) for shot in shots)
    if numbers < len(parameters):
        doubts.append(
            f"got {numbers} measured number{'s' if numbers > 1 else ''} against {len(parameters)} parameters: the "
            "posterior keeps its prior in most directions"
        )
    return doubts


def _check_scenes(fit: Fit, name: str) -> None:
    """Refuse priors that reach impossible scenes."""
    checked = set[tuple[str, frozenset[Path], bool]]()
    for place, shot in enumerate(fit.shots):
        where = f"{name}: shot[{place}]"
        try:
            scene = fit.scene_of(shot)
            check_plausible(scene.core, scene.target, scene.record, shot.impact)
        except ValueError as error:
            raise FitError(f"{where}: {_reason(error, shot)}") from None
        has_limit = any(observation.is_limit for observation in shot.observations)
        key = repr(shot.tables), shot.own, has_limit  # the scenes below depend on these alone
        if key in checked:
            continue
        checked.add(key)
        for values in corners(fit.scene_parameters):
            try:
                reached = fit.scene_of(shot, values)
                if has_limit:
                    check_arrests(reached)
            except ValueError as error:
                at = ", ".join(f"{dotted(path)} = {value:.4g}" for path, value in values.items())
                raise FitError(
                    f"{where}: the priors reach {at} (SI), which is not possible: {_reason(error, shot)}; bound them, "
                    "as uniform or truncated_normal do"
                ) from None


def _reason(error: ValueError, shot: MeasuredShot) -> str:
    return sentence(error, dict(shot.tables)) if isinstance(error, ValidationError) else str(error)
