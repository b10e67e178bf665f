"""A map corrected by finite elements: what is in its file, and what is computed once alone."""

import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from pkgutil import resolve_name

import numpy as np
import pandas as pd
import pytest
import xarray

from warpimpact.analysis.correction import corrected_estimate, correction_table, is_corrected, with_correction
from warpimpact.analysis.inspection import answer
from warpimpact.campaign.campaign import Campaign
from warpimpact.cli import main
from warpimpact.kernels.status import Status
from warpimpact.measures.hits import failed
from warpimpact.measures.measure import Measure
from warpimpact.measures.references import node_hits
from warpimpact.report.hit_data import page_data, thinned
from warpimpact.results import files
from warpimpact.studies import correction
from warpimpact.studies.correction import continuum_table, correction_offer, second_law, spread_hits

from ..slotted import SLOTTED_PLATE

CAMPAIGN = """
title = "thin"
[core]
shape = "cone"
diameter = "6 mm"
length = "16 mm"
cone_length = "8 mm"
mass = "3 g"
strength = "2 GPa"
[plate]
thickness = "2.4 mm"
resistance = "1.1 GPa"
shear_coefficient = 0.05
density = "2700 kg/m^3"
pattern = { shape = "circle", diameter = "5 mm", spacing = ["8 mm", "8 mm"] }
[impact]
velocity = "800 m/s"
[hits]
count = 96
[numerics]
level = 1
[output]
standoffs = ["50 mm"]
bending = true
solid_reference = false
[continuum]
materials = ["AA6082-T6"]
spacing = "1.2 mm"
hits = 10
"""


pytestmark = pytest.mark.usefixtures("coarse_elements")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory, coarse_elements: None) -> Path:
    folder = tmp_path_factory.mktemp("corrected")
    (folder / "a.toml").write_text(CAMPAIGN, encoding="utf-8")
    assert main(["run", str(folder / "a.toml"), "-o", str(folder / "a.nc"), "--device", "cpu"]) == 0
    return folder


