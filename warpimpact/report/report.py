"""A report of one or several results: one HTML file that works without a network, for a person who has no warpimpact.

The maps are drawn by Plotly, whose JavaScript (4.8 MB) stands in the file; everything that comes from a result or a
campaign is escaped, and the page forbids itself to load anything.
"""

from __future__ import annotations

import json
import tomllib
from base64 import b64encode
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import xarray
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup
from plotly.offline import get_plotlyjs

import warpimpact
from warpimpact.analysis.comparison import compare, comparison_text
from warpimpact.analysis.effectiveness import SHOWN_UNITS, effectiveness, interval_text, number_text
from warpimpact.analysis.study import study_text
from warpimpact.analysis.summary import UNITS, estimated, main_measures
from warpimpact.campaign.estimates import STATUSES, Measure
from warpimpact.campaign.replay import replay
from warpimpact.plotting.cell import range_text, words
from warpimpact.plotting.comparison import comparison_figure
from warpimpact.report.hits import MOST_HITS, page_data, thinned, trajectory_data, worst_and_spread
from warpimpact.results import ResultError, aside

Progress = Callable[[int, int], None]
_MM = 1e3
_PLATE_WIDTH = 240.0  # of the widest plate on the page [px]


@dataclass(frozen=True)
class Row:
    """A number of a table, and its interval as text; empty where there is none."""

    label: str
    value: str
    interval: str


def write_report(
    datasets: Mapping[str, xarray.Dataset],
    path: Path,
    *,
    folders: Mapping[str, Path],
    trajectories: int = 32,
    study: xarray.Dataset | None = None,
    progress: Progress | None = None,
) -> None:
    """Write the report of some results, whole or not at all.

    Args:
        datasets: results by the names they get; of open files only what is used is read.
        path: the HTML file; an existing one is replaced.
        folders: where the files are that each campaign names.
        trajectories: how many hits of each result are replayed, on the CPU.
        study: error and speed of the numerics on such a scene (`analysis.study.study`).
        progress: called with (hits replayed, hits to replay).

    Raises:
        OutputError: the file cannot be written.
        ResultError, CampaignError: a hit cannot be replayed.
    """
    measures = [effectiveness(dataset) for dataset in datasets.values()]
    worst = [list(dict.fromkeys(one.hit for one in some if one.hit is not None)) for some in measures]
    most = MOST_HITS // len(datasets)
    kept = [thinned(dataset, most, keep=hits) for dataset, hits in zip(datasets.values(), worst, strict=True)]
    few = [dataset.isel(hit=hits).load() for dataset, hits in zip(datasets.values(), kept, strict=True)]
    data = page_data(few, kept)
    chosen = [
        hits[worst_and_spread(some, trajectories, first=np.searchsorted(hits, first).tolist())].tolist()
        for some, hits, first in zip(few, kept, worst, strict=True)
    ]
    done, total = 0, sum(map(len, chosen))
    for (name, dataset), wanted, result in zip(datasets.items(), chosen, data["results"], strict=True):
        result |= {"first": wanted[0] if wanted else None, "trajectories": {}}
        for hit in wanted:
            result["trajectories"][hit] = trajectory_data(replay(dataset, hit, folder=folders[name]))
            done += 1
            if progress:
                progress(done, total)
    environment = Environment(
        loader=PackageLoader("warpimpact.report", ""), autoescape=True, undefined=StrictUndefined, trim_blocks=True
    )
    results = [
        _told(name, dataset, len(hits)) | {"measures": some}
        for (name, dataset), hits, some in zip(datasets.items(), kept, measures, strict=True)
    ]
    page = environment.get_template("page.html").render(
        data=data,
        plotly=Markup(get_plotlyjs()),
        results=results,
        pixels_per_mm=_PLATE_WIDTH / max(result["plate"]["y"] for result in results),
        made=f"{datetime.now(UTC):%Y-%m-%d %H:%M} UTC",
        version=warpimpact.__version__,
        comparison=_compared(datasets) if len(datasets) > 1 else None,
        texts={"number": number_text, "interval": interval_text, "units": SHOWN_UNITS},
        study=None if study is None else study.attrs | {"text": study_text(study)},
    )
    with aside(path) as file:
        file.write_text(page, encoding="utf-8")


def _told(name: str, dataset: xarray.Dataset, shown: int) -> dict[str, Any]:
    """What the page says of a result in words and tables."""
    attributes = dataset.attrs
    return {
        "name": name,
        "title": attributes.get("title", "untitled"),
        "hits": dataset.sizes["hit"],
        "shown": shown,
        "asked": _asked(dataset),
        "campaign": attributes.get("campaign", ""),
        "tables": _tables(dataset),
        "statuses": list(_statuses(dataset)),
        "numbers": list(_numbers(dataset)),
        "plate": _plate(dataset),
        "provenance": {words(key): str(attributes[key]) for key in _PROVENANCE if key in attributes},
        "speed": float(f"{attributes.get('hits_per_second', 0.0):.2g}"),
    }


