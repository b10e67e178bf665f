"""Files of all kinds but hit maps: what `inspect` prints of one, and its report, one HTML file that works offline."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from io import StringIO
from pathlib import Path
from typing import Any

import xarray
from markupsafe import Markup
from matplotlib import colormaps
from matplotlib.colors import Normalize
from matplotlib.figure import Figure as PlainFigure

from warpimpact.analysis.hit_map import mirrored
from warpimpact.analysis.numbers import View, html_of, table_html
from warpimpact.campaign.campaign import Campaign
from warpimpact.campaign.text import parsed
from warpimpact.firing.simulate import firing_view
from warpimpact.identification.identify import posterior_view
from warpimpact.optimisation.design import is_irreducible
from warpimpact.optimisation.front import front_table, front_view
from warpimpact.plotting.cell import nearest, paint_pixels, pixels
from warpimpact.plotting.comparison import THUMBNAIL, campaign_at, front_figure
from warpimpact.plotting.plate import draw_holes, draw_plate
from warpimpact.plotting.studies import firing_figure, hits_figure, pairs_figure, sweep_figure
from warpimpact.plotting.style import Figure, data_url, in_style
from warpimpact.plotting.trajectory import FIGURES
from warpimpact.records import variables as v
from warpimpact.report.report import templates
from warpimpact.results import attributes as attr
from warpimpact.results import files
from warpimpact.results.history import hit_view
from warpimpact.results.kinds import FIRING, FRONT, HISTORY, POSTERIOR, SWEEP, Kind
from warpimpact.results.vocabulary import WEIGHTS
from warpimpact.scene.sampling import IDENTITY, symmetries
from warpimpact.studies.sweep import sweep_view

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
    FIRING: (firing_view, {"What the tests report": firing_figure}, attr.FIRING_TEST),
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
        raise files.ResultError(f"--measure: got {kind.name}, but measures are those of a map of hits or a sweep")
    dataset = files.read(path, kind)
    return sweep_view(dataset, measures) if kind is SWEEP else _CONTENTS[kind][0](dataset)


def file_page(path: Path, kind: Kind, folder: Path) -> str:
    """Return the report of a file as HTML.

    Args:
        folder: folder of the files that the campaigns of a search name.

    Raises:
        ResultError: the file cannot be read.
    """
    dataset, (view_of_kind, figures, input_text) = files.read(path, kind), _CONTENTS[kind]
    title = str(dataset.attrs.get(attr.TITLE, path.stem))
    view = {"" if heading == title else heading: parts for heading, parts in view_of_kind(dataset).items()}
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
            figures=[(name, data_url(draw(dataset))) for name, draw in figures.items()],
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
