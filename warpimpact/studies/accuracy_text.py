"""The text of a study: its table, and its comparison with the literal scheme."""

from __future__ import annotations

import xarray

from warpimpact.results import variables as v
from warpimpact.studies.accuracy import QUOTED


def advantage(dataset: xarray.Dataset, literal: str) -> tuple[str, float] | None:
    """The fastest consistent setting that is as accurate as a literal one, and its speed over that of the literal one.

    As accurate means 90 % errors that are no larger at the last stand-off. None if there is no such setting.

    Args:
        literal: name of the literal setting.
    """
    quoted = dataset.sel(quantile=QUOTED).isel(standoff=-1)
    rival = quoted.sel(setting=literal)
    no_worse = quoted[v.SCHEME] == "consistent"
    for name in v.STUDIED:
        no_worse &= quoted[v.ERRORS[name]] <= rival[v.ERRORS[name]]
    if not no_worse.any():
        return None
    rates = quoted[v.HITS_PER_SECOND].where(no_worse)
    return str(rates.idxmax().item()), float(rates.max() / rival[v.HITS_PER_SECOND])


def study_text(dataset: xarray.Dataset) -> str:
    """The study as a table, fast to slow, and the uncertainty of the converged answer."""
    last = dataset.isel(standoff=-1).sortby(v.HITS_PER_SECOND, ascending=False)
    standoff = f"{last[v.STANDOFF].item() * 1e3:g} mm"
    change = last.isel(level=-1).sel(quantile=QUOTED)
    unsettled = int((dataset[v.SETTLED] == 0).sum())
    width = max(len(name) for name in last[v.SETTING].values)
    lines = [
        f"{'':{width + 10}}{'residual velocity [m/s]':>26}{f'tilt at {standoff} [°]':>28}{'other':>10}",
        f"{'setting':{width}}{'hits/s':>10}{_heads()}{_heads()}{'status':>8}",
        *(_row(last.isel(setting=index), width) for index in range(last.sizes["setting"])),
        "* no faster setting has a smaller 90 % error",
        *(_advantage_line(dataset, name) for name in last[v.SETTING].values[last[v.SCHEME] == "nodal"]),
        f"converged answer: uncertain by {change[v.CHANGES[v.RESIDUAL_VELOCITY]].item():.2g} m/s and "
        f"{change[v.CHANGES[v.TILT]].item():.2g}° (90 % of {dataset.sizes['hit']} hits)",
    ]
    if unsettled:
        lines.append(
            f"left out: {unsettled} of {dataset.sizes['hit']} hits, because their status depends on the numerics"
        )
    return "\n".join(lines)


def _advantage_line(dataset: xarray.Dataset, literal: str) -> str:
    found = advantage(dataset, literal)
    if found is None:
        return f"{literal}: no setting of the consistent scheme is as accurate"
    return f"{literal}: {found[0]} is at least as accurate and {found[1]:.3g} times as fast"


def _heads() -> str:
    return "  " + "".join(f"{name:>8}" for name in ("50 %", "90 %", "max")) + "  "


def _row(setting: xarray.Dataset, width: int) -> str:
    cells = f"{setting[v.SETTING].item():{width}}{setting[v.HITS_PER_SECOND].item():10.4g}"
    for name in v.STUDIED:
        cells += "  " + "".join(f"{value:8.3f}" for value in setting[v.ERRORS[name]].values)
        cells += " *" if setting[v.FRONTS[name]] else "  "
    return cells + f"{setting[v.OTHER_STATUS].item():8d}"
