"""The Dataset of a hit map: the one place that knows its names, units and attributes.

Inside the package everything is SI and radians; `to_dataset` is where angles become degrees. The Dataset
follows the CF conventions and opens with plain ``xarray.open_dataset``.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import xarray

from warpimpact.kernels.status import Status

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from warpimpact.scene import Shots
    from warpimpact.simulate import Outcomes


class OutputError(OSError):
    """A result file that cannot be written; the message is one sentence for the user."""


class ResultError(ValueError):
    """A file that cannot be read as a warpimpact result; the message is one sentence for the user."""


class Variable(NamedTuple):
    """What the Dataset says about one of its variables."""

    dims: tuple[str, ...]
    units: str
    long_name: str


COORDINATES = {
    "hit_y": Variable(("hit",), "m", "hit point on the front face, y"),
    "hit_z": Variable(("hit",), "m", "hit point on the front face, z"),
    "standoff": Variable(("standoff",), "m", "distance behind the rear face"),
    "axis": Variable(("axis",), "1", "axis of the plate frame"),
}

SHOT_VARIABLES = {
    "impact_velocity": Variable(("hit",), "m s-1", "impact velocity"),
    "obliquity": Variable(("hit",), "degree", "angle between line of fire and plate normal"),
    "azimuth": Variable(("hit",), "degree", "direction of the obliquity, from +y towards +z"),
    "impact_pitch": Variable(("hit",), "degree", "pitch of the core on impact, relative to the line of fire"),
    "impact_yaw": Variable(("hit",), "degree", "yaw of the core on impact, relative to the line of fire"),
    "spin": Variable(("hit",), "rad s-1", "spin of the core about its axis on impact"),
}

OUTCOME_VARIABLES = {
    "status": Variable(("hit",), "1", "how the shot ended"),
    "residual_velocity": Variable(("hit",), "m s-1", "residual velocity"),
    "deflection": Variable(("hit",), "degree", "angle between residual velocity and line of fire"),
    "angular_velocity": Variable(("hit", "axis"), "rad s-1", "residual angular velocity"),
    "energy_loss": Variable(("hit",), "J", "kinetic energy lost in the plate"),
    "contact_duration": Variable(("hit",), "s", "duration of contact"),
    "tilt": Variable(("hit", "standoff"), "degree", "angle between core axis and line of fire"),
    "pitch": Variable(("hit", "standoff"), "degree", "pitch of the core, projected into the x-z plane"),
    "yaw": Variable(("hit", "standoff"), "degree", "yaw of the core, projected into the x-y plane"),
    "total_yaw": Variable(("hit", "standoff"), "degree", "angle between core axis and residual velocity"),
}

OUTLINE_VARIABLES = {
    "outline_y": Variable(("vertex",), "m", "hole outlines in the unit cell, y, separated by NaN"),
    "outline_z": Variable(("vertex",), "m", "hole outlines in the unit cell, z, separated by NaN"),
}

VARIABLES = SHOT_VARIABLES | OUTCOME_VARIABLES | OUTLINE_VARIABLES

_ATTRIBUTES = {
    "Conventions": "CF-1.11",
    "source": "warpimpact: trajectories of a rigid core through a perforated plate that resists and weakens",
    "references": "Numerical and experimental investigation of asymmetrical contact between a steel plate "
    "and armour-piercing projectiles",
    "comment": "Plate frame, right-handed: x along the plate normal in the direction of fire, x = 0 at the "
    "front face; y and z in the plate. What does not exist is NaN.",
}


def to_dataset(
    shots: Shots,
    outcomes: Outcomes,
    *,
    standoffs: NDArray[np.float64],
    outlines: Sequence[NDArray[np.float64]],
    period: tuple[float, float],
    attributes: Mapping[str, str | int | float],
) -> xarray.Dataset:
    """Gather shots and outcomes into the Dataset of the hit map.

    Args:
        shots: n shots, SI and radians.
        outcomes: Their outcomes, SI and radians; NaN where a quantity does not exist.
        standoffs: Distances behind the rear face [m], shape (m,), for the outcomes of shape (n, m).
        outlines: Closed hole outlines [m], each of shape (vertices, 2), that maps draw.
        period: Extent (y, z) of the unit cell [m], centred on the origin, over which hits are drawn.
        attributes: Global attributes of the run: title, history, campaign, versions, device, seed, ...
    """
    vertices = _joined(outlines)
    coordinates = {"hit_y": shots.hit_y, "hit_z": shots.hit_z, "standoff": standoffs, "axis": ["x", "y", "z"]}
    values = {name: getattr(shots, name.removeprefix("impact_")) for name in SHOT_VARIABLES}
    values |= {name: getattr(outcomes, name) for name in OUTCOME_VARIABLES}
    values |= {"outline_y": vertices[:, 0], "outline_z": vertices[:, 1]}
    dataset = xarray.Dataset(
        {name: _described(variable, values[name]) for name, variable in VARIABLES.items()},
        {name: _described(variable, coordinates[name]) for name, variable in COORDINATES.items()},
        _ATTRIBUTES | dict(attributes) | {"plate_period": np.array(period)},
    )
    dataset["status"].attrs |= {
        "flag_values": np.array(list(Status), dtype=np.int8),
        "flag_meanings": " ".join(status.name.lower() for status in Status),
    }
    return dataset


def _described(variable: Variable, values: Any) -> tuple[tuple[str, ...], Any, dict[str, str]]:
    """Values in the units of the Dataset, with dimensions and attributes, as xarray takes them."""
    surface = np.degrees(values) if variable.units == "degree" else values
    return variable.dims, surface, {"units": variable.units, "long_name": variable.long_name}


def _joined(outlines: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
    """All outlines in one array of shape (vertices, 2), with a NaN row between one and the next."""
    gap = np.full((1, 2), np.nan)
    rows = [row for outline in outlines for row in (gap, outline)]
    return np.concatenate(rows[1:]) if rows else np.empty((0, 2))


def status_codes(dataset: xarray.Dataset) -> dict[str, int]:
    """Meaning → code of ``status``, in the order of the codes."""
    attributes = dataset["status"].attrs
    return dict(zip(attributes["flag_meanings"].split(), attributes["flag_values"].tolist(), strict=True))


def write(dataset: xarray.Dataset, path: Path) -> None:
    """Write the Dataset to a netCDF file, whole or not at all; an existing file is replaced.

    Raises:
        OutputError: The file cannot be written; what was there before is untouched.
    """
    aside = path.with_name(f".{path.name}.{os.getpid()}.part")
    encoding: dict[str, dict[str, Any]] = {
        str(name): {"zlib": True, "complevel": 1}
        for name, array in dataset.variables.items()
        if array.dtype.kind in "if"  # netCDF compresses no strings
    }
    for name in COORDINATES:
        encoding.setdefault(name, {})["_FillValue"] = None  # CF: a coordinate has no missing values
    try:
        dataset.to_netcdf(aside, format="NETCDF4", engine="netcdf4", encoding=encoding)
        os.replace(aside, path)
    except (OSError, RuntimeError) as error:  # netCDF reports a full disk as RuntimeError
        raise OutputError(f"{path}: cannot be written ({error})") from error
    finally:
        with suppress(OSError):
            aside.unlink()


def read(path: Path) -> xarray.Dataset:
    """Read a result file into memory.

    Raises:
        ResultError: The file is missing, is not netCDF, or is not a warpimpact result.
    """
    try:
        with xarray.open_dataset(path, engine="netcdf4") as file:
            dataset = file.load()
    except (OSError, RuntimeError) as error:
        raise ResultError(f"{path}: cannot be read as a netCDF file ({error})") from error
    missing = (COORDINATES.keys() | VARIABLES.keys()) - dataset.variables.keys()
    if missing:
        raise ResultError(f'{path}: not a warpimpact result, it has no variable "{min(missing)}"')
    return dataset
