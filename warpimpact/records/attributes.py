"""Names of the global attributes of the Datasets, which describe a result as a whole."""

import platform
import subprocess
from collections.abc import Mapping
from contextlib import suppress
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

UNITS = {
    **{"residual_velocity_error": "m s-1", "limit_velocity_error": "m s-1", "tilt_error": "degree"},
    **{"depth_error": "m", "limit_thickness_error": "m"},
}
"""CF units of the attributes that have some, which the attribute ``<name>_units`` of a result repeats."""
_SI = "SI; a text says its unit"


def _declared(name: str, units: str) -> str:
    UNITS[name] = units
    return name


# CF
TITLE = "title"
HISTORY = "history"
REFERENCES = "references"

MEANINGS = "meanings"
"""JSON of the units and flags of all variables and attributes, as they were written."""
KIND = "warpimpact_kind"
"""Name and version of the kind of file, as in records/kinds.py."""

# The campaign, and how it was computed
CAMPAIGN = "campaign"
INPUTS = "inputs"
"""JSON of the values of the campaign when it was computed, with checksums of the files that it names."""
WARPIMPACT_VERSION = "warpimpact_version"
WARP_VERSION = "warp_version"
DEVICE = "device"
NUMERICS = "numerics"
"""The numerics as used, in words."""
PRECISION = "precision"
NUMERICS_GIVEN = _declared("numerics_given", _SI)
RESOLUTION = "resolution"
"""JSON of the numerics that a pilot found. The next attributes, up to STATUS_ERROR, are present only with a pilot."""
TOLERANCE_MET = "tolerance_met"
ACCURACY = "accuracy"
"""JSON of the tolerance: errors in SI, and the share of the hits that shall stay within them."""
STATUS_ERROR = "status_error"
"""Share of the hits that end otherwise at a finer level; only of targets with several layers."""
CONTINUUM = _declared("continuum", _SI)
"""JSON of the settings and the materials of a result by finite elements, which has no other numerics."""
FINGERPRINT = "fingerprint"
COMPUTE_TIME = _declared("compute_time", "s")
HITS_PER_SECOND = _declared("hits_per_second", "s-1")


# The shots
SAMPLING = "sampling"
SEED = "seed"
COUNT = "count"
REPLICATES = "replicates"
SYMMETRIES = "symmetries"
"""Symmetries that give the rest of the cell from its hits, separated by "; "; only with `hits.irreducible`."""

# Target and output
SCENE = "scene"
"""What was shot at what, in words."""
CATALOGUE_NAMES = "catalogue_names"
"""A line for each name of the catalogue, with how well it is known; absent without names."""
OUTSIDE_TESTED_RANGE = "outside_tested_range"
"""JSON list of the sentences of `campaign.evidence.outside_tested_range`; absent where it was not determined."""
TOUCHING_LAYERS = "touching_layers"
"""A sentence on layers that may touch, of hits by finite elements; absent where none may (`Target.touching_layers`)."""
STANDOFF_POINT = "standoff_point"
OPEN_AREA = _declared("open_area", "1")
AREAL_DENSITY = _declared("areal_density", "kg m-2")
"""Areal density of the whole target."""
ADD_ON_DENSITY = _declared("add_on_areal_density", "kg m-2")
"""Areal density of the layers in front of the base; only with a base."""
LIGAMENT = _declared("ligament", "m")
PLATE_PERIOD = _declared("plate_period", "m")
PLATE_THICKNESS = _declared("plate_thickness", "m")
FAILED_SHARE = _declared("failed_share", "1")

# A sweep
SWEEP = "sweep"
"""JSON of the swept inputs: name of the dimension → values as they were written."""

# The stop rule
STOP_QUANTITY = "stop_quantity"
STOP_REASON = "stop_reason"
ESTIMATE = "estimate"
ESTIMATE_INTERVAL = "estimate_interval"
ESTIMATE_NUMERICS = "estimate_numerics"
"""Largest shift of the estimate by the numerics; only with a pilot."""
ESTIMATE_UNITS = "estimate_units"
CONFIDENCE = "confidence"

# A search of limits
LIMIT = "limit"
"""The quantity: "velocity" or "thickness"."""
LIMIT_LAYER = "limit_layer"
"""Number of the layer whose thickness was searched; 0 is the plate."""
LIMIT_DENSITY = _declared("limit_density", "kg m-3")
"""Mass per area and thickness of this layer, including its holes."""
LIMIT_ELSEWHERE = _declared("limit_elsewhere", "kg m-2")
"""Areal density of all other layers."""
LIMIT_TOLERANCE = "limit_tolerance"
LIMIT_HIGHEST = "limit_highest"
LIMIT_FACTORS = _declared("limit_material_factors", "1")
"""Ends of the 90 % interval of a test's limit velocity over the velocity: the material's error, and tests' scatter."""
LIMIT_DEVIATION = _declared("limit_material_deviation", "1")
"""Standard deviation of the logarithm of all limit velocities together, from the material's error alone."""

# A replayed hit
HIT = "hit"
AGREEMENT = "agreement"


def with_units(attributes: Mapping[str, Any]) -> dict[str, Any]:
    """Attributes, where each that has units is followed by its units."""
    described: dict[str, Any] = {}
    for name, value in attributes.items():
        described[name] = value
        if name in UNITS:
            described[f"{name}_units"] = UNITS[name]
    return described


def history_line(command: str) -> str:
    """A line of the history: the time, and the command that made a result."""
    return f"{datetime.now(UTC):%Y-%m-%dT%H:%M:%SZ} warpimpact {command}"


@cache
def versions() -> dict[str, str]:
    """Attributes with the versions that determine the bits of a result."""
    import warp  # a second to import

    return {WARPIMPACT_VERSION: version("warpimpact"), WARP_VERSION: warp.__version__}


@cache
def machine() -> dict[str, str]:
    """Attributes on machine, processor, commit and versions that do not change the bits."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    processors = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    description = {
        "python_version": platform.python_version(),
        "numpy_version": version("numpy"),
        "xarray_version": version("xarray"),
        "machine": f"{platform.system()} {platform.machine()}",
        "processor": next(processors, "") or platform.processor() or "unknown",
    }
    if (checkout := Path(__file__).resolve().parents[2]).joinpath(".git").exists():  # "-dirty" if it was changed
        command = ["git", "-C", str(checkout), "describe", "--always", "--dirty", "--abbrev=40", "--exclude=*"]
        with suppress(OSError, subprocess.SubprocessError):
            answer = subprocess.run(command, capture_output=True, text=True, timeout=10, check=True)
            description["commit"] = answer.stdout.strip()
    return description
