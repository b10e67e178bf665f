"""The contracts of a scheme and of a kind of target: a build that breaks one is refused, with what is wrong."""

from types import SimpleNamespace
from typing import Any

import pytest
import warp as wp

from warpimpact.kernels import block, contact, layers, nodal, one_plate, scheme, structs
from warpimpact.kernels.contracts import Scheme, TargetKind, checked
from warpimpact.kernels.variant import Variant

BUILDS = [
    (Scheme, contact, Variant()),
    (Scheme, contact, Variant(double=True)),
    (Scheme, block, Variant(window=2048)),
    (Scheme, nodal, Variant(nodal=True)),
    (TargetKind, one_plate, Variant()),
    (TargetKind, layers, Variant(layered=True)),
]


@pytest.mark.parametrize(("contract", "module", "variant"), BUILDS)
def test_every_build_keeps_its_contract(contract: type[Any], module: Any, variant: Variant) -> None:
    build = module.build(variant)
    functions = checked(contract, variant, build)
    assert all(vars(functions)[name] is getattr(build, name) for name in vars(functions))


def test_the_scheme_of_a_variant_is_the_one_that_it_asks_for() -> None:
    variant = Variant(window=2048)
    assert scheme.build(variant).load_on is block.build(variant).load_on
    assert scheme.build(Variant()).load_on is contact.build(Variant()).load_on
    variant = Variant(nodal=True)
    assert scheme.build(variant).load_on is nodal.build(variant).load_on


@pytest.mark.parametrize(("contract", "module", "variant"), BUILDS[:1] + BUILDS[-1:])
def test_a_function_that_is_missing_is_named(contract: type[Any], module: Any, variant: Variant) -> None:
    parts = vars(module.build(variant)) | {"load_on": None}
    with pytest.raises(TypeError, match=rf"a {contract.__name__} needs the device function load_on\("):
        checked(contract, variant, SimpleNamespace(**parts))


def test_another_argument_is_named() -> None:
    struct = structs.build(Variant())

    @wp.func
    def fields_of_slot(fields: struct.Touches, slot: wp.int32):
        return fields

    parts = vars(contact.build(Variant())) | {"fields_of_slot": fields_of_slot}
    with pytest.raises(TypeError, match=r"takes \(fields: \w*Touches\w*, .*must take \(fields: Fields, slot: int32\)"):
        checked(Scheme, Variant(), SimpleNamespace(**parts))


def test_a_build_of_another_precision_is_refused() -> None:
    with pytest.raises(TypeError, match="must take"):
        checked(Scheme, Variant(double=True), contact.build(Variant()))
