"""All records, a line for each, in the order of a file."""

from __future__ import annotations

from warpimpact.records.bending import BENDING_VARIABLES
from warpimpact.records.broken import BROKEN_VARIABLES
from warpimpact.records.exit import EXIT_VARIABLES, OUTCOME_VARIABLES
from warpimpact.records.group import Group
from warpimpact.records.layers import LAYER_STANDOFF_VARIABLES, LAYER_VARIABLES
from warpimpact.records.limit import LIMIT_RECORDS
from warpimpact.records.variable import Variable

RECORDS: tuple[Group, ...] = (
    OUTCOME_VARIABLES,
    EXIT_VARIABLES,
    BENDING_VARIABLES,
    BROKEN_VARIABLES,
    LAYER_VARIABLES,
    LAYER_STANDOFF_VARIABLES,
    *LIMIT_RECORDS,
)


def variables() -> tuple[Variable, ...]:
    """Those of all records."""
    return tuple(dict.fromkeys(one for group in RECORDS for one in group))


def variable(name: str) -> Variable:
    """That of a column.

    Raises:
        KeyError: no record has it.
    """
    return {str(one): one for one in variables()}[name]
