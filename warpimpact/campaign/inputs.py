"""The values of a campaign as a result keeps them: written, compared, and read again."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

from warpimpact.campaign.campaign import Campaign
from warpimpact.errors import ResultError
from warpimpact.measures.hits import SLICE
from warpimpact.measures.references import Result
from warpimpact.records import attributes as attr
from warpimpact.scene.input_files import files_of, parsed
from warpimpact.scene.units import quoted

ELEMENT_TABLES = ("bullet", "continuum")
"""Tables of a campaign that only finite elements read."""
CHANGED_SHOTS = "changed_shots"
"""Key of the checksum of changed shots in the inputs of a result."""


def inputs_of(campaign: Campaign) -> dict[str, Any]:
    """The values of a campaign as JSON has them, with the checksums of its files, and of its shots where `with_shots`
    changes them."""
    values: dict[str, Any] = json.loads(json.dumps(campaign.model_dump(), default=digest))
    if not campaign.is_changed:
        return values
    checksum, sampler = hashlib.sha256(), campaign.sampler()
    for first in range(0, len(sampler), SLICE):
        for name, column in sampler.shots(first, SLICE).columns.items():
            checksum.update(name.encode() + column.tobytes())
    return values | {CHANGED_SHOTS: checksum.hexdigest()}


def digest(path: Path) -> str:
    """The name and the checksum of a file, for a manifest."""
    return f"{path.name}, sha256 {hashlib.sha256(path.read_bytes()).hexdigest()}"


def first_difference(left: Any, right: Any, place: str = "") -> tuple[str, str, str] | None:
    """Place and both values of the first difference between two nested dictionaries; None if they are equal."""
    if left == right:
        return None
    if isinstance(left, list) and isinstance(right, list) and len(left) == len(right) and isinstance(left[0], dict):
        left, right = ({str(number): table for number, table in enumerate(side)} for side in (left, right))
    if isinstance(left, dict) and isinstance(right, dict):
        name = min(name for name in left.keys() | right.keys() if left.get(name) != right.get(name))
        return first_difference(left.get(name), right.get(name), f"{place}.{name}".removeprefix("campaign.").strip("."))
    was, now = ("not given" if value is None else quoted(value) for value in (left, right))
    return place, was, now


def campaign_in(result: Result, folder: Path) -> Campaign:
    """The campaign in a result; the files that it names are in a folder.

    Raises:
        ResultError: the result has no campaign, or the campaign and its files are no longer those of the run.
        CampaignError: the campaign cannot be read.
    """
    if attr.CAMPAIGN not in result.attrs:
        raise ResultError("the result does not contain its campaign")
    campaign = Campaign.from_text(
        result.attrs[attr.CAMPAIGN],
        name="the campaign in the result",
        folder=folder,
        count=int(result.attrs[attr.COUNT]) if attr.COUNT in result.attrs else None,  # a list of hits has none
        needs_velocity=result.attrs.get(attr.LIMIT) != "velocity",
    )
    check_inputs(result, campaign)
    return campaign


def check_inputs(result: Result, campaign: Campaign) -> None:
    """Refuse a campaign whose values, or files, are not those of a result; how elements compute it does not count.

    Raises:
        ResultError: the message names the first difference.
    """
    stored = json.loads(result.attrs.get(attr.INPUTS, "{}"))
    difference = first_difference(stored, inputs_of(campaign) | {name: stored.get(name) for name in ELEMENT_TABLES})
    if not stored or difference is None:
        return
    place, *values = difference
    if place == CHANGED_SHOTS:
        raise ResultError(
            "the result has shots that were changed in Python (with_shots), which its campaign does not give; "
            "warpimpact export writes them, and a campaign takes that file as hits.file"
        )
    words = "was {} and is {}".format(*values)
    if all(", sha256 " in value for value in values):
        words = f"{values[0][1:].partition(', sha256 ')[0]} has other contents now"
    elif file := files_of(parsed(result.attrs[attr.CAMPAIGN], "")).get(f"{place.partition('.')[0]}.file"):
        words += f", by {file}"
    raise ResultError(f"the campaign changed after the run: {place}: {words}; put it back, or run the campaign again")
