"""From a scene to arrays: numerics with every choice made, rings of the core, tile of the plate, filter."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import ndimage

from warpimpact.scene import (
    CirclePattern,
    ConeCore,
    Core,
    Impact,
    MaskPattern,
    Numerics,
    OgiveCore,
    Plate,
    PolynomialCore,
    ProfileCore,
    Scene,
    SlotPattern,
    TrianglePattern,
)
from warpimpact.solver import arrays
from warpimpact.solver.arrays import onset_jump
from warpimpact.solver.resolution import FASTEST_DECAY, FIDELITIES, NODAL, SLENDER, WEAKENING, decay_rate, resolve
from warpimpact.solver.rings import BEHIND, azimuths_of, rings_of
from warpimpact.solver.tile import BLUR, FINER, SUBSAMPLES, tent_taps, tile_of

PAPER = PolynomialCore(coefficients=(3.0e-4, 0.24, -5.29), length=27.86e-3, density=7850.0)
OGIVE = OgiveCore(diameter=6.17e-3, crh=3.0, length=27.0e-3, density=7850.0)
CONE = ConeCore(diameter=6.0e-3, length=20.0e-3, cone_length=12.0e-3, density=7850.0)
TABLE = ProfileCore(s=(0.0, 3e-3, 11e-3, 20e-3), r=(1e-3, 2e-3, 3e-3, 2.5e-3), density=7850.0)
CORES = pytest.mark.parametrize("core", [PAPER, OGIVE, CONE, TABLE], ids=["paper", "ogive", "cone", "table"])
PLATE = Plate(thickness=4e-3, resistance=2.6e9, degradation_length=0.6e-3)
SCENE = Scene(core=PAPER, target=PLATE)
PATTERNS = [
    SlotPattern(length=12e-3, width=4e-3, spacing=(8e-3, 16e-3), staggered=True),
    CirclePattern(diameter=5e-3, spacing=(7.1e-3, 9.3e-3)),
    TrianglePattern(side=6e-3, spacing=(8e-3, 8e-3), staggered=True),
]


# --- Resolution ---


@pytest.mark.parametrize("name", FIDELITIES)
def test_fidelity_fills_in_what_is_not_given(name: str) -> None:
    fidelity = FIDELITIES[name]
    resolution = resolve(Numerics(fidelity=name), SCENE)
    assert not resolution.nodal
    assert resolution.time_step is None
    assert (resolution.patches_axial, resolution.patches_around) == (
        fidelity.patches_axial,
        fidelity.patches_around,
    )
    assert resolution.grid_spacing == pytest.approx(0.6e-3 / fidelity.cells_per_length)
    assert resolution.double is fidelity.double


@pytest.mark.parametrize("scheme", ["consistent", "nodal"])
@pytest.mark.parametrize(
    ("name", "value"),
    [("time_step", 3e-7), ("patches_axial", 10), ("patches_around", 20), ("grid_spacing", 0.1e-3)],
)
def test_single_setting_goes_before_fidelity_and_scheme(name: str, value: float, scheme: str) -> None:
    given: dict[str, Any] = {"scheme": scheme, "fidelity": "reference"}
    plain = resolve(Numerics(**given), SCENE)
    changed = resolve(Numerics(**given, **{name: value}), SCENE)
    assert getattr(changed, name) == value
    assert {k for k in vars(plain) if getattr(plain, k) != getattr(changed, k)} == {name}


@pytest.mark.parametrize(("precision", "double"), [("single", False), ("double", True)])
@pytest.mark.parametrize("fidelity", FIDELITIES)
def test_precision_goes_before_fidelity(fidelity: str, precision: str, double: bool) -> None:
    assert resolve(Numerics(fidelity=fidelity, precision=precision), SCENE).double is double


@pytest.mark.parametrize("fidelity", FIDELITIES)
def test_nodal_scheme_has_the_paper_s_own_resolution(fidelity: str) -> None:
    resolution = resolve(Numerics(scheme="nodal", fidelity=fidelity), SCENE)
    assert resolution.nodal
    assert {name: getattr(resolution, name) for name in NODAL} == NODAL
    assert (resolution.patches_axial, resolution.patches_around) == (36, 36)
    assert (resolution.grid_spacing, resolution.time_step) == (1e-5, 1e-6)


def test_way_per_step_follows_the_plate_or_a_core_shorter_than_it() -> None:
    way = 800.0 * resolve(Numerics(), SCENE).step_at(800.0, 0.0, np.array([1e-3, 1.0]), np.inf)
    standard = FIDELITIES["standard"].travel
    np.testing.assert_allclose(way, [standard * 1e-3, standard * SLENDER * PAPER.length])


def test_step_is_bounded_by_what_contact_takes_off_the_resistance() -> None:
    resolution, velocity = resolve(Numerics(), SCENE), 800.0
    free = resolution.step_at(velocity, 0.0, PLATE.thickness, np.inf)
    for degradation, interval in ((1.0, 1e-6), (0.9, 1e-6), (0.05, 1e-6), (0.05, 1e-9), (0.0, 1e-6)):
        plate = PLATE.model_copy(update={"degradation": degradation, "degradation_interval": interval})
        step = resolution.step_of(Impact(velocity=velocity), plate)
        bound = np.inf if degradation == 1.0 else 0.0
        if 0.0 < degradation < 1.0:
            bound = WEAKENING * FIDELITIES["standard"].travel * interval / -np.log(degradation)
        assert step == pytest.approx(min(free, max(bound, 0.25 * free)))


def test_onset_is_a_share_of_what_a_wall_does_in_one_step() -> None:
    # One patch of wall, 2R × h, at full contact: a0·2R·h/m.
    mass = PAPER.mass_properties.mass
    wall = 2 * PAPER.max_radius * 4e-3
    longest = 2 * PAPER.max_radius * PAPER.length
    jumps = onset_jump(PAPER, np.array([4e-3, 1.0]), mass * np.array([1.0, 2.0]), np.array([2.6e9, 1e9]))
    share = arrays.ONSET / mass
    np.testing.assert_allclose(jumps, [share * 2.6e9 * wall, share * 0.5e9 * longest])
    assert onset_jump(PAPER, 4e-3, mass, 0.0) > 0.0


def test_decay_rate_is_that_of_an_interval_of_contact() -> None:
    rates = decay_rate(np.array([0.8, 1.0, 0.0]), 2e-6)
    np.testing.assert_allclose(0.8, np.exp(rates[0] * 2e-6), rtol=1e-15)
    assert rates[1] == 0.0
    assert rates[2] == -FASTEST_DECAY


# --- Rings ---


@CORES
def test_rings_close_the_surface(core: Core) -> None:
    around = 16
    rings = rings_of(core, 20, around)
    assert around * rings.area_axial.sum() == pytest.approx(0.0, abs=1e-12 * np.pi * core.max_radius**2)
    # Seen from the side a core shows 2 ∫ r ds; azimuths of the patches are those of their middles.
    s, weights = np.polynomial.legendre.leggauss(200)
    shadow = core.length * core.radius(core.length * (1 + s) / 2) @ weights
    facing = np.cos(2 * np.pi * (np.arange(around) + 0.5) / around).clip(0).sum()
    assert facing * rings.area_radial.sum() == pytest.approx(shadow, rel=1e-4)


@pytest.mark.parametrize("core", [OGIVE, CONE], ids=["ogive", "cone"])
def test_forward_areas_make_the_disc_of_the_largest_radius(core: Core) -> None:
    rings = rings_of(core, 20, 16)
    forward = 16 * rings.area_axial.clip(0).sum()
    assert forward == pytest.approx(np.pi * core.max_radius**2, rel=1e-12)


@CORES
def test_volume_of_the_rings_converges_to_the_core_s(core: Core) -> None:
    # V = ⅓ ∮ x·dA with one point per patch: second order in the rings.
    volume = core.mass_properties.mass / 7850.0
    errors = []
    for axial in (16, 32, 64):
        rings = rings_of(core, axial, 256)
        found = 256 / 3 * (rings.station @ rings.area_axial + rings.radius @ rings.area_radial)
        errors.append(abs(found / volume - 1))
    assert errors[0] < 0.01
    assert errors[2] < max(errors[0] / 8, 1e-4)


@CORES
def test_rings_lie_end_to_end_with_the_breaks_on_their_edges(core: Core) -> None:
    rings = rings_of(core, 20, 16)
    station = core.mass_properties.centre_of_mass - rings.station
    lateral = rings.half_axial != 0
    low, high = (station[lateral] + sign * rings.half_axial[lateral] for sign in (1, -1))
    np.testing.assert_allclose(low[1:], high[:-1], atol=1e-15)
    assert low[0] == pytest.approx(0.0, abs=1e-15)
    assert high[-1] == pytest.approx(core.length)
    for station_of_break in core.breaks:
        assert np.abs(high - station_of_break).min() < 1e-12
    np.testing.assert_allclose(rings.radius[lateral], core.radius(station[lateral]), rtol=1e-12)
    np.testing.assert_allclose(-rings.half_radial[lateral], (core.radius(low) - core.radius(high)) / 2, atol=1e-12)


def test_discs_are_rings_from_the_axis_to_the_rim() -> None:
    rings = rings_of(TABLE, 20, 16)
    disc = rings.half_axial == 0
    station = TABLE.mass_properties.centre_of_mass - rings.station[disc]
    for at, radius, facing in ((0.0, 1e-3, 1), (20e-3, 2.5e-3, -1)):
        here = np.abs(station - at) < 1e-12
        assert 16 * rings.area_axial[disc][here].sum() == pytest.approx(facing * np.pi * radius**2)
        outer = (rings.radius + np.abs(rings.half_radial))[disc][here]
        assert outer.max() == pytest.approx(radius)
    np.testing.assert_array_equal(rings.area_radial[disc], 0.0)
    assert len(rings_of(TABLE, 20, 16, discs=False).station) == 20


@pytest.mark.parametrize("around", [4, 5, 16])
def test_azimuths_are_their_own_mirror_images_half_a_patch_on_from_ring_to_ring(around: int) -> None:
    even, odd = azimuths_of(around).reshape(2, around)
    np.testing.assert_allclose(np.diff(even), 2 * np.pi / around)
    np.testing.assert_allclose(even - odd, np.pi / around)
    for azimuths in (even, odd):
        directions = np.exp(1j * azimuths)
        mirrored = directions.conj()
        apart = np.abs(directions[:, None] - mirrored)
        np.testing.assert_allclose(apart.min(axis=1), 0.0, atol=1e-12)


@CORES
def test_turns_are_half_the_change_of_the_normal_over_a_ring(core: Core) -> None:
    # From the middles of neighbouring rings: exact to second order within a smooth stretch of the profile.
    rings = rings_of(core, 400, 16)
    lateral = rings.half_axial != 0
    station = core.mass_properties.centre_of_mass - rings.station[lateral]
    half = np.abs(rings.half_axial[lateral])
    inside = 1e-4 * half

    def normals(at: Any) -> Any:
        slope = (core.radius(at + inside) - core.radius(at - inside)) / (2 * inside)
        return np.stack([slope, np.ones_like(slope)]) / np.hypot(slope, 1.0)

    low, high = normals(station - 0.99 * half), normals(station + 0.99 * half)
    turns = np.stack([rings.turn_axial, rings.turn_radial])[:, lateral]
    np.testing.assert_allclose(turns, (high - low) / 2, rtol=0.02, atol=1e-6)
    np.testing.assert_array_equal(np.stack([rings.turn_axial, rings.turn_radial])[:, ~lateral], 0.0)


@CORES
def test_rings_are_shorter_behind_the_widest_station(core: Core) -> None:
    count = 40
    rings = rings_of(core, count, 16, discs=True)
    lateral = rings.half_axial != 0
    station = core.mass_properties.centre_of_mass - rings.station[lateral]
    length = -2 * rings.half_axial[lateral]
    stations = np.linspace(0.0, core.length, 100_001)
    widest = stations[np.argmax(core.radius(stations) >= (1 - 1e-9) * core.max_radius)]
    assert length.sum() == pytest.approx(core.length)
    for part, longest in ((station < widest, 1.0), (station > widest, BEHIND)):
        if part.any():
            assert length[part].mean() == pytest.approx(longest * core.length / count, rel=0.15)


# --- Tile ---


@pytest.mark.parametrize("pattern", PATTERNS, ids=lambda pattern: pattern.shape)
def test_tile_has_the_plate_s_share_of_material(pattern: Any) -> None:
    plate = PLATE.model_copy(update={"pattern": pattern})
    spacing = 0.25e-3 / FINER  # the tile's, where the grid's is 0.25 mm
    tile = tile_of(plate, spacing)
    assert tile.material.mean() == pytest.approx(1 - pattern.open_area, abs=5e-4)
    assert tile.material.min() == 0.0
    assert tile.material.max() == 1.0
    assert max(tile.dy, tile.dz) <= spacing
    extent = np.array(tile.material.shape) * (tile.dy, tile.dz)
    np.testing.assert_allclose(extent, pattern.period, rtol=1e-12)


def test_tile_looks_closely_only_where_edges_are_and_misses_none() -> None:
    holes = [["0 mm", "0 mm", "20 deg"], ["6 mm", "3 mm", "-70 deg"]]
    hairlines = SlotPattern(length="6 mm", width="0.05 mm", spacing=["12 mm", "8 mm"], holes=holes)
    plate = PLATE.model_copy(update={"pattern": hairlines})
    tile = tile_of(plate, 0.25e-3)
    samples = SUBSAMPLES
    y, z = (
        (np.arange(samples * n) + 0.5) * d / samples
        for n, d in zip(tile.material.shape, (tile.dy, tile.dz), strict=True)
    )
    solid = ~hairlines.is_hole(y[:, None], z)
    sharp = solid.reshape(tile.material.shape[0], samples, -1, samples).mean(axis=(1, 3))
    shares = ndimage.uniform_filter(sharp, BLUR, mode="wrap")
    np.testing.assert_allclose(tile.material, shares, rtol=0, atol=1.5 / samples**2)  # rounding decides on edges
    assert (~np.isclose(tile.material, shares)).mean() < 1e-2
    assert 0.0 < 1.0 - tile.material.mean() < 0.01


def test_tile_is_kept_for_the_next_shots_but_not_for_another_mask_of_the_same_name(tmp_path: Path) -> None:
    def masked(hole: tuple[int, int]) -> Plate:
        mask = np.ones((4, 4), dtype=np.uint8)
        mask[hole] = 0
        np.save(tmp_path / "mask.npy", mask)
        pattern = MaskPattern(file=str(tmp_path / "mask.npy"), cell_size=1e-3)
        return PLATE.model_copy(update={"pattern": pattern})

    one, other = masked((0, 0)), masked((2, 1))
    assert tile_of(one, 0.5e-3) is tile_of(one.model_copy(update={"thickness": 1.0}), 0.5e-3)
    assert (tile_of(one, 0.5e-3).material != tile_of(other, 0.5e-3).material).any()


def test_tile_tells_material_from_holes_by_area() -> None:
    # A 5 mm hole on the origin, which is a corner of cell (0, 0); cells near the edge are fractions.
    plate = PLATE.model_copy(update={"pattern": CirclePattern(diameter=5e-3, spacing=(8e-3, 10e-3))})
    tile = tile_of(plate, 0.5e-3)
    y, z = ((np.arange(n) + 0.5) * 0.5e-3 for n in tile.material.shape)
    distance = np.hypot(np.minimum(y, 8e-3 - y)[:, None], np.minimum(z, 10e-3 - z))
    diagonal = BLUR * 0.5e-3 / np.sqrt(2)
    assert (tile.material[distance < 2.5e-3 - diagonal] == 0).all()
    assert (tile.material[distance > 2.5e-3 + diagonal] == 1).all()
    assert ((tile.material > 0) & (tile.material < 1)).sum() > 8
    np.testing.assert_array_equal(tile.material, tile.material[::-1, ::-1])  # the pattern's own symmetry


def test_sharp_tile_takes_the_cells_centres() -> None:
    plate = PLATE.model_copy(update={"pattern": PATTERNS[2]})
    tile = tile_of(plate, 0.1e-3, sharp=True)
    y, z = ((np.arange(n) + 0.5) * d for n, d in zip(tile.material.shape, (tile.dy, tile.dz), strict=True))
    np.testing.assert_array_equal(tile.material, ~PATTERNS[2].is_hole(y[:, None], z))


def test_spacing_that_fits_the_period_is_kept() -> None:
    plate = PLATE.model_copy(update={"pattern": CirclePattern(diameter=5e-3, spacing=(7e-3, 9.1e-3))})
    assert tile_of(plate, 0.1e-3, sharp=True).material.shape == (70, 91)
    assert tile_of(plate, 0.1e-3).material.shape == (70, 92)  # even, for a lattice staggered by half a period


# --- Tent ---


@pytest.mark.parametrize("ratio", [2, 3, 8])
def test_taps_are_a_tent_of_the_half_width_that_scattering_and_reading_leave(ratio: int) -> None:
    # A tent of half-width m cells has (m² − 1)/6 at the nodes and, scattered into and read bilinearly, (m² + 1)/6.
    length = np.sqrt(ratio**2 + 1.0)
    offsets = np.arange(-ratio + 1, ratio)
    np.testing.assert_allclose(tent_taps(length * 0.1, 0.1), (1 - np.abs(offsets) / ratio) / ratio, rtol=1e-9)


@pytest.mark.parametrize("ratio", [1.415, 1.5, 1.9, 2.5, 3.7, 7.99])
def test_taps_keep_mass_and_second_moment(ratio: float) -> None:
    taps = tent_taps(ratio, 1.0)
    offsets = np.arange(len(taps)) - len(taps) // 2
    assert len(taps) % 2 == 1
    assert (taps > 0).all()
    np.testing.assert_allclose(taps, taps[::-1], rtol=1e-12)
    assert taps.sum() == pytest.approx(1.0)
    # Bilinear scattering and bilinear reading add a sixth of the cell's square each, on average.
    assert taps @ offsets**2 + 1 / 3 == pytest.approx(ratio**2 / 6, rel=1e-9)


@pytest.mark.parametrize("ratio", [0.2, 1.0, 1.414])
def test_length_within_scattering_and_reading_is_not_filtered(ratio: float) -> None:
    np.testing.assert_array_equal(tent_taps(ratio, 1.0), [1.0])
