"""Results in strict arithmetic equal the stored ones, bit for bit."""

import json
import subprocess
import sys
from typing import Any

import numpy as np
import pytest

from . import stored_outcomes
from .stored_outcomes import CAMPAIGNS, OUTCOMES, STORED, as_numbers


@pytest.fixture(scope="module")
def outcomes() -> dict[str, Any]:
    # A separate process: kernels that other tests built here may round in another way.
    command = [sys.executable, stored_outcomes.__file__]
    return dict(json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout))


@pytest.mark.parametrize("name", CAMPAIGNS)
def test_results_are_those_stored(name: str, outcomes: dict[str, Any]) -> None:
    stored = json.loads(STORED.read_text())[name]
    for key in OUTCOMES:
        np.testing.assert_array_equal(as_numbers(outcomes[name][key]), as_numbers(stored[key]), err_msg=key)
