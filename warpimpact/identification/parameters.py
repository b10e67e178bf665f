"""Parameters of a fit: the unknown numbers of the scene, their priors, and the scene at some values of them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, get_args, get_origin

import numpy as np
from pydantic import TypeAdapter, ValidationError

from warpimpact.campaign.text import CampaignError
from warpimpact.scene import AnyCore, Interaction, Plate
from warpimpact.scene.distributions import EDGE, AnyDistribution, Distribution
from warpimpact.scene.model import Array, Model
from warpimpact.scene.problems import complaint
from warpimpact.scene.quantities import OF_THE_SCENE, QUANTITIES
from warpimpact.scene.scatter import in_si
from warpimpact.scene.units import meant, quoted, reader_in, typed
from warpimpact.solver.materials import decay_rate

Path = tuple[str | int, ...]
"""Place of a key in the tables of a scene, such as ("plate", "pattern", "spacing", 0)."""

COLUMN_OF: dict[Path, str] = {(QUANTITIES[name].table, name): name for name in OF_THE_SCENE}
"""Name of the column, by the path."""
UNITS_OF_EXPOSURE: tuple[Path, ...] = (("plate", "degradation_interval"), ("plate", "degradation_distance"))
"""β per Δt_β is the same law as β^(Δt₀/Δt_β) per Δt₀, so these become a degradation of the shot."""

TABLES: dict[str, Any] = {"plate": Plate, "interaction": Interaction, "core": AnyCore}
"""Tables of the scene whose numbers may be parameters."""
_DISTRIBUTION: TypeAdapter[Distribution] = TypeAdapter(AnyDistribution)


class FitError(CampaignError):
    """A fit that cannot be computed: one sentence naming file, field, value and what is allowed."""


@dataclass(frozen=True)
class Parameter:
    """An unknown number of the scene, or the scale of a discrepancy.

    Attributes:
        path: path of its key in the fit file, such as ("plate", "pattern", "spacing", 0).
        name: short name, such as "spacing_y".
        unit: SI unit; "rad" for an angle, "" for a pure number.
        prior: distribution in SI and radians.
    """

    path: Path
    name: str
    unit: str
    prior: Distribution

    def at(self, normal: Array) -> Array:
        """Values at standard normal numbers, of their shape. The parameter follows its prior if the numbers are
        normal."""
        from scipy.special import ndtr  # a while to import

        return self.prior.quantile(np.clip(ndtr(normal), EDGE, 1.0 - EDGE))

    @property
    def ends(self) -> tuple[float, float]:
        """Smallest and largest value that can be drawn."""
        low, high = self.prior.quantile(np.array([EDGE, 1.0 - EDGE]))
        return float(low), float(high)

    @property
    def is_column(self) -> bool:
        """Whether its values may differ from shot to shot of one computation."""
        return self.path in COLUMN_OF or self.path in UNITS_OF_EXPOSURE or self.path[0] == "discrepancy"


def read_priors(prior: Mapping[str, Any], tables: Mapping[str, Any], name: str) -> list[Parameter]:
    """The parameters of a table [prior].

    Args:
        prior: nested as the tables of the scene, with a distribution in the place of each unknown number.
        tables: tables of the scene, which say which shape a core or a pattern has.
        name: name of the file.

    Raises:
        FitError: the message names the key.
    """
    known = list[tuple[Path, str, Distribution]]()
    for path, given in _distributions(prior, (), name):
        place = f"{name}: prior.{dotted(path)}"
        read = _reader(path, tables, place)
        known.append((path, read.unit, read_distribution(read, given, place)))
    names = [_short(path) for path, *_ in known]
    return [
        Parameter(path, short if names.count(short) == 1 else "_".join(map(str, path)), unit, law)
        for short, (path, unit, law) in zip(names, known, strict=True)
    ]


def read_distribution(read: Any, given: Mapping[str, Any], place: str) -> Distribution:
    """A distribution of a quantity, in SI.

    Raises:
        FitError: the message names the place.
    """
    try:
        return _DISTRIBUTION.validate_python(in_si(read, given))
    except ValidationError as error:
        problem = error.errors(include_url=False)[0]
        where = ".".join(str(part) for part in problem["loc"] if part != given.get("distribution"))
        words = complaint(problem)
        words = f"got {quoted(dict(given))}, but: {words}" if problem["type"] == "value_error" else words
        raise FitError(f"{place}{'.' if where else ''}{where}: {words}") from None
    except ValueError as error:
        raise FitError(f"{place}.{error}") from None


def is_distribution(value: Any) -> bool:
    return isinstance(value, Mapping) and "distribution" in value


def _distributions(node: Any, path: Path, name: str) -> Iterator[tuple[Path, Mapping[str, Any]]]:
    if path and is_distribution(node):
        yield path, node
    elif isinstance(node, Mapping):
        for key, inner in node.items():
            yield from _distributions(inner, (*path, key), name)
    elif isinstance(node, list):
        for index, inner in enumerate(node):
            yield from _distributions(inner, (*path, index), name)
    elif not path or not isinstance(path[-1], int):  # in a list a fixed number may stand beside an unknown one
        raise FitError(
            f"{name}: prior.{dotted(path)}: got {quoted(node)}, but a prior is a distribution such as "
            '{ distribution = "uniform", low = 1, high = 2 }; a known value belongs in the table of the scene'
        )


def dotted(path: Path) -> str:
    """A path in the form of a fit file."""
    return "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in path).removeprefix(".")


def _short(path: Path) -> str:
    if isinstance(path[-1], str):
        return path[-1]
    last = "yz"[path[-1]] if path[-2] in ("spacing", "size") else path[-1]
    return f"{path[-2]}_{last}"


def _reader(path: Path, tables: Mapping[str, Any], place: str) -> Any:
    """The reader of the quantity at a path of the scene."""
    annotation: Any = TABLES.get(str(path[0]))
    if annotation is None:
        raise FitError(f'{place}: got the table "{path[0]}", but a prior belongs in one of {", ".join(TABLES)}')
    node: Any = tables.get(str(path[0]), {})
    for part in path[1:]:
        if isinstance(part, int):
            annotation = _element(annotation, part)
            continue
        model = _model(annotation, node)
        fields = {} if model is None else model.model_fields
        if part not in fields:
            raise FitError(f'{place}: got the unknown key "{part}"; {meant(part, fields)}')
        annotation = typed(fields[part])
        node = node.get(part, {}) if isinstance(node, Mapping) else {}
    reader = reader_in(annotation)
    if reader is None:
        raise FitError(f"{place}: is no number, but only a number can have a prior")
    return reader


def _model(annotation: Any, node: Any) -> type[Model] | None:
    """The model that reads a table; the table names its shape if there are several."""
    models = list(_models(annotation))
    shape = node.get("shape", "none") if isinstance(node, Mapping) else "none"
    named = [model for model in models if getattr(model.model_fields.get("shape"), "default", None) == shape]
    return next(iter(named or models), None)


def _models(annotation: Any) -> Iterator[type[Model]]:
    if isinstance(annotation, type) and issubclass(annotation, Model):
        yield annotation
    for inner in get_args(annotation):
        yield from _models(inner)


def _element(annotation: Any, index: int) -> Any:
    """Type of an entry of a tuple; None where it has no such entry."""
    if get_origin(annotation) is tuple:
        inner = get_args(annotation)
        if len(inner) == 2 and inner[1] is Ellipsis:
            return inner[0]
        return inner[index] if index < len(inner) else None
    return next((element for inner in get_args(annotation) if (element := _element(inner, index)) is not None), None)


def with_medians(table: Any, prior: Any, parameters: Sequence[Parameter], path: Path = ()) -> Any:
    """Tables of the scene with the median of every prior in its place."""
    if is_distribution(prior):
        (parameter,) = (parameter for parameter in parameters if parameter.path == path)
        return as_read(parameter, float(parameter.prior.quantile(np.array(0.5))))
    if isinstance(prior, Mapping):
        given = dict(table) if isinstance(table, Mapping) else {}
        return given | {
            key: with_medians(given.get(key), inner, parameters, (*path, key)) for key, inner in prior.items()
        }
    if isinstance(prior, list):
        return [with_medians(None, inner, parameters, (*path, index)) for index, inner in enumerate(prior)]
    return prior


def put(tables: Mapping[str, Any], path: Path, value: Any) -> dict[str, Any]:
    """Tables with one value replaced; the other values are shared with the given tables."""

    def inner(node: Any, rest: Path) -> Any:
        if not rest:
            return value
        if isinstance(rest[0], int):
            return [inner(entry, rest[1:]) if index == rest[0] else entry for index, entry in enumerate(node)]
        return {**node, rest[0]: inner(node.get(rest[0], {}), rest[1:])}

    replaced: dict[str, Any] = inner(tables, path)
    return replaced


def as_read(parameter: Parameter, value: float) -> Any:
    """A value in SI as the tables hold it."""
    return f"{value!r} rad" if parameter.unit == "rad" else value


def corners(parameters: Sequence[Parameter]) -> Iterator[dict[Path, float]]:
    """Extreme values of the parameters: each alone at its ends with all others at their medians, then all together."""
    medians = {parameter.path: float(parameter.prior.quantile(np.array(0.5))) for parameter in parameters}
    for parameter in parameters:
        for end in parameter.ends:
            yield {**medians, parameter.path: end}
    for index in range(min(2 ** len(parameters), 256)):
        yield {parameter.path: parameter.ends[index >> place & 1] for place, parameter in enumerate(parameters)}


def columns_of(values: Mapping[Path, Array], plate: Plate) -> dict[str, Array]:
    """Columns of Shots for some values, each of their shape.

    Args:
        values: values by path. Paths that make no column are left out.
        plate: plate of the scene. Its degradation and unit of exposure hold where no value replaces them.
    """
    columns = {name: values[path] for path, name in COLUMN_OF.items() if path in values}
    for path in UNITS_OF_EXPOSURE:
        if path in values:
            base = columns.get("degradation", np.full_like(values[path], plate.degradation))
            columns["degradation"] = np.exp(decay_rate(base, 1.0) * plate.degradation_unit / values[path])
    return columns
