"""The public names, imported as `from warpimpact import NAME`; the package loads them at the first use of one."""

from warpimpact.errors import CampaignError

from . import catalogue
from .analysis.comparison import compare
from .analysis.effectiveness import effectiveness
from .analysis.hit_map import hit_map
from .campaign.campaign import Campaign
from .catalogue import material, threat
from .continuum.finite_elements import FiniteElements
from .export.spreadsheet import table
from .firing.v50 import v50
from .identification.identify import identify
from .optimisation.optimise import optimise
from .records.outcomes import Outcomes
from .results.files import open_result
from .runs.options import RunOptions
from .runs.replay import replay
from .runs.run import run, run_to_file
from .runs.store import Store
from .scene import (
    CirclePattern,
    Hits,
    Impact,
    Interaction,
    Layer,
    OgiveCore,
    Plate,
    PolygonsPattern,
    Record,
    Scatter,
    Scene,
    Shots,
    SlotPattern,
    Target,
    make_shots,
)
from .solver.fast_law import FastLaw
from .solver.method import Method
from .solver.simulate import simulate
from .studies.limit import limit
from .studies.sensitivity import sensitivity
from .studies.sweep import sweep

__all__ = [
    "Campaign",
    "CampaignError",
    "CirclePattern",
    "FastLaw",
    "FiniteElements",
    "Hits",
    "Impact",
    "Interaction",
    "Layer",
    "Method",
    "OgiveCore",
    "Outcomes",
    "Plate",
    "PolygonsPattern",
    "Record",
    "RunOptions",
    "Scatter",
    "Scene",
    "Shots",
    "SlotPattern",
    "Store",
    "Target",
    "catalogue",
    "compare",
    "effectiveness",
    "hit_map",
    "identify",
    "limit",
    "make_shots",
    "material",
    "open_result",
    "optimise",
    "replay",
    "run",
    "run_to_file",
    "sensitivity",
    "simulate",
    "sweep",
    "table",
    "threat",
    "v50",
]
