"""The answer of a campaign: draws of its map from the fast law, hits by finite elements, and what is known of both."""

import re
import shutil
from collections.abc import Callable
from pathlib import Path
from pkgutil import resolve_name

import numpy as np
import pytest
import xarray

from warpimpact import FastLaw, run
from warpimpact.campaign.campaign import Campaign
from warpimpact.campaign.elements import continuum_table
from warpimpact.cli import main
from warpimpact.measures.draws import Draws
from warpimpact.measures.estimates import estimated
from warpimpact.measures.hits import failed, hit_numbers
from warpimpact.measures.measure import Measure
from warpimpact.measures.references import law_of, node_hits, pictures_of
from warpimpact.results import files
from warpimpact.runs import answer, draws
from warpimpact.runs.answer import spread_hits
from warpimpact.runs.draws import law_exits, second_law
from warpimpact.solver.device import Worker
from warpimpact.studies.correction import correction_offer

from ...options import CPU
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


pytestmark = pytest.mark.usefixtures("coarse_elements", "all_draws")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory, coarse_elements: None, all_draws: None) -> Path:
    folder = tmp_path_factory.mktemp("corrected")
    (folder / "a.toml").write_text(CAMPAIGN, encoding="utf-8")
    assert main(["run", str(folder / "a.toml"), "-o", str(folder / "a.nc"), "--device", "cpu"]) == 0
    return folder


def test_an_answer_keeps_its_hits_by_elements(folder: Path) -> None:
    """In each draw they are as elements computed them, but for the errors of strength and mesh, alike for all hits."""
    result = files.read(folder / "a.nc")
    elements, drawn = node_hits(result, "elements"), result["draws"].to_dataset()
    assert elements is not None
    assert elements.sizes["hit"] == 10
    assert np.ptp(elements["hit_y"].values) > 2e-3
    sound = elements.isel(hit=~failed(elements))
    of_hits = drawn.sel(drawn_hit=hit_numbers(sound))
    lost = 1.0 - (of_hits["residual_velocity"].values / 800.0) ** 2
    ratio = lost / (1.0 - (sound["residual_velocity"].values / 800.0) ** 2)
    assert np.ptp(ratio, axis=1).mean() < 0.5 * np.ptp(ratio.mean(axis=1))
    np.testing.assert_allclose(of_hits["deflection"].mean("draw"), sound["deflection"], atol=0.05)
    np.testing.assert_allclose(of_hits["tilt"].std("draw"), 0.0, atol=2.0)


def test_the_root_has_the_means_of_the_draws(folder: Path) -> None:
    result = files.read(folder / "a.nc")
    root, law, drawn = result.to_dataset(), result["law"].to_dataset(inherit=False), result["draws"].to_dataset()
    assert root["perforated"].values == pytest.approx((drawn["status"] == 0).mean("draw").values)
    np.testing.assert_allclose(root["residual_velocity"], drawn["residual_velocity"].mean("draw"), rtol=1e-5)
    mean = Measure.parse("mean(residual_velocity)")
    assert estimated(result, [mean])[mean].value == pytest.approx(float(root["residual_velocity"].mean()), rel=1e-5)
    np.testing.assert_array_equal(law_of(result).to_dataset()["residual_velocity"], law["residual_velocity"])
    with xarray.open_dataset(folder / "a.nc") as plain:
        np.testing.assert_array_equal(plain["residual_velocity"], root["residual_velocity"])


def test_draws_make_one_answer(folder: Path) -> None:
    """What follows of itself: shares add up, an event is at least as likely as one that implies it, and hits that are
    chosen bring their own draws."""
    result = files.read(folder / "a.nc")
    events = [Measure.parse(f"P({name})") for name in ("perforated", "stopped", "stopped_or_broken", "broken")]
    passed, stopped, either, broken = (one.value for one in estimated(result, events).values())
    assert passed + stopped == pytest.approx(1.0)
    assert either >= max(stopped, broken)
    few = result.isel(hit=slice(3, 9))
    own = Draws.of(few)
    assert own is not None
    assert (own.count, own.hits) == (128, 6)
    every = Draws.of(result)
    assert every is not None
    mean = Measure.parse("mean(tilt@50mm)")
    np.testing.assert_array_equal(own.by_hit(mean), every.by_hit(mean)[:, 3:9])


def test_without_elements_the_answer_has_the_error_of_the_law(folder: Path) -> None:
    """It is wider than with elements, and the same in memory as in a file."""
    campaign = Campaign.from_toml(folder / "a.toml")
    fast = campaign.computed_by(campaign.continuum.model_copy(update={"hits": None}))
    result, mean = run(fast, options=CPU), Measure.parse("mean(residual_velocity)")
    assert "elements" not in result.children
    by_law, by_elements = (estimated(one, [mean])[mean] for one in (result, files.read(folder / "a.nc")))
    assert by_law.half_width > 2.0 * by_elements.half_width
    assert by_law.low < by_elements.value < by_law.high
    assert main(["run", str(folder / "a.toml"), "--fast", "-o", str(folder / "fast.nc"), "--device", "cpu", "-q"]) == 0
    of_file = estimated(files.read(folder / "fast.nc"), [mean])[mean]
    assert (of_file.value, of_file.low, of_file.high) == (by_law.value, by_law.low, by_law.high)


