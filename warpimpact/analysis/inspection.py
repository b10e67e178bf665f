"""What a notebook shows of a result: a map, a verdict, and all its numbers."""

from __future__ import annotations

from dataclasses import dataclass
from html import escape
from pathlib import Path

import numpy as np
import xarray

from warpimpact.analysis.effectiveness import Score, effectiveness
from warpimpact.analysis.estimates import slices
from warpimpact.analysis.hit_map import hit_points
from warpimpact.analysis.inspect import inspect_text
from warpimpact.analysis.numbers import number_text
from warpimpact.analysis.plate_text import reference_name
from warpimpact.analysis.summary import numerics_sentence
from warpimpact.records.group import failures
from warpimpact.results import attributes as attr
from warpimpact.results import files
from warpimpact.results import variables as v
from warpimpact.results.dataset import passed
from warpimpact.results.outlines import outlines
from warpimpact.view import svg

_MOST_HITS = 2000
"""Most hits in a drawing."""
_PASSED, _STOPPED, _FAILED, _EDGE = "#D55E00", "#56B4E9", "#000000", "#d8d8d8"


@dataclass(frozen=True)
class Inspection:
    """All information on a result, as text, and in a notebook with a map.

    Attributes:
        text: what `warpimpact inspect` prints.
        verdict: how many cores pass, and the first measure of protection beside that of the solid plate.
        drawing: an SVG map of how the hits ended, over the holes.
    """

    text: str
    verdict: str
    drawing: str

    def __str__(self) -> str:
        return self.text

    def _repr_html_(self) -> str:
        """HTML for a notebook."""
        return f"<div><p><b>{escape(self.verdict)}</b></p>{self.drawing}<pre>{escape(self.text)}</pre></div>"


def inspect(dataset: xarray.Dataset | str | Path) -> Inspection:
    """A result, or its file, as text, with a verdict and a map. Of a file only a part is in memory at a time.

    Raises:
        ResultError: the file is missing or damaged, or is no map of hits.
    """
    if isinstance(dataset, str | Path):
        with files.opened(Path(dataset)) as result:
            return inspect(result)
    return Inspection(inspect_text(dataset), verdict(dataset, effectiveness(dataset)[0]), _drawing(dataset))


def verdict(dataset: xarray.Dataset, first: Score) -> str:
    """How many cores pass, one measure of protection, and the accuracy of the numerics."""
    count, interval = sum(int(passed(part).sum()) for part in slices(dataset[[v.STATUS]])), first.interval
    protection = f"{first.measure.title} {number_text(first.value)}"
    protection += "" if interval == "-" else f" ({interval})"
    protection += "" if np.isnan(first.ratio) else f", {number_text(first.ratio)} of the {reference_name(dataset)}'s"
    return f"{count} of {dataset.sizes['hit']} cores pass. {protection}. {numerics_sentence(dataset)}"


def _drawing(dataset: xarray.Dataset) -> str:
    """The hits, orange where a core passed, blue where it stopped and black where the computation failed."""
    if attr.PLATE_PERIOD not in dataset.attrs:
        return ""
    first_hits = dataset[[v.STATUS]].isel(hit=slice(_MOST_HITS)).load()
    hits, status, came = hit_points(first_hits), first_hits[v.STATUS].values, passed(first_hits)
    half = np.maximum(0.5 * np.asarray(dataset.attrs[attr.PLATE_PERIOD]), np.abs(hits).max(axis=0))
    holes = outlines(dataset)
    mark = 0.006 * half.max() * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    broken = failures(status)
    kinds = ((came, _PASSED), (~came & ~broken, _STOPPED), (broken, _FAILED))
    marks = [svg.Shape([hit + mark for hit in hits[which]], colour) for which, colour in kinds]
    shapes = [svg.Shape(svg.rings(holes["y"], holes["z"]), _EDGE), *marks]
    legend = "orange: the core passes; blue: it is stopped; black: not computed; grey: holes"
    return f"{svg.drawing(shapes, -half, half, 'map of the hits')}<br><small>{legend}</small>"
