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
    precision = np.float64 if "double" in name else np.float32  # of results
    for key in OUTCOMES:
        expected = as_numbers(stored[key]).astype(precision)
        np.testing.assert_array_equal(as_numbers(outcomes[name][key]), expected, err_msg=key)
