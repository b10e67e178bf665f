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
import xarray
from plotly.offline import get_plotlyjs

import warpimpact
from warpimpact.plotting.cell import words
from warpimpact.report.hit_data import MOST_HITS, page_data, thinned, trajectory_data, worst_and_spread
from warpimpact.report.words import cell_drawings, compared, conclusion, result_content, templates
from warpimpact.results import variables as v
from warpimpact.results.dataset import hit_numbers
from warpimpact.results.files import aside
from warpimpact.runs.replay import replay

Progress = Callable[[int, int], None]


def write_report(
    datasets: Mapping[str, xarray.Dataset],
    path: Path,
    *,
    folders: Mapping[str, Path],
    trajectories: int = 32,
    progress: Progress | None = None,
) -> None:
    """Write `report_page` of some results into a file, whole or not at all.

    Raises:
        OutputError: the file cannot be written.
        ResultError, CampaignError: a hit cannot be replayed.
    """
    page = report_page(datasets, folders=folders, trajectories=trajectories, progress=progress)
    with aside(path) as file:
        file.write_text(page, encoding="utf-8")


def report_page(
    datasets: Mapping[str, xarray.Dataset],
    *,
    folders: Mapping[str, Path],
    trajectories: int = 32,
    progress: Progress | None = None,
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
    worst = [
        list(dict.fromkeys(measure.hit for measure in result["measures"] if measure.hit is not None))
        for result in results
    ]
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
        drawn["first"] = telling(datasets[name], hits)
    comparison = compared(datasets) if len(datasets) > 1 else None
    return _page(
        data=data,
        results=[
            result | {"shown": few.sizes["hit"], "plate": plate}
            for result, few, plate in zip(results, shown, cell_drawings(datasets), strict=True)
        ],
        comparison=comparison,
        conclusion=conclusion(results, comparison),
    )


def telling(dataset: xarray.Dataset, hits: Sequence[int]) -> int | None:
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
    """The variable that the maps show first: a limit if there is one."""
    wanted = [*(words(names.value) for names in v.LIMITS.values()), words(v.RESIDUAL_VELOCITY)]
    return next((key for key in wanted if key in keys), keys[0])


def _page(*, results: Sequence[dict[str, Any]], data: dict[str, Any], **content: Any) -> str:
    """Fill in page.html."""
    plotly = re.sub(r"https?://(?!www\.w3\.org/)", "", get_plotlyjs())  # addresses of maps and of where charts go
    return (
        templates("report")
        .get_template("page.html")
        .render(
            results=results,
            plotly=_packed(plotly),
            packed=_packed(json.dumps(data, separators=(",", ":"), allow_nan=False)),
            variables=data["variables"],
            first=_first([variable["key"] for variable in data["variables"]]),
            made=f"{datetime.now(UTC):%Y-%m-%d %H:%M} UTC",
            version=warpimpact.__version__,
            **content,
        )
    )
