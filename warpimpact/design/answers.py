"""The answers to a page: hit maps of a design at each stage, trajectories, figures, reports."""

from __future__ import annotations

import json
import math
import time
from collections import OrderedDict
from collections.abc import Mapping, Sequence
from typing import Any

import xarray

from warpimpact.analysis.summary import breaks_promise, numerics_sentence
from warpimpact.campaign.plausible import doubted, doubted_holes
from warpimpact.campaign.resistances import catalogue_names
from warpimpact.campaign.tested_range import outside_tested_range, range_line
from warpimpact.campaign.text import CampaignError
from warpimpact.design.controls import drawn, groups
from warpimpact.design.designs import ROOT, Shelf, ValidDesign, choices, stage_of, work_ahead
from warpimpact.plotting.style import data_url
from warpimpact.plotting.trajectory import FIGURES
from warpimpact.report.hit_data import MOST_HITS, PAGE_PIXELS, page_data, thinned, trajectory_data
from warpimpact.report.report import compared, report_page, result_content, templates
from warpimpact.results import attributes as attr
from warpimpact.results.replayed_hit import hit_view
from warpimpact.runs.replay import replay
from warpimpact.runs.run import run
from warpimpact.solver.worker import Cancel
from warpimpact.view.view import text_of

_MOST_KEPT = 256 * 2**20
"""Most bytes of results that are kept, so that a return to a design computes nothing."""
_MOST_HISTORIES = 4
_COARSE = 96
"""Pixels along the longer side of a first map, which has few hits."""
PACE, BESIDE = 1.2, 0.3
"""Initial ratio of the time of a complete map to the time of a core (`work_ahead`), before it is measured; and its time
beside pilot and hits, for references and tables [s]."""
_FIRST = "The error of the numerics is not known."
THIS_DESIGN = "this design"
"""Name of the design on the page. The designs to compare with have names of their own."""


class Answers:
    """Answers the questions of a page, one at a time, and keeps computed results.

    Args:
        shelf: designs and files with which the page was started.
        device: device that computes.
    """

    def __init__(self, shelf: Shelf, device: str = "auto") -> None:
        self.shelf, self._device = shelf, device
        self._pace = PACE
        self._results: OrderedDict[str, xarray.Dataset] = OrderedDict()
        self._histories: OrderedDict[tuple[str, int], xarray.Dataset] = OrderedDict()
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
            "plate": drawn(campaign),
            "groups": groups(design),
            "choices": choices(design.tables),
            "toml": design.text,
            "title": campaign.title,
            "notes": [*doubted(campaign.scene, campaign.impact, campaign.hits), *doubted_holes(campaign.target)],
            "tested": [range_line(outside), *catalogue_names(campaign), *outside],
        }

    def result(self, design: ValidDesign, cancel: Cancel) -> xarray.Dataset:
        """The hit map of a design.

        Raises:
            Cancelled: by `cancel`.
        """
        text, campaign = design.text, design.campaign
        if text not in self._results:
            self._results[text] = run(
                campaign, references=True, device=self._device, progress=lambda _: None, cancel=cancel
            )
            while len(self._results) > 1 and sum(result.nbytes for result in self._results.values()) > _MOST_KEPT:
                self._results.popitem(last=False)
        self._results.move_to_end(text)
        return self._results[text]

    def maps(
        self, name: str, designs: Mapping[str, ValidDesign], full: Mapping[str, ValidDesign], level: int, cancel: Cancel
    ) -> dict[str, Any]:
        """The maps of a design, and of the designs to compare with, at one stage.

        Args:
            name: name of the stage.
            designs: the designs at this stage, by name; the design of the page is the first.
            full: the designs at their last stage.
            level: level of the hits, as far as it is known.

        Raises:
            Cancelled: by `cancel`.
        """
        new, begin = [design for design in designs.values() if design.text not in self._results], time.perf_counter()
        datasets = {label: self.result(design, cancel) for label, design in designs.items()}
        cancel.check()
        design_data = datasets[THIS_DESIGN]
        foreseen = sum(
            BESIDE + work_ahead(design.campaign, level) for design in (new if name == "full" else full.values())
        )
        if name == "full" and 0.0 < foreseen < math.inf:
            self._pace = (time.perf_counter() - begin) / foreseen
        ahead = 0.0 if name == "full" else self._pace * foreseen
        most = MOST_HITS // len(datasets)
        resolution = json.loads(design_data.attrs[attr.RESOLUTION]) if attr.RESOLUTION in design_data.attrs else {}
        return {
            "kind": "maps",
            "stage": name,
            "hits": design_data.sizes["hit"],
            "total": full[THIS_DESIGN].campaign.hits.count or 0,
            "ahead": ahead if math.isfinite(ahead) else 0.0,
            "numerics": _FIRST if name == "first" else numerics_sentence(design_data),
            "kept": not breaks_promise(design_data),
            "level": resolution.get("level"),
            "data": page_data(
                [thinned(dataset, most) for dataset in datasets.values()], _COARSE if name == "first" else PAGE_PIXELS
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

    def trajectory(self, design: ValidDesign, level: int, stage: str, hit: int, cancel: Cancel) -> dict[str, Any]:
        """The trajectory of a hit of a design at a stage.

        Raises:
            ResultError: there is no such hit.
        """
        history = self._history(stage_of(self.shelf, design, level, stage), hit, cancel)
        return {
            "hit": hit,
            "text": text_of(hit_view(history)),
            "figures": [draw.__name__.replace("_", " ") for draw in FIGURES],
            "views": trajectory_data(history),
        }

    def figure(
        self, design: ValidDesign, level: int, stage: str, hit: int, name: str, cancel: Cancel
    ) -> dict[str, str]:
        """A figure of a hit's history as the address of an image.

        Raises:
            CampaignError: there is no such figure.
        """
        draw = next((draw for draw in FIGURES if draw.__name__.replace("_", " ") == name), None)
        if draw is None:
            raise CampaignError(f'got the figure "{name[:80]}", which replay does not draw')
        return {"image": data_url(draw(self._history(stage_of(self.shelf, design, level, stage), hit, cancel)))}

    def _history(self, design: ValidDesign, hit: int, cancel: Cancel) -> xarray.Dataset:
        key = (design.text, hit)
        if key not in self._histories:
            self._histories[key] = replay(self.result(design, cancel), hit)
            while len(self._histories) > _MOST_HISTORIES:
                self._histories.popitem(last=False)
        return self._histories[key]

    def report(self, designs: Mapping[str, ValidDesign], cancel: Cancel) -> str:
        """The report of some designs as HTML.

        Raises:
            Cancelled: by `cancel`.
        """
        datasets = {name: self.result(design, cancel) for name, design in designs.items()}
        return report_page(datasets, folders=dict.fromkeys(datasets, ROOT), progress=lambda done, total: cancel.check())


def named(design: ValidDesign, others: Sequence[tuple[str, ValidDesign]]) -> dict[str, ValidDesign]:
    """A design and the designs to compare with, by names that differ.

    Raises:
        CampaignError: two have one name.
    """
    names = [THIS_DESIGN, *(name for name, _ in others)]
    if len(set(names)) < len(names):
        raise CampaignError("got two designs of one name to compare; give each its own")
    return {THIS_DESIGN: design, **dict(others)}
