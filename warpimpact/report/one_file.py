"""Files of all kinds but hit maps: what `inspect` prints of one, and its report, one HTML file that works offline."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from html import escape
from io import StringIO
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import xarray
from matplotlib import colormaps
from matplotlib.colors import Normalize
from matplotlib.figure import Figure as PlainFigure

from warpimpact.analysis.hit_map import mirrored
from warpimpact.analysis.numbers import View, html_of
from warpimpact.campaign.campaign import Campaign
from warpimpact.campaign.text import parsed
from warpimpact.firing.view import firing_view
from warpimpact.identification.posterior import posterior_view
from warpimpact.optimisation.design import is_even
from warpimpact.optimisation.front_view import OF_FRONT, design_text, front_view, numbers_of
from warpimpact.plotting.cell import nearest, paint_pixels, pixels
from warpimpact.plotting.front import THUMBNAIL, campaign_at, front_figure
from warpimpact.plotting.plate import draw_holes, draw_plate
from warpimpact.plotting.posterior import hits_figure, pairs_figure
from warpimpact.plotting.studies import firing_figure, sweep_figure
from warpimpact.plotting.style import Figure, data_url, in_style
from warpimpact.plotting.trajectory import FIGURES
from warpimpact.results import attributes as attr
from warpimpact.results import files, firing, posterior_file
from warpimpact.results import front as f
from warpimpact.results import variables as v
from warpimpact.results.kinds import FIRING, FRONT, HISTORY, POSTERIOR, SWEEP, Kind
from warpimpact.results.replayed_hit import hit_view
from warpimpact.results.vocabulary import WEIGHTS
from warpimpact.scene.symmetry import IDENTITY, symmetries
from warpimpact.studies.sweep import sweep_view

_STYLE = (
    "body{font:16px sans-serif;max-width:70rem;margin:2rem auto;padding:0 1rem}img{max-width:100%}pre{overflow:auto}"
    "td,th{padding:.2rem .9rem .2rem 0;text-align:right;border-bottom:1px solid #d8d8d8}table{border-collapse:collapse}"
    "th:first-child{text-align:left}.wide{overflow-x:auto}"
)


_FRONT_STYLE = (
    "svg{max-width:100%;height:auto}.design:not(:target){display:none}"
    ".designs:not(:has(:target)) .design:first-child{display:block}"
)
"""Shows the design whose point was clicked, at first that of the first point."""
_MAP_PIXELS = 160
"""Pixels along the longer side of a map."""


class _Shown(NamedTuple):
    """What is shown of a kind.

    Attributes:
        view: its view.
        figures: figures by their headings.
        asked: attribute with the text of the file behind the result.
    """

    view: Callable[..., View]
    figures: Mapping[str, Callable[[Any], PlainFigure]] = MappingProxyType({})
    asked: str = ""


_SHOWN = {
    POSTERIOR: _Shown(
        posterior_view,
        figures={
            "Parameters, in pairs": pairs_figure,
            "Where the shots hit": hits_figure,
        },
        asked=posterior_file.FIT_TEXT,
    ),
    FRONT: _Shown(front_view, asked=f.DESIGN),
    SWEEP: _Shown(sweep_view, figures={"By input": sweep_figure}, asked=attr.CAMPAIGN),
    FIRING: _Shown(firing_view, figures={"What the tests report": firing_figure}, asked=firing.TEST),
    HISTORY: _Shown(hit_view, figures={draw.__name__.replace("_", " ").capitalize(): draw for draw in FIGURES}),
}


def view_of(path: Path, kind: Kind, measures: Sequence[str] = ()) -> View:
    """The view of a file of any kind but a map of hits.

    Args:
        measures: texts of measures; by default those of the kind.

    Raises:
        ResultError: the file cannot be read, or has no such measures.
    """
    if measures and kind is not SWEEP:
        raise files.ResultError(f"--measure: got {kind.name}, but measures are those of a map of hits or a sweep")
    dataset = files.read(path, kind)
    return sweep_view(dataset, measures) if kind is SWEEP else _SHOWN[kind].view(dataset)


def write_file_report(path: Path, kind: Kind, output: Path, folder: Path) -> None:
    """Write the report of a file, whole or not at all.

    Args:
        folder: folder of the files that the campaigns of a search name.

    Raises:
        OutputError: the report cannot be written.
        ResultError: the file cannot be read.
    """
    dataset, shown = files.read(path, kind), _SHOWN[kind]
    attributes = dataset.attrs
    title = str(attributes.get(attr.TITLE, path.stem))
    view = {"" if heading == title else heading: parts for heading, parts in shown.view(dataset).items()}
    clickable = _front_html(dataset, folder) if kind is FRONT else ""
    figures = "".join(
        f"<h2>{name}</h2><img alt='{name}' src='{data_url(draw(dataset))}'>" for name, draw in shown.figures.items()
    )
    asked = (
        f"<h2>What was asked</h2><pre>{escape(str(attributes[shown.asked]))}</pre>" if shown.asked in attributes else ""
    )
    made = escape(
        ", ".join(str(attributes[name]) for name in (attr.HISTORY, attr.WARPIMPACT_VERSION) if name in attributes)
    )
    page = (
        "<!DOCTYPE html><html lang='en'><head><meta charset='utf-8'>"
        "<meta name='viewport' content='width=device-width, initial-scale=1'>"
        "<meta http-equiv='Content-Security-Policy' "
        "content=\"default-src 'none'; img-src data:; style-src 'unsafe-inline'\">"
        f"<title>{escape(title)}</title><style>{_STYLE}{_FRONT_STYLE}</style></head><body><h1>{escape(title)}</h1>"
        f"{clickable}{html_of(view, 'h2')}{figures}{asked}<p>{made}</p></body></html>\n"
    )
    with files.aside(output) as file:
        file.write_text(page, encoding="utf-8")


def _front_html(dataset: xarray.Dataset, folder: Path) -> str:
    """The figure of a search, whose points are links, and a section for each design of the front.

    Args:
        folder: folder of the files that its campaigns name.
    """
    picture = StringIO()
    front_figure(dataset, folder).savefig(picture, format="svg")
    drawing = picture.getvalue().replace(' target="_blank"', "")  # a link of Matplotlib opens a new page
    designs = (_design_html(dataset, place, folder) for place in range(dataset.sizes["front"]))
    return (
        "<h2>The front</h2><p>A click on a point of the front shows its plate, its map and its campaign.</p>"
        f"{drawing[drawing.index('<svg') :]}<div class='designs'>{''.join(designs)}</div>"
    )


def _design_html(dataset: xarray.Dataset, place: int, folder: Path) -> str:
    """The section of a design of the front; without a picture if a file of its campaign is gone."""
    file, campaign = escape(str(dataset[f.FILE].values[place])), campaign_at(dataset, place, folder)
    picture = ""
    if campaign is not None:
        picture = f"<img alt='plate and map of {file}' src='{data_url(_design_figure(dataset, place, campaign))}'>"
    return (
        f"<section class='design' id='{file}'><h2>{file}</h2>"
        f"<p>{escape(', '.join(numbers_of(dataset, OF_FRONT, place)))}</p>"
        f"<p>{escape(design_text(dataset, int(dataset[f.NUMBER][place])))}</p>{picture}"
        f"<pre>{escape(str(dataset[f.CAMPAIGN].values[place]))}</pre></section>"
    )


@in_style
def _design_figure(dataset: xarray.Dataset, place: int, campaign: Campaign) -> Figure:
    """A part of the plate, and its cell, coloured by the first measure at the nearest hit."""
    plate = campaign.plate
    figure = Figure(figsize=(9.0, 3.6), layout="constrained")
    left, right = figure.subplots(1, 2)
    draw_plate(left, plate, (THUMBNAIL / 2, THUMBNAIL / 2))
    left.set(xticks=[], yticks=[], title=f"{THUMBNAIL:g} mm × {THUMBNAIL:g} mm of the plate")
    if f.HIT_VALUE not in dataset:
        right.set_axis_off()
        return figure
    text = str(dataset[f.CAMPAIGN].values[place])
    group = symmetries(plate, campaign.impact) if is_even(parsed(text, "front")) else (IDENTITY,)
    points = {v.HIT_Y: f.HIT_Y, v.HIT_Z: f.HIT_Z}
    hits = mirrored(
        xarray.Dataset(
            {"value": ("hit", dataset[f.HIT_VALUE].values[place, 0])},
            {name: ("hit", dataset[stored].values[place]) for name, stored in points.items()},
            {attr.PLATE_PERIOD: plate.pattern.unit_cell, attr.SYMMETRIES: "; ".join(map(str, group))},
        )
    )
    _, places = nearest(hits, pixels(hits, _MAP_PIXELS))
    drawn = paint_pixels(right, hits, hits["value"].values[places], (colormaps["viridis"], Normalize()))
    draw_holes(right, plate, facecolor="none", edgecolor="white")
    labels = zip(dataset[f.GOAL_LABEL].values, dataset[f.GOAL].values, strict=True)
    effects = [str(label) for label, name in labels if not str(name).startswith(tuple(WEIGHTS))]
    label = effects[0].replace(", worst tenth", "").replace(", mean", "")
    right.set(xlabel="hit y [mm]", ylabel="hit z [mm]", title="Where the unit cell is hit")
    figure.colorbar(drawn, ax=right, label=label)
    return figure
