"""A posterior as a material of a catalogue file: parameters of the fast law, their plate, and their misses."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import xarray

from warpimpact.campaign.toml import toml_text
from warpimpact.catalogue.entries import Weakening
from warpimpact.identification.fit_file import fit_from
from warpimpact.identification.parameters import FitError
from warpimpact.results import attributes as attr
from warpimpact.results import files, posterior_file
from warpimpact.scene.display import STORED

ENTRY_QUANTILES = 0.05, 0.5, 0.95
"""Quantiles of a parameter in an entry."""
LONGEST_NAME = 80
"""Most letters of the name of an entry."""


def material_entry(path: Path) -> str:
    """The text of a catalogue file with the material of a posterior.

    The medians become numbers of the entry; the law of a plate that weakens is in its table `weakening`. `found` names
    the plate and the shots, and what the medians leave unexplained.

    Raises:
        ResultError, FitError, ValueError: the file is no posterior, or a file that its fit names is missing.
    """
    tree = files.read_tree(path, posterior_file.POSTERIOR)
    title = str(tree.attrs[attr.TITLE])
    fit = fit_from(str(tree.attrs[posterior_file.FIT_TEXT]), f"the fit in {path}", path.parent)
    quantiles = _quantiles(tree)
    medians = {place: float(of[1]) for place, of in quantiles.items()}
    scene = fit.scene_of(fit.shots[0], medians)
    plate, law = scene.target.layers[0], scene.interaction
    if law.static != 1.0:
        raise FitError(
            f"{path}: was found with interaction.static = {law.static:g}, which a catalogue's material lacks"
        )
    if law.free_surface is not None:
        raise FitError(f"{path}: was found with interaction.free_surface, which a catalogue's material lacks")
    calibres = plate.thickness / (2.0 * scene.core.max_radius)
    angles = [shot.impact.obliquity for shot in fit.shots]
    low, _, high = quantiles.get(("plate", "resistance"), (plate.resistance,) * 3)
    entry: dict[str, Any] = {
        "name": title[:LONGEST_NAME],
        "density": plate.density,
        "resistance": plate.resistance,
        **({"resistance_low": float(low), "resistance_high": float(high)} if low < high else {}),
        "shear_coefficient": plate.shear_coefficient,
        **{key: float(getattr(law, key)) for key in ("linear", "quadratic", "onset")},
        **{f"thickness_{end}": plate.thickness for end in ("low", "high")},
        **{f"calibres_{end}": calibres for end in ("low", "high")},
        **{f"obliquity_{end}": f"{np.degrees(of(angles)):.4g} deg" for end, of in (("low", min), ("high", max))},
    }
    weakening = plate.model_dump(include=set(Weakening.model_fields), exclude_none=True)
    words = _found(tree, len(fit.shots), {place[-1]: of for place, of in quantiles.items() if place[0] == "plate"})
    tables = {"weakening": weakening} if plate.degradation < 1.0 else {}
    tables["found"] = {title: words}
    tables["assumed"] = {"resistance": "of this plate and this core; no other thickness was fitted"}
    below = [f"\n[material.{name}]\n{toml_text(table)}" for name, table in tables.items()]
    return toml_text({"material": [entry]}) + "".join(below)


def _quantiles(tree: xarray.DataTree) -> dict[tuple[Any, ...], tuple[float, float, float]]:
    """Ends and middle of the 90 % interval of each parameter, by its path."""
    posterior = tree["posterior"].to_dataset()
    return {
        tuple(json.loads(array.attrs[posterior_file.PATH])): tuple(np.quantile(array.values, ENTRY_QUANTILES).tolist())
        for name, array in posterior.data_vars.items()
        if name not in posterior_file.HITS
    }


def _found(tree: xarray.DataTree, shots: int, quantiles: dict[Any, tuple[float, float, float]]) -> str:
    """Shots, intervals, and root mean squares of the misses of the computed medians, by quantity."""
    ranges = {"resistance": ("Y", 1e-9, " GPa"), "shear_coefficient": ("η", 1.0, ""), "degradation": ("β", 1.0, "")}
    intervals = [
        f"{letter} {scale * low:.3g} to {scale * high:.3g}{unit}"
        for key, (letter, scale, unit) in ranges.items()
        if (of := quantiles.get(key)) is not None
        for low, _, high in (of,)
    ]
    observed, computed = tree["observed_data"].to_dataset(), tree["posterior_predictive"].to_dataset()
    missed: dict[str, list[float]] = {}
    if "observation" in observed.coords:
        middle = np.nanmedian(computed[posterior_file.FITTED].values.reshape(-1, observed.sizes["observation"]), axis=0)
        apart = middle - observed[posterior_file.MEASURED].values
        units = observed[posterior_file.UNITS_OF].values
        for label, unit, value in zip(observed["observation"].values, units, apart, strict=True):
            what = str(label).rsplit(": ", 1)[-1].replace("_", " ")
            missed.setdefault(f"{what} [{STORED[str(unit)].shown}]", []).append(float(value))
    residuals = [f"{what}: {np.sqrt(np.nanmean(np.square(values))):.2g}" for what, values in missed.items()]
    converged = "" if tree.attrs[posterior_file.CONVERGED] else "; not converged"
    return (
        f"{shots} shots; 90 %: {', '.join(intervals)}; missed (rms): {', '.join(residuals) or 'no number'}{converged}"
    )
