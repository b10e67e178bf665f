"""Results in strict arithmetic equal the stored ones, bit for bit.

They are computed in strict arithmetic. With the flags of a release a compiler may sum in another order when the code
around a sum changes, and another processor may round in another way.

``python tests/verification/test_stored_outcomes.py`` prints them. After a change that is meant to change results, put
its output into stored/outcomes.json.
"""

import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray

from warpimpact import Campaign, RunOptions, run
from warpimpact.kernels import variant
from warpimpact.measures.references import law_of

STRICT = "-ffp-contract=off -fno-slp-vectorize"
"""Compiler flags of strict arithmetic."""
STORED = Path(__file__).parent / "stored" / "outcomes.json"
STANDARD = {"level": 2}  # fixed: no pilot chooses
SLOTS = {"shape": "slot", "length": 12e-3, "width": 4e-3, "spacing": [8e-3, 16e-3], "staggered": True}
CIRCLES = {"shape": "circle", "diameter": 9e-3, "spacing": [12.5e-3, 21.65e-3], "staggered": True}
PAPER_CORE = {"shape": "polynomial", "coefficients": [3e-4, 0.24, -5.29], "length": 27.86e-3, "mass": 4e-3}
SHANKED = {"shape": "ogive", "diameter": 6.17e-3, "crh": 3, "length": 27e-3, "mass": 5.25e-3}
PLATE = {"thickness": 4e-3, "resistance": 2.6e9, "shear_coefficient": 0.05, "degradation": 0.8, "pattern": SLOTS}
OBLIQUE = {"velocity": 820.0, "obliquity": "20 deg", "azimuth": "30 deg", "yaw": "3 deg", "spin": 1e4}
YAW = {"distribution": "normal", "mean": "0 deg", "std": "1 deg"}
RESISTANCE = {"distribution": "normal", "mean": 2.6e9, "std": 1e8}
ONE_NET = {"replicates": 1}
BASE: dict[str, Any] = {
    "core": PAPER_CORE,
    "plate": PLATE,
    "impact": {"velocity": 825.0},
    "hits": ONE_NET | {"count": 24, "seed": 3},
    "numerics": STANDARD,
    "output": {"solid_reference": False},
}
CAMPAIGNS: dict[str, dict[str, Any]] = {
    "slots": {},
    "slots, draft": {"numerics": {"level": 0}},
    "slots, double": {"numerics": {"level": 0, "precision": "double"}},
    "slots, nodal": {"numerics": {"scheme": "nodal", "grid_spacing": 5e-5}, "hits": ONE_NET | {"count": 6}},
    "slots, with bending and the nose": {"output": {"bending": True, "standoff_point": "nose"}},
    "slots, irreducible": {"hits": ONE_NET | {"count": 4, "irreducible": True}},
    "shank through round holes, oblique and yawed": {
        "core": SHANKED,
        "plate": PLATE | {"pattern": CIRCLES, "thickness": 6e-3},
        "impact": OBLIQUE,
    },
    "arrest in a hard plate that does not weaken": {
        "plate": PLATE | {"pattern": {"shape": "none"}, "degradation": 1.0, "resistance": 2e10, "thickness": 8e-3},
        "hits": ONE_NET | {"count": 2},
    },
    "Poncelet's stress, a rim": {
        "plate": PLATE | {"size": [12e-3, 20e-3]},
        "interaction": {"static": 1.0, "quadratic": 0.5},
        "hits": ONE_NET | {"count": 24, "area": "plate"},
    },
    "scatter": {"impact": {"velocity": 825.0, "yaw": YAW}, "plate": PLATE | {"resistance": RESISTANCE}},
}
OUTCOMES = ("status", "residual_velocity", "deflection", "tilt", "angular_velocity")


def computed() -> Iterator[tuple[str, xarray.Dataset]]:
    """Name and result of every campaign, on the CPU."""
    for name, changes in CAMPAIGNS.items():
        text = json.dumps({"title": name} | BASE | changes)
        yield (
            name,
            law_of(run(Campaign.from_text(text, name=name, folder=Path()), options=RunOptions("cpu"))).to_dataset(),
        )


def as_hex(values: np.ndarray) -> list[str]:
    """Numbers without loss."""
    return [float(value).hex() for value in np.asarray(values, dtype=float).ravel()]


@pytest.fixture(scope="module")
def outcomes() -> dict[str, Any]:
    # A separate process: kernels that other tests built here may round in another way.
    done = subprocess.run([sys.executable, __file__], check=True, capture_output=True, text=True)
    return dict(json.loads(done.stdout))


@pytest.mark.parametrize("name", CAMPAIGNS)
def test_results_are_those_stored(name: str, outcomes: dict[str, Any]) -> None:
    stored = json.loads(STORED.read_text())[name]
    precision = np.float64 if "double" in name else np.float32  # of results
    for key in OUTCOMES:
        actual, expected = (
            np.array([float.fromhex(value) for value in values]) for values in (outcomes[name][key], stored[key])
        )
        np.testing.assert_array_equal(actual, expected.astype(precision), err_msg=key)


if __name__ == "__main__":
    variant.CPU_FLAGS = STRICT  # before any kernel is built
    print(json.dumps({name: {key: as_hex(result[key].values) for key in OUTCOMES} for name, result in computed()}))
