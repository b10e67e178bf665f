"""Hit maps of hard bullet cores against perforated armour plates.

Everything that a program needs is imported from here, and figures from `warpimpact.plotting`; other modules may change.
A name is imported at its first use. This keeps ``import warpimpact`` and ``warpimpact --help`` quick.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from . import plotting
    from .analysis.comparison import compare
    from .analysis.comparison_text import Comparison
    from .analysis.hit_map import hit_map
    from .analysis.inspection import Inspection, inspect
    from .campaign.campaign import Campaign, Output
    from .campaign.plates import read_plates
    from .campaign.stop import Stop
    from .campaign.text import CampaignError
    from .catalogue.by_name import Layer, Plate, material, threat
    from .continuum.strikes import simulate
    from .export.spreadsheet import to_dataframe
    from .firing.v50 import v50
    from .optimisation.optimise import optimise, optimise_to_file
    from .records.outcomes import Outcomes
    from .results.files import OutputError, ResultError, open_result
    from .runs.choice import executor_for
    from .runs.executor import ClusterError
    from .runs.replay import replay
    from .runs.run import run, run_to_file
    from .scene import (
        Accuracy,
        CirclePattern,
        ConeCore,
        Core,
        EllipsePattern,
        FreeSurface,
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
        Radians,
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
    from .scene.flow import Continuum, Flow
    from .solver.device import DeviceError
    from .solver.limit import limit_thickness, limit_velocity
    from .studies.sensitivity import sensitivity

    __version__: str

__all__ = [
    "Accuracy",
    "Campaign",
    "CampaignError",
    "CirclePattern",
    "ClusterError",
    "Comparison",
    "ConeCore",
    "Continuum",
    "Core",
    "DeviceError",
    "EllipsePattern",
    "Flow",
    "FreeSurface",
    "HexagonPattern",
    "Hits",
    "Impact",
    "Inspection",
    "Interaction",
    "Layer",
    "NoPattern",
    "Numerics",
    "OgiveCore",
    "Outcomes",
    "Output",
    "OutputError",
    "Plate",
    "PolygonsPattern",
    "PolynomialCore",
    "ProfileCore",
    "Radians",
    "Record",
    "ResultError",
    "Scatter",
    "Scene",
    "Shots",
    "SlotPattern",
    "SquarePattern",
    "Stop",
    "Target",
    "TrianglePattern",
    "__version__",
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
    "optimise_to_file",
    "plotting",
    "read_plates",
    "replay",
    "run",
    "run_to_file",
    "sensitivity",
    "simulate",
    "threat",
    "to_dataframe",
    "v50",
]

_HOMES = {
    "Campaign": ".campaign.campaign",
    "CampaignError": ".campaign.text",
    "ClusterError": ".runs.executor",
    "Comparison": ".analysis.comparison_text",
    "Continuum": ".scene.flow",
    "DeviceError": ".solver.device",
    "Flow": ".scene.flow",
    "Layer": ".catalogue.by_name",
    "Outcomes": ".records.outcomes",
    "Output": ".campaign.campaign",
    "OutputError": ".results.files",
    "Plate": ".catalogue.by_name",
    "ResultError": ".results.files",
    "Stop": ".campaign.stop",
    "executor_for": ".runs.choice",
    "compare": ".analysis.comparison",
    "limit_thickness": ".solver.limit",
    "limit_velocity": ".solver.limit",
    "material": ".catalogue.by_name",
    "open_result": ".results.files",
    "read_plates": ".campaign.plates",
    "replay": ".runs.replay",
    "optimise": ".optimisation.optimise",
    "optimise_to_file": ".optimisation.optimise",
    "hit_map": ".analysis.hit_map",
    "Inspection": ".analysis.inspection",
    "inspect": ".analysis.inspection",
    "run": ".runs.run",
    "run_to_file": ".runs.run",
    "sensitivity": ".studies.sensitivity",
    "simulate": ".continuum.strikes",
    "threat": ".catalogue.by_name",
    "to_dataframe": ".export.spreadsheet",
    "v50": ".firing.v50",
}
"""Modules of the names that are not in `warpimpact.scene`."""


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version

        return version("warpimpact")
    if name == "plotting":
        return import_module(".plotting", __name__)
    if name in __all__:
        return getattr(import_module(_HOMES.get(name, ".scene"), __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return __all__
