"""Names of the global attributes of the Datasets, which describe a result as a whole."""

from importlib.metadata import version

# CF
TITLE = "title"
HISTORY = "history"
REFERENCES = "references"

# The campaign, and how it was computed
CAMPAIGN = "campaign"
CAMPAIGN_ANGLES = "campaign_angles"
"""Unit of the angles that the campaign gives as numbers; not there where they are radians (version 0.1.0)."""
WARPIMPACT_VERSION = "warpimpact_version"
WARP_VERSION = "warp_version"
DEVICE = "device"
NUMERICS = "numerics"
NUMERICS_GIVEN = "numerics_given"
RESOLUTION = "resolution"
"""JSON of the level of resolution that the promise of a named fidelity took; likewise only of one:"""
PROMISE_KEPT = "promise_kept"
RESIDUAL_VELOCITY_ERROR_P90 = "residual_velocity_error_p90"
TILT_ERROR_P90 = "tilt_error_p90"
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
IMPACT = "impact"
MATERIAL = "material"
LAYERS = "layers"
"""JSON of what stands behind the plate, by its number; not there where that is nothing."""
STANDOFF_POINT = "standoff_point"
OPEN_AREA = "open_area"
AREAL_DENSITY = "areal_density"
LIGAMENT = "ligament"
PLATE_PERIOD = "plate_period"
PLATE_THICKNESS = "plate_thickness"
FAILED_SHARE = "failed_share"

# The stop rule
STOP_QUANTITY = "stop_quantity"
STOP_REASON = "stop_reason"
ESTIMATE = "estimate"
ESTIMATE_INTERVAL = "estimate_interval"
ESTIMATE_UNITS = "estimate_units"
CONFIDENCE = "confidence"

# A replayed hit
HIT = "hit"
AGREEMENT = "agreement"


def versions() -> dict[str, str]:
    """The attributes that say which versions computed a result."""
    import warp  # a second to import

    return {WARPIMPACT_VERSION: version("warpimpact"), WARP_VERSION: warp.__version__}
