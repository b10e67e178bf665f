"""What a Dataset tells of the layers of a target: where they stand, what scatters in them, where they are solid."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from warpimpact.results import variables as v
from warpimpact.scene.target import value_in

if TYPE_CHECKING:
    import xarray
    from numpy.typing import NDArray

    from warpimpact.scene import Scene, Shots
    from warpimpact.solver.layering import Weakened


def of_layers(scene: Scene, shots: Shots) -> dict[str, NDArray[np.float64]]:
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


def sections(scene: Scene, hit: xarray.Dataset, section: NDArray[np.float64]) -> dict[str, NDArray[Any]]:
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


def fields(scene: Scene, behind: dict[int, Weakened]) -> dict[str, NDArray[Any]]:
    """What is left of the layers behind the plate in a replayed hit, by LAYER_FIELDS; empty if none is reached that
    weakens. Windows of several sizes are filled up with NaN."""
    if not behind:
        return {}
    snapshots = len(next(iter(behind.values())).share)
    rows = max(len(layer.cell_y) for layer in behind.values())
    columns, layers = max(len(layer.cell_z) for layer in behind.values()), len(scene.target.plates)
    cell_y, cell_z = np.full((layers, rows), np.nan), np.full((layers, columns), np.nan)
    share = np.full((snapshots, layers, rows, columns), np.nan)
    for number, layer in behind.items():
        y, z = len(layer.cell_y), len(layer.cell_z)
        cell_y[number, :y], cell_z[number, :z], share[:, number, :y, :z] = layer.cell_y, layer.cell_z, layer.share
    return {v.LAYER_CELL_Y: cell_y, v.LAYER_CELL_Z: cell_z, v.LAYER_RESISTANCE_SHARE: share}
