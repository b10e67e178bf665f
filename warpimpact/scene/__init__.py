"""What is shot at what: immutable, validated, in SI units and radians.

Change cores, plates, patterns, shots and their scatter here; a message says what was found and what is allowed. It
imports no other room: neither a kernel nor a Dataset.
"""

from .core import AnyCore, ConeCore, Core, MassProperties, OgiveCore, PolynomialCore, ProfileCore
from .interaction import FreeSurface, Interaction
from .numerics import PRESETS, Accuracy, Numerics
from .patterns import (
    AnyPattern,
    CirclePattern,
    EllipsePattern,
    HexagonPattern,
    LatticePattern,
    NoPattern,
    Pattern,
    PolygonsPattern,
    SlotPattern,
    SquarePattern,
    TrianglePattern,
)
from .plate import Plate
from .sampling import Sampler, make_shots
from .scatter import Scatter
from .scene import Record, Scene
from .shots import Hits, Impact, Shots
from .symmetry import IDENTITY, Symmetry, symmetries_used
from .target import Layer, Target
from .units import Radians
