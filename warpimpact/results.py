"""The Dataset of a hit map: how it is gathered, asked, written and read; variables.py tells what it holds.

Inside the package everything is SI and radians; `to_dataset` is where angles become degrees. The Dataset
follows the CF conventions and opens with plain ``xarray.open_dataset``.
"""

from __future__ import annotations

import math
import os
import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import netCDF4
import numpy as np
import xarray

from warpimpact.interrupts import uninterrupted
from warpimpact.kernels.status import Status
from warpimpact.variables import (
    BENDING_VARIABLES,
    COORDINATES,
    ESTIMATE_VARIABLES,
    HISTORY_COORDINATES,
    HISTORY_VARIABLES,
    OUTCOME_VARIABLES,
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

    from warpimpact.refine import Estimates
    from warpimpact.scene import Core, Plate, Shots
    from warpimpact.simulate import Outcomes, Replay


class OutputError(OSError):
    """A result file that cannot be written; the message is one sentence for the user."""


class ResultError(ValueError):
    """A file that cannot be read as a warpimpact result; the message is one sentence for the user."""


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
    shots: Shots,
    outcomes: Outcomes,
    *,
    standoffs: NDArray[np.float64],
    outlines: Sequence[NDArray[np.float64]],
    period: tuple[float, float],
    attributes: Mapping[str, str | int | float],
    estimates: Estimates | None = None,
) -> xarray.Dataset:
    """Gather shots and outcomes into the Dataset of the hit map.

    Args:
        shots: n shots, SI and radians.
        outcomes: Their outcomes, SI and radians; NaN where a quantity does not exist.
        standoffs: Distances behind the rear face [m], shape (m,), for the outcomes of shape (n, m).
        outlines: Closed hole outlines [m], each of shape (vertices, 2), that maps draw.
        period: Extent (y, z) of the unit cell [m], centred on the origin, over which hits are drawn.
        attributes: Global attributes of the run: title, history, campaign, versions, device, seed, ...
        estimates: Of the errors of a run to a tolerance, SI and radians.
    """
    vertices = _joined(outlines)
    coordinates = {"hit_y": shots.hit_y, "hit_z": shots.hit_z, "standoff": standoffs, "axis": ["x", "y", "z"]}
    values = {name: getattr(shots, name.removeprefix("impact_")) for name in SHOT_VARIABLES}
    values |= {name: shots.columns[name] for name in SCATTER_VARIABLES if name in shots.columns}
    values |= {
        name: getattr(outcomes, name) for name in OUTCOME_VARIABLES | BENDING_VARIABLES if hasattr(outcomes, name)
    }
    values |= {"outline_y": vertices[:, 0], "outline_z": vertices[:, 1]}
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
    hit: xarray.Dataset,
    replay: Replay,
    core: Core,
    plate: Plate,
    *,
    attributes: Mapping[str, str | int | float],
) -> xarray.Dataset:
    """Gather a replayed shot into the Dataset of its history.

    Args:
        hit: the shot and its outcome as `to_dataset` gives them, one hit of it selected; they stay as scalars,
            the angular velocity at the end as `residual_angular_velocity`.
        replay: the shot's history.
        core, plate: what hit what; the Dataset tells enough of both to draw them.
        attributes: global attributes over those of `hit`.
    """
    hit_y, hit_z = float(hit["hit_y"]), float(hit["hit_z"])
    history, stations = replay.history, np.union1d(np.linspace(0.0, core.length, _STATIONS), core.breaks)
    section = np.linspace(-4.0, 4.0, _SECTION_POINTS) * core.bounding_radius
    values = {name: getattr(history, name) for name in HISTORY_VARIABLES if hasattr(history, name)} | {
        "plate_position": history.position + np.array([0.0, hit_y, hit_z]),
        "resistance_share": replay.resistance_share,
        "core_radius": core.radius(stations),
        "solid_along_y": plate.is_solid(hit_y + section, np.array(hit_z)).astype(np.int8),
        "solid_along_z": plate.is_solid(np.array(hit_y), hit_z + section).astype(np.int8),
    }
    coordinates = {
        "time": history.time,
        "quaternion": ["x", "y", "z", "w"],
        "snapshot": replay.plate_time,
        "cell_y": replay.cell_y,
        "cell_z": replay.cell_z,
        "section": section,
        "station": core.mass_properties.centre_of_mass - stations,
    }
    dataset = hit.rename(angular_velocity="residual_angular_velocity").assign_coords(
        {name: _described(variable, coordinates[name]) for name, variable in HISTORY_COORDINATES.items()}
    )
    return dataset.assign(
        {name: _described(variable, values[name]) for name, variable in HISTORY_VARIABLES.items()}
    ).assign_attrs(dict(attributes) | {"plate_thickness": float(hit.get("thickness", plate.thickness))})


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


