"""The view of a posterior: parameters with their intervals, what the shots determine, and the accuracy of the
numbers."""

from __future__ import annotations

import json

import numpy as np
import xarray

from warpimpact.identification.posterior import LARGEST_NOISE, learnt, together
from warpimpact.results import attributes as attr
from warpimpact.results import posterior_file
from warpimpact.scene.display import STORED, Unit
from warpimpact.statistics.importance import LARGEST_K
from warpimpact.view.view import Column, Section, Table, labelled, number


def unit_of(array: xarray.DataArray | xarray.DataTree) -> tuple[str, float]:
    """Display unit of a parameter, and the factor to it."""
    units = str(array.attrs.get("units", "1"))
    unit = STORED.get(units, Unit(units, units))
    return unit.shown, unit.factor


def posterior_view(tree: xarray.DataTree) -> list[Section]:
    """The view of a posterior: its parameters, measured and computed numbers, the best set, and its accuracy."""
    return [_parameters(tree), _measured(tree), _best(tree), Section(_worth(tree))]


def _parameters(tree: xarray.DataTree) -> Section:
    columns = (
        *(Column("parameter"), number("median", digits=".3g"), Column("90 % interval"), Column("90 % of the prior")),
        Column("verdict"),
    )
    rows = []
    for name, knowledge in learnt(tree).items():
        unit, factor = unit_of(tree["posterior"][name])
        low, middle, high = (factor * value for value in knowledge.quantiles)
        prior = f"{factor * knowledge.prior[0]:.3g} to {factor * knowledge.prior[2]:.3g}"
        label = f"{name} [{unit}]" if unit else name
        rows.append((label, middle, f"{low:.3g} to {high:.3g}", prior, knowledge.verdict))
    correlations = [
        f"{first} and {other} are determined together more than each alone: their correlation is {value:+.2f}"
        for first, other, value in together(tree)
    ]
    return Section([Table(columns, rows), *correlations], str(tree.attrs[attr.TITLE]))


def _measured(tree: xarray.DataTree) -> Section:
    """Measured numbers beside the computed ones, and what another shot would show."""
    observed, computed = tree["observed_data"].to_dataset(), tree["posterior_predictive"].to_dataset()
    rows = []
    for place, label in enumerate(observed["observation"].values if "observation" in observed else ()):
        value, std = (float(observed[name][place]) for name in (posterior_file.MEASURED, posterior_file.STD))
        spans = [
            "{:.4g} to {:.4g}".format(*np.nanquantile(computed[name].values[..., place], [0.05, 0.95]))
            for name in (posterior_file.FITTED, posterior_file.MEASURED)
        ]
        rows.append((str(label), f"{value:g} ± {std:g}", *spans))
    heads = ("quantity", "measured", "computed at its hit, 90 %", "another such shot, 90 %")
    probabilities = json.loads(str(tree.attrs[posterior_file.ROW_PROBABILITY]))
    notes = [
        f"{shot}: {share:.2g} of the rows that another such shot would show are less probable than this one"
        for shot, share in probabilities.items()
    ]
    return Section([*([Table([*map(Column, heads)], rows)] if rows else []), *notes])


def _best(tree: xarray.DataTree) -> Section:
    """The set of parameters and hits with the smallest misfit."""
    best = tree["best"].to_dataset()
    rows = []
    for name in learnt(tree):
        unit, factor = unit_of(best[name])
        rows.append((name, f"{factor * float(best[name]):.3g} {unit}".strip()))
    for place, shot in enumerate(best["shot"].values):
        y, z = (1e3 * float(best[axis][place]) for axis in ("hit_y", "hit_z"))
        rows.append((f"hit of {shot}", f"({y:.2f}, {z:.2f}) mm"))
    terms = " + ".join(f"{value:.3g}" for value in best["misfit"].values)
    title = f"smallest misfit {float(best['misfit'].sum()):.3g} = {terms}, sum of squares over the uncertainties, at"
    return Section([labelled(rows)], title)


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
