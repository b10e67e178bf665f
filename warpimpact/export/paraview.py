"""The history of a hit as VTK files for ParaView: the moving surface of the core, and the plate as it weakens.

It needs PyVista (`pip install 'warpimpact[vtk]'`). The folder contains ``core.pvd`` and ``plate.pvd``, which list the
other files with their times; of a hit by finite
elements, ``plate.pvd`` has the deformed elements of all layers. Lengths are in metres in the frame of the plate, times
in seconds.
"""

from __future__ import annotations

import tempfile
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import xarray
from scipy.spatial.transform import Rotation

from warpimpact.analysis.replay_geometry import slabs
from warpimpact.results import variables as v
from warpimpact.results.files import OutputError

if TYPE_CHECKING:
    import pyvista
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

SIDES = 48
"""Points around the core's surface."""
_BODY = (v.VELOCITY, v.MARCHED_ANGULAR_VELOCITY, v.FORCE, v.MOMENT)


def write_vtk(history: xarray.Dataset, folder: Path) -> list[Path]:
    """Write a history into a new folder, whole or not at all; return the files to open.

    Args:
        history: a Dataset of `results.history_dataset`.

    Raises:
        OutputError: PyVista is not installed, or the folder cannot be written.
    """
    try:
        import pyvista  # noqa: F401
    except ImportError:
        raise OutputError(f"{folder}: VTK files need PyVista: pip install 'warpimpact[vtk]'") from None
    try:
        with tempfile.TemporaryDirectory(dir=folder.parent, prefix=f".{folder.name}.") as aside:
            pieces = Path(aside) / "vtk"
            pieces.mkdir()
            _write_series(pieces, "core", "vtp", history[v.TIME].values, cores(history))
            kind, meshes = ("vtu", deformed(history)) if v.NODE_POSITION in history else ("vti", plates(history))
            _write_series(pieces, "plate", kind, history[v.SNAPSHOT].values, meshes)
            pieces.rename(folder)
    except OSError as error:
        raise OutputError(f"{folder}: cannot be written ({error})") from error
    return [folder / "core.pvd", folder / "plate.pvd"]


def cores(history: xarray.Dataset) -> Iterator[pyvista.PolyData]:
    """The core's surface at every step: quadrilaterals with the velocity [m/s] of each point. The field data are the
    velocity, the angular velocity, the force and the moment of the whole core."""
    import pyvista

    station, radius = history[v.STATION].values, history[v.CORE_RADIUS].values
    azimuth = np.linspace(0.0, 2.0 * np.pi, SIDES, endpoint=False)
    ring = np.stack([np.zeros(SIDES), np.cos(azimuth), np.sin(azimuth)], axis=-1)
    arms = (station[:, None, None] * [1.0, 0.0, 0.0] + radius[:, None, None] * ring).reshape(-1, 3)
    faces = _faces(len(station))
    for step in range(history.sizes["time"]):
        now = history.isel(time=step)
        turned = Rotation.from_quat(now[v.ATTITUDE].values).apply(arms)
        velocity = now[v.VELOCITY].values + np.cross(now[v.MARCHED_ANGULAR_VELOCITY].values, turned)
        surface = pyvista.PolyData((now[v.PLATE_POSITION].values + turned).astype(np.float32), faces)
        surface.point_data[v.VELOCITY] = velocity.astype(np.float32)
        for name in _BODY:
            surface.field_data[f"core_{name}"] = now[name].values[None, :]
        yield surface


def _faces(rings: int) -> NDArray[np.int64]:
    """Quadrilaterals between rings and the polygons that close nose and base, in PyVista's format."""
    here = np.arange(SIDES)
    nxt = (here + 1) % SIDES
    start = SIDES * np.arange(rings - 1)[:, None]
    quads = np.stack([start + here, start + nxt, start + nxt + SIDES, start + here + SIDES], axis=-1).reshape(-1, 4)
    sides = np.hstack([np.full((len(quads), 1), 4), quads]).ravel()
    base = SIDES * (rings - 1) + here
    return np.concatenate([sides, [SIDES], here[::-1], [SIDES], base])


def deformed(history: xarray.Dataset) -> Iterator[pyvista.DataSet]:
    """The elements that are left of all layers at every snapshot, with their plastic strain."""
    import pyvista

    corners, hexahedron = history[v.ELEMENT_CORNER].values, pyvista.CellType.HEXAHEDRON
    for place, left, strain in zip(
        *(history[name].values for name in (v.NODE_POSITION, v.ELEMENT_LEFT, v.ELEMENT_STRAIN)), strict=True
    ):
        mesh = pyvista.UnstructuredGrid({hexahedron: corners[left > 0]}, place)
        mesh.cell_data[v.ELEMENT_STRAIN] = strain[left > 0]
        yield mesh


def plates(history: xarray.Dataset) -> Iterator[pyvista.ImageData]:
    """The plate within reach of the core at every snapshot: cells with the share of the resistance left."""
    import pyvista

    front, rear, _ = slabs(history, "y")[0]
    y, z = history[v.CELL_Y].values, history[v.CELL_Z].values
    dy, dz = y[1] - y[0], z[1] - z[0]
    for share in history[v.RESISTANCE_SHARE].values:
        grid = pyvista.ImageData(
            dimensions=(2, len(y) + 1, len(z) + 1),
            spacing=(rear - front, dy, dz),
            origin=(front, y[0] - 0.5 * dy, z[0] - 0.5 * dz),
        )
        grid.cell_data[v.RESISTANCE_SHARE] = share.ravel(order="F")
        yield grid


def _write_series(folder: Path, name: str, kind: str, times: Array, meshes: Iterator[pyvista.DataSet]) -> None:
    """Write meshes as ``<name>_<number>.<kind>``, and ``<name>.pvd`` with the time of each."""
    root = ElementTree.Element("VTKFile", type="Collection", version="0.1")
    collection = ElementTree.SubElement(root, "Collection")
    for number, (time, mesh) in enumerate(zip(times, meshes, strict=True)):
        file = f"{name}_{number:04d}.{kind}"
        mesh.save(folder / file)
        ElementTree.SubElement(collection, "DataSet", timestep=repr(float(time)), part="0", file=file)
    ElementTree.ElementTree(root).write(folder / f"{name}.pvd", xml_declaration=True, encoding="utf-8")
