"""The JSON schema of campaign files: it takes what warpimpact takes, and finds the slips that an editor can find."""

import tomllib
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft202012Validator

from warpimpact.campaign.schema import campaign_schema, file_schema
from warpimpact.firing.plan import FiringTest
from warpimpact.identification.fit_file import FitFile

CAMPAIGNS = sorted((Path(__file__).parents[3] / "campaigns").glob("*.toml"))
FIRING = [CAMPAIGNS[0].parent / "firing" / "v50_test.toml"]
FITS = sorted((CAMPAIGNS[0].parent / "fits").glob("*.toml"))


@pytest.fixture(scope="module")
def schema() -> dict[str, Any]:
    return campaign_schema()


@pytest.fixture
def campaign() -> dict[str, Any]:
    text = (CAMPAIGNS[0].parent / "slotted_plate.toml").read_text(encoding="utf-8")
    return tomllib.loads(text)


def complaints(schema: dict[str, Any], campaign: dict[str, Any]) -> list[str]:
    return [error.json_path for error in Draft202012Validator(schema).iter_errors(campaign)]


def test_it_is_a_schema(schema: dict[str, Any]) -> None:
    Draft202012Validator.check_schema(schema)


@pytest.mark.parametrize("path", CAMPAIGNS, ids=lambda path: path.stem)
def test_it_takes_the_campaigns(schema: dict[str, Any], path: Path) -> None:
    assert complaints(schema, tomllib.loads(path.read_text(encoding="utf-8"))) == []


def test_every_key_says_what_it_means(schema: dict[str, Any]) -> None:
    tables = {"campaign": schema, **schema["$defs"]}
    silent = [
        f"{table}.{key}"
        for table, one in tables.items()
        for key, shown in one.get("properties", {}).items()
        if table != "Scatter" and len(shown.get("description", "")) < 5
    ]
    assert not silent, f"say what these keys mean, under Attributes in the docstring of their model: {silent}"


@pytest.mark.parametrize(
    ("table", "change"),
    [
        ("core", {"lenght": "27 mm"}),
        ("plate", {"thickness": "mm 4"}),
        ("plate", {"degradation": 1.8}),
        ("plate", {"pattern": {"shape": "circle", "diametre": 1, "spacing": 2}}),
    ],
)
def test_a_slip_is_marked_in_its_table(
    schema: dict[str, Any], campaign: dict[str, Any], table: str, change: dict[str, Any]
) -> None:
    got = complaints(schema, campaign | {table: campaign[table] | change})
    assert got
    assert all(place.startswith(f"$.{table}") for place in got)


@pytest.mark.parametrize("path", FIRING, ids=lambda path: path.stem)
def test_firing_tests_have_a_schema(path: Path) -> None:
    test, schema = tomllib.loads(path.read_text(encoding="utf-8")), file_schema(FiringTest, "")
    assert complaints(schema, test) == []
    assert sorted(complaints(schema, test | {"tests": 0, "gum": {}})) == ["$", "$.tests"]
    assert complaints(schema, test | {"procedure": {"name": "langlie", "lowest": 1}}) == ["$.procedure"]


@pytest.mark.parametrize("path", FITS, ids=lambda path: path.stem)
def test_fits_have_a_schema(path: Path) -> None:
    fit, schema = tomllib.loads(path.read_text(encoding="utf-8")), file_schema(FitFile, "")
    assert complaints(schema, fit) == []
    assert complaints(schema, fit | {"samplin": {}}) == ["$"]
    assert complaints(schema, fit | {"sampling": {"set": 1}}) == ["$.sampling"]
