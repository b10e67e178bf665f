"""Strength factors of materials: at which of them elements just stop a core at its published limit velocity.

    python -m tests.benchmarks.continuum_strength [--minutes 60]      # continue the searches, then print the factors

A search marches a solid plate at the published velocity, without yaw, friction 0.03, draft elements, and constants by
rule (tests/benchmarks/tensile.py) times a factor. Every hit is a row, appended when it has ended, so that a search
may be ended at any time and continued.
"""

from __future__ import annotations

import argparse
import json
import math
import re
import time
from itertools import zip_longest
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from tests.benchmarks.strength_search import COARSE, FRICTION, HELD, SLOPE, estimate, flow_of, next_factor
from tests.benchmarks.tensile import flow_from_tensile_test
from tests.benchmarks.whole_strength import WholeFactor, whole_factors
from tests.validation.limit_rows import PUBLISHED, core, published
from warpimpact import FiniteElements, Impact, Plate, Scene, simulate
from warpimpact.catalogue.catalogue import FLOWS, Catalogue
from warpimpact.catalogue.entries import Material
from warpimpact.kernels.status import Status
from warpimpact.scene import Shots

HITS = Path(__file__).parent / "results" / "continuum_strength.csv"
ROWS = {
    "HHA Class 1": (298, 270, 447, 468, 314),
    "AA5083-H131": (16, 17),
    "AA6061-T651": (42,),
    "AA7039-T64": (211, 215),
    "SECURE500": (332, 331, 457),
    "ARMOX560": (255, 256),
    "ARMOX500": (254, 409),
    "MARS600": (324, 321, 322),
    "AA6055-T651": (361, 22, 24),
    "AA2060-T8": (0, 2),
    "AA7085-T711": (244, 245),
    "SECURE400": (326, 328, 329),
    "ARMOX ADVANCE": (251, 249, 404),
    "ARMOX370 Class 1": (405, 252),
    "SECURE600": (458, 459),
    "ARMOX600": (411, 410),
    "SECURE350": (455,),
    "ATI 500-MIL": (257, 413),
    "MARS440": (316, 453),
    "BIS HHA": (414, 259),
    "BIS UHH": (265, 266),
    "AA7056-T721": (380,),
    "AA7056-T761": (387,),
}
"""Published rows that are searched, by their place in the file of limit velocities: the first of each material, then
the second. Thick aluminium takes minutes a hit."""
USUAL_SLOPE = 0.5
"""d ln of the limit velocity over d ln of the strength factor, where no row was searched at two velocities."""
FASTER = {298: 1.08, 332: 1.08, 42: 1.1}
"""Rows that are also searched at more than their published velocity, for that slope."""
OTHER_THICKNESS = 1.2
"""Ratio of thicknesses in calibres from which a row is one of another thickness."""
USUAL = (0.6, 1.8)
"""Range of factors beyond which an entry says that strength alone does not decide."""
START = {True: 1.4, False: 1.1}
"""Factor of the first hit of a material, of steel or not."""


class Hit(NamedTuple):
    """A hit of the solid plate of a row: its velocity [m/s], strength factor, and whether on elements of a draft."""

    row: int
    velocity: float
    factor: float
    draft: bool = False

    def march(self) -> dict[str, float]:
        """Columns of its row: how it ended, residual velocity [m/s], and seconds of a core."""
        begin, rows, flow = time.process_time(), published(), flow_of(self.row, self.factor)
        impact = Impact(velocity=self.velocity, obliquity=np.degrees(rows.obliquity[self.row]))
        columns = {name: np.array([getattr(impact, name)]) for name in Impact.model_fields}
        shots = Shots(hit_y=np.zeros(1), hit_z=np.zeros(1), **columns)
        plate = Plate(thickness=rows.thickness[self.row], resistance=1.0e9, density=flow.density)
        scene = Scene(core=core(str(rows.projectile[self.row])), target=(plate,))
        size = None if self.draft else min(COARSE * scene.core.max_radius, plate.thickness / 4.0)
        method = FiniteElements(flows=(flow,), friction=FRICTION, spacing=size)
        outcome = simulate(scene, shots, method=method, threads=1)
        return {
            "status": int(outcome.status[0]),
            "residual": round(float(outcome.residual_velocity[0]), 2),
            "seconds": round(time.process_time() - begin, 1),
        }


def compute(hit: Hit) -> None:
    """Compute a hit and append it."""
    row = pd.DataFrame([{**hit._asdict(), **hit.march()}])
    row.to_csv(HITS, mode="a", header=not HITS.exists(), index=False)


def written() -> pd.DataFrame:
    """The hits of all searches, with the share of the core's energy that the plate took."""
    hits = pd.read_csv(HITS) if HITS.exists() else pd.DataFrame(columns=[*Hit._fields, "status", "residual", "seconds"])
    return hits.assign(energy=1.0 - (hits["residual"] / hits["velocity"]) ** 2)


