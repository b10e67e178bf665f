"""Entries of the catalogue from the fit of published limit velocities.

To write them again, after `python -m tests.validation.limit_velocities`: python -m tests.validation.limit_catalogue
"""

import json
import re

import numpy as np
import pandas as pd

from warpimpact.campaign.evidence import nose_length
from warpimpact.catalogue.catalogue import DATA_FOLDER, FOLDERS
from warpimpact.catalogue.entries import Material
from warpimpact.catalogue.strength import FIT_FILE, Z_90, Plates, limit_fit

from .limit_model import Fit, packaged
from .limit_rows import PROJECTILES, Rows, core, published
from .limit_splits import CARBIDE
from .limit_velocities import PREDICTIONS, errors, stored_fit

DATABASE = "ballistic limit database, Mendeley Data 10.17632/4f92y6jzzh.2"
HARD, THIN = 450.0, 0.65
"""Hardness of hard steel [HV], and calibres of a thin plate of it."""
_LEAST_RATIO = 1.25
"""The thicknesses between which an exponent is found differ at least by this ratio."""


def entries(rows: Rows, whole_fit: Fit, predicted: pd.DataFrame) -> list[str]:
    """The text of the file of every material, from the fit that the package holds."""
    return [_entry(rows, whole_fit, name, predicted) for name in dict.fromkeys(rows.material.tolist())]


def _entry(rows: Rows, whole_fit: Fit, name: str, predicted: pd.DataFrame) -> str:
    own = rows[rows.material == name]
    counts = {one: int((own.projectile == one).sum()) for one in PROJECTILES if (own.projectile == one).any()}
    projectile = ".30 AP M2" if ".30 AP M2" in counts else max(counts, key=lambda one: counts[one])
    of_it = own[own.projectile == projectile]
    low, high = of_it.calibres.min(), of_it.calibres.max()
    if high < _LEAST_RATIO * low:
        low, high = np.sqrt(low * high / _LEAST_RATIO), np.sqrt(low * high * _LEAST_RATIO)
    mean, deviation = limit_fit(name).predicted(_plates(of_it, np.array([low, np.sqrt(low * high), high])))
    exponent = (mean[2] - mean[0]) / np.log(high / low)
    strength = float(np.exp(mean[1] - exponent * np.log(np.sqrt(low * high))))
    spread = float(np.exp(Z_90 * deviation[1]))
    left = predicted[predicted["material"] == name]
    split = "one row out" if (left["split"] == "one row out").any() else "one material out"
    miss = errors(left[left["split"] == split], ["material"]).iloc[0]
    angles = np.degrees(own.obliquity)
    lines = [
        f'name = "{name}"',
        f'density = "{own.density.mean():.0f} kg/m^3"',
        f'resistance = "{strength / 1e6:.4g} MPa"',
        f'resistance_low = "{strength / spread / 1e6:.4g} MPa"',
        f'resistance_high = "{strength * spread / 1e6:.4g} MPa"',
        f"thickness_exponent = {exponent:.3f}",
        f"shear_coefficient = {whole_fit.friction:.3f}",
        "linear = 0",
        "quadratic = 0",
        f"sources = {json.dumps(sorted(set(own.source.tolist())))}",
        f'thickness_low = "{1e3 * own.thickness.min():.4g} mm"',
        f'thickness_high = "{1e3 * own.thickness.max():.4g} mm"',
        f"calibres_low = {own.calibres.min():.3f}",
        f"calibres_high = {own.calibres.max():.3f}",
        f'obliquity_low = "{angles.min():.3g} deg"',
        f'obliquity_high = "{angles.max():.3g} deg"',
        f"misfit = {miss['median']:.4f}",
        f"misfit_p90 = {miss['p90']:.4f}",
        f"coverage = {miss['inside']:.3f}",
        f"hardness = {own.hardness.mean():.0f}",
        "",
        "[rows]",
        *(f'"{one}" = {count}' for one, count in counts.items()),
        "",
        "[known]",
        f'rows = "{DATABASE}"',
        f'resistance = "hierarchical fit of the rows, for the {projectile} (docs/validation.md)"',
        f'misfit = "{split}"',
        "",
        "[assumed]",
        'bullet = "a bullet counts as its core: jacket and lead are left out"',
    ]
    return "\n".join(lines) + "\n"


