"""The Dataset of a map of hits: functions that build and read it (its variables: records/variables.py).

Inside the package everything is in SI and radians; angles become degrees here. The Dataset follows the CF conventions
and opens with plain ``xarray.open_dataset``.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from functools import lru_cache
from typing import Any

import numpy as np
import xarray
from numpy.typing import NDArray

from warpimpact.records import attributes as attr
from warpimpact.records import variables as v
from warpimpact.records.kinds import HIT_MAP
from warpimpact.records.outcomes import Outcomes
from warpimpact.scene import Core, Plate, Scene, Shots, Target
from warpimpact.scene.input_files import parsed
from warpimpact.scene.quantities import BY_LAYER, QUANTITIES
from warpimpact.scene.units import reader_in, typed

_ATTRIBUTES = {
    attr.KIND: HIT_MAP.mark,
    "Conventions": "CF-1.11",
    "source": "warpimpact: trajectories of a rigid core through a perforated plate that resists and weakens",
    attr.REFERENCES: "Numerical and experimental investigation of asymmetrical contact between a steel plate "
    "and armour-piercing projectiles",
    "comment": "Plate frame, right-handed: x along the plate normal in the direction of fire, x = 0 at the "
    "front face; y and z in the plate. NaN marks a value that does not exist.",
}


def to_dataset(
    scene: Scene,
    shots: Shots,
    outcomes: Outcomes,
    *,
    period: tuple[float, float],
    attributes: Mapping[str, Any],
    numbers: NDArray[Any] | None = None,
    double: bool = False,
    left_out: Collection[str] = (),
) -> xarray.Dataset:
    """Gather scene, shots and outcomes into the Dataset of the hit map.

    Args:
        outcomes: of the shots, SI and radians; NaN where there is no value.
        period: extent (y, z) of the unit cell [m], centred on the origin, over which hits and holes are drawn.
        attributes: global attributes of the run.
        numbers: numbers of the hits in their campaign; by default from 0 on.
        double: whether the outcomes were computed in double precision. If not, they are stored in single precision;
            shots are always double.
        left_out: variables that are not stored.
    """
    coordinates: dict[str, Any] = {
        v.HIT: np.arange(len(shots), dtype=np.int32) if numbers is None else numbers.astype(np.int32),
        v.HIT_Y: shots.hit_y,
        v.HIT_Z: shots.hit_z,
        v.STANDOFF: np.array(scene.record.standoffs),
        v.AXIS: ["x", "y", "z"],
        **labels(scene.target),
    }
    if v.PICTURE in outcomes:
        across, along_flight = v.picture_axes(scene.core)
        coordinates |= {v.INSTANT: np.array(v.INSTANTS), v.ALONG: along_flight, v.ACROSS: across}
    along = (name for name in (*v.COORDINATES, *v.LAYER_LABELS, *v.PICTURE_AXES) if name in coordinates)
    values = _values(scene, shots, outcomes)
    values[v.EDGE_DISTANCE] = scene.target.layers[0].edge_distance(shots.hit_y, shots.hit_z)
    zero = np.zeros(len(shots))
    values[v.EXIT_POSITION] = outcomes.exit_position + np.stack([zero, shots.hit_y, shots.hit_z], axis=-1)
    variables = (name for name in v.hit_variables() if name in values and name not in left_out)
    single = () if double else v.computed_variables()
    columns = stored_columns(variables, values, single)
    return xarray.Dataset(
        columns,
        {name: column for name, column in scene_columns(scene).items() if name not in columns}
        | stored_columns(along, coordinates, single),
        _ATTRIBUTES | attr.with_units(dict(attributes) | {attr.PLATE_PERIOD: np.array(period)}),
    )


def narrow_dataset(scene: Scene, shots: Shots, outcomes: Outcomes) -> xarray.Dataset:
    """The columns of `to_dataset` that measures need, for computations with many small results."""
    values = {v.MASS: scene.core.mass_properties.mass, **_values(scene, shots, outcomes)}
    kept = [one for one in (*v.hit_variables(), *v.LAYER_FACES) if one in values and one not in v.PICTURE_VARIABLES]
    coordinates: dict[Any, Any] = {v.HIT: np.arange(len(shots)), v.STANDOFF: np.array(scene.record.standoffs)}
    silhouette = _silhouette(scene.core)
    return xarray.Dataset(stored_columns(kept, values), stored_columns(coordinates, coordinates) | silhouette)


def _values(scene: Scene, shots: Shots, outcomes: Outcomes) -> dict[str, Any]:
    """Conditions, outcomes and faces of the layers by their names in a result, SI and radians."""
    known = _conditions(scene, shots) | vars(outcomes)
    return known | {v.PERFORATED: outcomes.perforated} | faces(scene.target)


def _conditions(scene: Scene, shots: Shots) -> dict[v.Variable, Any]:
    """Conditions of the shots by their names in a result, SI and radians."""
    columns = own_columns(scene.target, shots)
    conditions = {variable: getattr(shots, variable.field) for variable in v.SHOT_VARIABLES}
    return conditions | {name: columns[name] for name in v.SCATTER_VARIABLES if name in columns}


def shots_dataset(scene: Scene, shots: Shots) -> xarray.Dataset:
    """Places and conditions of shots, with the names and bits of their result."""
    values = {v.HIT_Y: shots.hit_y, v.HIT_Z: shots.hit_z, **_conditions(scene, shots)}
    return xarray.Dataset(stored_columns(values, {str(name): of for name, of in values.items()}))


def scene_columns(scene: Scene) -> dict[str, tuple[Any, ...]]:
    """Every input of a scene that is one number, as scalar coordinates (CF); those of several layers along "layer", and
    the silhouette of the core.

    Coordinates stay as they are where hits are chosen by ``where``.
    """
    plate, core, properties = scene.target.layers[0], scene.core, scene.core.mass_properties
    known = {str(variable): variable.long_name for variable in v.SCATTER_VARIABLES}
    columns: dict[str, tuple[Any, ...]] = {
        "core_length": column((), core.length, "m", "length of the core"),
        "core_diameter": column((), 2.0 * core.max_radius, "m", "diameter of the core"),
        v.MASS: column((), properties.mass, "kg", v.MASS.long_name),
    }
    for axis, side in zip("yz", plate.size or (), strict=False):
        columns[f"size_{axis}"] = column((), side, "m", f"extent of the plate along {axis}")
    if core.threat:
        columns["core_threat"] = ((), core.threat, {"long_name": "name of the core in the catalogue"})
    if plate.material:
        columns["material"] = ((), plate.material, {"long_name": "material of the plate in the catalogue"})
    models = {"": plate, "core": core, "pattern": plate.pattern, "interaction": scene.interaction}
    if scene.interaction.free_surface is not None:
        models["free_surface"] = scene.interaction.free_surface
    for of, model in models.items():
        for name, field in type(model).model_fields.items():
            value, reader = getattr(model, name), reader_in(typed(field))
            stored = name if (name in QUANTITIES and name != "density") or not of else f"{of}_{name}"
            if stored in columns or reader is None or not isinstance(value, float):
                continue
            units = reader.display.stored
            meaning = known.get(stored, f"{name} of the {of.replace('_', ' ') or 'plate'}, as in a campaign")
            columns[stored] = column((), np.degrees(value) if units == "degree" else value, units, meaning)
    if len(scene.target.layers) > 1:
        for name, variable in zip(BY_LAYER, v.LAYER_SCATTER, strict=True):
            values = [scene.target.value(name, layer) for layer in range(len(scene.target.layers))]
            columns[variable] = (("layer",), np.array(values), variable.attributes)
    return {str(name): column for name, column in columns.items()} | _silhouette(core)


@lru_cache(maxsize=64)
def _silhouette(core: Core) -> dict[str, tuple[Any, ...]]:
    """Presented areas of a core by inclination. Steps of a quarter of a degree err by 1e-5."""
    inclinations = np.radians(np.linspace(0.0, 90.0, 361))
    names = (v.INCLINATION, v.PRESENTED_AREA)
    return stored_columns(names, dict(zip(names, (inclinations, core.presented_area(inclinations)), strict=True)))


def own_columns(target: Target, shots: Shots) -> dict[str, NDArray[Any]]:
    """Quantities that differ from shot to shot, under the names of a result. A quantity that every layer has is named
    as `thickness` for the plate, and as `layer_thickness` for all layers if a layer behind the plate differs."""
    columns: dict[str, NDArray[Any]] = {name: values for name, values in shots.columns.items() if name not in BY_LAYER}
    for name in BY_LAYER:
        values = [shots.layer_value(target, name, k) for k in range(len(target.layers))]
        if shots.varies(name, 0):
            columns[name] = values[0]
        if any(shots.varies(name, k) for k in range(1, len(values))):
            columns[f"layer_{name}"] = np.stack(np.broadcast_arrays(*values, np.empty(len(shots)))[:-1], axis=1)
    return columns


def values_of(target: Target, hit: xarray.Dataset, name: str) -> list[float]:
    """The values of a quantity in all layers for one hit of a result, which has them under the names of
    `own_columns`."""
    if f"layer_{name}" in hit:
        return [float(value) for value in hit[f"layer_{name}"]]
    values = [target.value(name, k) for k in range(len(target.layers))]
    return [float(hit[name]), *values[1:]] if name in hit else values


def faces(target: Target) -> dict[str, NDArray[np.float64]]:
    """Faces of the layers; empty if the plate stands alone."""
    return dict(zip(v.LAYER_FACES, target.faces.T, strict=True)) if len(target.layers) > 1 else {}


def labels(target: Target) -> dict[str, Any]:
    """Number, name and material of the layers; empty if the plate stands alone."""
    if len(target.layers) == 1:
        return {}
    names = [name for name, _ in target.named]
    materials = [layer.material or "" for layer in target.layers]
    return {v.LAYER: np.arange(len(names), dtype=np.int8), v.LAYER_NAME: names, v.LAYER_MATERIAL: materials}


def _holed(dataset: xarray.Dataset, layer: int) -> Plate | None:
    """A layer (0 is the plate) with its holes and its rim, as the campaign of the result has them; None where it does
    not have them, or they are swept."""
    try:
        tables = parsed(str(dataset.attrs.get(attr.CAMPAIGN, "")), "the campaign in the result")
        table = [tables["plate"], *tables.get("layer", ())][layer]
        shape = {name: table[name] for name in ("pattern", "size") if table.get(name) is not None}
        plate = Plate.model_validate({"thickness": 1.0, "resistance": 0.0, **shape})
    except (AttributeError, LookupError, ValueError):
        return None
    is_swept = any("pattern" in key or key.startswith(("plate", "layer")) for key in tables.get("sweep", ()))
    return None if is_swept else plate


def is_uniform(dataset: xarray.Dataset) -> bool:
    """Whether a target is alike at every place: no layer has holes or a rim."""
    layers = [_holed(dataset, layer) for layer in range(dataset.sizes.get("layer", 1))]
    return all(plate is not None and plate.open_area == 0.0 and plate.size is None for plate in layers)


def outlines(dataset: xarray.Dataset, layer: int = 0) -> NDArray[np.float64]:
    """Outlines of the holes of a layer (0 is the plate) along y and z [m], shape (2, vertices), with a NaN between two
    outlines, as the campaign of the result has them; empty where it has none, or they are swept."""
    plate = _holed(dataset, layer)
    if plate is None:
        return np.empty((2, 0))
    columns = (f"layer_offset_{axis}" for axis in "yz")
    offset = np.array([float(np.median(dataset[at][..., layer])) if at in dataset else 0.0 for at in columns])
    half = 0.5 * np.array(dataset.attrs[attr.PLATE_PERIOD], dtype=float)
    return np.asarray(outlines_in(plate, *zip(-half - offset, half - offset, strict=True)).T + offset[:, None])


def outlines_in(plate: Plate, y_range: tuple[float, float], z_range: tuple[float, float]) -> NDArray[np.float64]:
    """Outlines of the holes in a rectangle [m], shape (vertices, 2), with a NaN between two outlines."""
    gap = np.full((1, 2), np.nan)
    rows = [row for outline in plate.pattern.outlines(y_range, z_range) for row in (gap, outline)]
    return np.concatenate(rows[1:]) if rows else np.empty((0, 2))


def column(
    dims: str | tuple[str, ...], values: Any, units: str, long_name: str
) -> tuple[str | tuple[str, ...], Any, dict[str, str]]:
    """Values with dimensions, units and meaning, as xarray takes them."""
    return dims, values, {"units": units, "long_name": long_name}


def with_interval(
    name: str, dims: str | tuple[str, ...], ends: NDArray[np.float64], units: str, long_name: str
) -> dict[str, tuple[Any, ...]]:
    """Columns of a number, and of the lower and the upper end of its interval: the last axis of `ends`."""
    value, low, high = np.moveaxis(ends, -1, 0)
    return {
        name: column(dims, value, units, long_name),
        f"{name}_low": column(dims, low, units, "lower end of its 95 % interval"),
        f"{name}_high": column(dims, high, units, "upper end of its 95 % interval"),
    }


def joined(chunks: Iterable[xarray.Dataset], dimension: str = v.HIT) -> xarray.Dataset:
    """Datasets of consecutive hits as one. Variables without hits, and attributes, are those of the first."""
    return xarray.concat(chunks, dimension, data_vars="minimal", coords="minimal", compat="override", join="override")


def stored_columns(
    variables: Iterable[v.Variable], values: Mapping[str, Any], single: Collection[str] = ()
) -> dict[str, tuple[Any, ...]]:
    """Values in the units of the Dataset, with dimensions and attributes, as xarray takes them; those of the variables
    in `single` in single precision."""
    return {
        str(variable): (
            variable.dims if np.ndim(values[variable]) else (),
            _stored(variable, values[variable], variable in single),
            variable.attributes,
        )
        for variable in variables
    }


def _stored(variable: v.Variable, values: Any, single: bool) -> Any:
    if getattr(values, "dtype", None) == np.bool_ and variable != v.PERFORATED:
        return values.astype(np.int8)
    shown = np.degrees(values) if variable.units == "degree" else values
    return shown.astype(np.float32) if single and shown.dtype.kind == "f" else shown
