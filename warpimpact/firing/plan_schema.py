"""The JSON schema of test files, for editors and for the reference in the documentation."""

from __future__ import annotations

from typing import Any

from warpimpact.campaign.schema import completed_schema
from warpimpact.firing.plan import FiringTest

Schema = dict[str, Any]


def firing_schema() -> Schema:
    """The JSON schema (2020-12) of a test file, with the meaning, the default and the bounds of every key."""
    return completed_schema(FiringTest) | {
        "title": "warpimpact firing test",
        "description": "A firing test of warpimpact: what is fired at, how, and what is asked of it.",
    }
