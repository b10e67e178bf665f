"""The scheme of a variant: how one layer loads a core in one step.

The consistent law is computed by one thread (contact.py) or by the lanes of a block (block.py); the paper's literal
scheme is in nodal.py. Each has the functions `fields_of_slot`, `open_window` and `load_on`.
"""

from functools import cache
from types import SimpleNamespace

from . import block, contact, nodal
from .variant import Variant


@cache
def build(variant: Variant) -> SimpleNamespace:
    """The functions of the variant's scheme."""
    return (nodal if variant.nodal else block if variant.window else contact).build(variant)