def test_a_run_is_corrected_at_hits_over_the_map(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    result = files.read(folder / "a.nc")
    elements, second = node_hits(result, "elements"), node_hits(result, "free_surface")
    assert elements is not None
    assert second is not None
    assert (elements.sizes["hit"], second.sizes["hit"]) == (10, 96)
    assert np.ptp(elements["hit_y"].values) > 2e-3
    corrected, error = result["corrected_residual_velocity"], result["corrected_residual_velocity_error"]
    assert (corrected.dims, corrected.attrs["units"]) == (("hit",), "m s-1")
    assert np.isfinite(corrected).all()
    elements = elements.isel(hit=~failed(elements))
    sound, truth = elements.sizes["hit"], elements["residual_velocity"]
    missed: xarray.DataArray = (corrected.sel(hit=elements["hit"]) - truth) / error.sel(hit=elements["hit"])
    assert float(abs(missed).max()) < 3.0
    assert "constant" in json.loads(result.attrs["correction"])["tilt@50mm"]
    mean = Measure.parse("mean(residual_velocity)")
    estimate = corrected_estimate(result, mean)
    assert estimate is not None
    assert estimate.value == pytest.approx(float(corrected.mean()), abs=1e-3)
    assert corrected_estimate(result, Measure.parse("worst_point(residual_energy_fraction)")) is None
    table, *notes = correction_table(result, [mean, Measure.parse("P(perforated)")])
    assert table.loc["P(perforated)", f"{sound} hits by elements"] == f"{sound} of {sound}"
    assert notes == [f"{10 - sound} of 10 hits failed by finite elements. Do not trust the correction."] * (sound < 9)
    stress: xarray.DataArray = result["corrected_bending_stress"].sel(hit=elements["hit"]) - elements["bending_stress"]
    assert float(abs(stress / result["corrected_bending_stress_error"].sel(hit=elements["hit"])).max()) < 3.0
    broken = elements["broken"].values
    assert broken.tolist() == (elements["bending_stress"].values > 2e9).tolist()
    whole = correction_table(result)[0]
    assert isinstance(whole, pd.DataFrame)
    assert whole.loc["P(broken)", f"{sound} hits by elements"] == f"{broken.sum():.0f} of {sound}"
    assert "P(broken)" in str(answer(result)[1])
    assert main(["inspect", str(folder / "a.nc")]) == 0
    assert "\ncorrected by finite elements\n" in capsys.readouterr().out
    assert main(["plot", str(folder / "a.nc"), "--variable", "corrected_tilt"]) == 0
    assert Path(capsys.readouterr().out.strip()).is_file()


def test_a_second_law_that_stops_the_cores_is_no_control(folder: Path) -> None:
    result = files.read(folder / "a.nc")
    plain = result.to_dataset()
    plain = plain.drop_vars([name for name in plain if str(name).startswith("corrected")])
    elements, second = node_hits(result, "elements"), node_hits(result, "free_surface")
    assert elements is not None
    assert second is not None
    second["status"] = second["status"] * 0 + Status.ARRESTED
    alone = with_correction(plain, second, elements)
    assert np.isfinite(alone["corrected_residual_velocity"]).all()
    assert "free surfaces" not in json.loads(alone.attrs["correction"])["residual_velocity"]
    few = elements.isel(hit=slice(4))
    assert "corrected_tilt" not in with_correction(plain, second, few)  # rather than a map without a value


def test_an_earlier_result_and_an_unfinished_one_stay(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command = ["run", str(folder / "a.toml"), "-o", str(folder / "a.nc"), "--device", "cpu"]
    before, chunk = (folder / "a.nc").read_bytes(), folder / "b.nc.parts" / "chunk_map_00000000_0.nc"
    assert main(command) == 2
    assert "a.nc: exists already" in capsys.readouterr().err
    assert main([*command, "--resume"]) == 0  # it is complete
    assert main([*command, "--resume", "--count", "80"]) == 2
    assert "a.nc: exists already" in capsys.readouterr().err
    assert (folder / "a.nc").read_bytes() == before
    chunk.parent.mkdir()
    chunk.write_text("computed", encoding="utf-8")
    assert main([*command[:3], str(folder / "b.nc"), *command[4:]]) == 2
    assert "contains an unfinished computation; continue it with --resume" in capsys.readouterr().err
    assert chunk.read_text(encoding="utf-8") == "computed"
    shutil.rmtree(chunk.parent)


def test_a_map_is_corrected_later_and_by_more_hits(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Hits that are there stay as they are; an interrupt leaves the map as it was; it ends as `run` does at once."""
    (folder / "plain.toml").write_text(CAMPAIGN.replace("hits = 10\n", ""), encoding="utf-8")
    path = folder / "plain.nc"
    assert main(["run", str(folder / "plain.toml"), "-o", str(path), "--device", "cpu", "-q"]) == 0
    command, plain = ["continuum", str(path), "--device", "cpu", "-q"], path.read_bytes()
    assert main([*command, "--hits", "4"]) == 2
    with monkeypatch.context() as patched:
        patched.setattr(correction, "with_correction", raised(KeyboardInterrupt()))
        assert main([*command, "--hits", "6"]) == 130
    assert path.read_bytes() == plain
    assert main([*command, "--hits", "6"]) == 2
    assert "contains an unfinished computation; continue it with --resume" in capsys.readouterr().err
    with monkeypatch.context() as patched:
        patched.setattr("warpimpact.runs.finite_elements.compute_hits", raised(AssertionError("all hits are there")))
        assert main([*command, "--hits", "6", "--resume"]) == 0
    assert "corrected" in capsys.readouterr().out
    few = node_hits(files.read(path), "elements")
    assert main([*command, "--hits", "10"]) == 0
    more = node_hits(files.read(path), "elements")
    assert few is not None
    assert more is not None
    assert (few.sizes["hit"], more.sizes["hit"]) == (6, 10)
    assert more.sel(hit=few["hit"]).drop_attrs().identical(few.drop_attrs())
    assert not path.with_name("plain.nc.parts").exists()
    before = path.read_bytes()
    assert main([*command, "--hits", "8"]) == 0  # there are more
    assert path.read_bytes() == before
    assert main([*command, "--hits", "5", "--friction", "0.03"]) == 0
    assert "has hits by other finite elements, which are replaced" in capsys.readouterr().err
    assert int(files.read(path)["elements/status"].count()) == 5
    assert main(["continuum", str(path), "--hit", "3", "-o", str(folder / "one.nc"), "--device", "cpu", "-q"]) == 0
    assert main(["continuum", str(folder / "one.nc")]) == 2
    assert "is no whole map of warpimpact run" in capsys.readouterr().err


def raised(error: BaseException) -> Callable[..., None]:
    """A function that raises an error."""

    def fail(*_: object, **__: object) -> None:
        raise error

    return fail


def test_chosen_hits_are_not_corrected(folder: Path) -> None:
    result = files.read(folder / "a.nc")
    assert is_corrected(result)
    assert not is_corrected(result.isel(hit=slice(1, None)))


def test_elements_need_a_material(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "b.toml").write_text(CAMPAIGN.split("[continuum]")[0], encoding="utf-8")
    assert main(["run", str(folder / "b.toml"), "-o", str(folder / "b.nc"), "--elements", "6"]) == 2
    assert "plate.material: not given, but finite elements need one" in capsys.readouterr().err
    assert not (folder / "b.nc").exists()


@pytest.mark.parametrize(
    ("task", "calls", "kept"),
    [
        ("run.compute_hits", 0, set()),
        ("run.compute_hits", 1, {"map"}),
        ("finite_elements.compute_hits", 3, {"map", "free_surface", "elements"}),
    ],
)
def test_an_interrupted_correction_is_resumed_to_the_same_bits(
    task: str,
    calls: int,
    kept: set[str],
    folder: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    assert_same_bits: Callable[[Path, Path], None],
) -> None:
    """Map, second law and elements are one computation: what it has is named, used, and removed at the end."""
    path, name = tmp_path / "a.nc", f"warpimpact.runs.{task}"
    left, compute, command = (
        calls,
        resolve_name(name),
        ["run", str(folder / "a.toml"), "-o", str(path), "--device", "cpu", "-q"],
    )

    def interrupted(*arguments: object, **how: object) -> object:
        nonlocal left
        left -= 1
        if left < 0:
            raise KeyboardInterrupt
        return compute(*arguments, **how)

    with monkeypatch.context() as patched:
        patched.setattr(name, interrupted)
        assert main(command) == 130
    parts = tmp_path / "a.nc.parts"
    assert {part for part in ("map", "free_surface", "elements") if [*parts.glob(f"chunk_{part}_*")]} == kept
    saved = f"what is computed is saved in {parts}; continue with --resume" if kept else "nothing is saved"
    assert capsys.readouterr().err.endswith(f"interrupted; {saved}\n")
    assert main([*command, "--resume"]) == 0
    assert_same_bits(path, folder / "a.nc")
    assert [one.name for one in tmp_path.iterdir()] == ["a.nc"]


def test_the_map_of_an_interrupted_correction_is_written_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Who wants no elements any more resumes without them, and nothing is computed again."""
    file, output = tmp_path / "a.toml", tmp_path / "a.nc"
    file.write_text(CAMPAIGN.replace("hits = 10\n", ""), encoding="utf-8")
    command = ["run", str(file), "-o", str(output), "--device", "cpu", "-q"]
    monkeypatch.setattr("warpimpact.runs.finite_elements.compute_hits", raised(KeyboardInterrupt()))
    assert main([*command, "--elements", "8"]) == 130
    monkeypatch.setattr("warpimpact.runs.run.compute_hits", raised(AssertionError("all hits are there")))
    assert main([*command, "--resume"]) == 0
    assert not is_corrected(files.read(output))


BASE = """
[[layer]]
gap = "{gap}"
thickness = "4 mm"
material = "AA6082-T6"
"""


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ('materials = ["AA6082-T6"]', "", "Name plate.material to correct this map by finite elements."),
        (
            'materials = ["AA6082-T6"]\nspacing = "1.2 mm"\nhits = 10\n',
            BASE.format(gap="5 mm").replace("material =", 'resistance = "1 GPa" #'),
            "Name plate.material to",
        ),
        ("shear_coefficient = 0.05", 'material = "AA6070-O"', "Give continuum.materials with constants of your own to"),
        ("hits = 10", "layers = 1" + BASE.format(gap="5 mm"), "Change the table [continuum] to correct this map by"),
        ("hits = 10", BASE.format(gap="50 mm"), "--elements 16 corrects the map, in about"),
    ],
    ids=["no material", "no material of two", "no constants", "no room", "fine"],
)
def test_an_answer_says_what_a_correction_needs(old: str, new: str, sentence: str, folder: Path) -> None:
    text = CAMPAIGN.replace(old, new)
    if "AA6070-O" in new:
        text = text.replace('materials = ["AA6082-T6"]', "")
    assert correction_offer(Campaign.from_text(text, name="thin", folder=folder)).startswith(sentence)


@pytest.mark.parametrize(
    ("spacing", "words"),
    [
        ("0.08 mm", r"--elements 16 corrects the map, in about [\d.]+ h of one CPU core\."),
        (
            "0.02 mm",
            r"No correction by finite elements: a hit takes up to \S+ elements of 0.02 mm and about [\d.]+ (h|days) of "
            r"one CPU core, but at most 2 h are allowed; give larger elements \(--element\)\.",
        ),
    ],
    ids=["hours", "weeks"],
)
def test_an_answer_says_how_long_a_correction_takes(
    spacing: str, words: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("warpimpact.continuum.cost.free_memory", lambda: 2**40)
    text = CAMPAIGN.replace("1.2 mm", spacing)
    assert re.fullmatch(words, correction_offer(Campaign.from_text(text, name="thin", folder=folder)))


def test_the_first_example_is_corrected_and_keeps_its_law() -> None:
    campaign = Campaign.from_toml(SLOTTED_PLATE.with_name("fitted_plate.toml"))
    elements = continuum_table(campaign)
    assert ([entry.name for entry in elements.entries], elements.hits) == (["ARMOX560T Johnson-Cook"], 12)
    assert (campaign.plate.material, campaign.plate.resistance) == (None, 3.05e9)


def test_the_second_law_scales_what_scatters(folder: Path) -> None:
    """Y of its own of each shot, as that of the scene; it has no friction and no weakening."""
    scattered = "[scatter]\n" + "".join(
        f'{name} = {{ distribution = "uniform", low = {low}, high = {high} }}\n'
        for name, low, high in (("resistance", '"1 GPa"', '"2 GPa"'), ("shear_coefficient", 0.0, 0.1))
    )
    campaign = Campaign.from_text(CAMPAIGN + scattered, name="scattered", folder=folder)
    second = second_law(campaign, files.read(folder / "a.nc").to_dataset())
    given, shots = campaign.sampler().shots(0, 8), second.sampler().shots(0, 8)
    assert given.resistance is not None
    np.testing.assert_allclose(shots.resistance, 2.8 / 2.6 * given.resistance)
    np.testing.assert_array_equal(shots.hit_y, given.hit_y)
    assert (shots.shear_coefficient, second.plate.shear_coefficient) == (None, 0.0)


def test_hits_spread_over_the_cell(folder: Path) -> None:
    """Every quarter of the cell has some of 16 hits, and no two are the same."""
    result = files.read(folder / "a.nc").to_dataset()
    numbers = spread_hits(result, 16)
    assert len(set(numbers.tolist())) == 16
    chosen = result.sel(hit=numbers)
    quarters = set(zip((chosen["hit_y"] > 0.0).values.tolist(), (chosen["hit_z"] > 0.0).values.tolist(), strict=True))
    assert len(quarters) == 4
    more = spread_hits(result, 24, numbers.tolist())
    assert (len(set(more.tolist())), set(numbers.tolist()) - set(more.tolist())) == (24, set())


def test_plates_under_the_same_shots_get_the_same_hits(folder: Path) -> None:
    """The outcomes do not count, nor does the size of the cell."""
    result = files.read(folder / "a.nc").to_dataset()
    wider = result.assign_coords(hit_y=result["hit_y"] * 1.7, hit_z=result["hit_z"] * 0.9)
    wider["residual_velocity"] = wider["residual_velocity"][::-1]
    np.testing.assert_array_equal(spread_hits(result, 12), spread_hits(wider, 12))


def test_a_report_maps_corrected_values_and_their_change(folder: Path) -> None:
    page = page_data([thinned(files.read(folder / "a.nc"), 96)])
    columns = {key: np.array(values, dtype=float) for key, values in page["results"][0]["columns"].items()}
    assert next(iter(columns)) == "corrected residual velocity"
    change = columns["corrected tilt at 50 mm"] - columns["tilt at 50 mm"]
    np.testing.assert_allclose(columns["tilt at 50 mm: corrected less fast law"], change, atol=2e-2)
    assert np.nanmax(np.abs(change)) > 0.1
