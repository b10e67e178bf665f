"""The file of a simulated firing test: its variables and attributes.

velocity, quantile   probability that a core passes the target against velocity
test, shot           the shots of every simulated test, and what it reports
proof                probability of at most k complete penetrations of n shots, against velocity
"""

from __future__ import annotations

from warpimpact.records.variable import Variable, with_interval
from warpimpact.results import attributes as attr

_TESTS, _SHOTS = ("test",), ("test", "shot")

VELOCITY = Variable("velocity", ("velocity",), "m s-1", "impact velocity")
SHARE, SHARE_LOW, SHARE_HIGH = with_interval(
    "perforation_probability", ("velocity",), "1", "probability that a core passes, at any place"
)
QUANTILE = Variable("quantile", ("quantile",), "1", "share of the places at which cores pass")
QUANTILE_VELOCITY, QUANTILE_LOW, QUANTILE_HIGH = with_interval(
    "quantile_velocity", ("quantile",), "m s-1", "velocity at which cores pass at this share of the places"
)
SHOT_VELOCITY = Variable("shot_velocity", _SHOTS, "m s-1", "velocity of the shot; no value after the end of the test")
SHOT_PERFORATED = Variable("shot_perforated", _SHOTS, "1", "1 passed, 0 stopped, -1 after the end of the test")
V50 = Variable("reported_v50", _TESTS, "m s-1", "V50 that the test reports")
SPREAD = Variable("reported_spread", _TESTS, "m s-1", "spread that the test reports; no value if not determined")
V50_LOW = Variable("reported_v50_low", _TESTS, "m s-1", "lower end of the interval that the test reports")
V50_HIGH = Variable("reported_v50_high", _TESTS, "m s-1", "upper end of the interval that the test reports")
PROOF_PERFORATION = Variable(
    "proof_perforation_probability", ("velocity",), "1", "probability that a core passes, with the gun's scatter"
)
PASS = Variable("pass_probability", ("velocity",), "1", "probability that the plan accepts, every shot at any place")
PASS_SAME_PLACE = Variable(
    "pass_probability_same_place", ("velocity",), "1", "the same if all shots of a test hit the same place"
)

TEST = attr.FIRING_TEST
SETTINGS = "firing_test_settings"
"""Attribute: all settings in SI, including defaults, as JSON."""
DISCLAIMER = "disclaimer"
SENTENCE = "a computation by a model, not a certificate: no shot was fired"
FIXED = {attr.REFERENCES: "docs/firing.md of warpimpact", DISCLAIMER: SENTENCE}
"""Attributes that every test has."""
TRUE_V50, TRUE_SPREAD = "true_v50", "true_spread"
"""True values of the target [m/s]: the median of its limit velocities, and half the distance from V16 to V84."""
PROOF_SHOTS = "proof_shots"
