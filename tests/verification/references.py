"""Closed forms and quadratures to compare the simulation with; nothing here uses warpimpact.

Section numbers (§) are those of docs/model.md. Everything is SI, angles are radians. A core flies straight along the
plate's normal here, so one coordinate is enough: the depth X of its tip below the front face. Station s counts from the
tip, and section s lies at depth X − s. Plates take the keywords of a scene: thickness h [m], resistance Y [Pa],
shear_coefficient η, degradation β, degradation_interval Δt_β [s], degradation_length ℓ [m].
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import pairwise
from math import atan, ceil, log1p, pi, sqrt

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import quad, solve_ivp
from scipy.interpolate import CubicSpline
from scipy.special import exprel

Array = NDArray[np.float64]

# The paper's core (§2): r(s) = c0 + c1 s + c2 s², cut at the length that gives the stated mass. Behind the
# shoulder, the station s_R of the largest radius R, a core in straight flight does not advance into material.
PAPER_COEFFICIENTS = (3.0e-4, 0.24, -5.29)
PAPER_LENGTH = 27.86e-3  # [m]
PAPER_MASS = 4.0e-3  # [kg]
PAPER_SHOULDER = 0.24 / (2 * 5.29)  # [m]
PAPER_LARGEST_RADIUS = 3.0e-4 + 0.24**2 / (4 * 5.29)  # [m]


def paper_radius(s: ArrayLike) -> Array:
    """Radius r(s) of the paper's core [m] at stations s [m]; same shape."""
    return np.polynomial.polynomial.polyval(np.asarray(s, dtype=float), PAPER_COEFFICIENTS)


@dataclass(frozen=True)
class Nose:
    """A nose before what is not in contact in straight flight: a cylindrical shank or a boat tail."""

    radius: Callable[[float], float]  # r(s) [m]
    slope: Callable[[float], float]  # dr/ds
    length: float  # [m]


PAPER_NOSE = Nose(
    radius=lambda s: float(paper_radius(s)),
    slope=lambda s: PAPER_COEFFICIENTS[1] + 2 * PAPER_COEFFICIENTS[2] * s,
    length=PAPER_SHOULDER,
)

# --- The paper's core through a solid plate: normal stress Y, friction η Y (§6.1 to 6.3) ---


def solid_plate_residual(
    *,
    velocity: float,
    thickness: float,
    resistance: float,
    shear_coefficient: float,
    onset: float = 0.0,
    nose: Nose | None = None,
    mass: float = PAPER_MASS,
) -> float:
    """Residual velocity [m/s] without degradation (§6.1, 6.2), from the work of the contact:

        m (v0² − v²)/2 = Y h 2π [r(0)²/2 + ∫₀^{s_R} share (r' + η) r ds],    share = min(1, r'/(κ √(1 + r'²))),

    κ the `onset`, s_R the end of the nose, by default the paper's up to its shoulder. What is parallel to the flight,
    as a shank is, does not touch. With κ → 0 it is m (v0² − v²)/2 = Y h [πR² + 2πη ∫₀^{s_R} r ds].

    Raises ValueError where the core is arrested.
    """
    nose = nose or PAPER_NOSE

    def per_station(s: float) -> float:
        return share_of_contact(nose.slope(s), onset) * (nose.slope(s) + shear_coefficient) * nose.radius(s)

    # Where the share gets less than 1 it has a kink: within the last tenth in any nose that runs into its shoulder.
    panels = (0.0, *nose.length * (1.0 - 0.1 * np.linspace(1.0, 0.0, 64) ** 2))
    integral = sum(quad(per_station, low, high)[0] for low, high in pairwise(panels))
    area = 2 * pi * (nose.radius(0.0) ** 2 / 2 + integral)
    square = velocity**2 - 2 * resistance * thickness * area / mass
    if square < 0:
        raise ValueError("the core is arrested")
    return sqrt(square)


def share_of_contact(slope: float, onset: float) -> float:
    """Share of a ring of slope r' in straight flight that is in contact (§4): min(1, n_x/κ), n_x = r'/√(1 + r'²)."""
    normal = max(slope, 0.0) / sqrt(1 + slope**2)
    return 1.0 if normal >= onset and normal > 0.0 else normal / onset if onset else 0.0


