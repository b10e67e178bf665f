"""The file of a replayed hit: the Dataset of its history, and what is shown of it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
import xarray
from numpy.typing import NDArray

from warpimpact.kernels.status import Status
from warpimpact.records import attributes as attr
from warpimpact.records import variables as v
from warpimpact.records.kinds import HISTORY
from warpimpact.results.dataset import column, outlines_in, values_of
from warpimpact.scene import Scene
from warpimpact.scene.units import count_text
from warpimpact.solver.replay import Replay

_CORE_STATIONS, _SECTION_POINTS = 101, 1601
"""Points of a core's profile and of a section of the plate."""
_AGREEMENT = {
    "not known": "How the fast law ended is not in the result, which has the means of its draws alone.",
    "bit-identical": "The end is bit-identical to the stored outcome.",
    "within rounding": "The end equals the stored outcome within rounding, as expected of another device.",
    "different": "The end DIFFERS from the stored outcome; probably another version of warpimpact computed it.",
}


def history_dataset(
    scene: Scene, hit: xarray.Dataset, replay: Replay, *, attributes: Mapping[str, Any]
) -> xarray.Dataset:
    """Gather a replayed shot into the Dataset of its history, with the data of core and plate that drawings need.

    The values of the hit become scalars, and its angular velocity `residual_angular_velocity`. The attributes override
    those of the hit.
    """
    core, plate, march = scene.core, scene.target.layers[0], replay.history
    hit_y, hit_z = float(hit[v.HIT_Y]), float(hit[v.HIT_Z])
    home, stations = (
        np.array([0.0, hit_y, hit_z]),
        np.union1d(np.linspace(0.0, core.length, _CORE_STATIONS), core.breaks),
    )
    farthest = np.abs(march.position[:, 1:]).max() if len(scene.target.layers) > 1 else 0.0
    section = np.linspace(-4.0, 4.0, _SECTION_POINTS) * (core.bounding_radius + 0.25 * farthest)
    from_centre = core.mass_properties.centre_of_mass - stations
    solid_y = plate.is_solid(hit_y + section, np.array(hit_z)).astype(np.int8)
    solid_z = plate.is_solid(np.array(hit_y), hit_z + section).astype(np.int8)
    outline = outlines_in(plate, *((float(cells.min()), float(cells.max())) for cells in replay.plate[:2]))
    along, wide, cells = ("time", "axis"), "through the hit point, else 0", ("snapshot", "cell_y", "cell_z")
    coordinates = {
        "time": column("time", march.time, "s", "time since the first touch of the front face"),
        "quaternion": column("quaternion", ["x", "y", "z", "w"], "1", "component of a quaternion, w its scalar part"),
        "snapshot": column("snapshot", replay.plate_time, "s", "time at which the plate is shown"),
        "cell_y": column("cell_y", replay.plate.cell_y, "m", "cell of the plate, y"),
        "cell_z": column("cell_z", replay.plate.cell_z, "m", "cell of the plate, z"),
        "section": column("section", section, "m", "distance from the hit point in the plate"),
        "station": column(
            "station", from_centre, "m", "distance along the core, from its centre of mass towards the nose"
        ),
    }
    columns = {
        "position": column(along, march.position, "m", "centre of mass, from the hit point"),
        "plate_position": column(along, march.position + home, "m", "centre of mass in the plate"),
        "attitude": column(
            ("time", "quaternion"), march.attitude, "1", "turn of the plate's axes into the core's, x towards its nose"
        ),
        "core_axis": column(along, march.core_axis, "1", "unit vector along the core towards its nose"),
        "velocity": column(along, march.velocity, "m s-1", "velocity of the centre of mass"),
        "angular_velocity": column(along, march.angular_velocity, "rad s-1", "angular velocity"),
        "force": column(along, march.force, "N", "force on the core, mean over the step"),
        "moment": column(along, march.moment, "N m", "moment about the centre of mass, mean over the step"),
        "translational_energy": column("time", march.translational_energy, "J", "kinetic energy of translation"),
        "rotational_energy": column("time", march.rotational_energy, "J", "kinetic energy of rotation"),
        "resistance_share": column(cells, replay.plate.share, "1", "share of the resistance left; 0 in holes"),
        "core_radius": column("station", core.radius(stations), "m", "radius of the core"),
        "solid_along_y": column("section", solid_y, "1", f"1 where the plate is solid along y {wide}"),
        "solid_along_z": column("section", solid_z, "1", f"1 where the plate is solid along z {wide}"),
        "outline_y": column("vertex", outline[:, 0], "m", "hole outlines in the unit cell, y, separated by NaN"),
        "outline_z": column("vertex", outline[:, 1], "m", "hole outlines in the unit cell, z, separated by NaN"),
    }
    if len(scene.target.layers) > 1:
        columns |= _layers(scene, hit, section)
    if (mesh := replay.deformed) is not None:
        place, of_element = mesh.position + home.astype(np.float32), ("snapshot", "element")
        left, node = mesh.left.astype(np.int8), ("snapshot", "node", "axis")
        columns |= {
            "element_corner": column(("element", "corner"), mesh.corners, "1", "node at a corner, in the order of VTK"),
            "node_position": column(node, place, "m", "place of a node in the plate frame"),
            "element_left": column(of_element, left, "1", "1 where the element has not failed, else 0"),
            "element_strain": column(of_element, mesh.strain, "1", "plastic strain of the element"),
        }
    thickness = float(hit.get(v.THICKNESS, plate.thickness))
    described = attr.with_units(dict(attributes) | {attr.KIND: HISTORY.mark, attr.PLATE_THICKNESS: thickness})
    history = hit.rename({v.ANGULAR_VELOCITY: "residual_angular_velocity"}).assign_coords(coordinates)
    return history.assign(columns).assign_attrs(described)


