"""P(perforation) over directions: geometry, weights, interval, and more hits where they are needed."""

import math
from pathlib import Path

import numpy as np
import pytest

from warpimpact import Campaign
from warpimpact.campaign.text import CampaignError
from warpimpact.firing.directions import Directions, impact_azimuth, obliquity, protect, weighted_mean
from warpimpact.firing.firing_view import firing_view
from warpimpact.firing.plan_file import firing_test
from warpimpact.firing.repeated import simulate_test
from warpimpact.firing.requirements import REQUIREMENTS, Requirement, requirement_line, threat_of, with_threat
from warpimpact.plotting.firing import directions_figure
from warpimpact.runs.choice import executor_for
from warpimpact.runs.questions import answered
from warpimpact.view.view import text_of

TEXT = """title = "slots"
core = { shape = "ogive", diameter = "6.17 mm", length = "27 mm", crh = 3.0, mass = "5.25 g" }
plate = { thickness = "4 mm", resistance = "2600 MPa", shear_coefficient = 0.05, pattern = { shape = "circle", diameter = "5 mm", spacing = "9 mm" } }
impact = { velocity = "300 m/s" }
hits = { count = 64, seed = 3 }
numerics = { level = 0 }
output = { standoffs = ["50 mm"], solid_reference = false }
"""  # noqa: E501


@pytest.mark.parametrize(
    ("azimuth", "elevation", "flight"),
    [(0, 0, (1, 0, 0)), (90, 0, (0, -1, 0)), (0, 90, (0, 0, -1)), (30, 40, None), (-50, 10, None)],
)
def test_a_threat_flies_the_way_it_is_seen_from(
    azimuth: float, elevation: float, flight: tuple[float, ...] | None
) -> None:
    """The unit vector from the threat to the plate, whose normal is x, with z upwards."""
    az, el = math.radians(azimuth), math.radians(elevation)
    expected = flight or (math.cos(az) * math.cos(el), -math.sin(az) * math.cos(el), -math.sin(el))
    slant, aside = obliquity(az, el), impact_azimuth(az, el)
    found = (math.cos(slant), math.sin(slant) * math.cos(aside), math.sin(slant) * math.sin(aside))
    assert found == pytest.approx(expected, abs=1e-12)


def test_weights_are_solid_angles_and_presented_areas() -> None:
    """A fine grid: the mean of cos θ over the solid angle is ∫cos²ε dε ∫cos α dα / (∫dα ∫cos ε dε)."""
    angles = [f"{one} deg" for one in np.linspace(-80, 80, 61)]
    solid = Directions(
        azimuth=angles, elevation=[f"{one} deg" for one in np.linspace(-60, 60, 61)], weight="solid_angle"
    )
    across, up, cosine = math.radians(80), math.radians(60), np.cos(solid.obliquities())
    mean = (up + 0.5 * math.sin(2 * up)) * math.sin(across) / (across * 2.0 * math.sin(up))
    assert (solid.weights() * cosine).sum() == pytest.approx(mean, abs=1e-3)
    area = solid.model_copy(update={"weight": "area"})
    assert (area.weights() / solid.weights()) == pytest.approx(cosine / (solid.weights() * cosine).sum())


def test_the_interval_of_the_mean_holds_as_often_as_it_says() -> None:
    """Three directions with the same hits: the interval contains the mean in about 95 % of 400 samples."""
    rng, weights, limits = np.random.default_rng(1), np.array([0.5, 0.3, 0.2]), np.array([0.1, 0.4, 0.8])
    held = 0
    for _ in range(400):
        hits = rng.random(128)
        found = weighted_mean([(hits < limit).astype(float) for limit in limits], weights, 16)
        held += found.low <= weights @ limits <= found.high
    assert 365 <= held <= 392
    alike = weighted_mean([np.zeros(64)] * 3, weights, 16)
    assert alike.value == alike.low == 0.0 < alike.high < 0.1