def figures(rows: Rows, predicted: pd.DataFrame) -> dict[str, dict[str, float]]:
    """Errors of what the model fails at, for the sentences of a campaign (warpimpact/campaign/tested_range.py)."""
    error = predicted["predicted"] / predicted["published"] - 1.0
    of, steel = predicted["split"], rows.steel[predicted["row"]]
    in_steel, in_aluminium = (error[(of == CARBIDE) & which] for which in (steel, ~steel))
    values = {
        "core": _cores(rows),
        "steel": _range(rows[rows.steel]),
        "aluminium": _range(rows[~rows.steel]),
        "thin hard steel": thin_hard_steel(rows),
        "carbide": {
            "steel": in_steel.median(),
            "steel rows": len(in_steel),
            "aluminium": in_aluminium.median(),
            "aluminium rows": len(in_aluminium),
        },
    }
    return {name: {key: round(float(value), 4) for key, value in one.items()} for name, one in values.items()}


def _cores(rows: Rows) -> dict[str, float]:
    """Noses in diameters, diameters [mm] and velocities [m/s] of all rows."""
    return {
        "nose": min(nose_length(core(name)) for name in PROJECTILES),
        "diameter_low": 1e3 * rows.diameter.min(),
        "diameter_high": 1e3 * rows.diameter.max(),
        "velocity_low": rows.velocity.min(),
        "velocity_high": rows.velocity.max(),
    }


def _range(rows: Rows) -> dict[str, float]:
    """What plates of one metal were: densities [kg/m³], thicknesses in calibres, angles [deg], resistances [GPa]."""
    resistance = []
    for name in dict.fromkeys(rows.material.tolist()):
        fit = limit_fit(name)
        resistance += (np.exp(fit.predicted(fit.rows)[0][fit.rows.material == name]) / 1e9).tolist()
    return {
        "density_low": rows.density.min(),
        "density_high": rows.density.max(),
        "calibres_low": rows.calibres.min(),
        "calibres_high": rows.calibres.max(),
        "obliquity_high": np.degrees(rows.obliquity.max()),
        "resistance_low": min(resistance),
        "resistance_high": max(resistance),
    }


def thin_hard_steel(rows: Rows) -> dict[str, float]:
    """Share of its Y at one calibre that hard steel has at the thickness of the thinnest row; the median of steels."""
    thin = rows[rows.steel & (rows.hardness >= HARD) & (rows.calibres < THIN)]
    shares = []
    for name in dict.fromkeys(thin.material.tolist()):
        of_it = thin[thin.material == name]
        mean, _ = limit_fit(name).predicted(_plates(of_it, np.array([thin.calibres.min(), 1.0])))
        shares.append(float(np.exp(mean[0] - mean[1])))
    return {"calibres": thin.calibres.min(), "materials": len(shares), "share": float(np.median(shares))}


def _plates(rows: Rows, calibres: np.ndarray) -> Plates:
    """Plates of the material of some rows at normal incidence, of these thicknesses in diameters of the core."""
    count = len(calibres)
    return Plates(
        projectile=np.full(count, rows.projectile[0]),
        bare=np.zeros(count, dtype=bool),
        material=np.full(count, rows.material[0]),
        source=np.full(count, "this plate"),
        thickness=calibres * rows.diameter[0],
        calibres=calibres,
        obliquity=np.zeros(count),
        density=np.full(count, rows.density[0]),
        flow_stress=np.full(count, rows.flow_stress.mean()),
        hardness=np.full(count, rows.hardness.mean()),
    )


def main() -> None:
    rows, predicted = published(), pd.read_csv(PREDICTIONS)
    FIT_FILE.write_text(json.dumps(packaged(rows, stored_fit()), separators=(",", ":")) + "\n", encoding="utf-8")
    (DATA_FOLDER / "figures.json").write_text(json.dumps(figures(rows, predicted), indent=1) + "\n", encoding="utf-8")
    for text in entries(rows, stored_fit(), predicted):
        name = text.partition('"')[2].partition('"')[0]
        file = re.sub("[^a-z0-9]+", "_", name.lower()).rstrip("_")
        (FOLDERS[Material] / f"{file}.toml").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
