"""The public names, imported as `from warpimpact import NAME`; the package loads them at the first use of one."""

from .analysis.comparison import compare
from .analysis.hit_map import hit_map
from .analysis.inspection import inspect
from .campaign.campaign import Campaign
from .campaign.text import CampaignError
from .catalogue.by_name import Layer, Plate, material, threat
from .continuum.strikes import simulate
from .export.spreadsheet import to_dataframe
from .firing.v50 import v50
from .optimisation.optimise import optimise
from .results.files import open_result
from .runs.executor import executor_for
from .runs.replay import replay
from .runs.run import run, run_to_file
from .scene import (
    CirclePattern,
    ConeCore,
    Core,
    EllipsePattern,
    HexagonPattern,
    Hits,
    Impact,
    Interaction,
    NoPattern,
    Numerics,
    OgiveCore,
    PolygonsPattern,
    PolynomialCore,
    ProfileCore,
    Record,
    Scatter,
    Scene,
    Shots,
    SlotPattern,
    SquarePattern,
    Target,
    TrianglePattern,
    make_shots,
)
from .scene.flow import Continuum
from .solver.limit import limit_thickness, limit_velocity
from .studies.sensitivity import sensitivity

__all__ = [
    "Campaign",
    "CampaignError",
    "CirclePattern",
    "ConeCore",
    "Continuum",
    "Core",
    "EllipsePattern",
    "HexagonPattern",
    "Hits",
    "Impact",
    "Interaction",
    "Layer",
    "NoPattern",
    "Numerics",
    "OgiveCore",
    "Plate",
    "PolygonsPattern",
    "PolynomialCore",
    "ProfileCore",
    "Record",
    "Scatter",
    "Scene",
    "Shots",
    "SlotPattern",
    "SquarePattern",
    "Target",
    "TrianglePattern",
    "compare",
    "executor_for",
    "hit_map",
    "inspect",
    "limit_thickness",
    "limit_velocity",
    "make_shots",
    "material",
    "open_result",
    "optimise",
    "replay",
    "run",
    "run_to_file",
    "sensitivity",
    "simulate",
    "threat",
    "to_dataframe",
    "v50",
]
