"""Hit maps of hard bullet cores against perforated armour plates.

A name is imported at its first use. This keeps ``import warpimpact`` and ``warpimpact --help`` quick.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .campaign.campaign import Campaign
    from .campaign.run import run
    from .export.table import to_dataframe
    from .scene import (
        CirclePattern,
        ConeCore,
        Core,
        EllipsePattern,
        HexagonPattern,
        Hits,
        Impact,
        Interaction,
        MaskPattern,
        NoPattern,
        Numerics,
        OgiveCore,
        Plate,
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
    from .solver.limit import limit_thickness, limit_velocity
    from .solver.simulate import simulate

    __version__: str

__all__ = [
    "Campaign",
    "CirclePattern",
    "ConeCore",
    "Core",
    "EllipsePattern",
    "HexagonPattern",
    "Hits",
    "Impact",
    "Interaction",
    "MaskPattern",
    "NoPattern",
    "Numerics",
    "OgiveCore",
    "Plate",
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
    "__version__",
    "limit_thickness",
    "limit_velocity",
    "make_shots",
    "run",
    "simulate",
    "to_dataframe",
]

_HOMES = {
    "Campaign": ".campaign.campaign",
    "limit_thickness": ".solver.limit",
    "limit_velocity": ".solver.limit",
    "run": ".campaign.run",
    "simulate": ".solver.simulate",
    "to_dataframe": ".export.table",
}


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version

        return version("warpimpact")
    if name in __all__:
        return getattr(import_module(_HOMES.get(name, ".scene"), __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
