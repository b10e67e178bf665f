"""Cores that deform and break, from a campaign to its answer and behind a gap."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import xarray

from warpimpact import Scene, effectiveness
from warpimpact.campaign.campaign import Campaign
from warpimpact.cli import main
from warpimpact.continuum import bullet_mesh
from warpimpact.continuum.front import law_errors
from warpimpact.continuum.handover import WHOLE, Exits, march_on
from warpimpact.errors import CampaignError
from warpimpact.kernels.status import Status
from warpimpact.measures.draws import COUNT
from warpimpact.measures.measure import Measure
from warpimpact.measures.references import node_hits, pictures_of
from warpimpact.measures.vocabulary import QUANTITIES
from warpimpact.plotting import maps
from warpimpact.records.variables import PictureLabel
from warpimpact.results import files
from warpimpact.runs.draws import MapModel
from warpimpact.scene import Core, OgiveCore, Plate, Shots
from warpimpact.scene.target import Layer
from warpimpact.scene.units import count_text
from warpimpact.solver.device import Worker
from warpimpact.solver.fast_law import FastLaw

ERROR = law_errors(of_catalogue=False, as_fired=True)
CAMPAIGN = """
title = "brittle cores"
core = { shape = "ogive", diameter = "6 mm", length = "22 mm", crh = 3, mass = "4 g", strength = "2.1 GPa" }
impact = { velocity = "800 m/s" }
hits = { count = 64 }
numerics = { level = 1 }
output = { standoffs = ["50 mm"], solid_reference = false }
continuum = { materials = ["ARMOX560T Johnson-Cook"], spacing = "1.2 mm", hits = 5, core = "deformable" }
[plate]
thickness = "3 mm"
resistance = "2.6 GPa"
pattern = { shape = "circle", diameter = "5 mm", spacing = ["8 mm", "8 mm"] }
"""
CORE = OgiveCore(diameter=6e-3, crh=3.0, length=20e-3, mass=4e-3)


@pytest.mark.usefixtures("coarse_elements", "all_draws")
def test_an_answer_says_how_many_cores_break(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Hits by elements are kept, and the others have the masses of such that ended alike. A replay says what is left
    of a core."""
    monkeypatch.setattr(bullet_mesh, "CORE_ACROSS", 6)
    (tmp_path / "a.toml").write_text(CAMPAIGN, encoding="utf-8")
    assert main(["run", str(tmp_path / "a.toml"), "-o", str(tmp_path / "a.nc"), "--device", "cpu"]) == 0
    result = files.read(tmp_path / "a.nc")
    elements, drawn = node_hits(result, "elements"), result["draws"].to_dataset()
    assert elements is not None
    breaks = elements["broken"].values
    assert 0.0 < breaks.mean() < 1.0
    own = drawn.sel(drawn_hit=elements["hit"].values)
    assert (own["broken"].values == breaks).all()
    np.testing.assert_allclose(own["fragment_mass"][0], elements["fragment_mass"], rtol=1e-3)
    allowed = np.array([*elements["fragment_mass"].values, 4.0e-3, 2.0e-3])
    nearest = np.abs(drawn["fragment_mass"].values[..., None] - allowed).min(axis=-1)
    assert nearest.max() < 1e-6
    pictures = pictures_of(result)
    assert pictures is not None
    assert pictures["hit"].values.tolist() == elements["hit"].values.tolist()
    area = (pictures["picture"] == PictureLabel.CORE).sum(["along", "across"])
    assert (area.isel(instant=-1) <= area.isel(instant=0)).all()
    assert (pictures["picture"].isel(instant=0) == PictureLabel.PLATE).any()
    marks = [mark.get_text() for mark in maps.breaks(result).legends[0].get_texts()]
    assert f"broken: {count_text(int(breaks.sum()), 'hit')}" in marks
    row = effectiveness(result, ["P(broken)"]).iloc[0]
    assert 0.0 < row["low"] < breaks.mean() < row["high"] < 1.0
    assert row["value"] == pytest.approx(float(result["broken"].mean()), abs=1e-4)
    hit = str(int(elements["hit"].values[breaks > 0.0][0]))
    assert main(["continuum", str(tmp_path / "a.nc"), "--hit", hit, "-o", str(tmp_path / "hit.nc")]) == 0
    assert main(["replay", str(tmp_path / "hit.nc"), "--hit", hit, "--snapshots", "2"]) == 0
    words = capsys.readouterr().out
    assert "1 of 1 cores break" in words
    assert re.search(
        r"The core broke [\d.]+ mm behind the nose into \d fragments; the one that leads has [\d.]+ g", words
    )
    assert "The end is bit-identical to the stored outcome." in words


