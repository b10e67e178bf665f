"""The study of speed and accuracy: its arithmetic on planted numbers, and a small one from end to end."""

import html
import io
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray
from PIL import Image

from warpimpact.campaign.campaign import Campaign
from warpimpact.cli import main
from warpimpact.kernels.status import Status
from warpimpact.plotting import study_figure
from warpimpact.results.files import write
from warpimpact.results.variables import STUDY_COORDINATES, STUDY_VARIABLES
from warpimpact.scene import Numerics, Shots
from warpimpact.solver.resolution import Level
from warpimpact.studies import accuracy as studies
from warpimpact.studies.accuracy import (
    Answer,
    converged,
    default_settings,
    extrapolated,
    front,
    label,
    spelt_out,
    study,
)
from warpimpact.studies.accuracy_text import advantage, study_text

SLOTTED_PLATE = Path(__file__).parents[3] / "campaigns" / "slotted_plate.toml"
LADDER = {"coarse": Level(8, 16, 1.0, 0.8), "middle": Level(16, 32, 2.0, 0.4), "fine": Level(32, 64, 4.0, 0.2)}
LEVELS = (Level(36, 72, 4.0, 0.15), Level(54, 108, 6.0, 0.1))


@pytest.fixture(scope="module")
def campaign() -> Campaign:
    return Campaign.from_toml(SLOTTED_PLATE)


@pytest.fixture(scope="module")
def small(campaign: Campaign) -> xarray.Dataset:
    """A study of three settings and the literal scheme on a coarse grid, 16 hits."""
    settings = {name: spelt_out(setting, campaign) for name, setting in LADDER.items()}
    settings["nodal"] = Numerics(scheme="nodal", grid_spacing=5e-5)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(studies, "MEASURED_TIME", 0.0)
        patch.setattr(studies, "SHORTEST_RUN", 0.0)
        patch.setattr(studies, "SINGLES", 0.0)
        return study(campaign, hits=16, device="cpu", settings=settings, levels=LEVELS)


def answer(velocity: list[float], tilt: list[float] | None = None, status: list[int] | None = None) -> Answer:
    """Two hits unless told otherwise, one stand-off."""
    tilts = np.array(tilt or [0.5] * len(velocity))[:, None]
    return Answer(np.array(status or [0] * len(velocity), np.int8), np.array(velocity), tilts)


def test_extrapolation_removes_an_error_linear_in_the_time_step() -> None:
    exact_velocity, exact_tilt = np.array([700.0, 0.0]), np.array([[0.3], [1.2]])

    def run(step: float) -> Answer:
        return Answer(np.zeros(2, np.int8), exact_velocity + np.array([40.0, 0.0]) * step, exact_tilt - 0.7 * step)

    found = extrapolated(run(0.2), run(0.1))
    np.testing.assert_allclose(found.residual_velocity, exact_velocity, atol=1e-12)
    np.testing.assert_allclose(found.tilt, exact_tilt, atol=1e-12)


def test_extrapolation_keeps_what_does_not_exist_and_what_cannot_be_negative() -> None:
    found = extrapolated(answer([1.0, 5.0], [0.3, np.nan]), answer([0.2, 5.0], [0.1, np.nan]))
    np.testing.assert_array_equal(found.residual_velocity, [0.0, 5.0])
    np.testing.assert_array_equal(found.tilt, [[0.0], [np.nan]])


def test_changes_are_those_of_the_extrapolated_answers_from_level_to_level() -> None:
    levels = [(answer([710.0]), answer([705.0])), (answer([704.0]), answer([703.0])), (answer([702.5]),) * 2]
    found = converged(levels)
    np.testing.assert_allclose(found.answer.residual_velocity, [702.5])
    np.testing.assert_allclose(found.changes["residual_velocity"], [[np.nan], [2.0], [0.5]])
    np.testing.assert_allclose(found.changes["tilt"][-1], [[0.0]])


