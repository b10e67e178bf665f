"""The answers to a page: hit maps of a design at each stage, trajectories, figures, reports."""

from __future__ import annotations

import json
from collections import OrderedDict
from collections.abc import Mapping
from dataclasses import replace
from typing import Annotated, Any, Literal

import xarray
from pydantic import BaseModel, Field

from warpimpact.analysis.inspection import exceeds_tolerance, tolerance_text
from warpimpact.analysis.numbers import text_of
from warpimpact.campaign.evidence import catalogue_names, outside_tested_range, range_line
from warpimpact.campaign.plausible import implausible_notes
from warpimpact.campaign.text import parsed
from warpimpact.design.controls import groups, plate_drawing
from warpimpact.design.designs import (
    ROOT,
    DesignStore,
    Tables,
    ValidDesign,
    apply_change,
    choices,
    elements_refusal,
    stages,
)
from warpimpact.plotting.style import data_url
from warpimpact.plotting.trajectory import FIGURES
from warpimpact.records import attributes as attr
from warpimpact.report.hit_data import MOST_HITS, PAGE_PIXELS, page_data, thinned, trajectory_data
from warpimpact.report.report import compared, report_page, result_content, templates
from warpimpact.results.history import hit_view
from warpimpact.runs.options import RunOptions
from warpimpact.runs.replay import replay
from warpimpact.runs.run import run
from warpimpact.solver.device import Cancel

_MOST_KEPT = 24
"""Most results that are kept, so that a return to a design computes nothing."""
_FIGURES = {draw.__name__.replace("_", " "): draw for draw in FIGURES}
_COARSE = 96
"""Pixels along the longer side of a first map, which has few hits."""
THIS_DESIGN = "this design"
"""Name of the design on the page. The designs to compare with have names of their own."""


class Query(BaseModel):
    """What the page sends; each kind of query has some of these."""

    design: Tables = {}
    pins: Annotated[dict[Annotated[str, Field(max_length=80)], Tables], Field(max_length=5)] = {}
    level: Annotated[int, Field(strict=True, ge=0, le=9)] = 0
    stage: str = "full"
    hit: Annotated[int, Field(strict=True, ge=0)] = 0
    layer: Annotated[int, Field(strict=True, ge=0)] = 0
    change: Literal["threat", "material", "shape", "add layer", "remove layer"] = "threat"
    value: str = ""
    figure: str = ""
    name: Annotated[str, Field(max_length=80)] = "file"
    text: str = ""


