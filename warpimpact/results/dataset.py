"""The Dataset of a hit map: how it is gathered, asked, written and read; variables.py tells what it holds.

Inside the package everything is SI and radians; `to_dataset` is where angles become degrees. The Dataset
follows the CF conventions and opens with plain ``xarray.open_dataset``.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray

from warpimpact.kernels.status import Status
from warpimpact.results.variables import (
    BENDING_VARIABLES,
    COORDINATES,
    ESTIMATE_VARIABLES,
    HISTORY_COORDINATES,
    HISTORY_VARIABLES,
    OUTCOME_VARIABLES,
    OUTLINE_VARIABLES,
    SCATTER_VARIABLES,
    SHOT_VARIABLES,
    SOLID_VARIABLES,
    STUDY_COORDINATES,
    STUDY_VARIABLES,
    VARIABLES,
    Variable,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from warpimpact.scene import Scene, Shots
    from warpimpact.solver.refinement import Estimates
    from warpimpact.solver.simulate import Outcomes, Replay


_ATTRIBUTES = {
    "Conventions": "CF-1.11",
    "source": "warpimpact: trajectories of a rigid core through a perforated plate that resists and weakens",
    "references": "Numerical and experimental investigation of asymmetrical contact between a steel plate "
    "and armour-piercing projectiles",
    "comment": "Plate frame, right-handed: x along the plate normal in the direction of fire, x = 0 at the "
    "front face; y and z in the plate. What does not exist is NaN.",
}

_STATIONS, _SECTION_POINTS = 101, 1601
"""Points of a core's profile and of a section of the plate in a history."""


def to_dataset(
    scene: Scene,
    shots: Shots,
    outcomes: Outcomes,
    *,
    period: tuple[float, float],
    attributes: Mapping[str, str | int | float],
    estimates: Estimates | None = None,
) -> xarray.Dataset:
    """Gather shots and outcomes into the Dataset of the hit map.

    Args:
        scene: What was shot at what; it records m stand-offs.
        shots: n shots, SI and radians.
        outcomes: Their outcomes, of shape (n,) or (n, m), SI and radians; NaN where a quantity does not exist.
        period: Extent (y, z) of the unit cell [m], centred on the origin, over which hits and holes are drawn.
        attributes: Global attributes of the run: title, history, campaign, versions, device, seed, ...
        estimates: Of the errors of a run to a tolerance, SI and radians.
    """
    standoffs = np.array(scene.record.standoffs)
    coordinates = {"hit_y": shots.hit_y, "hit_z": shots.hit_z, "standoff": standoffs, "axis": ["x", "y", "z"]}
    values = {name: getattr(shots, name.removeprefix("impact_")) for name in SHOT_VARIABLES}
    values |= {name: shots.columns[name] for name in SCATTER_VARIABLES if name in shots.columns}
    values |= {
        name: getattr(outcomes, name) for name in OUTCOME_VARIABLES | BENDING_VARIABLES if hasattr(outcomes, name)
    }
    values |= _outlines(scene, *((-0.5 * side, 0.5 * side) for side in period))
    optional = SCATTER_VARIABLES | BENDING_VARIABLES
    variables = VARIABLES | {name: variable for name, variable in optional.items() if name in values}
    if estimates is not None:
        variables = variables | ESTIMATE_VARIABLES
        values |= {name: getattr(estimates, name) for name in ESTIMATE_VARIABLES}
        values["converged"] = estimates.converged.astype(np.int8)
    dataset = xarray.Dataset(
        {name: _described(variable, values[name]) for name, variable in variables.items()},
        {name: _described(variable, coordinates[name]) for name, variable in COORDINATES.items()},
        _ATTRIBUTES | dict(attributes) | {"plate_period": np.array(period)},
    )
    return _with_flags(dataset)


def _with_flags(dataset: xarray.Dataset) -> xarray.Dataset:
    """The Dataset with the codes of its status said."""
    dataset["status"].attrs |= {
        "flag_values": np.array(list(Status), dtype=np.int8),
        "flag_meanings": " ".join(status.name.lower() for status in Status),
    }
    return dataset


def solid_dataset(outcomes: Outcomes) -> xarray.Dataset:
    """What the solid plate of equal areal density makes of the first shots, to stand beside the Dataset of all.

    Args:
        outcomes: SI and radians.
    """
    return xarray.Dataset(
        {
            name: _described(variable, getattr(outcomes, name.removeprefix("solid_")))
            for name, variable in SOLID_VARIABLES.items()
        }
    )


def solid_reference(dataset: xarray.Dataset) -> xarray.Dataset | None:
    """Shots and outcomes of the solid plate under the names of the hits' own, along "hit"; None if there are none.

    A plate that is solid is its own reference.
    """
    if dataset.attrs.get("open_area") == 0.0:
        return dataset
    if not SOLID_VARIABLES.keys() <= dataset.variables.keys():
        return None
    solid = dataset[list(SOLID_VARIABLES)].isel(solid_hit=slice(dataset.sizes["hit"])).load()
    solid = solid.rename({name: name.removeprefix("solid_") for name in SOLID_VARIABLES} | {"solid_hit": "hit"})
    shots = [name for name in (*SHOT_VARIABLES, *SCATTER_VARIABLES) if name in dataset]
    first = dataset[shots].isel(hit=slice(solid.sizes["hit"]))
    return solid.merge(first.load())


