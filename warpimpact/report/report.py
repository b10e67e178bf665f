"""A report of one or several results: one HTML file that works without a network and without warpimpact.

Plotly draws the maps; the file contains its JavaScript and the data of the hits, both compressed, which the page
unpacks. All text from a result or a campaign is escaped, and the page's security policy forbids it to load anything.
"""

from __future__ import annotations

import gzip
import json
import re
from base64 import b64encode
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray
from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined
from markupsafe import Markup
from plotly.offline import get_plotlyjs

import warpimpact
from warpimpact.analysis.correction import correction_table, is_corrected
from warpimpact.analysis.effectiveness import (
    depth_note,
    effectiveness,
    measures_table,
    reference_name,
    solid_note,
    weights_of,
    weights_text,
)
from warpimpact.analysis.estimates import estimated, means_of, passed_count, status_shares
from warpimpact.analysis.inspection import numerics_note, range_note, sampling_note, tolerance_text
from warpimpact.analysis.numbers import html_of, interval_text, number_text, table_html
from warpimpact.analysis.plates_by_impact import compare_by_impact, every_view, impact_view, verdict_by_impact
from warpimpact.analysis.verdict import answer
from warpimpact.plotting.cell import range_text, words
from warpimpact.plotting.comparison import impact_figure
from warpimpact.plotting.style import data_url
from warpimpact.records import variables as v
from warpimpact.report.hit_data import MOST_HITS, page_data, thinned, trajectory_data, worst_and_spread
from warpimpact.results import attributes as attr
from warpimpact.results.dataset import hit_numbers
from warpimpact.results.files import ResultError
from warpimpact.runs.replay import replay
from warpimpact.scene.units import MM
from warpimpact.studies.limit import limit_sentence, limit_view


def report_page(
    datasets: Mapping[str, xarray.Dataset],
    *,
    folders: Mapping[str, Path],
    trajectories: int = 32,
    progress: Callable[[int, int], None] | None = None,
) -> str:
    """The report of some results as HTML.

    Args:
        datasets: results by the names to show; of an open file only the needed parts are read.
        folders: for each result, the folder of the files that its campaign names.
        trajectories: number of hits of each result to replay on the CPU.
        progress: called with (hits replayed, hits to replay).

    Raises:
        ResultError, CampaignError: a hit cannot be replayed.
    """
    results = [result_content(name, dataset) for name, dataset in datasets.items()]
    worst = [list(dict.fromkeys(hit for hit in result["measures"].hit.tolist() if hit >= 0)) for result in results]
    most = MOST_HITS // len(datasets)
    shown = [thinned(dataset, most, keep=hits) for dataset, hits in zip(datasets.values(), worst, strict=True)]
    chosen = [worst_and_spread(few, trajectories, first=hits) for few, hits in zip(shown, worst, strict=True)]
    data, done, total = page_data(shown), 0, sum(map(len, chosen))
    for name, hits, drawn in zip(datasets, chosen, data["results"], strict=True):
        drawn["trajectories"] = {}
        for hit in hits:  # the page does not show what is left of the plate
            history = replay(datasets[name], hit, folder=folders[name], snapshots=0)
            drawn["trajectories"][hit] = trajectory_data(history)
            done += 1
            if progress:
                progress(done, total)
        drawn["first"] = largest_tilt(datasets[name], hits)
    comparison = compared(datasets) if len(datasets) > 1 else None
    for result, few in zip(results, shown, strict=True):
        result["shown"] = few.sizes["hit"]
    plotly = re.sub(r"https?://(?!www\.w3\.org/)", "", get_plotlyjs())  # addresses of maps and of where charts go
    page = templates("report").get_template("page.html")
    return page.render(
        results=results,
        plotly=_packed(plotly),
        packed=_packed(json.dumps(data, separators=(",", ":"), allow_nan=False)),
        variables=data["variables"],
        first=_first([variable["key"] for variable in data["variables"]]),
        made=f"{datetime.now(UTC):%Y-%m-%d %H:%M} UTC",
        version=warpimpact.__version__,
        comparison=comparison,
        notes=list(dict.fromkeys(note for result in results for note in result["notes"])),
    )


def largest_tilt(dataset: xarray.Dataset, hits: Sequence[int]) -> int | None:
    """The hit whose trajectory shows most: the one with the largest tilt at the largest stand-off."""
    if not hits or not dataset.sizes["standoff"]:
        return hits[0] if hits else None
    chosen = dataset[[v.TILT]].isel(hit=np.isin(hit_numbers(dataset), hits), standoff=-1).load()
    tilt = chosen[v.TILT].values
    return int(hit_numbers(chosen)[np.nanargmax(tilt)]) if np.isfinite(tilt).any() else hits[0]


def _packed(text: str) -> str:
    """A text compressed by gzip, as base64; the same text gives the same bytes."""
    return b64encode(gzip.compress(text.encode(), mtime=0)).decode()


