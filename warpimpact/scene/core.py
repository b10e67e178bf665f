"""Cores: rigid bodies of revolution r(s), s from the nose tip (docs/model.md §2)."""

from abc import ABC, abstractmethod
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple, Self

import numpy as np
from numpy.polynomial import Polynomial
from pydantic import Field, ValidationInfo, model_validator
from scipy.spatial import ConvexHull

from .input_files import input_file, read_columns
from .model import Array, Model
from .units import Length, Number, PositiveDensity, PositiveInertia, PositiveLength, PositiveMass, PositiveStress, Title

# Gauss–Legendre on 32 nodes is exact to degree 63: r⁴ of any polynomial core up to degree 15.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(32)
_OUTLINE_STATIONS = 1001  # per smooth stretch of the profile
_SILHOUETTE_STATIONS = 101  # per smooth stretch; chords lose 1e-4 of the area
_PART_STATIONS = 65
_LEAST_CUT = 1e-3  # of the length: a smaller cut is none


class MassProperties(NamedTuple):
    """Properties of a core that determine its motion.

    Attributes:
        mass: [kg]
        centre_of_mass: distance behind the nose tip [m].
        inertia_axial: about the axis [kg m²].
        inertia_transverse: about any line across the axis through the centre of mass [kg m²].
    """

    mass: float
    centre_of_mass: float
    inertia_axial: float
    inertia_transverse: float


class Core(Model, ABC):
    """A rigid, homogeneous body of revolution, closed by discs at nose and base.

    Attributes:
        mass: of the core [kg]; exactly one of mass and density is given.
        density: of its material [kg/m³].
        centre_of_mass: distance behind the nose tip [m]; by default it follows from the shape.
        inertia_axial, inertia_transverse: moments of inertia [kg m²] about the axis, and about a line across it through
            the centre of mass; by default they follow from the shape.
        strength: nominal bending stress above which the core breaks [Pa], or the largest principal stress of one that
            deforms by finite elements; None is a rigid core that never breaks, and `core steel` in one that deforms.
        threat: name of a bullet in the catalogue. In a file it gives shape, mass and velocity; a key beside it
            overrides its value.
        standard: standard that gives the velocity of that bullet if impact.velocity is missing; by default the first
            one of the catalogue.
        velocity_tolerance: whether that velocity scatters evenly within the tolerance of the standard.
    """

    mass: PositiveMass | None = None
    density: PositiveDensity | None = None
    centre_of_mass: Length | None = None
    inertia_axial: PositiveInertia | None = None
    inertia_transverse: PositiveInertia | None = None
    strength: PositiveStress | None = None
    threat: Title | None = None
    standard: Title | None = None
    velocity_tolerance: Annotated[bool, Field(strict=True)] = False

    if TYPE_CHECKING:  # a field of the drawn cores, a property of the tabulated one

        @property
        def length(self) -> float:
            """From nose tip to base [m]."""

    @property
    @abstractmethod
    def max_radius(self) -> float:
        """Largest radius [m]."""

    @property
    def breaks(self) -> tuple[float, ...]:
        """Stations within (0, length) where the profile is not smooth [m], ascending."""
        return ()

    @abstractmethod
    def radius(self, s: Array) -> Array:
        """Radius [m] at stations `s` [m] within [0, length]; same shape."""

    @model_validator(mode="after")
    def _is_a_body(self) -> Self:
        if (self.mass is None) == (self.density is None):
            given = "neither" if self.mass is None else "both"
            raise ValueError(f"got {given} of mass and density, but exactly one of them must be given")
        if self.centre_of_mass is not None and not 0 < self.centre_of_mass < self.length:
            raise ValueError(
                f"got centre_of_mass = {self.centre_of_mass:g} m, "
                f"but it must lie between nose and base, 0 to {self.length:g} m"
            )
        return self

    @cached_property
    def mass_properties(self) -> MassProperties:
        """Integrals over the solid of revolution, unless they are overridden.

        The transverse moment is about `centre_of_mass`, also where that is overridden (parallel-axis theorem).
        """
        s, r, volumes = self._slices()
        volume = volumes.sum()
        axial = (volumes * r**2).sum() / 2
        centre = self.centre_of_mass or (volumes * s).sum() / volume  # none of the overrides is 0
        transverse = axial / 2 + (volumes * (s - centre) ** 2).sum()
        density = self.density if self.mass is None else self.mass / volume
        return MassProperties(
            mass=float(density * volume),
            centre_of_mass=float(centre),
            inertia_axial=float(self.inertia_axial or density * axial),
            inertia_transverse=float(self.inertia_transverse or density * transverse),
        )

    @property
    def volume(self) -> float:
        """Volume [m³]."""
        return float(self._slices()[2].sum())

    @property
    def middle(self) -> float:
        """Station with half of the volume ahead of it [m]."""
        s, _, volumes = self._slices()
        return float(np.interp(0.5 * volumes.sum(), np.cumsum(volumes) - 0.5 * volumes, s))

    def between(self, front: float, rear: float) -> "Core":
        """The part of the core between two stations [m], of its density; its ends are flat."""
        least = _LEAST_CUT * self.length
        if front < least and rear > self.length - least:
            return self
        s = np.linspace(max(front, 0.0), min(rear, self.length), _PART_STATIONS)
        density = self.mass_properties.mass / self.volume
        return ProfileCore(s=tuple((s - s[0]).tolist()), r=tuple(self.radius(s).tolist()), density=density)

    @cached_property
    def bounding_radius(self) -> float:
        """Largest distance of a surface point from the centre of mass [m]."""
        s = self._stations(_OUTLINE_STATIONS)
        return float(np.hypot(s - self.mass_properties.centre_of_mass, self.radius(s)).max())

    def presented_area(self, inclination: Array) -> Array:
        """Area of the silhouette along a line of sight at this inclination to the axis [rad], of the same shape [m²].

        The silhouette of a convex body has the area ½ ∮ |n·d| dS (Cauchy). Between stations the body is a frustum,
        whose normals make one angle with the axis. The convex hull of the profile is used: hollows count as filled. The
        view from the nose equals that from the base.
        """
        s = self._stations(_SILHOUETTE_STATIONS)
        outline = np.column_stack([[0.0, *s, self.length], [0.0, *self.radius(s), 0.0]])
        outline = outline[ConvexHull(outline).vertices]
        along, outwards = (np.roll(outline, -1, axis=0) - outline).T
        area = np.pi * (np.roll(outline[:, 1], -1) + outline[:, 1])  # of a frustum, per length of its line
        of_axial = np.abs(outwards * np.cos(inclination)[..., None])
        of_radial = np.abs(along * np.sin(inclination)[..., None])
        ratio = np.divide(of_axial, of_radial, out=np.ones_like(of_radial), where=of_radial > of_axial)
        # Mean of |a + b cos φ| around the axis; it is a if the sign does not change.
        mean = of_axial * (1.0 - 2.0 / np.pi * np.arccos(ratio)) + of_radial * 2.0 / np.pi * np.sqrt(1.0 - ratio**2)
        return np.asarray(0.5 * (area * mean).sum(axis=-1))

    def _stations(self, count: int) -> Array:
        """This number of stations on every smooth stretch of the profile [m]."""
        return np.concatenate([np.linspace(a, b, count) for a, b in pairwise((0.0, *self.breaks, self.length))])

    def _slices(self) -> tuple[Array, Array, Array]:
        """Stations [m], radii [m] and volumes [m³] of slices, by a Gauss–Legendre rule on every smooth stretch."""
        ends = np.array([[0.0], *([station] for station in self.breaks), [self.length]])
        half = np.diff(ends, axis=0) / 2
        s = (ends[:-1] + half * (1 + _NODES)).ravel()
        r = self.radius(s)
        return s, r, np.pi * r**2 * (half * _WEIGHTS).ravel()


