"""A report of results, or of another file: one HTML file that works without a network and without warpimpact.

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
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray
from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined
from markupsafe import Markup
from matplotlib import colormaps
from matplotlib.colors import Normalize
from matplotlib.figure import Figure as PlainFigure
from plotly.offline import get_plotlyjs

from warpimpact.analysis.correction import provenance_table
from warpimpact.analysis.effectiveness import (
    depth_note,
    effectiveness,
    measures_table,
    reference_name,
    solid_note,
    weights_of,
    weights_text,
)
from warpimpact.analysis.hit_map import deformed_hits, mirrored
from warpimpact.analysis.inspection import (
    CAVEAT,
    answer,
    numerics_note,
    range_note,
    sampling_note,
    tolerance_text,
)
from warpimpact.analysis.numbers import View, html_of, interval_text, number_text, table_html
from warpimpact.analysis.plates_by_impact import compare_by_impact, every_view, impact_view, verdict_by_impact
from warpimpact.campaign.campaign import Campaign
from warpimpact.campaign.text import parsed
from warpimpact.errors import ResultError
from warpimpact.firing.simulate import firing_view
from warpimpact.identification.identify import posterior_view
from warpimpact.measures.estimates import estimated, means_of, status_shares
from warpimpact.measures.hits import hit_numbers
from warpimpact.measures.references import DRAWS, Result, as_dataset, as_tree
from warpimpact.measures.vocabulary import WEIGHTS
from warpimpact.optimisation.design import is_irreducible
from warpimpact.optimisation.front import front_table, front_view
from warpimpact.plotting.cell import computed_hits, nearest, paint_pixels, pixels, range_text, to_one_cell, words
from warpimpact.plotting.comparison import THUMBNAIL, campaign_at, front_figure, impact_figure
from warpimpact.plotting.maps import breaks
from warpimpact.plotting.plate import draw_holes, draw_plate
from warpimpact.plotting.studies import firing_figure, hits_figure, pairs_figure, sweep_figure
from warpimpact.plotting.style import Figure, data_url, in_style
from warpimpact.plotting.trajectory import FIGURES
from warpimpact.records import attributes as attr
from warpimpact.records import variables as v
from warpimpact.records.kinds import FIRING, FRONT, HISTORY, POSTERIOR, SWEEP, Kind
from warpimpact.report.hit_data import (
    MOST_HITS,
    SHARE,
    page_data,
    picture_data,
    thinned,
    trajectory_data,
    worst_and_spread,
)
from warpimpact.results import files
from warpimpact.results.dataset import is_uniform
from warpimpact.results.history import hit_view
from warpimpact.runs.replay import replay
from warpimpact.scene.sampling import IDENTITY, symmetries
from warpimpact.scene.units import MM, count_text
from warpimpact.studies.limit import limit_sentence, limit_view
from warpimpact.studies.sweep import sweep_view


def report_page(
    datasets: Mapping[str, Result],
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
    data, done, total = page_data(to_one_cell(shown)), 0, sum(map(len, chosen))
    for name, hits, drawn in zip(datasets, chosen, data["results"], strict=True):
        drawn["trajectories"] = {}
        for hit in hits:  # the page does not show what is left of the plate
            history = replay(datasets[name], hit, folder=folders[name], snapshots=0)
            drawn["trajectories"][hit] = trajectory_data(history)
            done += 1
            if progress:
                progress(done, total)
        drawn["pictures"] = picture_data(datasets[name])
        drawn["first"] = largest_tilt(as_dataset(datasets[name]), hits)
    comparison = compared(datasets) if len(datasets) > 1 else None
    for result, few in zip(results, shown, strict=True):
        result |= {"shown": computed_hits(few), "uniform": is_uniform(few)}
    plotly = re.sub(r"https?://(?!www\.w3\.org/)", "", get_plotlyjs())  # addresses of maps and of where charts go
    page = templates("report").get_template("page.html")
    return page.render(
        results=results,
        plotly=_packed(plotly),
        packed=_packed(json.dumps(data, separators=(",", ":"), allow_nan=False)),
        variables=data["variables"],
        first=_first([variable["key"] for variable in data["variables"]]),
        made=f"{datetime.now(UTC):%Y-%m-%d %H:%M} UTC",
        version=attr.versions()[attr.WARPIMPACT_VERSION],
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
    """The variable that the maps show first: a limit if there is one, or the share that passes where it differs."""
    wanted = [*(words(names.value) for names in v.LIMITS.values()), SHARE, words(v.RESIDUAL_VELOCITY)]
    return next((key for key in wanted if key in keys), keys[0])


_PROVENANCE = (
    *(attr.HISTORY, attr.WARPIMPACT_VERSION, attr.WARP_VERSION, attr.DEVICE, attr.NUMERICS, attr.SAMPLING, attr.SEED),
    *(attr.REPLICATES, attr.SYMMETRIES, attr.FINGERPRINT, attr.REFERENCES),
)


def templates(*rooms: str) -> Environment:
    """The pages in some rooms, in which all text is escaped and every name must be known."""
    loaders = [PackageLoader(f"warpimpact.{room}", "static") for room in rooms]
    environment = Environment(
        loader=ChoiceLoader(loaders), autoescape=True, undefined=StrictUndefined, trim_blocks=True
    )
    environment.globals["caveat"] = CAVEAT
    return environment


def result_content(name: str, result: Result) -> dict[str, Any]:
    """Text, tables and drawing of a result for the page; of an open file, one slice at a time is in memory."""
    dataset = as_dataset(result)
    attributes, measures = dataset.attrs, effectiveness(result)
    numbers = (sampling_note(result), numerics_note(result), depth_note(result), solid_note(result))
    is_limit, is_answer = attr.LIMIT in attributes, DRAWS in as_tree(result).children
    left_open = "hold what the sample of hits, the methods and the materials leave open"
    reservations = (f"Intervals {left_open if is_answer else 'describe the hits that were drawn'}.", *numbers)
    against_solid = f"{name}: with 95 % intervals, compared with the {reference_name(dataset)} of equal areal density"
    return {
        "name": name,
        "title": attributes.get(attr.TITLE, "untitled"),
        "hits": dataset.sizes["hit"],
        "verdict": Markup(html_of({"": [f"{limit_sentence(result)}."] if is_limit else answer(result)})),
        "is_limit": is_limit,
        "scene": _scene_text(dataset),
        "names": attributes.get(attr.CATALOGUE_NAMES, "").splitlines(),
        "campaign": attributes.get(attr.CAMPAIGN, ""),
        "accuracy": tolerance_text(dataset),
        "notes": [note for note in reservations if note],
        "measures": measures,
        "through": Markup(_numbers(result)),
        "breaks": "" if deformed_hits(result) is None else data_url(breaks(result), 90),
        "origin": Markup(html_of({"": provenance_table(result)})),
        "is_answer": is_answer,
        "protects": Markup(table_html(measures_table(measures, reference_name(dataset)), against_solid)),
        "provenance": {words(key): str(attributes[key]) for key in _PROVENANCE if key in attributes},
    }


def compared(datasets: Mapping[str, Result], *, picture: bool = True) -> dict[str, Any]:
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
    hits = count_text(dataset.sizes["hit"], "hit")
    text = f"{hits}{sampling}, over a cell of {y} × {z} mm, at {velocity} and obliquity {obliquity}."
    if attr.AREAL_DENSITY in dataset.attrs:
        text += f" The plate has {dataset.attrs[attr.OPEN_AREA]:.1%} open area; {weights_text(weights_of(dataset))}."
    return text


def _numbers(result: Result) -> str:
    """The numbers of a result as HTML: limits, or how the shots ended and what comes through."""
    dataset = as_dataset(result)
    if attr.LIMIT in dataset.attrs:
        return html_of(limit_view(result))
    rows = {
        words(status): (f"{share.value:.2%}", interval_text(share.low, share.high, digits=".2%"))
        for status, share in status_shares(result).items()
    }
    for measure, mean in estimated(result, means_of(dataset, v.shown_by("report"))).items():
        if mean.count:
            name = f"mean {measure.column.label}, {measure.display.shown}"
            rows[name] = number_text(mean.value, ".2f"), interval_text(mean.low, mean.high, mean.numerics, ".2f")
    table = pd.DataFrame.from_dict(rows, orient="index", columns=["value", "95 % interval"])
    return table_html(table, "Means are over the cores that pass")


# --- Files of all kinds but hit maps ---
_MAP_PIXELS = 160
"""Pixels along the longer side of a map."""


_CONTENTS: dict[Kind, tuple[Callable[[Any], View], dict[str, Callable[[Any], PlainFigure]], str]] = {
    POSTERIOR: (
        posterior_view,
        {"Parameters, in pairs": pairs_figure, "Where the shots hit": hits_figure},
        "fit",
    ),
    FRONT: (front_view, {}, "design_file"),
    SWEEP: (sweep_view, {"By input": sweep_figure}, attr.CAMPAIGN),
    FIRING: (firing_view, {"What the tests report": firing_figure}, "firing_test"),
    HISTORY: (hit_view, {draw.__name__.capitalize(): draw for draw in FIGURES}, ""),
}
"""Of each kind: its view, figures by their headings, and the attribute with the text of the file behind the result."""


def view_of(path: Path, kind: Kind, measures: Sequence[str] = ()) -> View:
    """Return the tables and sentences of a file of any kind but a map of hits.

    Args:
        measures: texts of measures; by default those of the kind.

    Raises:
        ResultError: the file cannot be read, or has no such measures.
    """
    if measures and kind is not SWEEP:
        raise ResultError(f"--measure: got {kind.name}, but measures are those of a map of hits or a sweep")
    tree = files.read(path, kind)
    return sweep_view(tree, measures) if kind is SWEEP else _CONTENTS[kind][0](tree.to_dataset())


def file_page(path: Path, kind: Kind, folder: Path) -> str:
    """Return the report of a file as HTML.

    Args:
        folder: folder of the files that the campaigns of a search name.

    Raises:
        ResultError: the file cannot be read.
    """
    tree, (view_of_kind, figures, input_text) = files.read(path, kind), _CONTENTS[kind]
    dataset = tree.to_dataset()
    content = tree if kind is SWEEP else dataset
    title = str(dataset.attrs.get(attr.TITLE, path.stem))
    view = {"" if heading == title else heading: parts for heading, parts in view_of_kind(content).items()}
    made = [str(dataset.attrs[name]) for name in (attr.HISTORY, attr.WARPIMPACT_VERSION) if name in dataset.attrs]
    front = StringIO()
    if kind is FRONT:
        front_figure(dataset, folder).savefig(front, format="svg")
    drawing = front.getvalue().replace(' target="_blank"', "")  # a link of Matplotlib opens a new page
    return (
        templates("report")
        .get_template("file.html")
        .render(
            title=title,
            front=Markup(drawing[drawing.find("<svg") :]),
            designs=[_design(dataset, place, folder) for place in range(dataset.sizes.get("front", 0))],
            view=Markup(html_of(view, "h2")),
            figures=[(name, data_url(draw(content))) for name, draw in figures.items()],
            input=dataset.attrs.get(input_text, ""),
            made=", ".join(made),
        )
    )


def _design(dataset: xarray.Dataset, place: int, folder: Path) -> dict[str, str]:
    """Return what is shown of a design of the front; no picture if a file of its campaign is gone."""
    campaign = campaign_at(dataset, place, folder)
    return {
        "file": str(dataset.front_file.values[place]),
        "numbers": table_html(front_table(dataset).iloc[[place]]),
        "variables": str(dataset.text.values[dataset.front_design.values[place]]),
        "picture": "" if campaign is None else data_url(_design_figure(dataset, place, campaign)),
        "campaign": str(dataset.front_campaign.values[place]),
    }


@in_style
def _design_figure(dataset: xarray.Dataset, place: int, campaign: Campaign) -> Figure:
    """A part of the plate, and its cell, coloured by the first measure at the nearest hit."""
    plate = campaign.plate
    figure = Figure(figsize=(9.0, 3.6), layout="constrained")
    left, right = figure.subplots(1, 2)
    draw_plate(left, plate, (THUMBNAIL / 2, THUMBNAIL / 2))
    left.set(xticks=[], yticks=[], title=f"{THUMBNAIL:g} mm × {THUMBNAIL:g} mm of the plate")
    if "front_hit_value" not in dataset:
        right.set_axis_off()
        return figure
    text = str(dataset.front_campaign.values[place])
    group = symmetries(plate, campaign.impact) if is_irreducible(parsed(text, "front")) else (IDENTITY,)
    points = {v.HIT_Y: "front_hit_y", v.HIT_Z: "front_hit_z"}
    hits = mirrored(
        xarray.Dataset(
            {"value": ("hit", dataset.front_hit_value.values[place, 0])},
            {name: ("hit", dataset[stored].values[place]) for name, stored in points.items()},
            {attr.PLATE_PERIOD: plate.pattern.period, attr.SYMMETRIES: "; ".join(map(str, group))},
        )
    )
    _, places = nearest(hits, pixels(hits, _MAP_PIXELS))
    drawn = paint_pixels(right, hits, hits["value"].values[places], (colormaps["viridis"], Normalize()))
    draw_holes(right, plate, facecolor="none", edgecolor="white")
    labels = zip(dataset.goal_label.values, dataset.goal.values, strict=True)
    effects = [str(label) for label, name in labels if not str(name).startswith(tuple(WEIGHTS))]
    label = effects[0].replace(", worst tenth", "").replace(", mean", "")
    right.set(xlabel="hit y [mm]", ylabel="hit z [mm]", title="Where the unit cell is hit")
    figure.colorbar(drawn, ax=right, label=label)
    return figure
