"""What a user gets who names threat and material: limit velocities of campaigns beside the published ones, left out.

`python -m tests.validation.limit_users` runs a campaign for every published row, with a catalogue that does not know
the row, and writes stored/limit_users.csv; in some minutes.
"""

import json
import math
from dataclasses import replace

import numpy as np
import pandas as pd

from warpimpact.campaign.campaign import Campaign
from warpimpact.campaign.evidence import limit_velocity_factors
from warpimpact.catalogue import strength
from warpimpact.solver.device import Worker
from warpimpact.solver.limit import LimitSpec, limits

from .limit_rows import STORED, Rows, published
from .limit_velocities import Table

USERS = STORED / "limit_users.csv"
HARD = 450.0
"""Hardness of hard steel [HV]."""


def campaign_of(rows: Rows, row: int) -> Campaign:
    """The campaign that a user would write for a row."""
    tables = {
        "title": "a published row",
        "core": {"threat": str(rows.projectile[row])},
        "plate": {"material": str(rows.material[row]), "thickness": float(rows.thickness[row])},
        "impact": {"velocity": float(rows.velocity[row]), "obliquity": math.degrees(rows.obliquity[row])},
        "hits": {"sampling": "grid", "count": 1},
    }
    return Campaign.from_text(json.dumps(tables), name="row", folder=STORED)


def predicted(rows: Rows, row: int) -> tuple[float, float, float]:
    """Limit velocity [m/s] and the ends of its 90 % interval, as a user gets them where the row is not known."""
    whole, without = strength.limit_fit, _without(rows, row, bool(rows.steel[row]))
    strength.limit_fit = lambda material: without
    try:
        campaign = campaign_of(rows, row)
        factors = limit_velocity_factors(campaign)
    finally:
        strength.limit_fit = whole
    assert factors is not None
    scene, shots = campaign.scene, campaign.sampler().shots(0, 1)
    value = float(limits(scene, shots, LimitSpec.of(scene), worker=Worker("cpu")).value[0])
    return value, factors[0] * value, factors[1] * value


def _without(rows: Rows, row: int, steel: bool) -> strength.LimitFit:
    """The fit of the package without a row."""
    stored = json.loads(strength.FIT_FILE.read_text(encoding="utf-8"))
    columns = {name: np.array(values) for name, values in stored["rows"].items()}
    kept = ((columns["density"] > strength.STEEL_DENSITY) == steel) & (np.arange(len(rows)) != row)
    chosen = {name: column[kept] for name, column in columns.items()}
    residual, noise = chosen.pop("residual"), chosen.pop("noise")
    return strength.LimitFit.of(strength.Plates(**chosen), stored["sizes"], stored["test"], residual, noise)


def every_row(rows: Rows) -> pd.DataFrame:
    """Of all rows whose material has another one."""
    several = [row for row in range(len(rows)) if (rows.material == rows.material[row]).sum() > 1]
    answers = np.array([predicted(rows, row) for row in several]).round(1)
    kept = replace(rows, **{name: values[np.array(several)] for name, values in vars(rows).items()})
    metal = np.where(~kept.steel, "aluminium", np.where(kept.hardness < HARD, "steel", "hard steel"))
    columns = {
        "row": several,
        "projectile": kept.projectile,
        "material": kept.material,
        "metal": metal,
        "published": kept.velocity,
    }
    return pd.DataFrame(columns | dict(zip(("predicted", "low", "high"), answers.T, strict=True)))


def users_table() -> Table:
    """The table of docs/validation.md, from the stored answers."""
    answers, rows = pd.read_csv(USERS), []
    groups = {"all": answers, **dict(iter(answers.groupby("metal")))}
    for name, group in groups.items():
        error = group["predicted"] / group["published"] - 1.0
        inside = group["published"].between(group["low"], group["high"]).mean()
        size = error.abs()
        off = f"{100 * size.median():.1f} / {100 * size.quantile(0.9):.1f} %", f"{100 * error.median():+.1f} %"
        rows.append((name, str(len(group)), *off, f"{100 * inside:.0f} %"))
    return ("plates", "rows", "error, median / 90 %", "bias", "inside their 90 % interval"), rows


def main() -> None:
    every_row(published()).to_csv(USERS, index=False)
    print(*users_table()[1], sep="\n")


if __name__ == "__main__":
    main()
