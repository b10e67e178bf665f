"""The answer of a run: whole percent, the digits that the fast law knows, and how far it was off."""

import csv
from pathlib import Path

import numpy as np
import pytest

from warpimpact.analysis.estimates import means_of
from warpimpact.analysis.verdict import LAW_ERRORS, answer
from warpimpact.campaign.campaign import Campaign
from warpimpact.campaign.evidence import scene_words
from warpimpact.kernels.status import Status
from warpimpact.results import variables as v

CAMPAIGNS = Path(__file__).parents[3] / "campaigns"
ROWS = Path(__file__).parents[2] / "benchmarks" / "results" / "continuum_trade.csv"


def test_the_scene_is_one_clause() -> None:
    assert scene_words(Campaign.from_toml(CAMPAIGNS / "addon.toml")) == (
        ".30 AP M2 at 878 m/s and 30° against 8 mm of HHA Class 1 with round holes, 28% open, then 50 mm of air and "
        "10 mm of AA7075-T651 (add-on 45.2 kg/m², base 28.1 kg/m², whole target 73.3 kg/m²)"
    )


def test_numbers_of_the_fast_law_have_its_digits(make_plate_result) -> None:
    ends = np.array([Status.PERFORATED, Status.UNTOUCHED, Status.ARRESTED, Status.UNFINISHED])
    result = make_plate_result(np.array([700.4, 801.0, 0.0, np.nan]), np.array([10.0, 20.9, np.nan, np.nan]), ends)
    _, numbers, law, *_ = answer(result, "It costs.")
    assert numbers == ("50% of 4 cores pass: mean residual velocity 751 m/s, mean tilt at 130 mm 15°; 1 shots failed.")
    assert law == "By the fast law: on six plates it was 8 to 77 m/s and 7 to 37° off finite elements. It costs."


@pytest.mark.parametrize(("perforated", "share"), [(1, "under 1%"), (399, "over 99%"), (400, "100%"), (100, "25%")])
def test_a_share_is_0_or_100_percent_only_where_it_is_exact(perforated, share, make_plate_result) -> None:
    status = np.where(np.arange(400) < perforated, Status.PERFORATED, Status.ARRESTED)
    result = make_plate_result(np.full(400, 100.0), np.zeros(400), status)
    assert answer(result)[1].startswith(f"{share} of 400 cores pass")


def test_a_plate_that_stops_every_core_has_no_residual_velocity(make_result) -> None:
    assert answer(make_result([Status.ARRESTED] * 3))[1] == "No core of 3 passes."


def test_a_tilt_that_is_the_deflection_is_shown_once(make_plate_result) -> None:
    result = make_plate_result(np.full(3, 300.0), np.array([10.0, 20.0, 30.0]), np.zeros(3, dtype=np.int8))
    both = (v.DEFLECTION, v.TILT)
    assert len(means_of(result.assign(deflection=result.tilt[:, 1] + 1.0), both)) == 3
    result["tilt"] = result.tilt.isel(standoff=[1, 1]).assign_coords(standoff=result.standoff)
    assert [one.text for one in means_of(result.assign(deflection=result.tilt[:, 1] + 0.05), both)] == [
        "mean(deflection)"
    ]


def test_the_errors_of_the_law_are_those_of_the_stored_rows() -> None:
    with ROWS.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))

    def of(plate: str, model: str, column: str) -> dict[str, float]:
        return {
            row["hit"]: float(row[column] or "nan") for row in rows if (row["plate"], row["model"]) == (plate, model)
        }

    columns, errors = {"velocity": "velocity", "tilt": "tilt_130"}, {"velocity": [], "tilt": []}
    for plate in {row["plate"] for row in rows if row["model"] == "free_surface"}:
        for name, column in columns.items():
            fast, truth = of(plate, "fast", column), of(plate, "continuum", column)
            both = np.array([fast[hit] - truth[hit] for hit in fast.keys() & truth.keys()])
            if np.isfinite(both).sum() >= 48:
                errors[name].append(float(np.sqrt(np.nanmean(both**2))))
    assert {name: len(plates) for name, plates in errors.items()} == {"velocity": 6, "tilt": 6}
    for name, plates in errors.items():
        assert (min(plates), max(plates)) == pytest.approx(LAW_ERRORS[name], abs=0.6)
