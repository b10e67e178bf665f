"""A report of a search for designs: one HTML file in which a click on a point shows its plate, its map and its
campaign; it works without a network."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import xarray
from markupsafe import Markup
from numpy.typing import NDArray

from warpimpact.campaign.campaign import Campaign
from warpimpact.campaign.text import parsed
from warpimpact.optimisation.design import is_even
from warpimpact.optimisation.front_view import OF_FRONT, OF_REFERENCE, design_text, front_view, numbers_of
from warpimpact.plotting.front import campaign_at, front_figure
from warpimpact.plotting.style import data_url, png_url
from warpimpact.report.words import templates
from warpimpact.results import attributes as attr
from warpimpact.results import front as f
from warpimpact.results.files import aside
from warpimpact.results.vocabulary import WEIGHTS
from warpimpact.scene.symmetry import IDENTITY, symmetries
from warpimpact.view import svg
from warpimpact.view.view import html_of

Array = NDArray[np.float64]

_WIDTH, _HEIGHT, _LEFT, _TOP, _ROOM = 900.0, 520.0, 70.0, 10.0, 44.0
"""Width and height of the chart, left and upper margin, and room for labels [px]."""
_SIDE = 30e-3
"""Side of the drawn part of a plate [m]."""
_MAP_PIXELS = 160
"""Pixels along the longer side of a map."""


def write_front_report(dataset: xarray.Dataset, path: Path, folder: Path) -> None:
    """Write the report of a search, whole or not at all.

    Args:
        folder: folder of the files that its campaigns name.

    Raises:
        OutputError: the file cannot be written.
    """
    goals = np.flatnonzero(np.isnan(dataset[f.GOAL_LIMIT].values))
    across, up = int(goals[0]), int(goals[min(1, len(goals) - 1)])
    chart = _Chart(dataset, across, up)
    designs = [_design(dataset, place, chart, folder) for place in range(dataset.sizes["front"])]
    references = [
        {"name": str(name), "numbers": numbers_of(dataset, OF_REFERENCE, place)}
        | chart.at(dataset[f.REFERENCE_RESULT].values[place])
        for place, name in enumerate(dataset[f.REFERENCE].values)
    ]
    page = (
        templates("report")
        .get_template("front.html")
        .render(
            title=str(dataset.attrs[attr.TITLE]),
            made=str(dataset.attrs[attr.HISTORY]),
            version=str(dataset.attrs[attr.WARPIMPACT_VERSION]),
            chart=chart.drawn(),
            designs=designs,
            side=f"{1e3 * _SIDE:.3g}",
            references=references,
            picture=data_url(front_figure(dataset, folder), 90),
            view=Markup(html_of(front_view(dataset))),
            design=str(dataset.attrs[f.DESIGN]),
        )
    )
    with aside(path) as file:
        file.write_text(page, encoding="utf-8")


class _Chart:
    """Two objectives as places of an SVG."""

    def __init__(self, dataset: xarray.Dataset, across: int, up: int) -> None:
        from matplotlib.ticker import MaxNLocator

        self._dataset, self._shown = dataset, [across, up]
        names = (f.RESULT, f.FRESH, f.FRESH_LOW, f.FRESH_HIGH, f.REFERENCE_RESULT)
        every = np.concatenate([dataset[name].values[:, self._shown] for name in names])
        every = every[np.isfinite(every).all(axis=1)]
        low, high = every.min(axis=0), every.max(axis=0)
        room = np.where(high > low, 0.04 * (high - low), 1.0)
        self._low, self._high = low - room, high + room
        self._ticks = [MaxNLocator(7).tick_values(*ends) for ends in zip(low, high, strict=True)]

    def at(self, values: Array) -> dict[str, float]:
        """Place of objectives and bounds, shape [asked]."""
        x, y = self._place(np.asarray(values)[self._shown])
        return {"x": x, "y": y}

    def _place(self, shown: Array) -> tuple[float, float]:
        share = (shown - self._low) / (self._high - self._low)
        right, bottom = _WIDTH - 10.0, _HEIGHT - _ROOM
        return round(_LEFT + float(share[0]) * (right - _LEFT), 1), round(bottom - float(share[1]) * (bottom - _TOP), 1)

    def drawn(self) -> dict[str, Any]:
        """What the page draws beside the front."""
        dataset, labels = self._dataset, self._dataset[f.GOAL_LABEL].values
        shown = dataset[f.RESULT].values[:, self._shown]
        every = (self._place(design) for design in shown if np.isfinite(design).all())
        ticks = [
            [tick for tick in at if low <= tick <= high]
            for at, low, high in zip(self._ticks, self._low, self._high, strict=True)
        ]
        middle = 0.5 * (self._low + self._high)
        return {
            "width": _WIDTH,
            "height": _HEIGHT,
            "left": _LEFT,
            "right": _WIDTH - 10.0,
            "top": _TOP,
            "bottom": _HEIGHT - _ROOM,
            "across": [(self._place(np.array([tick, middle[1]]))[0], f"{tick:g}") for tick in ticks[0]],
            "up": [(self._place(np.array([middle[0], tick]))[1], f"{tick:g}") for tick in ticks[1]],
            "label_across": str(labels[self._shown[0]]),
            "label_up": str(labels[self._shown[1]]),
            "every": "".join(f"M{x},{y}h0" for x, y in every),
        }

    def bar(self, place: int) -> str:
        """The interval of a design of the front as a path."""
        ends = [self._dataset[name].values[place, self._shown] for name in (f.FRESH, f.FRESH_LOW, f.FRESH_HIGH)]
        if not np.isfinite(ends).all():
            return ""
        (x, _), (_, low), (_, high) = (self._place(end) for end in ends)
        return f"M{x},{low}V{high}"


def _design(dataset: xarray.Dataset, place: int, chart: _Chart, folder: Path) -> dict[str, Any]:
    """The content of the page for a design of the front; without a drawing if a file of its campaign is gone."""
    text, campaign = str(dataset[f.CAMPAIGN].values[place]), campaign_at(dataset, place, folder)
    return {
        "file": str(dataset[f.FILE].values[place]),
        "numbers": numbers_of(dataset, OF_FRONT, place),
        "variables": design_text(dataset, int(dataset[f.NUMBER][place])),
        "campaign": text,
        "confirmed": bool(dataset[f.CONFIRMED][place]),
        "bar": chart.bar(place),
        "plate": None if campaign is None else _plate(campaign, str(dataset[f.FILE].values[place])),
        "map": None if campaign is None or f.HIT_VALUE not in dataset else _map(dataset, place, campaign, text),
        **chart.at(dataset[f.FRESH].values[place]),
    }


def _plate(campaign: Campaign, file: str) -> Markup:
    """A part of the plate."""
    half = np.full(2, 0.5 * _SIDE)
    outlines = campaign.plate.pattern.outlines((-half[0], half[0]), (-half[1], half[1]))
    return Markup(svg.drawing([svg.plate(outlines, -half, half)], -half, half, f"plate of {file}", scale=12.0))


def _map(dataset: xarray.Dataset, place: int, campaign: Campaign, text: str) -> dict[str, Any]:
    """The unit cell, coloured by the first measure at the nearest hit."""
    from PIL import Image

    values = dataset[f.HIT_VALUE].values[place, 0]
    y, z = dataset[f.HIT_Y].values[place], dataset[f.HIT_Z].values[place]
    cell = campaign.plate.pattern.unit_cell
    group = symmetries(campaign.plate, campaign.impact) if is_even(parsed(text, "front")) else (IDENTITY,)
    images = np.concatenate([np.transpose(symmetry.image(y, z, cell)) for symmetry in group])
    shown, low, high = _coloured(images, np.tile(values, len(group)), cell)
    buffer = BytesIO()
    Image.fromarray(shown).save(buffer, "PNG")
    picture = png_url(buffer.getvalue())
    half = 0.5 * np.array(cell)
    holes = svg.Shape(campaign.plate.pattern.outlines((-half[0], half[0]), (-half[1], half[1])), "none", "white")
    label = f"map of {dataset[f.FILE].values[place]}"
    effects = [
        str(label)
        for label, name in zip(dataset[f.GOAL_LABEL].values, dataset[f.GOAL].values, strict=True)
        if not str(name).startswith(tuple(WEIGHTS))
    ]
    return {
        "drawing": Markup(svg.drawing([holes], -half, half, label, scale=0.36 / max(cell), image=picture)),
        "label": effects[0].replace(", worst tenth", "").replace(", mean", ""),
        "low": low,
        "high": high,
    }


def _coloured(places: Array, values: Array, cell: tuple[float, float]) -> tuple[NDArray[np.uint8], float, float]:
    """Pixels of a cell by the nearest of some places in it, z up, and the ends of the scale."""
    from matplotlib import colormaps
    from scipy.spatial import KDTree

    known = np.isfinite(values)
    low, high = (float(values[known].min()), float(values[known].max())) if known.any() else (0.0, 1.0)
    counts = [max(8, round(_MAP_PIXELS * side / max(cell))) for side in cell]
    y, z = (((np.arange(count) + 0.5) / count - 0.5) * side for count, side in zip(counts, cell, strict=True))
    at = np.stack(np.meshgrid(y, z[::-1]), axis=-1).reshape(-1, 2)
    sides = np.array(cell)
    nearest = KDTree(places % sides % sides, boxsize=sides).query(at % sides % sides)[1]
    share = (values[nearest] - low) / ((high - low) or 1.0)
    colours = colormaps["viridis"](np.ma.masked_invalid(share), bytes=True)[:, :3]
    return np.asarray(colours, dtype=np.uint8).reshape(counts[1], counts[0], 3), low, high