def test_most_hits_of_a_large_map_have_fewer_draws(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Their means agree with those of all draws as well as so few draws can."""
    campaign = Campaign.from_toml(folder / "a.toml")
    fast = campaign.computed_by(campaign.continuum.model_copy(update={"hits": None}))
    whole = run(fast, options=CPU).to_dataset()["residual_velocity"].values
    monkeypatch.setattr(answer, "_FREE", answer._FREE._replace(hits=32, others=32 * 64))
    result = run(fast, options=CPU)
    assert result["draws"]["status"].shape == (128, 32)
    some = result.to_dataset()["residual_velocity"].values
    np.testing.assert_allclose(some[:32], whole[:32], rtol=2e-2)
    assert np.std(some[32:] - whole[32:]) < 60.0


def test_a_solid_plate_near_its_limit_may_hold_or_not(folder: Path) -> None:
    """What is not known of its strength is in the answer, which is neither 0 nor 1."""
    text = CAMPAIGN.replace('pattern = { shape = "circle", diameter = "5 mm", spacing = ["8 mm", "8 mm"] }', "")
    text = text.split("[continuum]")[0].replace('resistance = "1.1 GPa"', 'material = "AA6082-T6"')
    text = text.replace('thickness = "2.4 mm"', 'thickness = "20 mm"').replace("shear_coefficient = 0.05\n", "")
    passes = Measure.parse("P(perforated)")
    shares = []
    for velocity in (500, 560, 620):
        campaign = Campaign.from_text(text.replace('"800 m/s"', f'"{velocity} m/s"'), name="solid", folder=folder)
        shares.append(estimated(run(campaign, options=CPU), [passes])[passes])
    assert shares[0].value <= shares[1].value <= shares[2].value
    assert any(0.05 < share.value < 0.95 and share.low < 0.05 and share.high > 0.95 for share in shares)


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
    with monkeypatch.context() as patched:
        patched.setattr("warpimpact.runs.correct.answered", raised(KeyboardInterrupt()))
        assert main([*command, "--hits", "6"]) == 130
    assert path.read_bytes() == plain
    assert main([*command, "--hits", "6"]) == 2
    assert "contains an unfinished computation; continue it with --resume" in capsys.readouterr().err
    with monkeypatch.context() as patched:
        patched.setattr("warpimpact.runs.finite_elements.compute_hits", raised(AssertionError("all hits are there")))
        assert main([*command, "--hits", "6", "--resume"]) == 0
    few, seen = node_hits(files.read(path), "elements"), pictures_of(files.read(path))
    assert main([*command, "--hits", "10"]) == 0
    more = node_hits(files.read(path), "elements")
    assert few is not None
    assert more is not None
    assert (few.sizes["hit"], more.sizes["hit"]) == (6, 10)
    assert more.sel(hit=few["hit"]).drop_attrs().identical(few.drop_attrs())
    pictures = pictures_of(files.read(path))
    assert seen is not None
    assert pictures is not None
    assert pictures["hit"].values.tolist() == more["hit"].values.tolist()
    assert pictures.sel(hit=few["hit"].values).drop_attrs().identical(seen.drop_attrs())
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


def test_elements_need_a_material(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "b.toml").write_text(CAMPAIGN.split("[continuum]")[0], encoding="utf-8")
    assert main(["run", str(folder / "b.toml"), "-o", str(folder / "b.nc"), "--elements", "6"]) == 2
    assert "plate.material: not given, but finite elements need one" in capsys.readouterr().err
    assert not (folder / "b.nc").exists()


@pytest.mark.parametrize(
    ("task", "calls", "kept"),
    [
        ("run.compute_hits", 0, set()),
        ("finite_elements.compute_hits", 0, {"map"}),
        ("finite_elements.compute_hits", 3, {"map", "elements"}),
        ("answer.march_draws", 6, {"map", "elements", "map_draws"}),
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
    """Map, elements and draws are one computation: what it has is named, used, and removed at the end."""
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

    monkeypatch.setattr(answer, "_FREE", answer._FREE._replace(task=2**9))
    with monkeypatch.context() as patched:
        patched.setattr(name, interrupted)
        assert main(command) == 130
    parts = tmp_path / "a.nc.parts"
    there = {
        re.sub("_[0-9a-f]{8}(_|$)", "", path.stem.removeprefix("chunk_").rsplit("_", 2)[0])
        for path in parts.glob("chunk*")
    }
    assert there - {"pilot"} == kept
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
    assert "elements" not in files.read(output).children


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
        ("hits = 10", BASE.format(gap="50 mm"), "--elements 12 corrects the map, in about"),
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
        ("0.08 mm", r"--elements 12 corrects the map, in about [\d.]+ h of one CPU core\."),
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
    shots, seen = campaign.sampler().shots(0, 8), []

    def exits(scene: object, shots: object, *rest: object) -> object:
        seen.append((scene, shots))
        return draws_front_exits(scene, shots, *rest)

    draws_front_exits = draws.front_exits
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(draws, "front_exits", exits)
        law_exits(campaign, np.arange(8), FastLaw(level=1), 1, None, True, worker=Worker("cpu"))
    (_, first), (scene, second) = seen
    assert shots.resistance is not None
    np.testing.assert_allclose(second.resistance, 2.8 / 2.6 * first.resistance)
    assert (second.shear_coefficient, scene.target.layers[0].shear_coefficient) == (None, 0.0)
    assert second_law(scene)[0].interaction.free_surface is None


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
