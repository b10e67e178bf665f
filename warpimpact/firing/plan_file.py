"""Reads a firing test from a TOML file and validates it; the schema of such files. A mistake becomes one sentence."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pydantic import ValidationError

from warpimpact.campaign.schema import completed_schema
from warpimpact.campaign.text import CampaignError, parsed, read_text
from warpimpact.firing.plan import FiringTest
from warpimpact.firing.requirements import with_requirement
from warpimpact.results.kinds import TEST
from warpimpact.scene.problems import sentence


def read_test(path: str | Path) -> FiringTest:
    """Read a test file; file names in it count from its folder.

    Raises:
        CampaignError: the file is missing, is not TOML, or has a value that is not allowed.
    """
    path = Path(path)
    return firing_test(read_text(path), str(path), path.parent)


def firing_test(text: str, name: str, folder: Path) -> FiringTest:
    """Read a test from its text; `name` is the name of the file in errors."""
    data: dict[str, Any] = parsed(text, name, TEST)
    try:
        test = FiringTest.model_validate(data, context={"folder": folder})
    except ValidationError as error:
        raise CampaignError(f"{name}: {sentence(error, data)}") from None
    test._source = text
    try:
        return with_requirement(test)
    except CampaignError as error:
        raise CampaignError(f"{name}: {error}") from None


def firing_schema() -> dict[str, Any]:
    """The JSON schema (2020-12) of a test file, with the meaning, the default and the bounds of every key."""
    return completed_schema(FiringTest) | {
        "title": "warpimpact firing test",
        "description": "A firing test of warpimpact: what is fired at, how, and what is asked of it.",
    }
