"""The scheme of a variant."""

from warpimpact.kernels import block, contact, nodal, scheme
from warpimpact.kernels.variant import Variant


def test_the_scheme_of_a_variant_is_the_one_that_it_asks_for() -> None:
    variant = Variant(window=2048)
    assert scheme.build(variant).load_on is block.build(variant).load_on
    assert scheme.build(Variant()).load_on is contact.build(Variant()).load_on
    variant = Variant(nodal=True)
    assert scheme.build(variant).load_on is nodal.build(variant).load_on