def study_dataset(values: Mapping[str, Any], attributes: Mapping[str, str | int | float]) -> xarray.Dataset:
    """Gather a study of speed and accuracy.

    Args:
        values: of every name in STUDY_VARIABLES and STUDY_COORDINATES, SI and radians.
        attributes: global attributes: title, history, campaign, versions, device, ...
    """
    return _with_flags(
        xarray.Dataset(
            {name: _described(variable, values[name]) for name, variable in STUDY_VARIABLES.items()},
            {name: _described(variable, values[name]) for name, variable in STUDY_COORDINATES.items()},
            _ATTRIBUTES | dict(attributes),
        )
    )


def history_dataset(
    scene: Scene, hit: xarray.Dataset, replay: Replay, *, attributes: Mapping[str, str | int | float]
) -> xarray.Dataset:
    """Gather a replayed shot into the Dataset of its history, which tells enough of core and plate to draw them.

    Args:
        scene: what was shot at what.
        hit: the shot and its outcome as `to_dataset` gives them, one hit of it selected; they stay as scalars,
            the angular velocity at the end as `residual_angular_velocity`.
        replay: the shot's history.
        attributes: global attributes over those of `hit`.
    """
    core, plate = scene.core, scene.target.plate
    hit_y, hit_z = float(hit["hit_y"]), float(hit["hit_z"])
    history, stations = replay.history, np.union1d(np.linspace(0.0, core.length, _STATIONS), core.breaks)
    section = np.linspace(-4.0, 4.0, _SECTION_POINTS) * core.bounding_radius
    values = (
        {name: getattr(history, name) for name in HISTORY_VARIABLES if hasattr(history, name)}
        | {
            "plate_position": history.position + np.array([0.0, hit_y, hit_z]),
            "resistance_share": replay.resistance_share,
            "core_radius": core.radius(stations),
            "solid_along_y": plate.is_solid(hit_y + section, np.array(hit_z)).astype(np.int8),
            "solid_along_z": plate.is_solid(np.array(hit_y), hit_z + section).astype(np.int8),
        }
        | _outlines(scene, *((float(cells.min()), float(cells.max())) for cells in (replay.cell_y, replay.cell_z)))
    )
    coordinates = {
        "time": history.time,
        "quaternion": ["x", "y", "z", "w"],
        "snapshot": replay.plate_time,
        "cell_y": replay.cell_y,
        "cell_z": replay.cell_z,
        "section": section,
        "station": core.mass_properties.centre_of_mass - stations,
    }
    dataset = (
        hit.drop_dims("vertex")
        .rename(angular_velocity="residual_angular_velocity")
        .assign_coords(
            {name: _described(variable, coordinates[name]) for name, variable in HISTORY_COORDINATES.items()}
        )
    )
    return dataset.assign(
        {name: _described(variable, values[name]) for name, variable in (HISTORY_VARIABLES | OUTLINE_VARIABLES).items()}
    ).assign_attrs(dict(attributes) | {"plate_thickness": float(hit.get("thickness", plate.thickness))})


def _described(variable: Variable, values: Any) -> tuple[tuple[str, ...], Any, dict[str, str]]:
    """Values in the units of the Dataset, with dimensions and attributes, as xarray takes them."""
    surface = np.degrees(values) if variable.units == "degree" else values
    return variable.dims, surface, {"units": variable.units, "long_name": variable.long_name}


def _outlines(
    scene: Scene, y_range: tuple[float, float], z_range: tuple[float, float]
) -> dict[str, NDArray[np.float64]]:
    """Outlines of the holes in a rectangle [m], by OUTLINE_VARIABLES, with a NaN between one and the next."""
    gap = np.full((1, 2), np.nan)
    rows = [row for outline in scene.target.plate.pattern.outlines(y_range, z_range) for row in (gap, outline)]
    vertices = np.concatenate(rows[1:]) if rows else np.empty((0, 2))
    return {"outline_y": vertices[:, 0], "outline_z": vertices[:, 1]}


def status_codes(dataset: xarray.Dataset) -> dict[str, int]:
    """Meaning → code of ``status``, in the order of the codes."""
    attributes = dataset["status"].attrs
    return dict(zip(attributes["flag_meanings"].split(), attributes["flag_values"].tolist(), strict=True))


def passed(dataset: xarray.Dataset) -> NDArray[np.bool_]:
    """Whether each core passed the plate, shape (hit,): it perforated the plate or missed its material."""
    return np.isin(dataset["status"].values, [Status.PERFORATED, Status.MISSED])


def failed(dataset: xarray.Dataset) -> NDArray[np.bool_]:
    """Whether the computation of each shot failed, shape (hit,)."""
    return np.isin(dataset["status"].values, [status for status in Status if status.failed])


def images(dataset: xarray.Dataset) -> int:
    """How many hits in a row are images of each other; 1 but for a map with `hits.irreducible`."""
    return str(dataset.attrs.get("symmetries", "()")).count("(")