def nonlocal_degradation_residual(
    *,
    velocity: float,
    thickness: float,
    resistance: float,
    shear_coefficient: float,
    degradation: float,
    degradation_interval: float,
    degradation_length: float,
    resolution: int = 8,
) -> float:
    """Residual velocity [m/s] with degradation at a finite ℓ (§4), `resolution` radial intervals per ℓ.

    The surface in contact, stations X − h to X short of the shoulder, covers the annulus a < r < b of the
    plate once: ρ = 1 there and 0 elsewhere. With D_R(p) the tent K around p integrated over the disc r < R,

        v dT/dX = D_b − D_a,        m v dv/dX = −∫ 2πr (dr/ds + η) Ȳ(r(s)) ds − ∫_{nose disc} 2πr Ȳ(r) dr,

    Ȳ(r) the mean of Y β^(T/Δt_β) over a circle. T is carried at polar points: equidistant in r with a spline
    between them, and Gauss points in φ over an eighth of the turn, of which K's symmetry makes the rest. At 8
    intervals per ℓ the result is good to 2e-3 m/s for ℓ ≤ 0.5 mm.

    Towards ℓ → 0 the local limit is reached as ℓ without friction, but only as √ℓ with it: the last √(ℓ/|c2|)
    of length before the shoulder lies within ℓ of the rim, where T grows at about half the rate.

    Raises ValueError where the core is arrested.
    """
    intervals = ceil(resolution * PAPER_LARGEST_RADIUS / min(degradation_length, PAPER_LARGEST_RADIUS))
    nodes = np.linspace(0, PAPER_LARGEST_RADIUS, intervals + 1)
    angles, angle_weights = _gauss(0, pi / 4, 6)
    y, z = nodes[:, None] * np.cos(angles), nodes[:, None] * np.sin(angles)

    def rate(depth: float, state: Array, nose_disc_in: bool) -> Array:
        v, exposure = state[0], state[1:].reshape(y.shape)
        degraded = resistance * degradation ** (exposure / degradation_interval)
        mean = CubicSpline(nodes, degraded @ angle_weights / (pi / 4))
        rear, front = max(depth - thickness, 0.0), min(depth, PAPER_SHOULDER)
        s, weights = _gauss(rear, front, 24)
        force = weights @ (_paper_force_per_station(s, shear_coefficient) * mean(paper_radius(s)))
        growth = tent_over_disc(y, z, float(paper_radius(front)), degradation_length)
        if nose_disc_in:
            r, weights = _gauss(0, paper_radius(0.0), 8)
            force += weights @ (2 * pi * r * mean(r))
        else:
            growth -= tent_over_disc(y, z, float(paper_radius(rear)), degradation_length)
        return np.concatenate([[-force / (PAPER_MASS * v)], growth.ravel() / v])

    breaks = sorted([0.0, thickness, PAPER_SHOULDER, PAPER_SHOULDER + thickness])
    state = np.concatenate([[velocity], np.zeros(y.size)])
    for start, stop in pairwise(breaks):
        panel = partial(rate, nose_disc_in=stop <= thickness)
        # T is only as smooth as the tent, so a step of high order has no advantage.
        state = _march(panel, (start, stop), state, method="RK45", rtol=1e-6)
    return float(state[0])


def tent_over_disc(y: Array, z: Array, radius: float, length: float) -> Array:
    """∫ K(y − y', z − z') over the disc y'² + z'² < radius², K(y, z) = (1 − |y|/ℓ)₊ (1 − |z|/ℓ)₊ / ℓ² (§4).

    The chord along y' in closed form, then Gauss's rule in θ, z' = radius sin θ, on either side of the tent's
    ridge. Points y, z [m] of one shape, 0 ≤ z ≤ y so that the chords' ends near them are crossed steeply; the
    result, from 0 to 1, has that shape.
    """
    total = np.zeros(y.shape)
    y_column, z_column = y[..., None], z[..., None]
    for low, high in ((z - length, z), (z, z + length)):
        theta_low, theta_high = (np.arcsin(np.clip(end / radius, -1, 1)) for end in (low, high))
        theta, weights = _gauss(theta_low, theta_high, 12)
        half_chord = radius * np.cos(theta)
        far, near = (y_column + half_chord) / length, (y_column - half_chord) / length
        along_y = _tent_integral(far) - _tent_integral(near)
        along_z = (1 - np.abs(z_column - radius * np.sin(theta)) / length) / length
        total += np.sum(weights * half_chord * along_z * along_y, axis=-1)
    return total


def _tent_integral(u: Array) -> Array:
    """∫ (1 − |x|)₊ dx from −∞ to u; same shape."""
    u = np.clip(u, -1, 1)
    return 0.5 + u - u * np.abs(u) / 2


def _paper_force_per_station(s: ArrayLike, shear_coefficient: float) -> Array:
    """Axial force per resistance and station, 2πr (dr/ds + η) [m], at stations s [m]; same shape.

    A ring of surface dS has |n_x| dS = 2πr dr; its friction, along the meridian, has the axial part 2πr η ds.
    """
    _, c1, c2 = PAPER_COEFFICIENTS
    return 2 * pi * paper_radius(s) * (c1 + 2 * c2 * np.asarray(s) + shear_coefficient)


# --- Velocity-dependent stress σ = a0 + a2 (v·n)² on a pointed core in a thick plate (§4, 6.4; Poncelet) ---


def cone_nose(*, diameter: float, length: float) -> Nose:
    """A cone: r = s · diameter / (2 length)."""
    slope = diameter / (2 * length)
    return Nose(radius=lambda s: slope * s, slope=lambda _: slope, length=length)


def ogive_nose(*, diameter: float, crh: float) -> Nose:
    """A tangent ogive: an arc of radius crh · diameter that runs into the shank without a kink."""
    arc = crh * diameter
    length = diameter * sqrt(crh - 0.25)

    def height(s: float) -> float:
        return sqrt(arc**2 - (length - s) ** 2)

    return Nose(
        radius=lambda s: height(s) - arc + diameter / 2, slope=lambda s: (length - s) / height(s), length=length
    )


