"""The Datasets of a hit map, a history and a study: functions that build and read them. variables.py says what they
hold.

Inside the package everything is in SI and radians; angles become degrees here. The Dataset follows the CF conventions
and opens with plain ``xarray.open_dataset``.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray

from warpimpact.kernels.status import Status
from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.scene.target import value_in

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from warpimpact.scene import Scene, Shots
    from warpimpact.solver.refinement import Estimates
    from warpimpact.solver.simulate import Outcomes, Replay


_ATTRIBUTES = {
    "Conventions": "CF-1.11",
    "source": "warpimpact: trajectories of a rigid core through a perforated plate that resists and weakens",
    attr.REFERENCES: "Numerical and experimental investigation of asymmetrical contact between a steel plate "
    "and armour-piercing projectiles",
    "comment": "Plate frame, right-handed: x along the plate normal in the direction of fire, x = 0 at the "
    "front face; y and z in the plate. NaN marks a value that does not exist.",
}

_STATIONS, _SECTION_POINTS = 101, 1601
"""Points of a core's profile and of a section of the plate in a history."""


def to_dataset(
    scene: Scene,
    shots: Shots,
    outcomes: Outcomes,
    *,
    period: tuple[float, float],
    attributes: Mapping[str, Any],
    estimates: Estimates | None = None,
) -> xarray.Dataset:
    """Gather shots and outcomes into the Dataset of the hit map.

    Args:
        scene: The scene, which records m stand-offs.
        shots: n shots, SI and radians.
        outcomes: Their outcomes, of shape (n,) or (n, m), SI and radians; NaN where there is no value.
        period: Extent (y, z) of the unit cell [m], centred on the origin, over which hits and holes are drawn.
        attributes: Global attributes of the run: title, history, campaign, versions, device, seed, ...
        estimates: Estimated errors of a run to a tolerance, SI and radians.
    """
    coordinates: dict[str, Any] = {
        v.HIT_Y: shots.hit_y,
        v.HIT_Z: shots.hit_z,
        v.STANDOFF: np.array(scene.record.standoffs),
        v.AXIS: ["x", "y", "z"],
    }
    values: dict[str, Any] = {variable: getattr(shots, variable.field) for variable in v.SHOT_VARIABLES}
    of_shots = (*v.SCATTER_VARIABLES, *v.BURST_VARIABLES)
    values |= {name: shots.columns[name] for name in of_shots if name in shots.columns}
    ended = (*v.OUTCOME_VARIABLES, *v.BENDING_VARIABLES, *v.LAYER_VARIABLES)
    values |= {name: getattr(outcomes, name) for name in ended if hasattr(outcomes, name)}
    values |= _of_layers(scene, shots)
    values |= _outlines(scene, *((-0.5 * side, 0.5 * side) for side in period))
    layers = (*v.LAYER_VARIABLES, *v.LAYER_FACES)
    optional = (name for name in (*of_shots, *v.BENDING_VARIABLES, *layers) if name in values)
    variables = [*v.VARIABLES, *optional]
    if estimates is not None:
        variables += v.ESTIMATE_VARIABLES
        values |= {name: getattr(estimates, name) for name in v.ESTIMATE_VARIABLES}
        values[v.CONVERGED] = estimates.converged.astype(np.int8)
    return xarray.Dataset(
        _described(variables, values),
        _described(v.COORDINATES, coordinates),
        _ATTRIBUTES | dict(attributes) | {attr.PLATE_PERIOD: np.array(period)},
    )


def solid_dataset(outcomes: Outcomes) -> xarray.Dataset:
    """Outcomes of the first shots against the solid plate of equal areal density, to be merged with the Dataset of all
    shots.

    Args:
        outcomes: SI and radians.
    """
    values: dict[str, Any] = {variable: getattr(outcomes, variable.field) for variable in v.SOLID_VARIABLES}
    return xarray.Dataset(_described(v.SOLID_VARIABLES, values))