def _layers(scene: Scene, hit: xarray.Dataset, section: NDArray[np.float64]) -> dict[str, tuple[Any, ...]]:
    """Faces of the layers for one hit, and where each layer is solid along y and z through the hit point."""
    target, hit_y, hit_z = scene.target, float(hit[v.HIT_Y]), float(hit[v.HIT_Z])
    thickness, offset_y, offset_z = (values_of(target, hit, name) for name in ("thickness", "offset_y", "offset_z"))
    front = np.array(target.fronts([np.array(value) for value in thickness]))
    places, wide = list(zip(target.layers, offset_y, offset_z, strict=True)), "through the hit point, else 0"
    along_y = np.array([plate.is_solid(hit_y - y + section, np.array(hit_z - z)) for plate, y, z in places])
    along_z = np.array([plate.is_solid(np.array(hit_y - y), hit_z - z + section) for plate, y, z in places])
    return {
        v.LAYER_FRONT: ("layer", front, v.LAYER_FRONT.attributes),
        v.LAYER_REAR: ("layer", front + np.array(thickness), v.LAYER_REAR.attributes),
        **{
            f"layer_solid_along_{axis}": column(
                ("layer", "section"), solid.astype(np.int8), "1", f"1 where the layer is solid along {axis} {wide}"
            )
            for axis, solid in (("y", along_y), ("z", along_z))
        },
    }


def hit_view(history: xarray.Dataset) -> dict[str, list[str | pd.DataFrame]]:
    """Where a replayed hit was, how it ended, whether the core broke, and whether it agrees with the stored outcome."""
    place = ", ".join(f"{axis} = {float(history[f'hit_{axis}']) * 1e3:.3f} mm" for axis in "yz")
    tilts = [tilt for tilt in history[v.TILT] if tilt.notnull()]
    numbers = {
        "residual velocity": f"{float(history[v.RESIDUAL_VELOCITY]):.1f} m/s",
        **{f"tilt at {float(tilt.standoff) * 1e3:g} mm": f"{float(tilt):.1f} °" for tilt in tilts},
    }
    table = pd.DataFrame({"": numbers})
    broken = [_breaking_words(history)] if v.BROKEN in history else []
    end, agreement = Status(int(history[v.STATUS])).sentence, _AGREEMENT[history.attrs[attr.AGREEMENT]]
    return {f"hit {history.attrs[attr.HIT]} at {place}": [end, table, *broken, agreement]}


def _breaking_words(history: xarray.Dataset) -> str:
    """Whether the core of a replayed hit broke, and where."""
    is_broken, where = bool(history[v.BROKEN] > 0.0), f"{float(history[v.BROKEN_SECTION]) * 1e3:.1f} mm behind the nose"
    if v.FRAGMENT_MASS in history:
        mass, eroded = (f"{float(history[name]) * 1e3:.2f} g" for name in (v.FRAGMENT_MASS, v.ERODED_MASS))
        fragments = count_text(int(history[v.FRAGMENTS]), "fragment")
        if is_broken:
            return f"The core broke {where} into {fragments}; the one that leads has {mass}, and {eroded} failed."
        return f"The core did not break; {mass} of it are left, and {eroded} failed."
    if not is_broken:
        return "The bending stress stayed below the core's strength."
    after = f"after {float(history[v.BROKEN_TIME]) * 1e6:.1f} µs, {where}"
    return f"The bending stress passed the core's strength {after}. The computed core goes on as one body."
