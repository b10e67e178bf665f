"""Names of the global attributes of the Datasets: what is told of a result as a whole."""

from importlib.metadata import version

# CF
TITLE = "title"
HISTORY = "history"
REFERENCES = "references"

# The campaign and what made a result of it
CAMPAIGN = "campaign"
CAMPAIGN_ANGLES = "campaign_angles"
"""Unit of the angles that the campaign gives as numbers; not there where they are radians (version 0.1.0)."""
WARPIMPACT_VERSION = "warpimpact_version"
WARP_VERSION = "warp_version"
DEVICE = "device"
NUMERICS = "numerics"
NUMERICS_GIVEN = "numerics_given"
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
"""How many hits in a row are images of each other; like the other two only of a map with `hits.irreducible`."""
COMPUTED_HITS = "computed_hits"

# Core, plate and output
CORE = "core"
IMPACT = "impact"
MATERIAL = "material"
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