def passed(dataset: xarray.Dataset) -> NDArray[np.bool_]:
    """Whether each core passed the plate, shape (hit,): it perforated the plate or missed its material."""
    return np.isin(dataset["status"].values, [Status.PERFORATED, Status.MISSED])


def failed(dataset: xarray.Dataset) -> NDArray[np.bool_]:
    """Whether the computation of each shot failed, shape (hit,)."""
    return np.isin(dataset["status"].values, [status for status in Status if status.failed])


def images(dataset: xarray.Dataset) -> int:
    """How many hits in a row are images of each other; 1 but for a map with `hits.irreducible`."""
    return str(dataset.attrs.get("symmetries", "()")).count("(")


def write(dataset: xarray.Dataset, path: Path) -> None:
    """Write the Dataset to a netCDF file, whole or not at all; an existing file is replaced.

    Raises:
        OutputError: The file cannot be written; what was there before is untouched.
    """
    with uninterrupted(), aside(path) as file:
        dataset.to_netcdf(file, format="NETCDF4", engine="netcdf4", encoding=_encoding(dataset))


CHUNK = 2**15
"""Hits per chunk of a joined file: 256 KiB of one variable."""


def join(parts: Sequence[Path], path: Path, attributes: Mapping[str, Any]) -> None:
    """Write results one after the other into one file, whole or not at all, with one of them in memory at a time.

    Args:
        parts: results of the same campaign, in the order of their hits, on the disk of `path`.
        path: the file; an existing one is replaced.
        attributes: global attributes over those of the first part.

    Raises:
        OutputError: The file cannot be written; what was there before is untouched.
    """
    hits = 0
    for part in parts:
        with netCDF4.Dataset(part) as source:
            hits += len(source.dimensions["hit"])
    with aside(path, parts[0].parent) as file:
        with uninterrupted():
            dataset = read(parts[0]).assign_attrs(attributes).drop_encoding()
            encoding = _encoding(dataset, chunk=min(hits, CHUNK))
            dataset.to_netcdf(file, format="NETCDF4", engine="netcdf4", encoding=encoding, unlimited_dims=["hit"])
        at = dataset.sizes["hit"]
        with netCDF4.Dataset(file, "a") as joined:
            joined.set_auto_maskandscale(False)
            for variable in joined.variables.values():
                if variable.chunking() != "contiguous":  # of the megabytes that a variable may keep, two chunks will do
                    variable.set_var_chunk_cache(size=2 * math.prod(variable.chunking()) * variable.dtype.itemsize)
            for part in parts[1:]:
                at = _append(joined, part, at)


def _append(joined: Any, part: Path, at: int) -> int:
    """Copy the hits of a part behind those that are there; returns how many there are then."""
    with netCDF4.Dataset(part) as source:
        source.set_auto_maskandscale(False)
        end = at + len(source.dimensions["hit"])
        for name, variable in joined.variables.items():
            if "hit" in variable.dimensions:
                variable[at:end] = source[name][:]
    return end