def _first(keys: Sequence[str]) -> str:
    """The variable that the maps show first: a corrected velocity or a limit if there is one."""
    velocity = words(v.RESIDUAL_VELOCITY)
    wanted = [f"corrected {velocity}", *(words(names.value) for names in v.LIMITS.values()), velocity]
    return next((key for key in wanted if key in keys), keys[0])


_PROVENANCE = (
    *(attr.HISTORY, attr.WARPIMPACT_VERSION, attr.WARP_VERSION, attr.DEVICE, attr.NUMERICS, attr.SAMPLING, attr.SEED),
    *(attr.REPLICATES, attr.SYMMETRIES, attr.FINGERPRINT, attr.REFERENCES),
)


def templates(*rooms: str) -> Environment:
    """The pages in some rooms, in which all text is escaped and every name must be known."""
    loaders = [PackageLoader(f"warpimpact.{room}", "static") for room in rooms]
    return Environment(loader=ChoiceLoader(loaders), autoescape=True, undefined=StrictUndefined, trim_blocks=True)


def result_content(name: str, dataset: xarray.Dataset) -> dict[str, Any]:
    """Text, tables and drawing of a result for the page; of an open file, one slice at a time is in memory."""
    attributes, measures = dataset.attrs, effectiveness(dataset)
    numbers = (sampling_note(dataset), numerics_note(dataset), depth_note(dataset), solid_note(dataset))
    reservations = ("Intervals describe the hits that were drawn.", *numbers)
    is_limit = attr.LIMIT in attributes
    against_solid = f"{name}: with 95 % intervals, compared with the {reference_name(dataset)} of equal areal density"
    return {
        "name": name,
        "title": attributes.get(attr.TITLE, "untitled"),
        "hits": dataset.sizes["hit"],
        "verdict": Markup(html_of({"": [f"{limit_sentence(dataset)}."] if is_limit else answer(dataset)})),
        "is_limit": is_limit,
        "scene": _scene_text(dataset),
        "names": attributes.get(attr.CATALOGUE_NAMES, "").splitlines(),
        "campaign": attributes.get(attr.CAMPAIGN, ""),
        "accuracy": tolerance_text(dataset),
        "notes": [note for note in reservations if note],
        "measures": measures,
        "through": Markup(_numbers(dataset)),
        "protects": Markup(table_html(measures_table(measures, reference_name(dataset)), against_solid)),
        "provenance": {words(key): str(attributes[key]) for key in _PROVENANCE if key in attributes},
    }


def compared(datasets: Mapping[str, xarray.Dataset], *, picture: bool = True) -> dict[str, Any]:
    """Return the comparison of plates as HTML, its deciding measure alone, and a picture if one is wanted.

    Without a comparison, a sentence gives the reason.
    """
    names, notes = list(datasets), range_note(datasets.values())
    try:
        comparisons = compare_by_impact(list(datasets.values()), names)
    except ResultError as error:
        return {"view": Markup(html_of({"": [str(error)]})), "every": "", "verdict": [], "picture": ""}
    figure = impact_figure(comparisons) if picture else None
    return {
        "view": Markup(html_of(impact_view(comparisons, notes))),
        "every": Markup(html_of(every_view(comparisons))),
        "verdict": verdict_by_impact(comparisons),
        "picture": "" if figure is None else data_url(figure, 100),
    }


def _scene_text(dataset: xarray.Dataset) -> str:
    """Hits, cell, impact and plate in one or two sentences."""
    y, z = (f"{length * MM:.4g}" for length in dataset.attrs[attr.PLATE_PERIOD])
    velocity, obliquity = (range_text(dataset[name]) for name in (v.IMPACT_VELOCITY, v.OBLIQUITY))
    sampling = f", {dataset.attrs[attr.SAMPLING]} sampling" if attr.SAMPLING in dataset.attrs else ""
    text = (
        f"{dataset.sizes['hit']} hits{sampling}, over a cell of {y} × {z} mm, at {velocity} and obliquity {obliquity}."
    )
    if attr.AREAL_DENSITY in dataset.attrs:
        text += f" The plate has {dataset.attrs[attr.OPEN_AREA]:.1%} open area; {weights_text(weights_of(dataset))}."
    return text


def _numbers(dataset: xarray.Dataset) -> str:
    """The numbers of a result as HTML: limits, or what elements corrected, or how the shots ended and what comes
    through."""
    if attr.LIMIT in dataset.attrs:
        return html_of(limit_view(dataset))
    if is_corrected(dataset):
        return html_of({"": correction_table(dataset)})
    rows = {
        words(status): (f"{share.value:.2%}", interval_text(share.low, share.high, digits=".2%"))
        for status, share in status_shares(dataset).items()
    }
    for measure, mean in estimated(dataset, means_of(dataset, v.shown_by("report"))).items():
        if mean.count:
            name = f"mean {measure.column.label}, {measure.display.shown}"
            rows[name] = number_text(mean.value, ".2f"), interval_text(mean.low, mean.high, mean.numerics, ".2f")
    table = pd.DataFrame.from_dict(rows, orient="index", columns=["value", "95 % interval"])
    return table_html(table, f"Means are over the {passed_count(dataset)} of {dataset.sizes['hit']} cores that passed")
