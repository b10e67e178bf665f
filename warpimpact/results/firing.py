"""The file of a simulated firing test: its variables and attributes.

response        probability of perforation against velocity, and the places that it comes from
test            what every simulated test reports
size            how exact tests of other sizes are
azimuth, elevation   probability of perforation by direction of fire
proof           probability that n shots with at most k perforations pass, against velocity
"""

from __future__ import annotations

from warpimpact.records.variable import Variable, with_interval
from warpimpact.results import attributes as attr

_TESTS, _SHOTS, _SIZES, _ENDS = ("test",), ("test", "shot"), ("size",), ("bound",)

VELOCITY = Variable("velocity", ("velocity",), "m s-1", "impact velocity")
SHARE, SHARE_LOW, SHARE_HIGH = with_interval(
    "perforation_probability", ("velocity",), "1", "probability that a shot at any place perforates"
)
QUANTILE = Variable("quantile", ("quantile",), "1", "share of the places that perforate")
QUANTILE_VELOCITY, QUANTILE_LOW, QUANTILE_HIGH = with_interval(
    "quantile_velocity", ("quantile",), "m s-1", "velocity at which this share of the places perforates"
)
CHANGES = Variable(
    "change_velocity",
    ("place", "change"),
    "m s-1",
    "velocity at which the answer of the place changes; it begins stopped",
)
HIT_Y = Variable("hit_y", ("place",), "m", "hit point, y")
HIT_Z = Variable("hit_z", ("place",), "m", "hit point, z")
OUTLINE_Y = Variable("outline_y", ("vertex",), "m", "hole outlines in the unit cell, y, separated by NaN")
OUTLINE_Z = Variable("outline_z", ("vertex",), "m", "hole outlines in the unit cell, z, separated by NaN")
YAW = Variable("yaw", ("place",), "degree", "angle between core axis and line of fire at impact")

SHOT_VELOCITY = Variable("shot_velocity", _SHOTS, "m s-1", "velocity of the shot; no value where the test had ended")
SHOT_PERFORATED = Variable("shot_perforated", _SHOTS, "1", "1 perforated, 0 stopped, -1 where the test had ended")
SHOT_PLACE = Variable("shot_place", _SHOTS, "1", "place that the shot hit; -1 where the test had ended")
V50 = Variable("reported_v50", _TESTS, "m s-1", "V50 that the test reports")
SPREAD = Variable("reported_spread", _TESTS, "m s-1", "spread that the test reports")
V50_LOW = Variable("reported_v50_low", _TESTS, "m s-1", "lower end of the interval that the test reports")
V50_HIGH = Variable("reported_v50_high", _TESTS, "m s-1", "upper end of the interval that the test reports")
SHOTS = Variable("shots", _TESTS, "1", "shots of the test")

SIZE = Variable("size", _SIZES, "1", "shots of a test; of mil_std_662f those that V50 is the mean of")
SIZE_SHOTS = Variable("size_shots", _SIZES, "1", "shots that such a test takes, mean")
SIZE_WITHIN = Variable("size_within", _SIZES, "1", "share of the tests whose V50 is as exact as asked")
SIZE_BIAS = Variable("size_bias", _SIZES, "m s-1", "mean of the reported V50 less the true one")
SIZE_DEVIATION = Variable("size_deviation", _SIZES, "m s-1", "standard deviation of the reported V50")

PROOF_PERFORATION = Variable(
    "proof_perforation_probability",
    ("velocity",),
    "1",
    "probability that a fair shot perforates, with the gun's scatter",
)
PASS = Variable("pass_probability", ("velocity",), "1", "probability that the plan passes, every shot at any place")
PASS_SAME_PLACE = Variable(
    "pass_probability_same_place", ("velocity",), "1", "the same if all shots of a test hit the same place"
)

AZIMUTH = Variable("azimuth", ("azimuth",), "degree", "direction of the threat about the vertical, from the normal")
ELEVATION = Variable("elevation", ("elevation",), "degree", "direction of the threat above the horizon")
_DIRECTIONS = ("azimuth", "elevation")
DIRECTION_SHARE, DIRECTION_LOW, DIRECTION_HIGH = with_interval(
    "direction_perforation_probability", _DIRECTIONS, "1", "probability of perforation"
)
DIRECTION_OBLIQUITY = Variable("direction_obliquity", _DIRECTIONS, "degree", "angle between line of fire and normal")
DIRECTION_WEIGHT = Variable("direction_weight", _DIRECTIONS, "1", "weight of the direction in the mean")
DIRECTION_HITS = Variable("direction_hits", _DIRECTIONS, "1", "hits computed in the direction")
DIRECTION_FAILED = Variable("direction_failed", _DIRECTIONS, "1", "hits whose computation failed")

VARIABLES = tuple(one for one in [*globals().values()] if isinstance(one, Variable))
"""All of the above."""
TEST = attr.FIRING_TEST
SETTINGS = "firing_test_settings"
"""Attribute: all settings in SI, including defaults, as JSON."""
REQUIREMENT = "requirement"
"""Attribute: what a named requirement asks for as understood here, its source and what is assumed; empty without
one."""
DISCLAIMER = "disclaimer"
SENTENCE = "a computation by a model, not a certificate: no shot was fired"
FIXED = {attr.REFERENCES: "docs/firing.md of warpimpact", DISCLAIMER: SENTENCE}
"""Attributes that every test has."""
TRUE_V50, TRUE_SPREAD = "true_v50", "true_spread"
"""True values of the target [m/s]: the median of its limit velocities, and half the distance from V16 to V84."""
PROOF_SHOTS, PROOF_ALLOWED, PROOF_VELOCITY = "proof_shots", "proof_allowed", "proof_velocity"
CELL = "plate_period"
UNFAIR_YAW, UNFAIR_VELOCITY = "unfair_yaw_share", "unfair_velocity_share"
"""Shares of the shots that the rules of fair hits refuse."""
MEAN, MEAN_INTERVAL = "mean_perforation_probability", "mean_perforation_probability_interval"
"""Weighted mean over all directions, and its interval."""
SEARCH = "limit_runs_per_hit"
"""Runs per hit of the search of limits."""
