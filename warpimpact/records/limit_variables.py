"""Limits of single shots; the search of limits fills them (solver/limit.py)."""

from __future__ import annotations

from typing import NamedTuple

from warpimpact.records.group import VariableGroup
from warpimpact.records.variable import HITS, MAIN, Variable


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
