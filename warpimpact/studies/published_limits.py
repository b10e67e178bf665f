"""Published limit velocities beside those of a search."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import xarray
from pydantic import ValidationError

from warpimpact.analysis.estimates import estimated
from warpimpact.campaign.published import Published
from warpimpact.campaign.text import CampaignError, parsed
from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.results.measures import Measure
from warpimpact.scene.problems import sentence
from warpimpact.view.view import Column, Section, Table, number

_MEDIAN = Measure.parse("V50")
_SAME_OBLIQUITY = 0.5
"""Largest difference of a hit's obliquity from a published one to which it is compared [degree]."""


class Beside(NamedTuple):
    """A published limit velocity, and the median limit of the hits at its obliquity [m/s]; NaN where there are none."""

    published: Published
    computed: float

    @property
    def label(self) -> str:
        """Label in a legend."""
        return f"published: {self.published.label}".removesuffix(": ")


def published_beside(dataset: xarray.Dataset) -> list[Beside]:
    """The published limits that the campaign of a search of limit velocities names.

    Raises:
        CampaignError: the campaign of the result was altered.
    """
    if dataset.attrs[attr.LIMIT] != "velocity":
        return []
    data = parsed(dataset.attrs[attr.CAMPAIGN], attr.CAMPAIGN)
    given = data.get("published", [])
    try:
        rows = [Published.model_validate(row) for row in (given if isinstance(given, list) else [given])]
    except ValidationError as error:
        raise CampaignError(f"published: {sentence(error, data)}") from None
    return [Beside(row, _computed(dataset, math.degrees(row.obliquity))) for row in rows]


def _computed(dataset: xarray.Dataset, obliquity: float) -> float:
    near = np.abs(dataset[v.OBLIQUITY].values - obliquity) <= _SAME_OBLIQUITY
    return estimated(dataset.isel(hit=near), [_MEDIAN])[_MEDIAN].value if near.any() else math.nan


def published_view(dataset: xarray.Dataset) -> list[Section]:
    """The published limits beside the computed ones, and their sources; empty if the campaign names none."""
    beside = published_beside(dataset)
    if not beside:
        return []
    sources = list(dict.fromkeys(row.published.source for row in beside))
    columns = (
        *(number("published", "m/s", ".4g"), number("obliquity", "°", ".4g"), number("computed", "m/s", ".4g")),
        *(number("difference", "%", "+.1f"), Column("of")),
    )
    rows = []
    for published, computed in beside:
        of = f"{published.label} [{sources.index(published.source) + 1}]".strip()
        difference = 100.0 * (computed / published.velocity - 1.0)
        rows.append((published.velocity, math.degrees(published.obliquity), computed, difference, of))
    return [Section([Table(columns, rows), *(f"[{place}] {source}" for place, source in enumerate(sources, start=1))])]