@pytest.mark.parametrize("run", range(4))
def test_a_hit_that_ends_otherwise_in_any_run_is_not_settled(run: int) -> None:
    runs = [answer([10.0, 700.0])] * 4
    runs[run] = answer([0.0, 700.0], status=[Status.ARRESTED, Status.PERFORATED])
    found = converged([(runs[0], runs[1]), (runs[2], runs[3])])
    assert found.settled.tolist() == [False, True]
    assert np.isnan(found.changes["residual_velocity"][:, 0]).all()
    assert found.changes["residual_velocity"][-1, 1] == 0.0


def test_errors_leave_out_hits_that_end_otherwise() -> None:
    truth = converged([(answer([700.0, 600.0, 10.0]),) * 2] * 2)
    ends_otherwise = answer([701.0, 603.0, 0.0], status=[0, 0, Status.ARRESTED])
    values = studies._error_values([ends_otherwise], truth)
    assert values["other_status"].tolist() == [1]
    np.testing.assert_allclose(values["residual_velocity_error"], [[2.0, 2.8, 3.0]])


def test_errors_without_any_hit_to_compare_are_nan() -> None:
    truth = converged([(answer([700.0]),) * 2] * 2)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        values = studies._error_values([answer([0.0], [np.nan], status=[Status.ARRESTED])], truth)
    assert np.isnan(values["residual_velocity_error"]).all()
    assert values["tilt_error"].shape == (1, 3, 1)


def test_front_is_what_no_setting_beats_in_both() -> None:
    rates = np.array([1.0, 10.0, 10.0, 8.0, 100.0, 50.0, 1000.0, 2000.0])
    errors = np.array([0.1, 1.0, 2.0, 1.0, 5.0, 6.0, 20.0, np.nan])
    assert front(rates, errors).tolist() == [True, True, False, False, True, False, True, False]


def test_equal_settings_are_on_the_front_together() -> None:
    assert front(np.ones(2), np.ones(2)).all()


