"""Published limit velocities of solid plates, and what the model gives for the same plates per resistance.

Without degradation every term of σ = Y + C √(ρY) v_n + B ρ v_n² scales with Y as the velocity scales with √Y, so the
limit velocity of one row is √Y times a function of friction η, B and C (docs/model.md §4.5, 6.9). `tabulated` computes
this function with `limit_velocity` on a few nodes of each; a fit then needs no more runs.

To compute the stored table again, in a minute on one core: python -m tests.validation.limit_rows
"""

import json
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from warpimpact.scene import Interaction, Numerics, OgiveCore, Plate, Scene, Shots
from warpimpact.solver.limit import limit_velocity

Array = NDArray[np.float64]

STORED = Path(__file__).parent / "stored"
PUBLISHED = STORED / "limit_velocities.csv"
TABLE = STORED / "limit_table.json"

CORE = OgiveCore(diameter=6.248e-3, length=27.5e-3, crh=3.0, mass=5.3e-3)
"""Of the .30 AP M2 bullet. A bullet counts as its core: jacket and lead are left out."""
NODES = {"friction": (0.0, 0.1, 0.2), "linear": (0.0, 0.5, 1.0), "quadratic": (0.0, 1.0, 2.0)}
"""η, C and B of the table."""
HEAVY = 5000.0
"""Plate density that parts steel from aluminium [kg/m³]."""
DENSITY = {"aluminium": 2700.0, "steel": 7850.0}
"""Plate density of the table [kg/m³]. Another density ρ acts as another C √ρ and B ρ."""
TYPICAL = {"aluminium": 1.0e9, "steel": 3.0e9}
"""Y at which the table is computed [Pa]. The limit velocities then are some 300 to 1000 m/s."""


@dataclass(frozen=True)
class Rows:
    """Rows of the table of limit velocities; arrays of shape [rows].

    Attributes:
        material, projectile, source: names as they are published; the projectile is "bullet" or "core".
        thickness: of the plate [m].
        obliquity: [rad].
        velocity: published limit velocity [m/s].
        density: of the plate [kg/m³].
        flow_stress: mean of yield and tensile strength of the plate [Pa].
        unit: limit velocity per √Y that the model gives, √(m³/kg), shape [rows, η, C, B] of NODES.
    """

    material: NDArray[np.str_]
    projectile: NDArray[np.str_]
    source: NDArray[np.str_]
    thickness: Array
    obliquity: Array
    velocity: Array
    density: Array
    flow_stress: Array
    unit: Array

    def __len__(self) -> int:
        """Number of rows."""
        return len(self.velocity)

    def __getitem__(self, which: NDArray[np.bool_] | NDArray[np.int64]) -> "Rows":
        """Some of the rows."""
        return Rows(**{name: values[which] for name, values in vars(self).items()})


def metal(density: float) -> str:
    """The one of DENSITY whose table serves for a plate."""
    return "steel" if density > HEAVY else "aluminium"


def published(file: Path = PUBLISHED) -> Rows:
    """All rows of a file, with what the model gives for each: of the published rows the stored table, else computed."""
    data = pd.read_csv(file)
    table = json.loads(TABLE.read_text(encoding="utf-8")) if file == PUBLISHED else tabulated(file)
    assert {name: tuple(values) for name, values in table["nodes"].items()} == NODES
    by_plate = {tuple(row["plate"]): row["unit"] for row in table["rows"]}
    return Rows(
        material=data["material"].to_numpy(dtype=np.str_),
        projectile=data["projectile"].to_numpy(dtype=np.str_),
        source=data["source"].to_numpy(dtype=np.str_),
        thickness=data["thickness_mm"].to_numpy(float) * 1e-3,
        obliquity=np.radians(data["obliquity_deg"].to_numpy(float)),
        velocity=data["limit_velocity_m_s"].to_numpy(float),
        density=data["plate_density_g_cm3"].to_numpy(float) * 1e3,
        flow_stress=data[["plate_yield_MPa", "plate_UTS_MPa"]].mean(axis=1).to_numpy(float) * 1e6,
        unit=np.array([by_plate[plate] for plate in _plates(data)]),
    )


def computed(plates: list[tuple[str, float, float]], *, linear: float, quadratic: float, friction: Array) -> Array:
    """Limit velocity per √Y of some plates, √(m³/kg), shape [plates, friction].

    Args:
        plates: metal, thickness [mm] and obliquity [deg] of each; one metal.
        linear, quadratic: C and B.
        friction: η, shape [friction].
    """
    (kind,) = {plate[0] for plate in plates}
    each = [(h * 1e-3, np.radians(angle), eta) for (_, h, angle), eta in product(plates, friction)]
    thickness, obliquity, shear = np.array(each).T
    zero = np.zeros(len(each))
    way = thickness / np.cos(obliquity)
    shots = Shots(
        hit_y=zero,
        hit_z=zero,
        velocity=np.sqrt(2.5 * TYPICAL[kind] * np.pi * CORE.max_radius**2 * way / CORE.mass),
        obliquity=obliquity,
        azimuth=zero,
        pitch=zero,
        yaw=zero,
        spin=zero,
        thickness=thickness,
        shear_coefficient=shear,
    )
    plate = Plate(thickness=float(thickness.max()), resistance=TYPICAL[kind], density=DENSITY[kind])
    scene = Scene(core=CORE, target=plate, interaction=Interaction(linear=linear, quadratic=quadratic))
    limits = limit_velocity(scene, shots, numerics=Numerics(level=2), tolerance=0.5, device="cpu")
    assert limits.converged.all()
    return (limits.value / np.sqrt(TYPICAL[kind])).reshape(len(plates), len(friction))


def tabulated(file: Path = PUBLISHED) -> dict[str, Any]:
    """The table of all plates of a file, as it is stored."""
    plates = sorted(set(_plates(pd.read_csv(file))))
    unit = np.empty((len(plates), *(len(values) for values in NODES.values())))
    for kind in DENSITY:
        some = [index for index, plate in enumerate(plates) if plate[0] == kind]
        if not some:
            continue
        for (c, linear), (b, quadratic) in product(enumerate(NODES["linear"]), enumerate(NODES["quadratic"])):
            friction = np.array(NODES["friction"])
            values = computed([plates[i] for i in some], linear=linear, quadratic=quadratic, friction=friction)
            unit[some, :, c, b] = values
    rows = [{"plate": plate, "unit": values.tolist()} for plate, values in zip(plates, unit.round(8), strict=True)]
    return {"nodes": NODES, "rows": rows}


def _plates(data: pd.DataFrame) -> list[tuple[str, float, float]]:
    """Metal, thickness [mm] and obliquity [deg] of each row."""
    columns = zip(data["plate_density_g_cm3"], data["thickness_mm"], data["obliquity_deg"], strict=True)
    return [(metal(1e3 * density), float(thickness), float(angle)) for density, thickness, angle in columns]


if __name__ == "__main__":
    table = tabulated()
    lines = ",\n".join(json.dumps(row) for row in table["rows"])
    TABLE.write_text(f'{{"nodes": {json.dumps(table["nodes"])},\n"rows": [\n{lines}\n]}}\n', encoding="utf-8")
