"""All groups of variables, in the order of a file; among them limits, which the search of limits fills
(solver/limit.py), and what a hit by finite elements says of itself, which `continuum.strikes` fills.
"""

from __future__ import annotations

from typing import NamedTuple

from warpimpact.records.bending_variables import BENDING_VARIABLES, BROKEN_VARIABLES
from warpimpact.records.exit import EXIT_VARIABLES, OUTCOME_VARIABLES
from warpimpact.records.layer_variables import LAYER_VARIABLES
from warpimpact.records.variable import HITS, MAIN, Variable, VariableGroup


class LimitVariables(NamedTuple):
    """The variables of a search of limits."""

    value: Variable
    lower: Variable
    upper: Variable
    runs: Variable
    converged: Variable


def _limit_variables(quantity: str, units: str, long_name: str) -> LimitVariables:
    name = f"limit_{quantity}"
    return LimitVariables(
        Variable(name, HITS, units, long_name, field="value", shown_by=MAIN),
        Variable(f"{name}_lower", HITS, units, f"{long_name}, lower end", field="lower"),
        Variable(f"{name}_upper", HITS, units, f"{long_name}, upper end", field="upper"),
        Variable("limit_runs", HITS, "1", "how often the hit was computed", field="runs"),
        Variable("limit_converged", HITS, "1", "whether the ends meet the tolerance, 1 or 0", field="converged"),
    )


LIMITS = {
    "velocity": _limit_variables("velocity", "m s-1", "limit velocity"),
    "thickness": _limit_variables("thickness", "m", "limit thickness of the plate"),
}
"""Variables of a limit by the quantity of the search. Only results of `warpimpact limit` have them. All other variables
of such a result belong to the shot at the end of the limit's interval at which the core passes."""
LIMIT_VARIABLES = tuple(variables.value for variables in LIMITS.values())

LIMIT_RECORDS = tuple(
    VariableGroup(f"With `warpimpact limit --quantity {quantity}`", variables, measured=False, exact=True)
    for quantity, variables in LIMITS.items()
)


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


RECORDS: tuple[VariableGroup, ...] = (
    OUTCOME_VARIABLES,
    EXIT_VARIABLES,
    BENDING_VARIABLES,
    BROKEN_VARIABLES,
    LAYER_VARIABLES,
    *LIMIT_RECORDS,
    CONTINUUM_VARIABLES,
)


def variables() -> tuple[Variable, ...]:
    """The variables of all groups."""
    return tuple(dict.fromkeys(name for group in RECORDS for name in group))


def variable(name: str) -> Variable:
    """The variable of a column.

    Raises:
        KeyError: no group has it.
    """
    return {str(variable): variable for variable in variables()}[name]
