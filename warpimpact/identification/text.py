"""A posterior as text: parameters with their intervals, what the shots determine, and what the numbers are worth."""

from __future__ import annotations

import json

import numpy as np
import xarray

from warpimpact.identification.posterior import LARGEST_NOISE, learnt, together
from warpimpact.results import attributes as attr
from warpimpact.results import posterior_file
from warpimpact.scene.display import STORED, Unit
from warpimpact.statistics.importance import LARGEST_K


def unit_of(array: xarray.DataArray | xarray.DataTree) -> tuple[str, float]:
    """Unit of a parameter as it is shown, and the factor to it."""
    units = str(array.attrs.get("units", "1"))
    unit = STORED.get(units, Unit(units, units))
    return unit.shown, unit.factor


def posterior_text(tree: xarray.DataTree) -> str:
    return "\n".join([*_parameters(tree), "", *_rows(tree), "", *_best(tree), "", *_worth(tree)])


def _parameters(tree: xarray.DataTree) -> list[str]:
    lines = [
        str(tree.attrs[attr.TITLE]),
        f"{'parameter':26}{'median':>9}  {'90 % interval':18}{'90 % of the prior':20}verdict",
    ]
    for name, one in learnt(tree).items():
        unit, factor = unit_of(tree["posterior"][name])
        low, middle, high = (factor * value for value in one.quantiles)
        prior = f"{factor * one.prior[0]:.3g} to {factor * one.prior[2]:.3g}"
        label = f"{name} [{unit}]" if unit else name
        lines.append(f"{label:26}{middle:9.3g}  {f'{low:.3g} to {high:.3g}':18}{prior:20}{one.verdict}")
    lines += [
        f"{one} and {other} are determined together more than each alone: their correlation is {value:+.2f}"
        for one, other, value in together(tree)
    ]
    return lines


def _rows(tree: xarray.DataTree) -> list[str]:
    """Measured numbers beside what is computed for them, and what another shot would show."""
    observed, computed = tree["observed_data"].to_dataset(), tree["posterior_predictive"].to_dataset()
    lines = [f"{'measured':42}{'':18}{'computed at its hit':22}{'another such shot':20}(90 % intervals)"]
    for place, label in enumerate(observed["observation"].values if "observation" in observed else ()):
        value, std = (float(observed[name][place]) for name in (posterior_file.MEASURED, posterior_file.STD))
        spans = [
            "{:.4g} to {:.4g}".format(*np.nanquantile(computed[name].values[..., place], [0.05, 0.95]))
            for name in (posterior_file.FITTED, posterior_file.MEASURED)
        ]
        lines.append(f"{label!s:42}{f'{value:g} ± {std:g}':18}{spans[0]:22}{spans[1]:20}")
    for shot, share in json.loads(str(tree.attrs[posterior_file.ROW_PROBABILITY])).items():
        lines.append(
            f"{shot}: {share:.2g} of the rows that another such shot would show are less probable than this one"
        )
    return lines


def _best(tree: xarray.DataTree) -> list[str]:
    best = tree["best"].to_dataset()
    values = []
    for name in learnt(tree):
        unit, factor = unit_of(best[name])
        values.append(f"{name} {factor * float(best[name]):.3g} {unit}".strip())
    hits = ", ".join(
        f"{shot} ({1e3 * float(best['hit_y'][place]):.2f}, {1e3 * float(best['hit_z'][place]):.2f}) mm"
        for place, shot in enumerate(best["shot"].values)
    )
    return [
        f"smallest misfit {float(best['misfit'].sum()):.3g} = "
        f"{' + '.join(f'{value:.3g}' for value in best['misfit'].values)}, sum of squares over the uncertainties, at",
        f"  {', '.join(values)}",
        f"  hits: {hits}",
    ]


def _worth(tree: xarray.DataTree) -> list[str]:
    attributes = tree.attrs
    measures = posterior_file.EFFECTIVE, posterior_file.PARETO_K, posterior_file.HIT_NOISE
    effective, k, noise = (float(attributes[name]) for name in measures)
    sets = attributes[posterior_file.SETS]
    lines = [
        f"{sets} sets of parameters, effective sample size {effective:.0f}, Pareto k {k:.2f}, "
        f"the hits leave ±{noise:.2g} in ln L"
    ]
    if attributes[posterior_file.CONVERGED]:
        return lines
    wanted = int(attributes[posterior_file.WANTED])
    causes = [
        (effective < wanted, f"the effective sample size is below {wanted}: give more sets"),
        (k > LARGEST_K, f"Pareto k is above {LARGEST_K}: some sets carry too much weight; give more sets"),
        (noise > LARGEST_NOISE, f"the hits leave more than ±{LARGEST_NOISE} in ln L: give more hits"),
    ]
    return [*lines, "NOT CONVERGED: " + "; ".join(text for failed, text in causes if failed)]