class PolynomialCore(Core):
    """r(s) = Σ coefficients[i] sⁱ, in metres: the paper's core is [3.0e-4, 0.24, -5.29].

    Attributes:
        shape: "polynomial".
        coefficients: of r(s), the constant first, in metres.
        length: from nose to base [m].
    """

    shape: Literal["polynomial"] = "polynomial"
    coefficients: tuple[Number, ...] = Field(fail_fast=True, min_length=1, max_length=16)
    length: PositiveLength

    @model_validator(mode="after")
    def _radius_positive(self) -> Self:
        s = np.array([*self._extremes(), 0.0, self.length])
        r = self._polynomial(s)
        if r.min() < 0 or r.max() <= 0 or (r[:-2] <= 0).any():  # 0 is allowed at nose and base only
            raise ValueError(
                f"got coefficients with a radius of {r.min():g} m at s = {s[r.argmin()]:g} m, "
                f"but the radius must be positive from nose to base, 0 to {self.length:g} m"
            )
        return self

    @cached_property
    def max_radius(self) -> float:
        return float(self.radius(np.array([0.0, self.length, *self._extremes()])).max())

    def radius(self, s: Array) -> Array:
        return np.asarray(np.maximum(self._polynomial(s), 0.0))

    @property
    def _polynomial(self) -> Polynomial:
        return Polynomial(self.coefficients)

    def _extremes(self) -> Array:
        roots = self._polynomial.deriv().roots()
        real = roots.real[np.isreal(roots)]
        return real[(real > 0) & (real < self.length)]


