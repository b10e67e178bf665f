"""What a hit by finite elements tells of itself; `continuum.strikes` fills them."""

from __future__ import annotations

from warpimpact.records.group import VariableGroup
from warpimpact.records.variable import HITS, Variable

ENERGY_IMBALANCE = Variable(
    "energy_imbalance", HITS, "1", "energy that is missing or too much, as a share of what the core lost"
)
HOURGLASS_SHARE = Variable(
    "hourglass_share", HITS, "1", "share of the lost energy that the resistance against hourglasses took"
)
ERODED_ELEMENTS = Variable("eroded_elements", HITS, "1", "number of finite elements that failed")

CONTINUUM_VARIABLES = VariableGroup(
    "With `warpimpact continuum`", (ENERGY_IMBALANCE, HOURGLASS_SHARE, ERODED_ELEMENTS), measured=False
)