def search(number: int, velocity: float, until: float) -> None:
    """Continue the search of a row at a velocity, until it ends or time is up [s of the monotonic clock]."""
    rows = published()
    while time.monotonic() < until:
        hits = written()
        hits = hits[~hits["draft"].astype(bool)]
        of_it = hits[(hits["row"] == number) & (hits["velocity"] == velocity)]
        alike = hits[
            (rows.material[hits["row"].astype(int)] == rows.material[number])
            & hits["status"].isin((Status.PERFORATED, *HELD))
        ]
        start = START[bool(rows.steel[number])] if alike.empty else round(0.97 * alike["factor"].iloc[-1], 4)
        factor = next_factor(of_it, start)
        if factor is None:
            return
        compute(Hit(number, velocity, round(factor, 4)))


def refinement() -> dict[bool, float]:
    """Factor on elements of a draft over that on those of a search, for steel (True) and aluminium, by hits on both."""
    keys = ["row", "velocity", "factor"]
    hits = written().query("status == 0")
    draft = hits["draft"].astype(bool)
    both = hits[draft].merge(hits[~draft], on=keys, suffixes=("", "_search"))
    logs = np.log(both["energy_search"] / both["energy"]) / SLOPE
    means = np.exp(logs.groupby(published().steel[both["row"]]).mean())
    return {steel: float(means.get(steel, 1.0)) for steel in (True, False)}


def every_factor() -> pd.DataFrame:
    """Factors of all searches that have ended: columns row, velocity, factor."""
    finer, hits = refinement(), written()
    rows = []
    for (number, velocity), of_it in hits[~hits["draft"].astype(bool)].groupby(["row", "velocity"]):
        factor = estimate(of_it) * finer[bool(published().steel[number])]
        if next_factor(of_it, 1.0) is None and not math.isnan(factor):
            rows.append({"row": number, "velocity": velocity, "factor": factor})
    return pd.DataFrame(rows)


def velocity_slopes(searched: pd.DataFrame) -> dict[bool, float]:
    """d ln limit velocity over d ln factor, for steel (True) and aluminium, from rows that were searched twice."""
    twice = searched.groupby("row").filter(lambda of_it: len(of_it) == 2).groupby("row")
    slopes = np.log(twice["velocity"].last() / twice["velocity"].first()) / np.log(
        twice["factor"].last() / twice["factor"].first()
    )
    means = slopes.groupby(published().steel[slopes.index]).mean()
    return {steel: float(means.get(steel, USUAL_SLOPE)) for steel in (True, False)}


def factors() -> pd.DataFrame:
    """The rows whose search has ended, by material and thickness, with factor and slope of the velocity."""
    rows, searched = published(), every_factor()
    slopes = velocity_slopes(searched)
    at_limit = searched[searched["velocity"] == rows.velocity[searched["row"]]].set_index("row")
    table = pd.read_csv(PUBLISHED).loc[at_limit.index]
    table = table.assign(factor=at_limit["factor"], calibres=rows.calibres[table.index], steel=rows.steel[table.index])
    return table.assign(slope=table["steel"].map(slopes)).sort_values(["material", "calibres"], kind="stable")


def left_out(rows: pd.DataFrame) -> pd.DataFrame:
    """Relative errors of the limit velocity of rows of a material by its rows of another plate, thickness or angle."""
    calibres, angles, logs = rows["calibres"].to_numpy(), rows["obliquity_deg"].to_numpy(), np.log(rows["factor"])
    others = {
        "row": ~np.eye(len(rows), dtype=bool),
        "thickness": abs(np.log(np.divide.outer(calibres, calibres))) > math.log(OTHER_THICKNESS),
        "angle": np.subtract.outer(angles, angles) != 0.0,
    }
    means = {name: [logs[one].mean() if one.any() else math.nan for one in which] for name, which in others.items()}
    return pd.DataFrame({
        name: np.expm1(rows["slope"].to_numpy() * (np.array(mean) - logs.to_numpy())) for name, mean in means.items()
    }, index=rows.index)  # fmt: skip


def scatter(rows: pd.DataFrame) -> float:
    """Standard deviation of ln factor between plates of one material and angle, over all of some rows."""
    logs = np.log(rows["factor"]).groupby([rows["material"], rows["obliquity_deg"]])
    free = logs.size() - 1
    return math.sqrt((logs.var() * free).sum() / free.sum())


def root_mean_squares(rows: pd.DataFrame) -> pd.Series[float]:
    """Errors of limit velocities by another plate, thickness or angle, over all materials of some rows."""
    errors = pd.concat([left_out(of_it) for _, of_it in rows.groupby("material")])
    return np.sqrt((errors**2).mean())


