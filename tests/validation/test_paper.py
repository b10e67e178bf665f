"""The paper's two model rows (its Tables 1 and 2) from its own parameters, at hit points that a search found."""

from importlib.resources import files
from pathlib import Path

import pytest
import xarray

from warpimpact import Campaign, run
from warpimpact.analysis.paper import PUBLISHED, computed_row, validation_table


@pytest.fixture(scope="module")
def paper_shots() -> xarray.Dataset:
    return run(Campaign.from_toml(Path(str(files("warpimpact.campaigns") / "paper_shots.toml"))), device="cpu")


@pytest.mark.parametrize(("hit", "shot"), list(enumerate(PUBLISHED)))
def test_the_papers_model_rows_are_met(paper_shots: xarray.Dataset, hit: int, shot: str) -> None:
    computed, published = computed_row(paper_shots, hit), PUBLISHED[shot]["paper's model"]
    assert computed.residual_velocity == pytest.approx(published.residual_velocity, abs=3.0)
    assert computed[1:] == pytest.approx(published[1:], abs=3.0)


def test_the_table_shows_every_source_and_the_difference(paper_shots: xarray.Dataset) -> None:
    table = validation_table(paper_shots)
    for shot, rows in PUBLISHED.items():
        assert shot in table
        for source, row in rows.items():
            assert f"  {source:26}{row.residual_velocity:9.1f}" in table
    difference = computed_row(paper_shots, 0).residual_velocity - 746
    assert f"{difference:+9.1f}" in table