def _compared(datasets: Mapping[str, xarray.Dataset]) -> dict[str, str]:
    """The comparison of the plates as text and as a picture; or why there is none."""
    try:
        comparison = compare(list(datasets.values()), list(datasets))
    except ResultError as error:
        return {"text": str(error), "picture": ""}
    picture = BytesIO()
    comparison_figure(comparison).savefig(picture, dpi=100)
    return {"text": comparison_text(comparison), "picture": b64encode(picture.getvalue()).decode()}


_PROVENANCE = (
    "history",
    "warpimpact_version",
    "warp_version",
    "device",
    "numerics",
    "sampling",
    "seed",
    "replicates",
    "symmetries",
    "computed_hits",
    "fingerprint",
    "references",
)


def _asked(dataset: xarray.Dataset) -> str:
    """What was shot at what, as a sentence or two."""
    y, z = (f"{length * _MM:.4g}" for length in dataset.attrs["plate_period"])
    velocity, obliquity = (range_text(dataset[name]) for name in ("impact_velocity", "obliquity"))
    sampling = f", {dataset.attrs['sampling']} sampling" if "sampling" in dataset.attrs else ""
    text = (
        f"{dataset.sizes['hit']} hits{sampling}, over a cell of {y} × {z} mm, at {velocity} and obliquity {obliquity}."
    )
    if "areal_density" in dataset.attrs:
        told = dataset.attrs
        text += f" The plate is open by {told['open_area']:.1%} and weighs {told['areal_density']:.3g} kg/m²."
    return text


def _tables(dataset: xarray.Dataset) -> dict[str, dict[str, str]]:
    """Tables of a campaign with its values as they were written, the one inside another as `plate.pattern`; the number
    of hits may be that of the command line."""
    campaign = dataset.attrs.get("campaign", "")
    values = json.loads(campaign) if campaign.startswith("{") else tomllib.loads(campaign)
    tables = dict(_flat(values, ""))
    if "count" in dataset.attrs and "count" in tables.get("hits", {}):
        tables["hits"]["count"] = str(dataset.attrs["count"])
    return tables


def _flat(table: Mapping[str, Any], name: str) -> Iterator[tuple[str, dict[str, str]]]:
    """A table, and those inside it, by their dotted names."""
    plain = {key: _plain(value) for key, value in table.items() if not isinstance(value, dict) and value is not None}
    if name and plain:
        yield name, plain
    for key, value in table.items():
        if isinstance(value, dict):
            yield from _flat(value, f"{name}.{key}".strip("."))


def _plain(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return ", ".join(map(str, value)) if isinstance(value, list) else str(value)


def _statuses(dataset: xarray.Dataset) -> Iterator[Row]:
    for measure, estimate in estimated(dataset, [Measure.parse(f"P({name})") for name in STATUSES]).items():
        if estimate.value > 0.0:
            yield Row(words(measure.variable), f"{estimate.value:.2%}", f"{estimate.low:.2%} to {estimate.high:.2%}")


def _numbers(dataset: xarray.Dataset) -> Iterator[Row]:
    for measure, estimate in estimated(dataset, main_measures(dataset["standoff"].values.tolist())).items():
        if estimate.count:
            at = f" at {measure.standoff * _MM:g} mm" if measure.standoff else ""
            unit = UNITS[measure.units]
            interval = f"{estimate.low:.2f} to {estimate.high:.2f}{unit}"
            yield Row(f"mean {words(measure.variable)}{at}", f"{estimate.value:.2f}{unit}", interval)


def _plate(dataset: xarray.Dataset) -> dict[str, Any]:
    """The cell that hits are spread over, its holes as the path of an SVG: lengths in mm, y to the right, z up."""
    vertices = np.stack([dataset["outline_y"].values, -dataset["outline_z"].values], axis=-1) * _MM
    gaps = np.flatnonzero(np.isnan(vertices[:, 0]))
    rings = [ring[~np.isnan(ring[:, 0])] for ring in np.split(vertices, gaps)]
    path = " ".join("M" + "L".join(f"{y:.3f},{z:.3f}" for y, z in ring) + "Z" for ring in rings if len(ring))
    y, z = (float(length) * _MM for length in dataset.attrs["plate_period"])
    return {"path": path, "y": y, "z": z}