@pytest.mark.usefixtures("all_draws")
def test_in_every_draw_cores_break_with_one_probability() -> None:
    """By Jeffreys' prior and 3 of 12 hits, its mean is 3.5/13, and its standard deviation 0.119."""
    none, broken = np.empty((0, 7)), np.arange(12) < 3
    shares = np.where(broken[:, None], (0.4, 3e-3, 15e-3), (0.9, 2e-3, 22e-3))
    numbers, at = np.arange(500), np.arange(12)
    model = MapModel(1, numbers, none, none, none, at, broken, shares, ERROR, 5, np.ones((COUNT, 1)), np.zeros(COUNT))
    drawn, left = model.fates(CORE, numbers, COUNT)
    others = drawn[:, 12:].mean(axis=1)
    assert (drawn[:, :12] == broken).all()
    assert (left == np.where(drawn[..., None], shares[0], shares[-1])).all()
    assert others.mean() == pytest.approx(3.5 / 13, abs=0.03)
    assert others.std() == pytest.approx(0.119, rel=0.2)


@pytest.mark.usefixtures("all_draws")
def test_without_a_broken_core_some_may_break() -> None:
    none = np.empty((0, 7))
    whole, shares = np.zeros(6, dtype=bool), np.tile((0.95, 0.0, 20e-3), (6, 1))
    numbers, at = np.arange(300), np.arange(6)
    model = MapModel(1, numbers, none, none, none, at, whole, shares, ERROR, 5, np.ones((COUNT, 1)), np.zeros(COUNT))
    drawn, left = model.fates(CORE, numbers, COUNT)
    assert 0.0 < drawn.mean() < 0.2
    assert (left[drawn] == (0.5, 0.0, CORE.middle)).all()
    assert CORE.between(0.0, CORE.middle).mass_properties.mass == pytest.approx(0.5 * CORE.mass, rel=1e-3)


FRONT = Plate(thickness=2e-3, resistance=1.0e9)
BASE = Layer(thickness=8e-3, gap=50e-3, resistance=1.0e9)
TURNING = np.array([300.0, 0.0, 2.0e3])


def behind_the_front(body: Core, share: list[float], stretch: list[tuple[float, float]]) -> Exits:
    """Cores along the normal that turn at the rate TURNING."""
    count, own = len(share), body.mass_properties
    return Exits(
        status=np.full(count, Status.PERFORATED, dtype=np.int8),
        position=np.tile([20e-3, 0.0, 0.0], (count, 1)),
        velocity=np.tile([650.0, 0.0, 0.0], (count, 1)),
        momentum=np.tile([own.inertia_axial, own.inertia_transverse, own.inertia_transverse] * TURNING, (count, 1)),
        attitude=np.tile([0.0, 0.0, 0.0, 1.0], (count, 1)),
        touched=np.ones((count, 1), dtype=bool),
        time=np.zeros(count),
        share=np.array(share),
        stretch=np.array(stretch),
    )


def shots_along_the_normal(count: int) -> Shots:
    zeros = np.zeros(count)
    return Shots(zeros, zeros, np.full(count, 700.0), zeros, zeros, zeros, zeros, zeros)


