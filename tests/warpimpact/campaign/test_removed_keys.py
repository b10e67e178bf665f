"""A key that was removed is refused, with what to use instead."""

import json
from pathlib import Path

import pytest

from warpimpact import Campaign, CampaignError
from warpimpact.campaign.text import REMOVED_KEYS, parsed


def tables_with(key: str) -> dict[str, object]:
    """Tables that hold only a removed key, or a removed value."""
    path, _, value = key.partition(" = ")
    tables: object = value or 1
    for part in reversed(path.split(".")):
        tables = {part: tables}
    assert isinstance(tables, dict)
    return tables


@pytest.mark.parametrize("key", REMOVED_KEYS)
def test_a_removed_key_names_its_successor(key: str) -> None:
    with pytest.raises(ValueError, match="was removed: ") as error:
        parsed(json.dumps(tables_with(key)), "old.toml")
    assert str(error.value) == f"old.toml: {key} was removed: {REMOVED_KEYS[key]}"


def test_a_campaign_with_a_removed_key_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(REMOVED_KEYS, "layer.colour", "leave it out")
    with pytest.raises(CampaignError, match=r"old\.toml: layer\.colour was removed: leave it out"):
        Campaign.from_text("[[layer]]\ncolour = 1", name="old.toml", folder=Path())
