"""The scheme of a variant: how one layer loads a core in one step.

A scheme is the consistent law by one thread (contact.py) or by the lanes of a block (block.py), or the paper's literal
scheme (nodal.py). It offers `fields_of_slot`, `fields_of_window`, which differs from that where the window lies in
shared memory, `open_window` (about a hit on an untouched plate), and `load_on`, which also adds the exposure of the
step to the fields of the context.
"""

from functools import cache
from types import SimpleNamespace

from . import block, contact, nodal
from .variant import Variant


@cache
def build(variant: Variant) -> SimpleNamespace:
    """Device functions of the variant's scheme."""
    return (nodal if variant.nodal else block if variant.window else contact).build(variant)
