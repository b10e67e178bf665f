"""All groups of variables, in the order of a file."""

from __future__ import annotations

from warpimpact.records.bending_variables import BENDING_VARIABLES, BROKEN_VARIABLES
from warpimpact.records.continuum_variables import CONTINUUM_VARIABLES
from warpimpact.records.exit import EXIT_VARIABLES, OUTCOME_VARIABLES
from warpimpact.records.group import VariableGroup
from warpimpact.records.layer_variables import LAYER_VARIABLES
from warpimpact.records.limit_variables import LIMIT_RECORDS
from warpimpact.records.variable import Variable

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
