"""Names of the global attributes of the Datasets, which describe a result as a whole."""

import platform
import subprocess
from collections.abc import Mapping
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

# CF
TITLE = "title"
HISTORY = "history"
REFERENCES = "references"

# The campaign, and how it was computed
CAMPAIGN = "campaign"
WARPIMPACT_VERSION = "warpimpact_version"
WARP_VERSION = "warp_version"
PYTHON_VERSION = "python_version"
NUMPY_VERSION = "numpy_version"
XARRAY_VERSION = "xarray_version"
COMMIT = "commit"
"""Of the checkout that computed the result; not there where warpimpact was installed without one."""
MACHINE = "machine"
PROCESSOR = "processor"
DEVICE = "device"
NUMERICS = "numerics"
"""The numerics in force in words. As numbers:"""
PATCHES_AXIAL = "patches_axial"
PATCHES_AROUND = "patches_around"
GRID_SPACING = "grid_spacing"
TIME_STEP = "time_step"
PRECISION = "precision"
NUMERICS_GIVEN = "numerics_given"
RESOLUTION = "resolution"
"""JSON of the numerics that a pilot found; likewise only with a pilot:"""
PROMISE_KEPT = "promise_kept"
ACCURACY = "accuracy"
"""JSON of what was asked for: errors in SI, and the share of the hits that is to stay within them. What was found:"""
RESIDUAL_VELOCITY_ERROR = "residual_velocity_error"
TILT_ERROR = "tilt_error"
DEPTH_ERROR = "depth_error"
"""Only where some shots of the pilot stop in a layer."""
FINGERPRINT = "fingerprint"
COMPUTE_TIME = "compute_time"
HITS_PER_SECOND = "hits_per_second"

# The shots
SAMPLING = "sampling"
SEED = "seed"
COUNT = "count"
REPLICATES = "replicates"
SYMMETRIES = "symmetries"
IMAGES = "images"
"""How many hits in a row are images of each other. SYMMETRIES, IMAGES and COMPUTED_HITS need `hits.irreducible`."""
COMPUTED_HITS = "computed_hits"
BURST = "burst"
"""JSON of the burst; likewise only of a campaign of bursts:"""
SHOTS_AT_A_PLATE = "shots_at_a_plate"

# Core, plate and output
CORE = "core"
PLATE = "plate"
IMPACT = "impact"
MATERIAL = "material"
DISCREPANCY = "discrepancy"
"""JSON of the standard deviation that a posterior's model misses by, by units of the Dataset."""
DISCREPANCY_COUNTS = "discrepancy_counts"
"""1 where a reader asks to count it; in no file."""
LAYERS = "layers"
"""JSON of what stands behind the plate, by its number; not there where that is nothing."""
STANDOFF_POINT = "standoff_point"
OPEN_AREA = "open_area"
AREAL_DENSITY = "areal_density"
LIGAMENT = "ligament"
PLATE_PERIOD = "plate_period"
PLATE_THICKNESS = "plate_thickness"
FAILED_SHARE = "failed_share"

# A sweep
SWEEP = "sweep"
"""JSON of the swept inputs: name of the dimension → values as they were written."""

# The stop rule
STOP_QUANTITY = "stop_quantity"
STOP_REASON = "stop_reason"
ESTIMATE = "estimate"
ESTIMATE_INTERVAL = "estimate_interval"
ESTIMATE_UNITS = "estimate_units"
CONFIDENCE = "confidence"

# A search of limits
LIMIT = "limit"
"""The quantity: "velocity" or "thickness"."""
LIMIT_LAYER = "limit_layer"
"""Whose thickness was searched; 0 is the plate."""
LIMIT_DENSITY = "limit_density"
"""Mass per area and thickness of that layer, its holes included."""
LIMIT_ELSEWHERE = "limit_elsewhere"
"""Areal density of all other layers."""
SOLID_LIMIT_TIME = "solid_limit_time"
"""Time that the search at the solid plate took [s]."""
SOLID_LIMIT_DENSITY, SOLID_LIMIT_HIGHEST = "solid_limit_density", "solid_limit_highest"
"""Mass per volume of the solid plate that replaces the whole target, and the largest value tried."""
LIMIT_TOLERANCE = "limit_tolerance"
LIMIT_HIGHEST = "limit_highest"
LIMIT_ERROR = "limit_error"
"""Of a limit velocity [m/s] or of a limit thickness [m]."""

# A replayed hit
HIT = "hit"
AGREEMENT = "agreement"


_SI = "SI; a text says its unit"
UNITS = {
    COMPUTE_TIME: "s",
    HITS_PER_SECOND: "s-1",
    RESIDUAL_VELOCITY_ERROR: "m s-1",
    TILT_ERROR: "degree",
    DEPTH_ERROR: "m",
    GRID_SPACING: "m",
    TIME_STEP: "s",
    OPEN_AREA: "1",
    AREAL_DENSITY: "kg m-2",
    LIMIT_DENSITY: "kg m-3",
    SOLID_LIMIT_DENSITY: "kg m-3",
    SOLID_LIMIT_TIME: "s",
    LIMIT_ELSEWHERE: "kg m-2",
    LIGAMENT: "m",
    PLATE_PERIOD: "m",
    PLATE_THICKNESS: "m",
    FAILED_SHARE: "1",
    CORE: _SI,
    PLATE: _SI,
    IMPACT: _SI,
    MATERIAL: _SI,
    NUMERICS_GIVEN: _SI,
}
"""Units of the attributes that have one; the attribute ``<name>_units`` tells them in the Dataset."""


def with_units(attributes: Mapping[str, Any]) -> dict[str, Any]:
    """Attributes, each that has a unit followed by it."""
    told: dict[str, Any] = {}
    for name, value in attributes.items():
        told[name] = value
        if name in UNITS:
            told[f"{name}_units"] = UNITS[name]
    return told


def versions() -> dict[str, str]:
    """The attributes that say which versions computed a result and decide its bits."""
    import warp  # a second to import

    return {WARPIMPACT_VERSION: version("warpimpact"), WARP_VERSION: warp.__version__}


@cache
def machine() -> dict[str, str]:
    """The attributes that say what else was there: machine, processor, commit and other versions."""
    told = {
        PYTHON_VERSION: platform.python_version(),
        NUMPY_VERSION: version("numpy"),
        XARRAY_VERSION: version("xarray"),
        MACHINE: f"{platform.system()} {platform.machine()}",
        PROCESSOR: _processor(),
    }
    commit = _commit()
    return told | ({COMMIT: commit} if commit else {})


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    named = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(named, "") or platform.processor() or "unknown"


def _commit() -> str:
    """Commit of the checkout around this file, with "-dirty" if it was changed; empty if there is none."""
    checkout = Path(__file__).resolve().parents[2]
    if not (checkout / ".git").exists():
        return ""
    command = ["git", "-C", str(checkout), "describe", "--always", "--dirty", "--abbrev=40", "--exclude=*"]
    try:
        return subprocess.run(command, capture_output=True, text=True, timeout=10, check=True).stdout.strip()
    except (OSError, subprocess.SubprocessError):
        return ""
