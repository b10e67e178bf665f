"""The public names, imported as `from warpimpact import NAME`; the package loads them at the first use of one."""

from warpimpact.errors import CampaignError

from . import catalogue
from .analysis.comparison import compare
from .analysis.hit_map import hit_map
from .campaign.campaign import Campaign
from .catalogue import material, threat
from .continuum.simulate import simulate
from .export.spreadsheet import to_dataframe
from .firing.v50 import v50
from .optimisation.optimise import optimise
from .results.files import open_result
from .runs.computer import computer
from .runs.replay import replay
from .runs.run import run, run_to_file
from .scene import (
    CirclePattern,
    Hits,
    Impact,
    Interaction,
    Layer,
    Numerics,
    OgiveCore,
    Plate,
    PolygonsPattern,
    Record,
    Scene,
    SlotPattern,
    make_shots,
)
from .scene.flow import Continuum
from .studies.sensitivity import sensitivity

__all__ = [
    "Campaign",
    "CampaignError",
    "CirclePattern",
    "Continuum",
    "Hits",
    "Impact",
    "Interaction",
    "Layer",
    "Numerics",
    "OgiveCore",
    "Plate",
    "PolygonsPattern",
    "Record",
    "Scene",
    "SlotPattern",
    "catalogue",
    "compare",
    "computer",
    "hit_map",
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
