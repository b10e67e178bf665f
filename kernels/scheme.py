"""The scheme of a variant: how one layer loads a core in one step (contract: kernels/contracts.py)."""

from functools import cache

from . import block, contact, nodal
from .contracts import Scheme, checked
from .variant import Variant


@cache
def build(variant: Variant) -> Scheme:
    """The functions of the variant's scheme."""
    scheme = nodal if variant.nodal else block if variant.window else contact
    return checked(Scheme, variant, scheme.build(variant))
