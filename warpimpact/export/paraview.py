"""The history of a hit as VTK files for ParaView: the moving surface of the core, and the plate as it weakens.

It needs meshio (`pip install 'warpimpact[vtk]'`). The folder contains ``core.pvd`` and ``plate.pvd``, which list the
other files with their times; of a hit by finite elements, ``plate.pvd`` has the deformed elements of all layers.
Lengths are in metres in the frame of the plate, times in seconds.
"""

from __future__ import annotations

import tempfile
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import xarray
from scipy.spatial.transform import Rotation

from warpimpact.analysis.replay_geometry import slabs
from warpimpact.errors import OutputError
from warpimpact.scene.model import Array

SIDES = 48
"""Points around the core's surface."""
_BODY = ("velocity", "angular_velocity", "force", "moment")


def write_vtk(history: xarray.Dataset, folder: Path) -> list[Path]:
    """Write a history into a new folder, whole or not at all; return the files to open.

    Args:
        history: a Dataset of `results.history.history_dataset`.

    Raises:
        OutputError: meshio is not installed, or the folder cannot be written.
    """
    try:
        import meshio  # noqa: F401
    except ImportError:
        raise OutputError(f"{folder}: VTK files need meshio: pip install 'warpimpact[vtk]'") from None
    try:
        with tempfile.TemporaryDirectory(dir=folder.parent, prefix=f".{folder.name}.") as temporary:
            pieces = Path(temporary) / "vtk"
            pieces.mkdir()
            _write_series(pieces, "core", history["time"].values, _cores(history))
            plates = _deformed(history) if "node_position" in history else _weakened(history)
            _write_series(pieces, "plate", history["snapshot"].values, plates)
            pieces.rename(folder)
    except OSError as error:
        raise OutputError(f"{folder}: cannot be written ({error})") from error
    return [folder / "core.pvd", folder / "plate.pvd"]


def _cores(history: xarray.Dataset) -> Iterator[Any]:
    """The core's surface at every step, with the velocity [m/s] of each point, and with the velocity, the angular
    velocity, the force and the moment of the whole core."""
    import meshio

    station, radius = history["station"].values, history["core_radius"].values
    azimuth = np.linspace(0.0, 2.0 * np.pi, SIDES, endpoint=False)
    ring = np.stack([np.zeros(SIDES), np.cos(azimuth), np.sin(azimuth)], axis=-1)
    arms = (station[:, None, None] * [1.0, 0.0, 0.0] + radius[:, None, None] * ring).reshape(-1, 3)
    here = np.arange(len(arms)).reshape(-1, SIDES)
    after = np.roll(here, -1, axis=1)
    quads = np.stack([here[:-1], here[1:], after[1:], after[:-1]], axis=-1).reshape(-1, 4)
    fan = np.stack([np.zeros(SIDES - 2, dtype=int), np.arange(1, SIDES - 1), np.arange(2, SIDES)], axis=-1)
    cells = [("quad", quads), ("triangle", np.concatenate([here[0][fan], here[-1][fan[:, ::-1]]]))]
    for step in range(history.sizes["time"]):
        now = history.isel(time=step)
        turned = Rotation.from_quat(now["attitude"].values).apply(arms)
        velocity = now["velocity"].values + np.cross(now["angular_velocity"].values, turned)
        data = {f"core_{name}": np.tile(now[name].values, (len(arms), 1)) for name in _BODY}
        yield meshio.Mesh(now["plate_position"].values + turned, cells, {"velocity": velocity, **data})


def _deformed(history: xarray.Dataset) -> Iterator[Any]:
    """The elements that are left of all layers at every snapshot, with their plastic strain."""
    import meshio

    corners, fields = history["element_corner"].values, ("node_position", "element_left", "element_strain")
    for place, left, strain in zip(*(history[name].values for name in fields), strict=True):
        there = left > 0
        yield meshio.Mesh(place, [("hexahedron", corners[there])], cell_data={"element_strain": [strain[there]]})


def _weakened(history: xarray.Dataset) -> Iterator[Any]:
    """The plate within reach of the core at every snapshot: cells with the share of the resistance left."""
    import meshio

    front, rear, _ = slabs(history, "y")[0]
    centres = [history[name].values for name in ("cell_y", "cell_z")]
    edges = [np.append(at, 2.0 * at[-1] - at[-2]) - 0.5 * (at[1] - at[0]) for at in centres]
    points = np.stack(np.meshgrid([front, rear], *edges, indexing="ij"), axis=-1).reshape(-1, 3)
    number = np.arange(len(points)).reshape(2, len(edges[0]), len(edges[1]))
    sides = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
    y, z = map(len, centres)
    cells = np.stack([number[i, j : j + y, k : k + z].ravel() for i, j, k in sides], axis=-1)
    for share in history["resistance_share"].values:
        yield meshio.Mesh(points, [("hexahedron", cells)], cell_data={"resistance_share": [share.ravel()]})


def _write_series(folder: Path, name: str, times: Array, meshes: Iterator[Any]) -> None:
    """Write meshes as ``<name>_<number>.vtu``, and ``<name>.pvd`` with the time of each."""
    root = ElementTree.Element("VTKFile", type="Collection", version="0.1")
    collection = ElementTree.SubElement(root, "Collection")
    for number, (time, mesh) in enumerate(zip(times, meshes, strict=True)):
        file = f"{name}_{number:04d}.vtu"
        mesh.write(folder / file)
        ElementTree.SubElement(collection, "DataSet", timestep=repr(float(time)), part="0", file=file)
    ElementTree.ElementTree(root).write(folder / f"{name}.pvd", xml_declaration=True, encoding="utf-8")
