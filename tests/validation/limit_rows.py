"""Published limit velocities of solid plates, and what the model gives for the same plates per resistance.

Without degradation the limit velocity v of a core of mass m and diameter d in a plate of thickness h follows from
v² m / d³ = Y F(h/d, θ, η) (docs/model.md §4.5, 6.9). `tabulated` computes F by limit velocities on some nodes of each
core; a fit then needs no more runs.

To compute the stored table again, in some minutes on one core: python -m tests.validation.limit_rows
"""

import json
from dataclasses import dataclass
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline, PchipInterpolator

from warpimpact.catalogue.catalogue import Catalogue
from warpimpact.catalogue.entries import Threat
from warpimpact.catalogue.strength import Plates
from warpimpact.scene import Core, Plate, Scene, Shots
from warpimpact.solver.device import Worker
from warpimpact.solver.fast_law import FastLaw
from warpimpact.solver.limit import LimitSpec, limits

Array = NDArray[np.float64]

STORED = Path(__file__).parent / "stored"
PUBLISHED = STORED / "limit_velocities.csv"
TABLE = STORED / "limit_table.json"

PROJECTILES = (".30 AP M2", ".50 AP M2", "14.5 mm B32", "14.5 mm BS41")
BARE = " core"
"""Ends the name of a projectile that is the core alone, without jacket and lead. A bullet counts as its core."""
NODES = {
    "calibres": (0.4, 0.65, 1.0, 1.6, 2.5, 4.0, 6.3, 10.0),
    "obliquity": (0.0, 15.0, 30.0, 45.0),
    "friction": (0.0, 0.1, 0.2),
}
"""h/d, θ [deg] and η of the table."""
RESISTANCE = 1.0e9
"""At which the table is computed [Pa]."""


@dataclass(frozen=True)
class Rows(Plates):
    """Rows of the table of limit velocities: plates as they are published; arrays of shape [rows].

    Attributes:
        velocity: published limit velocity [m/s].
        deviation: its measured standard deviation [m/s]; NaN where there is none.
    """

    velocity: Array
    deviation: Array

    def __len__(self) -> int:
        """Number of rows."""
        return len(self.velocity)

    def __getitem__(self, which: NDArray[Any]) -> "Rows":
        """Some of the rows."""
        return Rows(**{name: values[which] for name, values in vars(self).items()})

    @property
    def diameter(self) -> Array:
        """Of the cores [m]."""
        return diameters(self.projectile)

    @property
    def mass(self) -> Array:
        """Of the cores [kg]."""
        return np.array([core(name).mass_properties.mass for name in self.projectile])


def diameters(projectiles: NDArray[np.str_]) -> Array:
    """Of the cores of projectiles [m]."""
    return np.array([2.0 * core(name).max_radius for name in projectiles])


@cache
def core(projectile: str) -> Core:
    """The core of a projectile, from the catalogue."""
    shape = Catalogue().named(Threat, str(projectile)).shape
    assert shape is not None
    return shape


def published() -> Rows:
    """All rows of the stored table."""
    data = pd.read_csv(PUBLISHED)
    full = data["projectile"]
    bare = full.str.endswith(BARE).to_numpy(bool)
    names = full.str.removesuffix(BARE)
    thickness = data["thickness_mm"].to_numpy(float) * 1e-3
    return Rows(
        projectile=names.to_numpy(np.str_),
        bare=bare,
        material=data["material"].to_numpy(np.str_),
        source=data["source"].to_numpy(np.str_),
        thickness=thickness,
        calibres=thickness / diameters(names.to_numpy(np.str_)),
        obliquity=np.radians(data["obliquity_deg"].to_numpy(float)),
        velocity=data["limit_velocity_m_s"].to_numpy(float),
        deviation=data["standard_deviation_m_s"].to_numpy(float),
        density=data["plate_density_g_cm3"].to_numpy(float) * 1e3,
        flow_stress=data[["plate_yield_MPa", "plate_UTS_MPa"]].mean(axis=1).to_numpy(float) * 1e6,
        hardness=data["plate_hardness_HV"].to_numpy(float),
    )


def computed(projectile: str, plates: list[tuple[float, float, float]], start: float = 2.5) -> Array:
    """F of some plates, shape [plates].

    Args:
        plates: h/d, θ [deg] and η of each.
        start: energy at which the searches begin, over that of the plain work.
    """
    body = core(projectile)
    mass, diameter = body.mass_properties.mass, 2.0 * body.max_radius
    calibres, obliquity, friction = np.array(plates).T
    angle, zero = np.radians(obliquity), np.zeros(len(plates))
    work = RESISTANCE * np.pi / 4.0 * diameter**3 * calibres / np.cos(angle)
    shots = Shots(
        hit_y=zero,
        hit_z=zero,
        velocity=np.sqrt(start * work / mass),
        obliquity=angle,
        azimuth=zero,
        pitch=zero,
        yaw=zero,
        spin=zero,
        thickness=calibres * diameter,
        shear_coefficient=friction,
    )
    plate = Plate(thickness=float(calibres.max() * diameter), resistance=RESISTANCE, density=mass / diameter**3)
    scene = Scene(core=body, target=plate)
    search = limits(scene, shots, LimitSpec("velocity", 0.5, highest=4.0e3), FastLaw(level=2), Worker("cpu"))
    value = search.value**2 * mass / (RESISTANCE * diameter**3)
    for place in np.flatnonzero(~np.isfinite(value)) if start < 5.0 else ():  # the search went past the limit
        value[place] = computed(projectile, [plates[place]], 2.0 * start)[0]
    return np.asarray(value)


def tabulated() -> dict[str, Any]:
    """The table of all projectiles, as it is stored."""
    plates = list(product(*NODES.values()))
    table = {name: [float(f"{value:.5g}") for value in computed(name, plates)] for name in PROJECTILES}
    return {"nodes": NODES, "projectiles": table}


@cache
def _table() -> dict[str, Any]:
    stored: dict[str, Any] = json.loads(TABLE.read_text(encoding="utf-8"))
    assert {name: tuple(values) for name, values in stored["nodes"].items()} == NODES
    projectiles: dict[str, Any] = stored["projectiles"]
    return projectiles


def unit(rows: Rows) -> Array:
    """ln F of rows at the nodes of η, shape [rows, 3]."""
    shape = tuple(len(values) for values in NODES.values())
    calibres = np.array(NODES["calibres"])
    nodes = np.empty((len(rows), shape[2]))
    for name in set(rows.projectile):
        per_calibre = np.log(np.reshape(_table()[name], shape) / calibres[:, None, None])
        here = np.flatnonzero(rows.projectile == name)
        at = CubicSpline(np.log(calibres), per_calibre)(np.log(rows.calibres[here]))
        angles = np.degrees(rows.obliquity[here])
        for angle in np.unique(angles):
            some = angles == angle
            nodes[here[some]] = PchipInterpolator(NODES["obliquity"], at[some], axis=1)(angle)
    return nodes + np.log(rows.calibres)[:, None]


def log_unit(nodes: Array, friction: float) -> Array:
    """ln F of rows, by a parabola through the nodes of η, shape [rows].

    Args:
        nodes: `unit` of the rows.
        friction: η.
    """
    at = np.array(NODES["friction"])
    return np.asarray(np.vander([friction], 3) @ np.linalg.solve(np.vander(at, 3), nodes.T))[0]


def main() -> None:
    TABLE.write_text(json.dumps(tabulated(), separators=(",", ":")) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