def _encoding(dataset: xarray.Dataset, *, chunk: int | None = None) -> dict[str, dict[str, Any]]:
    """How variables are stored: compressed, and with `chunk` hits per chunk if that is given."""
    encoding: dict[str, dict[str, Any]] = {
        str(name): {"zlib": True, "complevel": 1}
        for name, array in dataset.variables.items()
        if array.dtype.kind in "if"  # netCDF compresses no strings
    }
    for name in dataset.coords:
        encoding.setdefault(str(name), {})["_FillValue"] = None  # CF: a coordinate has no missing values
    for name, array in dataset.variables.items():
        if chunk and "hit" in array.dims:
            encoding[str(name)]["chunksizes"] = (chunk, *array.shape[1:])
    return encoding


@contextmanager
def aside(path: Path, folder: Path | None = None) -> Iterator[Path]:
    """A name in a folder of the same disk, if not given that of `path`, to write to; what was written there is on the
    disk before it gets its own name.

    Raises:
        OutputError: The file cannot be written; what was there before is untouched.
    """
    written = (folder or path.parent) / f".{path.name}.{os.getpid()}.part"
    try:
        yield written
        _flush(written, os.O_RDWR)
        os.replace(written, path)
        if os.name == "posix":  # elsewhere a folder cannot be opened, and needs no flushing
            _flush(path.parent, os.O_RDONLY)
    except (OSError, RuntimeError) as error:  # netCDF reports a full disk as RuntimeError
        raise OutputError(f"{path}: cannot be written ({_cause(error, path)})") from error
    finally:
        with suppress(OSError):
            written.unlink()


def _flush(path: Path, mode: int) -> None:
    descriptor = os.open(path, mode)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _cause(error: Exception, path: Path) -> str:
    """What an error of the disk means: netCDF does not say that the disk is full."""
    with suppress(OSError):
        if isinstance(error, RuntimeError) and shutil.disk_usage(path.parent).free < 2**20:
            return "the disk is full"
    return str(error)


def read(path: Path) -> xarray.Dataset:
    """Read a result file into memory.

    Raises:
        ResultError: The file is missing, is not netCDF, or is not a warpimpact result.
    """
    with uninterrupted(), opened(path) as file:
        return file.load()


@contextmanager
def opened(path: Path) -> Iterator[xarray.Dataset]:
    """A result file of which only what is used is read.

    Raises:
        ResultError: as in `read`.
    """
    with opened_either(path) as dataset:
        if is_history(dataset):
            raise ResultError(f"{path}: is the history of a single hit, not a map of hits")
        yield dataset


@contextmanager
def opened_either(path: Path) -> Iterator[xarray.Dataset]:
    """A result file, or the history of one of its hits, of which only what is used is read.

    Raises:
        ResultError: The file is missing, is not netCDF, or is neither.
    """
    with _netcdf(path) as dataset:
        missing = (COORDINATES.keys() | VARIABLES.keys()) - dataset.variables.keys()
        if missing:
            raise ResultError(f'{path}: not a warpimpact result, it has no variable "{min(missing)}"')
        yield dataset


def read_study(path: Path) -> xarray.Dataset:
    """Read a study of speed and accuracy into memory.

    Raises:
        ResultError: The file is missing, is not netCDF, or is not a study.
    """
    with _netcdf(path) as dataset:
        missing = (STUDY_COORDINATES.keys() | STUDY_VARIABLES.keys()) - dataset.variables.keys()
        if missing:
            raise ResultError(f'{path}: not a study of warpimpact, it has no variable "{min(missing)}"')
        return dataset.load()


def is_history(dataset: xarray.Dataset) -> bool:
    """Whether a Dataset is the history of one hit, not a map of hits."""
    return "hit" not in dataset.sizes


def _netcdf(path: Path) -> xarray.Dataset:
    """An open netCDF file, with room for some chunks of a variable instead of for tens of megabytes."""
    _, slots, preemption = kept = netCDF4.get_chunk_cache()
    netCDF4.set_chunk_cache(4 * 8 * CHUNK, slots, preemption)
    try:
        return xarray.open_dataset(path, engine="netcdf4")
    except (OSError, RuntimeError) as error:
        raise ResultError(f"{path}: cannot be read as a netCDF file ({error})") from error
    finally:
        netCDF4.set_chunk_cache(*kept)