def evidence(rows: pd.DataFrame, error: float, of_metal: pd.Series[float]) -> dict[str, str]:
    """What the factor of a material meets, and its errors: those of its rows, else those of all rows of the metal."""
    factor, own = math.exp(np.log(rows["factor"]).mean()), root_mean_squares(rows)
    angles = " and ".join(f"{angle:g}°" for angle in sorted(set(rows["obliquity_deg"])))
    limits = "1 published limit" if len(rows) == 1 else f"{len(rows)} published limits"
    words = []
    for split, value in own.fillna(of_metal).dropna().items():
        words.append(f"by another {split} {value:.1%}{' of all rows' if math.isnan(own[split]) else ''}")
    tested = {
        "solid plates": f"strength × {factor:.2f} (± {error:.0%}) meets {limits} at {angles}",
        "rms error of limit velocities": ", ".join(words),
    }
    if not USUAL[0] <= factor <= USUAL[1]:
        tested["not usual"] = "something besides strength decides, such as a core that breaks"
    return tested


def entry(rows: pd.DataFrame, deviation: float, of_metal: pd.Series[float], whole: WholeFactor | None) -> str:
    """The file of a material in the catalogue of the continuum.

    Args:
        rows: its rows.
        deviation: of ln factor between plates of a material, over all rows of the metal.
        of_metal: errors of limit velocities over all rows of the metal.
        whole: by whole bullets whose cores break; None of aluminium.
    """
    name, first = str(rows["material"].iloc[0]), rows.iloc[0]
    factor, error = math.exp(np.log(rows["factor"]).mean()), deviation * math.sqrt(1.0 + 1.0 / len(rows))
    material = Catalogue().named(Material, name)
    strengths = float(first["plate_yield_MPa"]), float(first["plate_UTS_MPa"])
    flow = flow_from_tensile_test(material.density, 1e6 * strengths[0], 1e6 * strengths[1])
    aliases = [f"aliases = {json.dumps(list(material.aliases))}"] if material.aliases else []
    lines = [
        f"name = {json.dumps(name)}",
        *aliases,
        f'density = "{flow.density:.4g} kg/m^3"',
        f'youngs_modulus = "{flow.youngs_modulus / 1e9:g} GPa"',
        f"poissons_ratio = {flow.poissons_ratio:g}",
        f'yield_stress = "{factor * flow.yield_stress / 1e6:.5g} MPa"',
        f'voce_stress = ["{factor * flow.voce_stress[0] / 1e6:.5g} MPa", "0 MPa"]',
        f"voce_rate = [{flow.voce_rate[0]:.5g}, 0.0]",
        f"rate_exponent = {flow.rate_exponent:g}",
        f"heat_capacity = {flow.heat_capacity:.1f}",
        f"melting_range = {flow.melting_range:.1f}",
        f'fracture_work = "{factor * flow.fracture_work / 1e6:.5g} MPa"',
        f"friction = {FRICTION}",
        f"strength_factor = {factor:.4f}",
        f"strength_error = {error:.4f}",
        *([] if whole is None else [f"whole_factor = {whole.factor:.4f}", f"whole_error = {whole.error:.4f}"]),
        "",
        "[known]",
        f'strength = "yield {strengths[0]:.5g} MPa, tensile {strengths[1]:.5g} MPa, published with the limits"',
        "",
        "[assumed]",
        'hardening = "by rule from both"',
        f'"rate, heat and fracture" = "usual values of {"steel" if first["steel"] else "aluminium"}"',
        "",
        "[tested]",
        *(f'"{name}" = "{words}"' for name, words in evidence(rows, error, of_metal).items()),
        *([] if whole is None else [f'"whole bullets whose cores break" = "{whole.words}"']),
        "",
        "[limits]",
    ]
    for (_, row), by_others in zip(rows.iterrows(), left_out(rows)["row"], strict=True):
        plate = f"{row['projectile']}, {row['thickness_mm']:g} mm at {row['obliquity_deg']:g}°"
        others = "" if math.isnan(by_others) else f"; by the factor of the others {by_others:+.1%}"
        lines.append(f'"{plate}" = "published {row["limit_velocity_m_s"]:g} m/s, factor {row["factor"]:.2f}{others}"')
    return "\n".join(lines) + "\n"


def entries() -> dict[str, str]:
    """The files of all materials with rows, by their names in the folder of the catalogue."""
    rows, whole = factors(), whole_factors()
    files = {}
    for is_steel, metal in rows.groupby("steel"):
        for name, of_it in metal.groupby("material"):
            by_bullets = WholeFactor.of(whole, str(name)) if is_steel else None
            stem = re.sub("[^a-z0-9]+", "_", str(name).lower()).strip("_")
            files[f"{stem}.toml"] = entry(of_it, scatter(metal), root_mean_squares(metal), by_bullets)
    return files


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=0.0)
    until = time.monotonic() + 60.0 * parser.parse_args().minutes
    for numbers in zip_longest(*ROWS.values()):
        for number in numbers:
            if number is not None:
                search(number, float(published().velocity[number]), until)
    for number, share in FASTER.items():
        search(number, round(share * float(published().velocity[number]), 1), until)
    for file, text in entries().items():
        (FLOWS / file).write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