class _NosedCore(Core):
    """A nose up to its shoulder, then a cylindrical shank of `diameter` up to `length`.

    Attributes:
        diameter: of the shank [m].
        length: from nose tip to base [m].
    """

    diameter: PositiveLength
    length: PositiveLength

    @model_validator(mode="after")
    def _holds_its_nose(self) -> Self:
        if self.nose_length > self.length * (1 + 1e-12):  # a nose as long as the core may round to a little more
            raise ValueError(
                f"got length = {self.length:g} m, but the core must be at least as long as its nose, "
                f"{self.nose_length:g} m"
            )
        return self

    @property
    @abstractmethod
    def nose_length(self) -> float:
        """From tip to shoulder [m]."""

    @property
    def max_radius(self) -> float:
        return self.diameter / 2

    @property
    def breaks(self) -> tuple[float, ...]:
        """The shoulder, where a shank follows; slope or curvature jump there [m]."""
        return (self.nose_length,) if self.nose_length < self.length else ()


class OgiveCore(_NosedCore):
    """Tangent ogive nose of `crh` calibres radius, then a cylindrical shank of `diameter` up to `length`.

    Attributes:
        shape: "ogive".
        crh: radius of the ogive in diameters of the core, "calibre radius head".
    """

    shape: Literal["ogive"] = "ogive"
    crh: Annotated[Number, Field(ge=0.5)]

    @property
    def nose_length(self) -> float:
        """From tip to shoulder [m]: √(R² − (R − d/2)²) with R = crh·d."""
        return float(self.diameter * np.sqrt(self.crh - 0.25))

    def radius(self, s: Array) -> Array:
        curvature_radius = self.crh * self.diameter
        to_shoulder = np.maximum(self.nose_length - s, 0.0)
        arc = np.sqrt(np.maximum(curvature_radius**2 - to_shoulder**2, 0.0))
        return np.maximum(arc - curvature_radius + self.diameter / 2, 0.0)


class ConeCore(_NosedCore):
    """Sharp cone of `cone_length` (by default all of `length`), then a cylindrical shank of `diameter`.

    Attributes:
        shape: "cone".
        cone_length: from tip to shoulder [m]; by default all of `length`.
    """

    shape: Literal["cone"] = "cone"
    cone_length: PositiveLength | None = None

    @property
    def nose_length(self) -> float:
        return self.length if self.cone_length is None else self.cone_length

    def radius(self, s: Array) -> Array:
        return self.diameter / 2 * np.minimum(np.asarray(s) / self.nose_length, 1.0)


class ProfileCore(Core):
    """Straight lines between tabulated stations `s` and radii `r` [m], from s = 0 at the nose to the base.

    Both may come from `file`, a CSV file with the header s,r in metres.

    Attributes:
        shape: "profile".
        s: stations from the nose tip, which is 0, to the base, increasing [m].
        r: radii there [m]; 0 at an end only.
        file: CSV file with the header s,r in metres, instead of s and r.
    """

    shape: Literal["profile"] = "profile"
    s: tuple[Length, ...] = Field(fail_fast=True, min_length=2)
    r: tuple[Length, ...] = Field(fail_fast=True, min_length=2)

    @model_validator(mode="before")
    @classmethod
    def _table_from_file(cls, values: Any, info: ValidationInfo) -> Any:
        if not isinstance(values, dict) or "file" not in values:
            return values
        if "s" in values or "r" in values:
            raise ValueError("file and s or r cannot be combined: a profile is given either by file or by s and r")
        columns = read_columns(input_file(values["file"], info), {"s": Length, "r": Length}, ("s", "r"))
        rest = {key: value for key, value in values.items() if key != "file"}
        return rest | {name: column.tolist() for name, column in columns.items()}

    @classmethod
    def _keys(cls) -> list[str]:
        return [*super()._keys(), "file"]

    @model_validator(mode="after")
    def _is_a_profile(self) -> Self:
        if len(self.s) != len(self.r):
            raise ValueError(f"got stations s: {len(self.s)}, radii r: {len(self.r)}, but each s needs one r")
        s, r = np.array(self.s), np.array(self.r)
        if s[0] != 0.0 or (np.diff(s) <= 0.0).any():
            raise ValueError(f"got stations s from {s[0]:g} to {s[-1]:g} m, but they must increase from 0")
        inner = np.array([False, *[True] * (len(r) - 2), False])
        if (bad := (r < 0.0) | (inner & (r == 0.0)) | (r.max() == 0.0)).any():
            raise ValueError(
                f"got r = {r[bad][0]:g} m in row {bad.argmax() + 1}, but r must be positive, or 0 at an end"
            )
        return self

    @property
    def length(self) -> float:
        return self.s[-1]

    @property
    def max_radius(self) -> float:
        return max(self.r)

    @property
    def breaks(self) -> tuple[float, ...]:
        """The stations between nose and base [m]."""
        return self.s[1:-1]

    def radius(self, s: Array) -> Array:
        return np.interp(s, self.s, self.r)


AnyCore = Annotated[PolynomialCore | OgiveCore | ConeCore | ProfileCore, Field(discriminator="shape")]
