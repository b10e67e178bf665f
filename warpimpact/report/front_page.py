"""The report of a search for designs: a click on a point of the front shows its plate, its map and its campaign."""

from __future__ import annotations

from html import escape
from io import StringIO
from pathlib import Path

import xarray
from matplotlib import colormaps
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from warpimpact.analysis.hit_map import mirrored
from warpimpact.campaign.campaign import Campaign
from warpimpact.campaign.text import parsed
from warpimpact.optimisation.design import is_even
from warpimpact.optimisation.front_view import OF_FRONT, design_text, numbers_of
from warpimpact.plotting.cell import paint_pixels, pixels, tree_of
from warpimpact.plotting.front import THUMBNAIL, campaign_at, draw_thumbnail, front_figure
from warpimpact.plotting.plate import hole_patches
from warpimpact.plotting.style import data_url
from warpimpact.results import attributes as attr
from warpimpact.results import front as f
from warpimpact.results import variables as v
from warpimpact.results.vocabulary import WEIGHTS
from warpimpact.scene.symmetry import IDENTITY, symmetries

FRONT_STYLE = (
    "svg{max-width:100%;height:auto}.design:not(:target){display:none}"
    ".designs:not(:has(:target)) .design:first-child{display:block}"
)
"""Shows the design whose point was clicked, at first that of the first point."""
_MAP_PIXELS = 160
"""Pixels along the longer side of a map."""


def front_html(dataset: xarray.Dataset, folder: Path) -> str:
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


def _design_figure(dataset: xarray.Dataset, place: int, campaign: Campaign) -> Figure:
    """A part of the plate, and its cell, coloured by the first measure at the nearest hit."""
    plate = campaign.plate
    figure = Figure(figsize=(9.0, 3.6), layout="constrained")
    left, right = figure.subplots(1, 2)
    draw_thumbnail(left, plate)
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
    nearest = tree_of(hits).query(pixels(hits, _MAP_PIXELS))[1]
    drawn = paint_pixels(right, hits, hits["value"].values[nearest], (colormaps["viridis"], Normalize()))
    for patch in hole_patches(plate, right):
        patch.set(facecolor="none", edgecolor="white")
        right.add_patch(patch)
    labels = zip(dataset[f.GOAL_LABEL].values, dataset[f.GOAL].values, strict=True)
    effects = [str(label) for label, name in labels if not str(name).startswith(tuple(WEIGHTS))]
    label = effects[0].replace(", worst tenth", "").replace(", mean", "")
    right.set(xlabel="hit y [mm]", ylabel="hit z [mm]", title="Where the unit cell is hit")
    figure.colorbar(drawn, ax=right, label=label)
    return figure