def test_a_fragment_goes_on_with_its_mass_and_its_shape() -> None:
    """Through a base, it ends as a core of this shape and mass alone, in whatever company."""
    part, stretches = CORE.between(3e-3, 12e-3), [WHOLE, (3e-3, 12e-3), WHOLE, (0.0, 20e-3)]
    share = 0.9 * part.mass_properties.mass / CORE.mass
    scene, shots = Scene(core=CORE, target=(FRONT, BASE)), shots_along_the_normal(4)
    exits = behind_the_front(CORE, [1.0, share, share, 1.0], stretches)
    ended = march_on(scene, shots, exits, Worker("cpu"), FastLaw(level=1))
    whole, fragment, light, all_of_it = ended.residual_velocity
    lighter, own = replace(shots[:1], mass=np.array([share * CORE.mass])), behind_the_front(part, [1.0], [WHOLE])
    own = own._replace(momentum=0.9 * own.momentum)
    alone = march_on(Scene(core=part, target=(FRONT, BASE)), lighter, own, Worker("cpu"), FastLaw(level=1))
    assert fragment == pytest.approx(alone.residual_velocity[0], rel=1e-9)
    assert ended.angular_velocity[1] == pytest.approx(alone.angular_velocity[0], rel=1e-6)
    assert all_of_it == whole
    assert abs(light - fragment) > 1.0
    assert ended.energy_loss[1] > ended.energy_loss[0]


def test_the_strength_of_a_core_needs_bending_or_elements_that_deform() -> None:
    deforming = Campaign.from_text(CAMPAIGN, name="a.toml", folder=Path())
    assert deforming.lacking(Measure.parse("P(broken)")) == ""
    with pytest.raises(CampaignError, match=r'needs output.bending = true: .* or give continuum.core = "deformable"'):
        Campaign.from_text(CAMPAIGN.replace(', core = "deformable"', ""), name="a.toml", folder=Path())
    rigid = CAMPAIGN.replace(', core = "deformable"', "").replace(', strength = "2.1 GPa"', "")
    lacking = Campaign.from_text(rigid, name="a.toml", folder=Path()).lacking
    assert lacking(Measure.parse("mean(fragment_mass)")) == 'continuum.core = "deformable" and continuum.hits'
    stop = '[stop]\nquantity = "P(broken)"\nhalf_width = 0.05\nmax_count = 512\n'
    with pytest.raises(CampaignError, match=r"needs output.bending = true and core.strength"):  # which the law asks for
        Campaign.from_text(CAMPAIGN.replace("{ count = 64 }", "{}") + stop, name="a.toml", folder=Path())


def test_the_energy_behind_a_plate_is_that_of_the_leading_fragment() -> None:
    """Half of the mass at half of the velocity has an eighth of the energy."""
    columns = {"status": [0, 0], "residual_velocity": [400.0, 400.0], "fragment_mass": [4e-3, 2e-3]}
    columns |= {"impact_velocity": [800.0, 800.0]}
    part = xarray.Dataset({name: ("hit", of) for name, of in columns.items()}, {"mass": 4e-3})
    share, energy = (QUANTITIES[name].values(part, 0.0) for name in ("residual_energy_fraction", "residual_energy"))
    assert share == pytest.approx([0.25, 0.125])
    assert energy == pytest.approx([320.0, 160.0])


@pytest.mark.usefixtures("all_draws")
def test_an_answer_all_of_whose_hits_failed_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Their elements are so coarse that hourglasses take too much."""
    (tmp_path / "a.toml").write_text(CAMPAIGN.replace("hits = 5", "hits = 1"), encoding="utf-8")
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("warpimpact.continuum.one_hit.LARGEST_HOURGLASS_SHARE", 0.0)
        assert main(["run", str(tmp_path / "a.toml"), "-o", str(tmp_path / "a.nc"), "--device", "cpu"]) == 0
    assert "Do not trust the answer." in capsys.readouterr().out
