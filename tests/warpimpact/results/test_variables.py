"""The table of variables."""

import pickle

import pytest

from warpimpact.records.group import VariableGroup
from warpimpact.results import variables as v


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


def test_another_process_gets_the_plain_name() -> None:
    copy = pickle.loads(pickle.dumps(v.TILT))
    assert type(copy) is str
    assert copy == v.TILT == "tilt"


def test_what_a_command_shows() -> None:
    limits = tuple(variables.value for variables in v.LIMITS.values())
    assert v.shown_by("report") == (*limits, v.RESIDUAL_VELOCITY, v.DEFLECTION, v.TILT)
    assert v.shown_by("plot") == (*v.shown_by("report"), v.LARGEST_BENDING_MOMENT, v.BENDING_STRESS)