def test_more_hits_are_computed_where_the_share_is_between_0_and_1() -> None:
    campaign = Campaign.from_text(TEXT, name="a", folder=Path())
    directions = Directions(azimuth=[0, "60 deg"], elevation=[0], first_count=32, max_count=128, half_width=0.01)
    with executor_for("cpu") as executor:
        sector = answered(protect(campaign, directions), executor)
    assert sector.share[1, 0] in (0.0, 1.0)
    assert 0.0 < sector.share[0, 0] < 1.0
    assert sector.hits.ravel().tolist() == [128, 32]
    assert sector.mean.value == pytest.approx(float((directions.weights() * sector.share).sum()))
    test = firing_test('title = "a"\n[target]\nmean = 1\ndeviation = 1\n', "a", Path()).model_copy(
        update={"directions": directions, "target": {"campaign": __file__}}
    )
    dataset = simulate_test(test, None, None, sector)
    text = text_of(firing_view(dataset))
    assert "\nmean, weighted by area: " in text
    assert "\nevidence: two shots at one slotted plate" in text
    assert "mean by area" in directions_figure(dataset).get_supxlabel()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("count = 64", "count = 64, irreducible = true"), "without irreducible"),
        (('"300 m/s"', '"300 m/s", obliquity = 5'), "are set by directions; leave them out"),
    ],
)
def test_campaigns_that_have_no_directions_are_refused(change: tuple[str, str], message: str) -> None:
    with pytest.raises(CampaignError, match=message):
        next(protect(Campaign.from_text(TEXT.replace(*change), name="a", folder=Path()), Directions()))


STANAG = 'title = "a"\nrequirement = "STANAG 4569 L3"\nthreat = "7.62x51 AP M993 (WC)"\n[target]\nmean = 800\n'
STANAG += "deviation = 25\n"


def test_a_named_requirement_gives_threat_velocity_and_shots() -> None:
    test = firing_test(STANAG, "a", Path())
    assert test.proof is not None
    assert (test.proof.velocity, test.gun.window) == (930.0, 20.0)
    campaign = with_threat(Campaign.from_text(TEXT, name="a", folder=Path()), test)
    assert campaign.impact.velocity == 930.0
    assert campaign.core.mass_properties.mass == pytest.approx(5.9e-3)
    assert "second-hand" in requirement_line(test)
    own = firing_test(STANAG + '[proof]\nvelocity = "900 m/s"\nshots = 7\n', "a", Path())
    assert own.proof is not None
    assert (own.proof.velocity, own.proof.shots) == (900.0, 7)
    unknown = firing_test(STANAG.replace("7.62x51 AP M993 (WC)", "7.62x54R B32 API"), "a", Path())
    kept = with_threat(Campaign.from_text(TEXT, name="a", folder=Path()), unknown)
    assert kept.core.mass_properties.mass == pytest.approx(5.25e-3)
    assert "the core of this threat is not known" in requirement_line(unknown)


@pytest.mark.parametrize("requirement", REQUIREMENTS, ids=lambda one: one.name)
def test_every_requirement_has_a_threat_in_the_catalogue(requirement: Requirement) -> None:
    names = {"STANAG 4569 L3": "7.62x54R B32 API"}
    threat, velocity = threat_of(requirement, names.get(requirement.name))
    assert velocity.value > 0.0
    assert threat.known


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("STANAG 4569 L3", "STANAG 4569 L33"), 'did you mean "STANAG 4569 L3"?'),
        (('threat = "7.62x51 AP M993 (WC)"\n', ""), "threat: is missing, but STANAG 4569 L3 has 2"),
        (("7.62x51 AP M993 (WC)", "14.5 mm B32"), 'threat: got "14.5 mm B32", but STANAG 4569 L3 has'),
        (('requirement = "STANAG 4569 L3"\n', ""), "threat needs requirement"),
    ],
)
def test_an_unknown_requirement_is_told(change: tuple[str, str], message: str) -> None:
    with pytest.raises(CampaignError) as error:
        firing_test(STANAG.replace(*change), "a.toml", Path())
    assert message in str(error.value)
