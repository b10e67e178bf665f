"""The table of variables, and results whose files were written before an attribute existed."""

import pickle
from typing import Any

import numpy as np
import pytest

from warpimpact.records.group import VariableGroup
from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.results.dataset import images


def groups() -> dict[str, tuple[v.Variable, ...]]:
    return {
        name: tuple(group)
        for name, group in vars(v).items()
        if name.isupper()
        and isinstance(group, (tuple, dict, VariableGroup))
        and all(isinstance(one, v.Variable) for one in group)
    }


@pytest.mark.parametrize("name", groups())
def test_a_group_names_each_variable_once(name: str) -> None:
    group = groups()[name]
    assert len(set(group)) == len(group) > 0


def test_every_variable_belongs_to_a_group() -> None:
    listed = {id(one) for group in groups().values() for one in group}
    members = {name for name, one in vars(v).items() if isinstance(one, v.Variable) and id(one) not in listed}
    assert members == set()


def test_a_variable_is_the_key_of_its_values(make_result: Any) -> None:
    dataset = make_result()
    for name in (*v.COORDINATES, *v.VARIABLES):
        assert dataset[name].dims == name.dims
        assert dataset[name].attrs.keys() == name.attributes.keys()
    assert all(type(name) is str for name in dataset.variables)


def test_another_process_gets_the_plain_name() -> None:
    copy = pickle.loads(pickle.dumps(v.TILT))
    assert type(copy) is str
    assert copy == v.TILT == "tilt"


def test_codes_carry_their_meanings() -> None:
    assert v.STATUS.attributes["flag_meanings"].split()[:2] == ["perforated", "arrested"]
    assert v.STATUS.attributes["flag_values"].dtype == np.int8
    assert "flag_values" not in v.TILT.attributes


def test_what_a_command_shows() -> None:
    limits = tuple(variables.value for variables in v.LIMITS.values())
    assert v.shown_by("report") == (*limits, v.RESIDUAL_VELOCITY, v.DEFLECTION, v.TILT)
    assert v.shown_by("plot") == (*v.shown_by("report"), v.LARGEST_BENDING_MOMENT, v.BENDING_STRESS)


def test_the_number_of_images_is_an_attribute_of_its_own(make_result: Any) -> None:
    dataset = make_result()
    assert images(dataset) == 1
    assert images(dataset.assign_attrs({attr.IMAGES: 4})) == 4
