"""Strength factors of steels by whole bullets whose cores deform and break (docs/continuum.md).

    python -m tests.benchmarks.whole_strength --minutes 60       # continues the searches, then prints the factors

Searches are those of continuum_strength.py, with the bullet and the core of the catalogue. The energy of a core that
breaks is that of the fragment that leads. Hits whose hourglasses take too much energy count here.
"""

from __future__ import annotations

import argparse
import math
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from tests.benchmarks.strength_search import COARSE, FRICTION, SLOPE, estimate, flow_of, next_factor
from tests.validation.limit_rows import core, published
from warpimpact import FiniteElements, Impact, Plate, Scene
from warpimpact.catalogue.catalogue import Catalogue, flow_entry
from warpimpact.catalogue.entries import Threat
from warpimpact.kernels.status import Status
from warpimpact.scene import Shots
from warpimpact.scene.bullet import Bullet

HITS = Path(__file__).parent / "results" / "whole_strength.csv"
ROWS = (298, 256, 270, 252, 324, 326, 266, 259, 332, 255, 251, 254, 316, 328, 314, 265, 322, 329, 257, 331, 249)
"""Steel plates that the .30 AP M2 was fired at, at 0 and 30°. The core's constants meet the first two."""
CHOSE_THE_CORE = (298, 256)
DRAFT = {298: 1.0, 270: 1.0, 256: 0.7866, 252: 0.7866}
"""Hits that are also computed on elements of a draft, by the row and the factor."""
WIDTH = 0.12
"""In ln factor, at which a search ends."""


def bullet_of(threat: str) -> Bullet:
    """The bullet of a threat with its materials."""
    known = Catalogue().named(Threat, threat).bullet
    assert known is not None
    return known.model_copy(update={"jacket": flow_entry("jacket brass").flow, "filler": flow_entry("lead").flow})


def march(row: int, factor: float, draft: bool = False) -> dict[str, float]:
    """How a hit of a row ends: status, residual velocity [m/s], share of the core's energy that the plate took, mass of
    the fragment that leads [g], number of fragments, hourglass share, and seconds of a core."""
    begin, rows, flow = time.process_time(), published(), flow_of(row, factor)
    impact = Impact(velocity=float(rows.velocity[row]), obliquity=float(np.degrees(rows.obliquity[row])))
    columns = {name: np.array([getattr(impact, name)]) for name in Impact.model_fields}
    shots = Shots(hit_y=np.zeros(1), hit_z=np.zeros(1), **columns)
    threat, thickness = str(rows.projectile[row]), float(rows.thickness[row])
    scene = Scene(core=core(threat), target=(Plate(thickness=thickness, resistance=1.0e9, density=flow.density),))
    size = None if draft else min(COARSE * scene.core.max_radius, thickness / 4.0)
    parts = {"bullet": bullet_of(threat), "core": flow_entry("core steel").flow}
    method = FiniteElements(flows=(flow,), friction=FRICTION, spacing=size, **parts)
    hit = method.prepare_hit(scene, shots, 0, {}).march()
    assert hit.fragments is not None
    left = float(np.linalg.norm(hit.flight["state"]["velocity"]))
    return {
        "status": int(hit.flight["status"]),
        "residual": round(left, 2),
        "energy": round(1.0 - hit.fragments.share * (left / impact.velocity) ** 2, 4),
        "leading": round(1e3 * hit.fragments.mass, 2),
        "fragments": hit.fragments.number,
        "hourglass": round(hit.energies.hourglass_share, 3),
        "seconds": round(time.process_time() - begin, 1),
    }


def written(draft: bool = False) -> pd.DataFrame:
    """The hits of all searches, or those on elements of a draft."""
    hits = pd.read_csv(HITS) if HITS.exists() else pd.DataFrame(columns=["row", "factor", "draft", "status", "energy"])
    return hits[hits["draft"].astype(bool) == draft]


def compute(row: int, factor: float, draft: bool = False) -> None:
    """Compute a hit and append it."""
    hit = pd.DataFrame([{"row": row, "factor": factor, "draft": draft, **march(row, factor, draft)}])
    hit.to_csv(HITS, mode="a", header=not HITS.exists(), index=False)


def search(row: int, until: float) -> None:
    """Continue the search of a row, until it ends or time is up [s of the monotonic clock]."""
    while time.monotonic() < until:
        hits = written()
        factor = next_factor(hits[hits["row"] == row], 1.0, WIDTH)
        if factor is None:
            return
        compute(row, round(factor, 4))


def refinement() -> float:
    """Factor on elements of a draft over that on those of a search, by hits that pass on both."""
    both = written(draft=True).merge(written(), on=["row", "factor"], suffixes=("", "_search"))
    both = both[(both["status"] == Status.PERFORATED) & (both["status_search"] == Status.PERFORATED)]
    return math.exp(float((np.log(both["energy_search"] / both["energy"]) / SLOPE).mean())) if len(both) else 1.0


def whole_factors() -> pd.DataFrame:
    """Rows whose search has ended: material, thickness [mm], obliquity [°], factor, and whether it chose the core."""
    rows, hits, finer, table = published(), written(), refinement(), []
    for row, of_it in hits.groupby("row"):
        factor, number = estimate(of_it), int(str(row))
        if next_factor(of_it, 1.0, WIDTH) is None and not math.isnan(factor):
            columns = {"row": number, "material": rows.material[number], "chose": number in CHOSE_THE_CORE}
            columns |= {"thickness": round(1e3 * float(rows.thickness[number]), 1)}
            columns |= {"obliquity": round(float(np.degrees(rows.obliquity[number])))}
            table.append(columns | {"velocity": round(float(rows.velocity[number])), "factor": finer * factor})
    return pd.DataFrame(table).sort_values(["material", "thickness"], ignore_index=True)


class WholeFactor(NamedTuple):
    """The factor of a steel, its relative standard error at another plate, and what it meets."""

    factor: float
    error: float
    words: str

    @classmethod
    def of(cls, table: pd.DataFrame, material: str) -> WholeFactor:
        """The mean of its rows, else of those of all steels; all scatter alike."""
        logs, own = np.log(table["factor"]), table["material"] == material
        count, known = (int(own.sum()), logs[own]) if own.any() else (len(logs), logs)
        factor, error = math.exp(known.mean()), float(logs.std()) * math.sqrt(1.0 + 1.0 / count)
        limits = f"{count} published limit{'s' * (count > 1)}{'' if own.any() else ' of other steels'}"
        return cls(factor, error, f"strength × {factor:.2f} (± {error:.0%}) meets {limits}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=0.0)
    until = time.monotonic() + 60.0 * parser.parse_args().minutes
    for row in ROWS:
        search(row, until)
    for row, factor in DRAFT.items():
        if time.monotonic() < until and row not in set(written(draft=True)["row"]):
            compute(row, factor, draft=True)
    print(whole_factors().round(2).to_string())
    print(f"elements of a draft: factor × {refinement():.3f}")


if __name__ == "__main__":
    main()