def solid_reference(dataset: xarray.Dataset) -> xarray.Dataset | None:
    """Shots and outcomes of the solid plate, with the names of a hit map and along "hit"; None if there are none.

    A solid plate that stands alone is its own reference.
    """
    if dataset.attrs.get(attr.OPEN_AREA) == 0.0 and v.LAYER_STATUS not in dataset.variables:
        return dataset
    if not v.SOLID_VARIABLES.keys() <= dataset.variables.keys():
        return None
    solid = dataset[list(v.SOLID_VARIABLES)].isel(solid_hit=slice(dataset.sizes["hit"])).load()
    solid = solid.rename(v.SOLID_VARIABLES | {"solid_hit": "hit"})
    shots = v.shot_variables(dataset)
    first = dataset[shots].isel(hit=slice(solid.sizes["hit"]))
    return solid.merge(first.load())


def study_dataset(values: Mapping[str, Any], attributes: Mapping[str, Any]) -> xarray.Dataset:
    """Gather a study of speed and accuracy.

    Args:
        values: of every name in STUDY_VARIABLES and STUDY_COORDINATES, SI and radians.
        attributes: global attributes: title, history, campaign, versions, device, ...
    """
    return xarray.Dataset(
        _described(v.STUDY_VARIABLES, values),
        _described(v.STUDY_COORDINATES, values),
        _ATTRIBUTES | dict(attributes),
    )


def history_dataset(
    scene: Scene, hit: xarray.Dataset, replay: Replay, *, attributes: Mapping[str, Any]
) -> xarray.Dataset:
    """Gather a replayed shot into the Dataset of its history, which has enough data of core and plate to draw them.

    Args:
        scene: what was shot at what.
        hit: one hit of a Dataset of `to_dataset`. Its values stay as scalars; its angular velocity becomes
            `residual_angular_velocity`.
        replay: the shot's history.
        attributes: global attributes, which override those of `hit`.
    """
    core, plate = scene.core, scene.target.plate
    hit_y, hit_z = float(hit[v.HIT_Y]), float(hit[v.HIT_Z])
    history, stations = replay.history, np.union1d(np.linspace(0.0, core.length, _STATIONS), core.breaks)
    farthest = np.abs(history.position[:, 1:]).max() if scene.target.layers else 0.0
    section = np.linspace(-4.0, 4.0, _SECTION_POINTS) * (core.bounding_radius + 0.25 * farthest)
    values: dict[str, Any] = {name: getattr(history, name) for name in v.HISTORY_VARIABLES if hasattr(history, name)}
    values |= {
        v.PLATE_POSITION: history.position + np.array([0.0, hit_y, hit_z]),
        v.RESISTANCE_SHARE: replay.resistance_share,
        v.CORE_RADIUS: core.radius(stations),
        v.SOLID_ALONG_Y: plate.is_solid(hit_y + section, np.array(hit_z)).astype(np.int8),
        v.SOLID_ALONG_Z: plate.is_solid(np.array(hit_y), hit_z + section).astype(np.int8),
    }
    values |= _sections(scene, hit, section)
    values |= _outlines(scene, *((float(cells.min()), float(cells.max())) for cells in (replay.cell_y, replay.cell_z)))
    coordinates: dict[str, Any] = {
        v.TIME: history.time,
        v.QUATERNION: ["x", "y", "z", "w"],
        v.SNAPSHOT: replay.plate_time,
        v.CELL_Y: replay.cell_y,
        v.CELL_Z: replay.cell_z,
        v.SECTION: section,
        v.STATION: core.mass_properties.centre_of_mass - stations,
    }
    dataset = (
        hit.drop_dims("vertex")
        .rename({v.ANGULAR_VELOCITY: v.RESIDUAL_ANGULAR_VELOCITY})
        .assign_coords(_described(v.HISTORY_COORDINATES, coordinates))
    )
    thickness = float(hit.get(v.THICKNESS, plate.thickness))
    layered = (*v.LAYER_FACES, *v.LAYER_SECTIONS) if scene.target.layers else ()
    return dataset.assign(_described((*v.HISTORY_VARIABLES, *v.OUTLINE_VARIABLES, *layered), values)).assign_attrs(
        dict(attributes) | {attr.PLATE_THICKNESS: thickness}
    )


def _of_layers(scene: Scene, shots: Shots) -> dict[str, NDArray[np.float64]]:
    """Faces of the layers, and what differs in them from shot to shot; empty if the plate stands alone."""
    target = scene.target
    if not target.layers:
        return {}
    values = dict(zip(v.LAYER_FACES, target.faces.T, strict=True))
    for variable in v.LAYER_SCATTER:
        if variable in shots.columns:
            name = variable.removeprefix("layer_")
            own = [shots.own(name, value_in(target.plate, name))]
            own += [shots.own_of_layer(name, k, value_in(layer, name)) for k, layer in enumerate(target.layers)]
            values[variable] = np.stack(np.broadcast_arrays(*own, np.empty(len(shots)))[:-1], axis=1)
    return values


