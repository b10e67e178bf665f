"""The answer of a result in a few lines: what was shot at what, the numbers that decide, and how sure they are.

Numbers that finite elements have corrected have one range, of hits and numerics together. Those of the fast law alone
have the digits that the law knows: its bias is larger than any interval of its hits.
"""

from __future__ import annotations

import json
import math

import pandas as pd
import xarray

from warpimpact.analysis.correction import correction_table, is_corrected
from warpimpact.analysis.effectiveness import effectiveness, reference_name
from warpimpact.analysis.estimates import estimated, passed_count
from warpimpact.analysis.inspection import exceeds_tolerance, stop_lines
from warpimpact.campaign.evidence import range_line
from warpimpact.records import variables as v
from warpimpact.results import attributes as attr
from warpimpact.results.dataset import failed
from warpimpact.results.measures import Measure
from warpimpact.results.vocabulary import has_base
from warpimpact.solver.accuracy import errors_text

LAW_ERRORS = {"velocity": (8.0, 77.0), "tilt": (7.0, 37.0)}
"""Smallest and largest error (root mean square) of the fast law on the six plates of docs/continuum.md, against finite
elements of the same hits: of the residual velocity [m/s], and of the tilt at 130 mm [°]."""
_BROKEN = Measure.parse("P(broken)")


def answer(dataset: xarray.Dataset, elements: str = "") -> list[str | pd.DataFrame]:
    """The answer of a map of hits, sentences and a table of what elements corrected, in four to six lines.

    Args:
        elements: a sentence on what a correction by finite elements would cost, or why there can be none.
    """
    scene = dataset.attrs.get(attr.SCENE, dataset.attrs.get(attr.TITLE, "untitled"))
    outside, has_elements = dataset.attrs.get(attr.OUTSIDE_TESTED_RANGE), is_corrected(dataset)
    sentence = _sentence(dataset)
    lines: list[str | pd.DataFrame] = [f"{scene}.", *([] if has_elements else [sentence])]
    if has_elements:
        lines += [f"By the fast law: {sentence}"] if has_base(dataset) else []
        broken = [_BROKEN] if v.BROKEN in dataset else []
        lines += correction_table(dataset, [*deciding_measures(dataset), *broken])
    if exceeds_tolerance(dataset):
        errors = errors_text(dataset.attrs)
        level = json.loads(dataset.attrs[attr.RESOLUTION])["level"]
        lines.append(f"The numerics err by {errors}, more than their tolerance. Give a numerics.level above {level}.")
    if not has_elements and attr.CONTINUUM not in dataset.attrs:
        (slow, fast), (little, much) = LAW_ERRORS["velocity"], LAW_ERRORS["tilt"]
        errors = f"{slow:.0f} to {fast:.0f} m/s and {little:.0f} to {much:.0f}°"
        lines.append(f"By the fast law: on six plates it was {errors} off finite elements. {elements}".strip())
    return [*lines, *stop_lines(dataset), *([] if outside is None else [range_line(json.loads(outside))])]


def deciding_measures(dataset: xarray.Dataset) -> list[Measure]:
    """Whether cores pass the base; without one, the residual velocity, and the tilt farthest behind the plate."""
    if has_base(dataset):
        return [Measure.parse("P(base_perforated)")]
    standoffs = dataset[v.STANDOFF].values.tolist()
    angle = f"tilt@{standoffs[-1]!r}m" if standoffs else v.DEFLECTION
    return [Measure.parse(f"mean({v.RESIDUAL_VELOCITY})"), Measure.parse(f"mean({angle})")]


def _sentence(dataset: xarray.Dataset) -> str:
    """How many cores pass the base, behind the add-on, behind the solid one, and without one; without a base, how many
    cores pass, and with which velocity and tilt; how many break, and how many shots failed, where some do."""
    measures, ends = deciding_measures(dataset), ""
    if v.BROKEN in dataset:
        ends += f"; {_share(estimated(dataset, [_BROKEN])[_BROKEN].value)} of the cores break"
    if bad := int(failed(dataset).sum()):
        ends += f"; {bad} shots failed"
    if has_base(dataset):
        row = effectiveness(dataset, [measures[0].text]).iloc[0]
        solid = f"behind the {reference_name(dataset)} of the same weight"
        others = ((row.solid, solid), (row.alone, "without add-on"))
        shown = ", ".join(f"{value:.0%} {where}" for value, where in others if not math.isnan(value))
        return f"{_share(row.value)} of the cores pass the base{f'; {shown}' if shown else ''}{ends}."
    passed, hits = passed_count(dataset), dataset.sizes[v.HIT]
    if not passed:
        return f"No core of {hits} passes{ends}."
    means = ", ".join(
        f"mean {measure.column.label} {mean.value:.0f}{measure.display.suffix}"
        for measure, mean in estimated(dataset, measures).items()
    )
    return f"{_share(passed / hits)} of {hits} cores pass: {means}{ends}."


def _share(share: float) -> str:
    """A share in whole percent that is 0 or 100 % only where no or every core counts."""
    if math.isnan(share):
        return "an unknown share"
    return "under 1%" if 0.0 < share < 0.005 else "over 99%" if 0.995 < share < 1.0 else f"{share:.0%}"