@dataclass(frozen=True)
class Poncelet:
    """Straight flight through a plate thicker than the nose: m v dv/dX = −(F0 + F2 v²) once the nose is in.

    A ring's normal has the axial part n_x = r'/√(1 + r'²), the ring carries σ = a0 + a2 v² n_x² and η σ:

        F0 = ∫ a0 2πr (r' + η) ds,        F2 = ∫ a2 2πr (r' + η) r'²/(1 + r'²) ds        over the nose,

    each ring by its share of contact where there is an onset κ.

    While the nose enters or leaves, the integrals run over the stations inside the plate. a0 > 0; a2, η ≥ 0.
    """

    nose: Nose
    mass: float  # [kg]
    velocity: float  # at impact [m/s]
    static_stress: float  # a0 [Pa]
    quadratic_stress: float  # a2 [kg/m³]
    shear_coefficient: float = 0.0
    onset: float = 0.0

    @cached_property
    def nose_in(self) -> tuple[float, ...]:
        """(v [m/s], F0 [N], F2 [kg/m], time since impact [s]) when the nose is just inside, X = nose.length.

        Raises ValueError where the core comes to rest before.
        """
        return self._cross_face((self.velocity, 0.0, 0.0, 0.0), sign=1)

    def velocity_at(self, depth: ArrayLike) -> Array:
        """v [m/s] at depths X [m] between nose.length and the depth of rest or the rear face; same shape.

        v² = v_i² e^(−κx) − (2 F0/m) (1 − e^(−κx))/κ, x = X − nose.length, κ = 2 F2/m, v_i = v(nose.length).
        """
        v, static, quadratic, _ = self.nose_in
        x = np.asarray(depth, dtype=float) - self.nose.length
        decay = 2 * quadratic / self.mass * x
        return np.sqrt(v**2 * np.exp(-decay) - 2 * static / self.mass * x * exprel(-decay))

    @property
    def depth_of_rest(self) -> float:
        """X [m] of the tip at rest: nose.length + m/(2 F2) ln(1 + F2 v_i²/F0)."""
        v, static, quadratic, _ = self.nose_in
        ratio = quadratic * v**2 / static
        return self.nose.length + self.mass * v**2 / (2 * static) * (log1p(ratio) / ratio if ratio else 1.0)

    @property
    def time_of_rest(self) -> float:
        """Time from impact to rest [s]: the entry's plus m/√(F0 F2) · arctan(v_i √(F2/F0))."""
        v, static, quadratic, entry = self.nose_in
        ratio = v * sqrt(quadratic / static)
        return entry + self.mass * v / static * (atan(ratio) / ratio if ratio else 1.0)

    def residual_velocity(self, thickness: float) -> float:
        """v [m/s] when the nose has left a plate of nose.length ≤ h < depth_of_rest [m].

        Raises ValueError where the core is arrested while the nose leaves.
        """
        _, static, quadratic, _ = self.nose_in
        return self._cross_face((float(self.velocity_at(thickness)), static, quadratic, 0.0), sign=-1)[0]

    def _cross_face(self, start: tuple[float, ...], sign: int) -> tuple[float, ...]:
        """(v, F0, F2, time) once the nose has crossed a face: its rings join (1) or leave (−1) contact."""

        def rate(s: float, state: Array) -> list[float]:
            v, static, quadratic, _ = state
            slope = self.nose.slope(s)
            share = share_of_contact(slope, self.onset)
            ring = sign * 2 * pi * self.nose.radius(s) * share * (slope + self.shear_coefficient)
            return [
                -(static + quadratic * v**2) / (self.mass * v),
                ring * self.static_stress,
                ring * self.quadratic_stress * slope**2 / (1 + slope**2),
                1 / v,
            ]

        return tuple(_march(rate, (0.0, self.nose.length), np.array(start), rtol=1e-10).tolist())


# --- Quadrature ---


def _gauss(low: ArrayLike, high: ArrayLike, order: int) -> tuple[Array, Array]:
    """Gauss–Legendre points and weights from low to high, both (...): each of shape (..., order)."""
    points, weights = np.polynomial.legendre.leggauss(order)
    middle, half = (np.add(low, high) / 2)[..., None], (np.subtract(high, low) / 2)[..., None]
    return middle + half * points, half * weights


def _march(
    rate: Callable[[float, Array], ArrayLike],
    span: tuple[float, float],
    state: Array,
    *,
    method: str = "DOP853",
    rtol: float,
) -> Array:
    """Solve d(state)/dX = rate(X, state), state[0] the speed: the last state.

    Raises ValueError where the core comes to rest on the way: dv/dX has no bound there.
    """
    # The other states, in SI, are of order 1e-6 or larger, so rtol is what counts.
    solution = solve_ivp(rate, span, state, method, rtol=rtol, atol=1e-6 * rtol)
    if not solution.success:
        raise ValueError("the core is arrested")
    return np.asarray(solution.y[:, -1])
