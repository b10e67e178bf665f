"""What is shot at what: immutable, validated, in SI units and radians.

Change cores, plates, patterns, shots and their scatter here; a message says what was found and what is allowed. It
imports no other room: neither a kernel nor a Dataset.
"""

from .core import AnyCore, ConeCore, Core, MassProperties, OgiveCore, PolynomialCore, ProfileCore
from .interaction import FreeSurface, Interaction
from .pattern import LatticePattern, NoPattern, Pattern
from .sampling import IDENTITY, Sampler, Symmetry, make_shots, symmetries_used
from .scatter import Scatter
from .scene import Record, Scene
from .shapes import (
    AnyPattern,
    CirclePattern,
    EllipsePattern,
    HexagonPattern,
    PolygonsPattern,
    SlotPattern,
    SquarePattern,
    TrianglePattern,
)
from .shots import Hits, Impact, Shots
from .target import Layer, Plate, Target
from .units import Radians