def _sections(scene: Scene, hit: xarray.Dataset, section: NDArray[np.float64]) -> dict[str, NDArray[Any]]:
    """Faces of the layers for one hit, and where each is solid along y and z through the hit point; empty if the plate
    stands alone."""
    target, hit_y, hit_z = scene.target, float(hit[v.HIT_Y]), float(hit[v.HIT_Z])
    if not target.layers:
        return {}

    def own(name: str) -> list[float]:
        means = [value_in(plate, name) for plate in target.plates]
        return hit[f"layer_{name}"].values.tolist() if f"layer_{name}" in hit else means

    thickness = own("thickness")
    if v.THICKNESS in hit:
        thickness[0] = float(hit[v.THICKNESS])
    front = np.array(target.fronts([np.array(one) for one in thickness]))
    places = list(zip(target.plates, own("offset_y"), own("offset_z"), strict=True))
    along_y = [plate.is_solid(hit_y - y + section, np.array(hit_z - z)) for plate, y, z in places]
    along_z = [plate.is_solid(np.array(hit_y - y), hit_z - z + section) for plate, y, z in places]
    return {
        v.LAYER_FRONT: front,
        v.LAYER_REAR: front + np.array(thickness),
        v.LAYER_SOLID_ALONG_Y: np.array(along_y).astype(np.int8),
        v.LAYER_SOLID_ALONG_Z: np.array(along_z).astype(np.int8),
    }


def _described(variables: Iterable[v.Variable], values: Mapping[str, Any]) -> dict[str, tuple[Any, ...]]:
    """Values in the units of the Dataset, with dimensions and attributes, as xarray takes them."""
    return {str(one): (one.dims, _in_units(one, values[one]), one.attributes) for one in variables}


def _in_units(variable: v.Variable, values: Any) -> Any:
    return np.degrees(values) if variable.units == "degree" else values


def _outlines(
    scene: Scene, y_range: tuple[float, float], z_range: tuple[float, float]
) -> dict[str, NDArray[np.float64]]:
    """Outlines of the holes in a rectangle [m], by OUTLINE_VARIABLES, with a NaN between one and the next."""
    gap = np.full((1, 2), np.nan)
    rows = [row for outline in scene.target.plate.pattern.outlines(y_range, z_range) for row in (gap, outline)]
    vertices = np.concatenate(rows[1:]) if rows else np.empty((0, 2))
    return {v.OUTLINE_Y: vertices[:, 0], v.OUTLINE_Z: vertices[:, 1]}


def status_codes(dataset: xarray.Dataset) -> dict[str, int]:
    """Meaning → code of ``status``, in the order of the codes."""
    attributes = dataset[v.STATUS].attrs
    return dict(zip(attributes["flag_meanings"].split(), attributes["flag_values"].tolist(), strict=True))


def passed(dataset: xarray.Dataset) -> NDArray[np.bool_]:
    """Whether each core passed the plate, shape (hit,): it perforated the plate or missed its material."""
    return np.isin(dataset[v.STATUS].values, [Status.PERFORATED, Status.MISSED])


def failed(dataset: xarray.Dataset) -> NDArray[np.bool_]:
    """Whether the computation of each shot failed, shape (hit,)."""
    return np.isin(dataset[v.STATUS].values, [status for status in Status if status.failed])


def shots_at_a_plate(dataset: xarray.Dataset) -> int:
    """How many hits in a row are on one plate; 1 without bursts."""
    return int(dataset.attrs.get(attr.SHOTS_AT_A_PLATE, 1))


def images(dataset: xarray.Dataset) -> int:
    """How many hits in a row are images of each other; 1 without `hits.irreducible`."""
    told = dataset.attrs
    if attr.IMAGES in told or attr.SYMMETRIES not in told:
        return int(told.get(attr.IMAGES, 1))
    return str(told[attr.SYMMETRIES]).count("(")  # files of version 0.1.0 name the symmetries, but not their number
