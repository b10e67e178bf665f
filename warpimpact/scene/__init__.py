"""What is shot at what: immutable, validated, in SI units and radians."""

from .core import AnyCore, ConeCore, Core, MassProperties, OgiveCore, PolynomialCore, ProfileCore
from .interaction import Interaction
from .numerics import Numerics, Tolerance
from .patterns import (
    AnyPattern,
    CirclePattern,
    LatticePattern,
    MaskPattern,
    NoPattern,
    Pattern,
    SlotPattern,
    TrianglePattern,
)
from .plate import Plate
from .shots import Hits, Impact, Shots, make_shots, symmetries_used
from .symmetry import IDENTITY, Symmetry

__all__ = [
    "IDENTITY",
    "AnyCore",
    "AnyPattern",
    "CirclePattern",
    "ConeCore",
    "Core",
    "Hits",
    "Impact",
    "Interaction",
    "LatticePattern",
    "MaskPattern",
    "MassProperties",
    "NoPattern",
    "Numerics",
    "OgiveCore",
    "Pattern",
    "Plate",
    "PolynomialCore",
    "ProfileCore",
    "Shots",
    "SlotPattern",
    "Symmetry",
    "Tolerance",
    "TrianglePattern",
    "make_shots",
    "symmetries_used",
]
