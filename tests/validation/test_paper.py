"""The paper's two model rows (its Tables 1 and 2) from its own parameters, and published limit velocities."""

import re
from dataclasses import replace
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest
import xarray

from warpimpact import Campaign, run
from warpimpact.analysis.paper import PUBLISHED, check_scene, closest_table, computed_row
from warpimpact.campaign.campaign import CampaignError
from warpimpact.errors import ResultError
from warpimpact.kernels.status import Status
from warpimpact.measures.references import law_of
from warpimpact.scene import Impact, OgiveCore, Plate, Record, Scene, Shots
from warpimpact.solver.device import Worker
from warpimpact.solver.fast_law import FastLaw
from warpimpact.solver.limit import LimitSpec, limits, short_steps
from warpimpact.solver.simulate import simulate

from ..options import CPU


@pytest.fixture(scope="module")
def paper_shots() -> xarray.Dataset:
    campaign = Campaign.from_toml(Path(str(files("warpimpact.campaigns") / "paper_shots.toml")))
    return law_of(run(campaign, options=CPU)).to_dataset()


@pytest.mark.parametrize(("hit", "shot"), list(enumerate(PUBLISHED)))
def test_the_papers_model_rows_are_met(paper_shots: xarray.Dataset, hit: int, shot: str) -> None:
    computed, published = computed_row(paper_shots, hit), PUBLISHED[shot]["paper's model"]
    assert computed.residual_velocity == pytest.approx(published.residual_velocity, abs=3.0)
    assert computed[1:] == pytest.approx(published[1:], abs=3.0)


CAMPAIGNS = Path(__file__).parents[2] / "campaigns"
PAPER = (CAMPAIGNS / "paper_shots.toml").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("change", "difference"),
    [
        (('thickness = "4 mm"', 'thickness = "6 mm"'), "plate.thickness is 0.006, in the paper 0.004"),
        (("825 m/s", "820 m/s"), "impact.velocity is 820.0, in the paper 825.0"),
        (
            ('sampling = "list"\nfile = "paper_shots.csv"', "count = 2"),
            'hits.sampling is "sobol", in the paper "list"',
        ),
        (('"130 mm"]', '"140 mm"]'), "output.standoffs is [0.05, 0.14], in the paper [0.05, 0.13]"),
    ],
)
def test_only_the_papers_scene_is_compared_with_the_paper(change: tuple[str, str], difference: str) -> None:
    assert change[0] in PAPER
    other = Campaign.from_text(PAPER.replace(*change), name="other", folder=CAMPAIGNS)
    with pytest.raises(CampaignError) as caught:
        check_scene(other, "other.toml")
    assert str(caught.value).startswith("other.toml: is not the paper's scene")
    assert difference in str(caught.value)


def test_what_the_paper_does_not_publish_may_differ() -> None:
    text = PAPER.replace('"7.1 mm"', '"8 mm"').replace("staggered = false", "staggered = true").replace("1 us", "2 us")
    check_scene(Campaign.from_text(text, name="lattice", folder=CAMPAIGNS), "lattice")


def test_the_closest_hits_of_a_map_are_where_the_paper_says() -> None:
    given = Campaign.from_toml(CAMPAIGNS / "fitted_plate.toml", count=1024)
    dataset = run(given.computed_by(given.continuum.model_copy(update={"hits": None})), options=CPU)
    text = closest_table(dataset)
    assert re.search(r"through a hole +experiment +714.0 +24.3 +83.2", text)  # tan² tilt = tan² pitch + tan² yaw
    for place, in_hole in (("in the hole", True), ("in the web", False)):
        (hit,) = re.findall(rf"hit (\d+), {place}", text)
        y, z = (1e3 * abs(float(dataset[name][int(hit)])) for name in ("hit_y", "hit_z"))
        assert _in_a_slot(y, z) is in_hole
    faster = Campaign.from_toml(CAMPAIGNS / "fitted_plate.toml", count=4).model_copy(
        update={"impact": {"velocity": "925 m/s"}, "numerics": {"level": 0}, "continuum": {}}
    )
    with pytest.raises(ResultError, match=r"its impact\.velocity is 925\.0, but the published shots had 825\.0"):
        closest_table(run(faster, options=CPU))


def _in_a_slot(y: float, z: float) -> bool:
    """Whether a point of the cell [mm] is in a slot of 4 by 12 mm: at its middle, or at a corner of (8, 16) mm."""
    return any(np.hypot(y - at_y, max(abs(z - at_z) - 4.0, 0.0)) < 2.0 for at_y, at_z in ((0.0, 0.0), (8.0, 8.0)))


# --- Published limit velocities, rows of the compilation by Ryan and others (docs/model.md §7, 8) ---

CORE = OgiveCore(diameter=6.248e-3, length=27.5e-3, crh=3.0, mass=5.3e-3)
STEEL = Plate(thickness=4e-3, resistance=3e9, shear_coefficient=0.05)
RESISTANCE = 3e9
STANDARD = FastLaw(level=2)


def test_bending_stress_does_not_explain_the_step_of_hard_steel() -> None:
    # gooch_19_arcelor, MARS600 at 30 deg: limit velocity [m/s] by thickness [mm].
    published = {3.2: 356.0, 3.5: 404.0, 4.1: 566.0, 4.2: 575.0}
    thickness, velocity = 1e-3 * np.array(list(published)), np.array(list(published.values()))
    scene = Scene(core=CORE, target=STEEL, record=Record(bending=True))
    zero = np.zeros(4)
    shots = Shots(zero, zero, zero + 600.0, zero + Impact(velocity=1.0, obliquity="30 deg").obliquity, *[zero] * 4)
    shots = replace(shots, thickness=thickness)
    actual = limits(scene, shots, LimitSpec.of(scene), STANDARD, Worker("cpu"))
    smooth = actual.outcomes.bending_stress  # all at one resistance: the documented figures, without a step
    assert smooth == pytest.approx([5.8e9, 6.3e9, 7.3e9, 7.4e9], rel=0.02)
    fitted = RESISTANCE * (velocity / actual.value) ** 2
    assert fitted == pytest.approx([2.2e9, 2.6e9, 4.4e9, 4.4e9], rel=0.03)
    above = replace(shots, velocity=1.02 * velocity, resistance=fitted)
    ended = simulate(scene, above, method=short_steps(STANDARD), device="cpu")
    assert (ended.status == Status.PERFORATED).all()
    # Some 3 to 4 GPa is plausible for a core of 570 HV: passed below the step, too.
    assert (ended.bending_stress[:2] > 4e9).all()
    assert ended.bending_stress == pytest.approx([4.3e9, 5.5e9, 10.5e9, 10.9e9], rel=0.04)
