"""A result by finite elements as measured shots: the fit that `identify` makes from it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from warpimpact.campaign.text import parsed
from warpimpact.identification.fit import Fit, FitError, fit_from
from warpimpact.results import attributes as attr
from warpimpact.results import files
from warpimpact.results import variables as v
from warpimpact.results.dataset import failed, hit_numbers

VELOCITY, NEAR, FAR = 5.0, 5.0, 10.0
"""Uncertainty of the continuum by its numerics: of a velocity [m/s], and of a tilt at the first stand-off and at the
others [degree] (docs/continuum.md)."""
PRIORS: dict[str, Any] = {
    "resistance": {"distribution": "uniform", "low": "0.3 GPa", "high": "6 GPa"},
    "shear_coefficient": {"distribution": "uniform", "low": 0, "high": 0.2},
    "degradation": {"distribution": "uniform", "low": 0.6, "high": 1.0},
}
"""Priors of Y, η and β, the parameters of such a fit."""


def fit_of_result(path: Path) -> Fit:
    """The fit of Y, η and β to the hits of a result by finite elements, whose hit points are known.

    Raises:
        ResultError, FitError: the file is no such result, has layers behind its plate, or no hit that passed the plate.
    """
    result = files.read(path)
    if attr.CONTINUUM not in result.attrs:
        raise FitError(
            f"{path}: is a map of hits of the fast law; a fit takes one of warpimpact continuum, or a fit file"
        )
    tables = parsed(result.attrs[attr.CAMPAIGN], f"the campaign in {path}")
    if tables.get("layer"):
        raise FitError(f"{path}: has layers behind its plate, but a fit is of one plate")
    plate = {key: value for key, value in tables["plate"].items() if key not in (*PRIORS, "material")}
    standoffs = [float(standoff) for standoff in result[v.STANDOFF].values]
    fit: dict[str, Any] = {
        "title": f"{tables['title']}: by finite elements",
        **{key: tables[key] for key in ("core", "interaction", "catalogue") if key in tables},
        "plate": plate,
        "record": {"standoffs": standoffs, "standoff_point": result.attrs[attr.STANDOFF_POINT]},
        "prior": {"plate": PRIORS},
        "shot": _shots(result, path),
    }
    return fit_from(json.dumps(fit), str(path), path.parent)


def _shots(result: Any, path: Path) -> list[dict[str, Any]]:
    passed = ~failed(result) & ~np.isnan(result[v.TILT].values).any(axis=1)
    if not passed.any():
        raise FitError(f"{path}: has no hit that passed the plate")
    impact = {variable.field: variable for variable in v.SHOT_VARIABLES}
    errors = [f"{NEAR if k == 0 else FAR} deg" for k in range(result.sizes[v.STANDOFF])]
    shots = []
    for place in np.flatnonzero(passed):
        hit = result.isel(hit=place)
        shots.append(
            {
                "name": f"hit {hit_numbers(result)[place]}",
                "hit": {"y": float(hit[v.HIT_Y]), "z": float(hit[v.HIT_Z])},
                "impact": {name: float(hit[variable]) for name, variable in impact.items()},
                "measured": {
                    "residual_velocity": {"value": float(hit[v.RESIDUAL_VELOCITY]), "std": VELOCITY},
                    "tilt": {"value": [float(tilt) for tilt in hit[v.TILT].values], "std": errors},
                },
            }
        )
    return shots
