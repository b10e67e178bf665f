"""The file of a search for designs: its variables and attributes.

design      every design that was computed
variable    the free variables
goal        objectives, then bounds
front       designs of the front, computed again with fresh hits
reference   targets to compare with, with the hits of the front
"""

from __future__ import annotations

from warpimpact.records.variable import Variable, with_interval
from warpimpact.results import attributes as attr

NAME = Variable("variable", ("variable",), "1", "free variable")
UNIT = Variable("variable_unit", ("variable",), "1", "unit of the variable, as the design file has it")
LABELS = Variable("variable_labels", ("variable",), "1", "what a variable chooses from, as a JSON list")
GOAL = Variable("goal", ("goal",), "1", "objective or bound")
GOAL_LABEL = Variable("goal_label", ("goal",), "1", "what it is, for people, with its unit")
GOAL_SIGN = Variable("goal_sign", ("goal",), "1", "1 where less is sought, -1 where more is")
GOAL_LIMIT = Variable("goal_limit", ("goal",), "1", "limit of a bound in its own units; no value of an objective")

VALUE = Variable("value", ("design", "variable"), "1", "value in its unit; number of a choice; none where unused")
TEXT = Variable("text", ("design",), "1", "names and values of the variables that count")
RESULT = Variable("result", ("design", "goal"), "1", "objective or bound by the hits of the search, in its own units")
ON_FRONT = Variable("on_front", ("design",), "1", "1 on the front of the search, else 0")

NUMBER = Variable("front_design", ("front",), "1", "number of the design")
FRESH, FRESH_LOW, FRESH_HIGH = with_interval(
    "front_result", ("front", "goal"), "1", "objective or bound by fresh hits, in its own units"
)
CONFIRMED = Variable(
    "front_confirmed", ("front",), "1", "1 where fresh hits leave it on the front and within the bounds, else 0"
)
CAMPAIGN = Variable("front_campaign", ("front",), "1", "campaign of the first threat, as TOML")
FILE = Variable("front_file", ("front",), "1", "name of its campaign file")
WORST = Variable("front_worst_threat", ("front", "goal"), "1", "threat whose hits count; empty if all count, or none")
OUTSIDE = Variable("front_outside", ("front",), "1", "whether it is inside the tested range, or what is outside")
HIT_Y = Variable("front_hit_y", ("front", "hit"), "m", "hit point in the irreducible part of the cell, y")
HIT_Z = Variable("front_hit_z", ("front", "hit"), "m", "hit point in the irreducible part of the cell, z")
HIT_VALUE = Variable("front_hit_value", ("front", "effect", "hit"), "1", "value of the hit, of the first threat")

REFERENCE = Variable("reference", ("reference",), "1", "target to compare with")
REFERENCE_RESULT, REFERENCE_LOW, REFERENCE_HIGH = with_interval(
    "reference_result", ("reference", "goal"), "1", "objective or bound, in its own units"
)

BY_ELEMENTS = CORRECTED, CORRECTED_LOW, CORRECTED_HIGH = with_interval(
    "front_corrected", ("front", "goal"), "1", "objective or bound, corrected by finite elements"
)
REFERENCE_BY_ELEMENTS = REFERENCE_CORRECTED, REFERENCE_CORRECTED_LOW, REFERENCE_CORRECTED_HIGH = with_interval(
    "reference_corrected", ("reference", "goal"), "1", "objective or bound, corrected by finite elements"
)
"""Present with `search.elements`, as BY_ELEMENTS."""

DESIGN = attr.DESIGN_FILE
OUTCOME, FEASIBLE, NONE_FEASIBLE = "outcome", "front", "no design within the bounds"
"""Attribute: how the search ended, one of FEASIBLE and NONE_FEASIBLE."""
HITS, REFUSED, PILOTS, ELEMENTS = "hits_per_design", "refused_designs", "pilots", "elements"
"""Attributes: hits of a design by each threat, designs that broke a constraint, pilots of the search, and hits of a
design of the front by finite elements."""
REFERENCES = "docs/howto/optimise.md of warpimpact"