def test_speed_is_that_of_many_hits_without_their_preparation(
    campaign: Campaign, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = [0.0]

    def fake(scene: object, shots: Shots, **options: object) -> Answer:
        clock[0] += 1.0 + 0.01 * len(shots)
        return answer([1.0])

    monkeypatch.setattr(studies, "simulate", fake)
    monkeypatch.setattr(studies.time, "perf_counter", lambda: clock[0])
    once, twice = spelt_out(LEVELS[0], campaign), spelt_out(studies._doubled(LEVELS[0]), campaign)
    assert twice == once.model_copy(update={"travel": 2.0 * LEVELS[0].travel})


def test_default_settings_hold_levels_sweep_and_literal_scheme(campaign: Campaign) -> None:
    settings = default_settings(campaign)
    assert len(settings) == len(studies.LADDER_LEVELS) + len(studies.SWEEP) + 2
    assert settings["level 2"] == Numerics(level=2)
    assert settings["nodal, 0.5 µs"] == Numerics(scheme="nodal", time_step=0.5e-6)
    assert label(campaign, settings["8×12, ℓ/0.7, 3.86 µs"]) == "8×12, ℓ/0.7, 3.86 µs"


@pytest.mark.parametrize(
    ("table", "changed"),
    [
        ("layer", ({"thickness": "2 mm", "resistance": "1 GPa", "gap": "50 mm"},)),
        ("plate", {"thickness": 6e-3}),  # more than its depth of weakening
        ("plate", {"degradation_interval": None, "degradation_distance": 0.8e-3}),
    ],
)
def test_what_the_literal_scheme_does_not_know_is_studied_without_it(
    campaign: Campaign, table: str, changed: Any
) -> None:
    part = campaign.plate.model_copy(update=changed) if table == "plate" else changed
    settings = default_settings(campaign.model_copy(update={table: part}))
    assert {one.scheme for one in settings.values()} == {"consistent"}
    assert len(settings) == sum(one.scheme == "consistent" for one in default_settings(campaign).values())


def test_bursts_are_refused_in_one_sentence(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["study", str(SLOTTED_PLATE.with_name("burst_of_five.toml"))]) == 2
    assert "got a burst, but a study measures hits on fresh plates" in capsys.readouterr().err


def test_errors_fall_from_coarse_to_fine(small: xarray.Dataset) -> None:
    for name in ("residual_velocity_error", "tilt_error"):
        errors = small[name].sel(quantile=0.9, setting=list(LADDER))
        errors = errors.isel(standoff=-1) if "standoff" in errors.dims else errors
        coarse, middle, fine = errors.values
        assert coarse > 1.5 * middle > 2.0 * fine > 0.0


def test_converged_answer_is_surer_than_the_settings_it_judges(small: xarray.Dataset) -> None:
    last = small.isel(level=-1).sel(quantile=0.9)
    assert 0.0 < last["residual_velocity_change"] < 0.5 * last["residual_velocity_error"].sel(setting="middle")
    assert np.isnan(small["residual_velocity_change"].isel(level=0)).all()
    np.testing.assert_allclose(
        small["residual_velocity_uncertainty"].quantile(0.9), last["residual_velocity_change"], rtol=1e-12
    )


def test_the_literal_scheme_is_far_from_the_limit(small: xarray.Dataset) -> None:
    errors = small["residual_velocity_error"].sel(quantile=0.5)
    assert errors.sel(setting="nodal") > 10.0 * errors.sel(setting="middle")


def test_advantage_compares_speed_at_no_larger_error() -> None:
    dataset = xarray.Dataset(
        {
            "scheme": ("setting", ["consistent"] * 3 + ["nodal"]),
            "hits_per_second": ("setting", [1000.0, 300.0, 100.0, 2.0]),
            "residual_velocity_error": (("setting", "quantile"), [[9.0], [3.0], [1.0], [4.0]]),
            "tilt_error": (("setting", "quantile", "standoff"), [[[5.0]], [[5.0]], [[1.0]], [[5.0]]]),
        },
        {"setting": ["rough", "middle", "fine", "literal"], "quantile": [0.9], "standoff": [0.13]},
    )
    assert advantage(dataset, "literal") == ("middle", 150.0)
    dataset["tilt_error"][:3] = 6.0
    assert advantage(dataset, "literal") is None


def test_variables_have_units_names_and_the_campaign(small: xarray.Dataset, campaign: Campaign) -> None:
    assert set(small.variables) == {*STUDY_VARIABLES, *STUDY_COORDINATES}
    assert all(array.attrs["units"] and array.attrs["long_name"] for array in small.variables.values())
    assert small.sizes == {"setting": 4, "quantile": 3, "standoff": 2, "level": 2, "hit": 16}
    assert small.attrs["campaign"] == campaign.text
    assert small.attrs["device"].startswith("cpu")
    assert "warpimpact study" in small.attrs["history"]


def test_file_gives_back_what_was_measured(small: xarray.Dataset, tmp_path: Path) -> None:
    write(small, tmp_path / "study.nc")
    with xarray.open_dataset(tmp_path / "study.nc") as file:
        xarray.testing.assert_identical(file.load().drop_encoding(), small)


def test_progress_ends_with_all_hits_and_never_goes_back(campaign: Campaign) -> None:
    seen: list[tuple[int, int]] = []
    settings = {"only": spelt_out(LADDER["coarse"], campaign)}
    levels = (LADDER["coarse"], LADDER["middle"])
    study(campaign, hits=8, device="cpu", settings=settings, levels=levels, progress=lambda *now: seen.append(now))
    assert seen == sorted(seen)
    assert seen[-1] == (8, 8)


def test_text_says_the_errors_fast_to_slow(small: xarray.Dataset) -> None:
    lines = study_text(small).splitlines()
    rows = {line.split()[0]: line.replace("*", "").split()[1:] for line in lines[2:6]}
    assert set(rows) == {"coarse", "middle", "fine", "nodal"}
    rates = [float(row[0]) for row in rows.values()]
    assert rates == sorted(rates, reverse=True)
    expected = small["residual_velocity_error"].sel(setting="middle").values
    np.testing.assert_allclose([float(cell) for cell in rows["middle"][1:4]], expected, atol=5e-4)
    assert "left out" not in study_text(small)
    small = small.assign(settled=small["settled"] * 0)
    assert study_text(small).endswith("left out: 16 of 16 hits, because their status depends on the numerics")


def test_report_holds_the_study(
    small: xarray.Dataset, make_result: Callable[..., xarray.Dataset], tmp_path: Path
) -> None:
    write(make_result(100), tmp_path / "a.nc")
    write(small, tmp_path / "study.nc")
    page = tmp_path / "a.html"
    assert main(["report", str(tmp_path / "a.nc"), "--study", str(tmp_path / "study.nc"), "--trajectories", "0"]) == 0
    text = html.unescape(page.read_text())
    for setting in small["setting"].values:
        one = small.sel(setting=setting).isel(standoff=-1)
        errors = [*one["residual_velocity_error"].values, *one["tilt_error"].values]
        cells = [setting, f"{float(one['hits_per_second']):.4g}", *(f"{error:.3f}" for error in errors)]
        assert "".join(f'<td class="number">{cell}</td>' for cell in cells) in text
    assert study_text(small).splitlines()[-1] in text  # how uncertain the converged answer is


def test_figure_shows_front_fidelities_literal_scheme_and_floor(small: xarray.Dataset) -> None:
    renamed = small.assign_coords(setting=["level 0", "level 2", "level 4", "nodal"])
    figure = study_figure(renamed)
    for axes, quantity in zip(figure.axes, ("residual_velocity", "tilt"), strict=True):
        assert (axes.get_xscale(), axes.get_yscale()) == ("log", "log")
        assert {text.get_text() for text in axes.texts} == {"level 0", "level 2", "level 4", "nodal"}
        chosen = renamed.isel(setting=renamed[f"{quantity}_front"].values == 1).sortby("hits_per_second")
        np.testing.assert_array_equal(axes.lines[0].get_xdata(), chosen["hits_per_second"])
        floor = axes.patches[0].get_extents().transformed(axes.transData.inverted())
        change = renamed[f"{quantity}_change"].sel(quantile=0.9).isel(level=-1)
        top = change.isel(standoff=-1) if "standoff" in change.dims else change
        assert floor.y1 == pytest.approx(float(top), rel=1e-6)
    figure.savefig(picture := io.BytesIO())
    with Image.open(picture) as image:
        assert np.asarray(image.convert("L")).std() > 10.0


def test_figure_of_a_scene_without_errors_draws_without_complaint(small: xarray.Dataset) -> None:
    exact = small.assign({name: 0.0 * small[name] for name in small if str(name).endswith(("_error", "_change"))})
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        study_figure(exact).savefig(io.BytesIO())


def test_command_writes_file_figure_and_table(
    small: xarray.Dataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    asked: dict[str, object] = {}

    def fake(campaign: Campaign, **options: object) -> xarray.Dataset:
        asked.update(options, title=campaign.title)
        return small

    monkeypatch.setattr(studies, "study", fake)
    monkeypatch.chdir(tmp_path)
    assert main(["study", str(SLOTTED_PLATE), "--hits", "16", "--device", "cpu"]) == 0
    assert (asked["title"], asked["hits"], asked["device"]) == (small.attrs["title"], 16, "cpu")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["slotted_plate_study.nc", "slotted_plate_study.png"]
    assert study_text(small) in capsys.readouterr().out
    assert main(["study", str(SLOTTED_PLATE)]) == 2
    assert "slotted_plate_study.nc: exists already" in capsys.readouterr().err


@pytest.mark.parametrize("hits", ["0", "many"])
def test_a_wrong_number_of_hits_ends_with_2(hits: str) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["study", str(SLOTTED_PLATE), "--hits", hits])
    assert ended.value.code == 2


def test_ticks_of_logarithmic_axes_are_plain_numbers(small: xarray.Dataset) -> None:
    # Figures leave mathtext unparsed, so that a title may hold a dollar sign.
    figure = study_figure(small)
    figure.canvas.draw()
    labels = [label.get_text() for axes in figure.axes for label in (*axes.get_xticklabels(), *axes.get_yticklabels())]
    assert any(labels)
    assert not any("$" in label for label in labels)
