"""Files of all kinds but hit maps: what `inspect` prints of one, and its report, one HTML file that works offline."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from html import escape
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

from matplotlib.figure import Figure

from warpimpact.analysis.sweep_view import sweep_view
from warpimpact.firing.view import firing_view
from warpimpact.identification.posterior import posterior_view
from warpimpact.optimisation.front_view import front_view
from warpimpact.plotting.firing import firing_figure
from warpimpact.plotting.posterior import hits_figure, pairs_figure
from warpimpact.plotting.style import data_url
from warpimpact.plotting.sweep import sweep_figure
from warpimpact.plotting.trajectory import FIGURES
from warpimpact.report.front_page import FRONT_STYLE, front_html
from warpimpact.results import attributes as attr
from warpimpact.results import files, firing, front, posterior_file
from warpimpact.results.kinds import FIRING, FRONT, HISTORY, POSTERIOR, SWEEP, Kind
from warpimpact.results.replayed_hit import hit_view
from warpimpact.view.view import Section, html_of

_STYLE = (
    "body{font:16px sans-serif;max-width:70rem;margin:2rem auto;padding:0 1rem}img{max-width:100%}pre{overflow:auto}"
    "td,th{padding:.2rem .9rem .2rem 0;text-align:left;border-bottom:1px solid #d8d8d8}table{border-collapse:collapse}"
    ".number{text-align:right}.wide{overflow-x:auto}"
)


class _Shown(NamedTuple):
    """What is shown of a kind.

    Attributes:
        view: its view; for a kind with measures it takes their texts, too.
        measured: whether it takes measures.
        figures: figures by their headings.
        asked: attribute with the text of the file behind the result.
    """

    view: Callable[..., list[Section]]
    measured: bool = False
    figures: Mapping[str, Callable[[Any], Figure]] = MappingProxyType({})
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
    FRONT: _Shown(front_view, asked=front.DESIGN),
    SWEEP: _Shown(sweep_view, measured=True, figures={"By input": sweep_figure}, asked=attr.CAMPAIGN),
    FIRING: _Shown(firing_view, figures={"What the tests report": firing_figure}, asked=firing.TEST),
    HISTORY: _Shown(hit_view, figures={draw.__name__.replace("_", " ").capitalize(): draw for draw in FIGURES}),
}


def view_of(path: Path, kind: Kind, measures: Sequence[str] = ()) -> list[Section]:
    """The view of a file of any kind but a map of hits.

    Args:
        measures: texts of measures; by default those of the kind.

    Raises:
        ResultError: the file cannot be read, or has no such measures.
    """
    return _view(kind, files.read(path, kind), measures)


def _view(kind: Kind, dataset: Any, measures: Sequence[str] = ()) -> list[Section]:
    shown = _SHOWN[kind]
    if measures and not shown.measured:
        raise files.ResultError(f"--measure: got {kind.name}, but measures are those of a map of hits or a sweep")
    asked = (measures,) if shown.measured else ()
    return shown.view(dataset, *asked)


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
    title, (first, *others) = str(attributes.get(attr.TITLE, path.stem)), _view(kind, dataset)
    sections = [replace(first, title="") if first.title == title else first, *others]
    clickable = front_html(dataset, folder) if kind is FRONT else ""
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
        f"<title>{escape(title)}</title><style>{_STYLE}{FRONT_STYLE}</style></head><body><h1>{escape(title)}</h1>"
        f"{clickable}{html_of(sections, 'h2')}{figures}{asked}<p>{made}</p></body></html>\n"
    )
    with files.aside(output) as file:
        file.write_text(page, encoding="utf-8")
