"""The file of a search for designs: its variables and attributes.

design      every design that was computed
variable    the free variables
asked       objectives, then bounds
front       designs of the front, computed again with fresh hits
reference   targets to compare with, with the hits of the front
generation  of the search
"""

from __future__ import annotations

from warpimpact.records.variable import Variable, with_interval
from warpimpact.results import attributes as attr

_BY_DESIGN, _BY_FRONT, _BY_REFERENCE = ("design", "asked"), ("front", "asked"), ("reference", "asked")

NAME = Variable("variable", ("variable",), "1", "free variable")
UNIT = Variable("variable_unit", ("variable",), "1", "unit of the variable, as the design file has it")
LABELS = Variable("variable_labels", ("variable",), "1", "what a variable chooses from, as a JSON list")
ASKED = Variable("asked", ("asked",), "1", "objective or bound")
LABEL = Variable("asked_label", ("asked",), "1", "what it is, for people, with its unit")
SIGN = Variable("asked_sign", ("asked",), "1", "1 where less is sought, -1 where more is")
ASKED_LIMIT = Variable("asked_limit", ("asked",), "1", "limit of a bound in its own units; no value of an objective")

VALUE = Variable("value", ("design", "variable"), "1", "value in its unit; number of a choice; none where unused")
FOUND, FOUND_LOW, FOUND_HIGH = with_interval("found", _BY_DESIGN, "1", "objective or bound in its own units")
HITS = Variable("hits", ("design",), "1", "hits that were computed by each threat")
LEVELS = Variable("numerics", ("design",), "1", "numerics by threat, as JSON")
COST = Variable("cost", ("design",), "s", "processor time that its hits took")
ON_FRONT = Variable("on_front", ("design",), "1", "1 on the front of the search, else 0")

NUMBER = Variable("front_design", ("front",), "1", "number of the design")
FRESH, FRESH_LOW, FRESH_HIGH = with_interval(
    "front_found", _BY_FRONT, "1", "objective or bound by fresh hits, in its own units"
)
KEPT = Variable("front_kept", ("front",), "1", "1 where fresh hits leave it on the front and within the bounds, else 0")
GROUP = Variable("front_group", ("front",), "1", "first design than which it is not certainly better at 95 %")
CAMPAIGN = Variable("front_campaign", ("front",), "1", "campaign of the first threat, as TOML")
FILE = Variable("front_file", ("front",), "1", "name of its campaign file")
SOLID = Variable("front_solid", _BY_FRONT, "1", "the same of the solid plate of equal areal density")
FRESH_LEVELS = Variable("front_numerics", ("front",), "1", "numerics by threat, as JSON")
HIT_Y = Variable("front_hit_y", ("front", "hit"), "m", "hit point in the irreducible part of the cell, y")
HIT_Z = Variable("front_hit_z", ("front", "hit"), "m", "hit point in the irreducible part of the cell, z")
HIT_VALUE = Variable("front_hit_value", ("front", "effect", "hit"), "1", "what the hit says, of the first threat")

REFERENCE = Variable("reference", ("reference",), "1", "target to compare with")
REFERENCE_FOUND, REFERENCE_LOW, REFERENCE_HIGH = with_interval(
    "reference_found", _BY_REFERENCE, "1", "objective or bound, in its own units"
)
REFERENCE_CAMPAIGN = Variable("reference_campaign", ("reference",), "1", "campaign of the first threat, as TOML")

UNTESTED = Variable("front_untested", ("front",), "1", "in what its plates lie outside the tested range")

COMPUTED = Variable("computed", ("generation",), "1", "designs that were computed so far")
VOLUME = Variable(
    "hypervolume",
    ("generation",),
    "1",
    "hypervolume of the front so far, as a share of the box of the first generation",
)

VARIABLES = tuple(one for one in [*globals().values()] if isinstance(one, Variable))
"""All of the above."""
DESIGN = attr.DESIGN_FILE
OUTCOME, FEASIBLE, NONE_FEASIBLE = "outcome", "front", "no design within the bounds"
"""Attribute: how the search ended, one of FEASIBLE and NONE_FEASIBLE."""
BOX = "hypervolume_box"
"""Attribute: worst values of the first generation to minimise, then their distances from the best."""
REFUSED, PILOTS = "refused_designs", "pilots"
"""Attributes: designs that broke a constraint, and pilots of the search."""
REFERENCES = "docs/howto/optimise.md of warpimpact"


NEEDED = tuple(name for name in VARIABLES if name not in (HIT_Y, HIT_Z, HIT_VALUE))
"""Variables of every search; the others are there if its plates have such hits."""