class Answers:
    """Answers the queries of pages, one at a time, and keeps computed results.

    Each may raise Cancelled by the token `cancel`.

    Args:
        store: designs and files with which the page was started.
        options: where to compute.
    """

    def __init__(self, store: DesignStore, options: RunOptions) -> None:
        self.store, self._options = store, replace(options, progress=lambda now: None, warn=lambda sentence: None)
        self._results: OrderedDict[str, xarray.DataTree] = OrderedDict()
        self._replayed = ("", 0, xarray.Dataset())
        self._environment = templates("design", "report")

    def page(self, **content: Any) -> str:
        """The page without any design."""
        return self._environment.get_template("design.html").render(**content)

    def plate(self, design: ValidDesign) -> dict[str, Any]:
        """The plate, the controls and the campaign file of a design; no shot is computed."""
        campaign = design.campaign
        outside = outside_tested_range(campaign)
        return {
            "kind": "plate",
            "plate": plate_drawing(campaign),
            "groups": groups(design),
            "choices": choices(design.tables),
            "toml": design.text,
            "title": campaign.title,
            "notes": [
                *implausible_notes(campaign.scene, campaign.impact, campaign.hits, design.tables),
                *filter(None, [elements_refusal(campaign)]),
            ],
            "tested": [range_line(outside), *catalogue_names(campaign), *outside],
        }

    def result(self, design: ValidDesign, cancel: Cancel) -> xarray.DataTree:
        """The answer of a design."""
        text, campaign = design.text, design.campaign
        if text not in self._results:
            self._results[text] = run(campaign, references=True, options=replace(self._options, cancel=cancel))
            if len(self._results) > _MOST_KEPT:
                self._results.popitem(last=False)
        self._results.move_to_end(text)
        return self._results[text]

    def maps(
        self, stage: str, following: str, designs: Mapping[str, ValidDesign], total: int, cancel: Cancel
    ) -> dict[str, Any]:
        """The maps of a design, and of the designs to compare with, at one stage.

        Args:
            following: the next stage, or empty.
            designs: the designs at this stage, by name; the design of the page is the first.
            total: number of hits at the last stage.
        """
        datasets = {label: self.result(design, cancel) for label, design in designs.items()}
        cancel.check()
        own, most, is_first = datasets[THIS_DESIGN].to_dataset(), MOST_HITS // len(datasets), stage == "first"
        resolution = json.loads(own.attrs.get(attr.RESOLUTION, "{}"))
        accuracy = None if is_first else tolerance_text(own)
        return {
            "kind": "maps",
            "stage": stage,
            "following": following,
            "hits": own.sizes["hit"],
            "total": total,
            "numerics": f"Numerics: {accuracy}." if accuracy else "The error of the numerics is not known.",
            "kept": not exceeds_tolerance(own),
            "level": resolution.get("level"),
            "data": page_data(
                [thinned(dataset, most) for dataset in datasets.values()], _COARSE if is_first else PAGE_PIXELS
            ),
        }

    def numbers(self, designs: Mapping[str, ValidDesign], cancel: Cancel) -> dict[str, Any]:
        """The tables of the designs as HTML."""
        datasets = {label: self.result(design, cancel) for label, design in designs.items()}
        results = []
        for label, dataset in datasets.items():
            cancel.check()
            results.append(result_content(label, dataset))
        cancel.check()
        comparison = compared(datasets, picture=False) if len(datasets) > 1 else None
        html = self._environment.get_template("answer.html").render(results=results, comparison=comparison)
        return {"kind": "numbers", "html": html}

    def designs(self, query: Query) -> dict[str, ValidDesign]:
        """The design of a query, and the designs to compare with, by name."""
        every = {THIS_DESIGN: query.design} | query.pins
        return {name: self.store.checked(tables) for name, tables in every.items()}

    def change(self, query: Query, cancel: Cancel) -> Tables:
        """The tables of a design after a change."""
        return apply_change(self.store.checked(query.design), self.store, query.change, query.layer, query.value)

    def open(self, query: Query, cancel: Cancel) -> Tables:
        """The tables of a campaign file that the browser has read."""
        return self.store.checked(parsed(query.text, query.name)).tables

    def trajectory(self, query: Query, cancel: Cancel) -> dict[str, Any]:
        """The trajectory of a hit of a design at a stage."""
        history = self._history(query, cancel)
        return {
            "hit": query.hit,
            "text": text_of(hit_view(history)),
            "figures": list(_FIGURES),
            "views": trajectory_data(history),
        }

    def figure(self, query: Query, cancel: Cancel) -> dict[str, str]:
        """A figure of a hit's history as the address of an image."""
        return {"image": data_url(_FIGURES[query.figure](self._history(query, cancel)))}

    def _history(self, query: Query, cancel: Cancel) -> xarray.Dataset:
        every = stages(self.store, self.store.checked(query.design), query.level)
        stage = "full" if query.stage == "elements" else query.stage  # the fast law replays both
        design = every.get(stage, every["full"])
        if self._replayed[:2] != (design.text, query.hit):
            self._replayed = (design.text, query.hit, replay(self.result(design, cancel), query.hit))
        return self._replayed[2]

    def report(self, query: Query, cancel: Cancel) -> dict[str, str]:
        """The report of some designs at a stage as HTML."""
        datasets = dict[str, xarray.DataTree]()
        for name, design in self.designs(query).items():
            every = stages(self.store, design, query.level)
            datasets[name] = self.result(every.get(query.stage, every["full"]), cancel)
        page = report_page(datasets, folders=dict.fromkeys(datasets, ROOT), progress=lambda done, total: cancel.check())
        return {"html": page}
