"""Entries of the catalogue: their geometry, their evidence, and a user's own file."""

from pathlib import Path

import pytest

from warpimpact.analysis.numbers import text_of
from warpimpact.catalogue.catalogue import Catalogue, flow_entry
from warpimpact.catalogue.catalogue_view import catalogue_view, material_view, threat_view
from warpimpact.catalogue.entries import Material, Threat

THREATS = Catalogue().all(Threat)
CORES = [name for name, threat in THREATS.items() if threat.shape is not None]
OWN = """
[[threat]]
name = "steel cone"
core = { shape = "cone", diameter = "6 mm", length = "20 mm", mass = "1.5 g" }
known = { core = "measured" }

[[material]]
name = "plate A"
density = "7850 kg/m^3"
resistance = "2 GPa"
thickness_exponent = 0.25
shear_coefficient = 0.1
quadratic = 0.5
rows = { "steel cone" = 12 }
thickness_low = "3 mm"
thickness_high = "12 mm"
calibres_low = 0.5
calibres_high = 2.0
obliquity_high = "30 deg"
misfit = 0.02
"""


@pytest.fixture
def own(tmp_path: Path) -> Path:
    path = tmp_path / "own.toml"
    path.write_text(OWN, encoding="utf-8")
    return path


# Mass of the volume at the density of the material, beside the published mass. Where the length follows from the mass
# it is rounded to 0.01 mm; nose and length of the .30 AP M2 are second-hand, and its volume is 3.6 % too large.
@pytest.mark.parametrize("name", CORES)
def test_mass_of_the_geometry(name: str) -> None:
    threat = THREATS[name]
    assert threat.shape is not None
    assert threat.shape.mass_properties.mass == pytest.approx(threat.core_mass, rel=1e-9)
    by_volume = threat.shape.model_copy(update={"mass": None, "density": threat.core_density}).mass_properties.mass
    assert by_volume == pytest.approx(threat.core_mass, rel=0.04 if name == ".30 AP M2" else 5e-4)


@pytest.mark.parametrize("name", THREATS)
def test_what_is_open_is_called_assumed(name: str) -> None:
    threat = THREATS[name]
    text = text_of(threat_view(threat))
    second_hand = [key for key, source in threat.known.items() if "second-hand" in source]
    for mark, keys in (("assumed", threat.assumed), ("quoted at second hand", second_hand)):
        for key in keys:
            assert key.replace("_", " ") in threat.evidence.partition(mark)[2].partition(";")[0]
            assert any(line.startswith(mark) and key.replace("_", " ") in line for line in text.splitlines())
    shaped = {"core", "nose", "length"} & {*threat.known, *threat.assumed}
    assert shaped or threat.shape is None  # no shape without a word on where it comes from


def test_own_entries(own: Path) -> None:
    catalogue = Catalogue.of(own)
    plate = catalogue.named(Material, "plate A")
    assert plate.resistance_at(16.0).median == pytest.approx(4e9)
    assert "12 limit velocities" in plate.evidence
    assert "steel cone" in text_of(catalogue_view(catalogue))
    assert "3 to 12 mm" in text_of(material_view(plate, is_own=catalogue.is_own(plate)))
    assert catalogue.named(Threat, "7.62x51 P80 AP") == THREATS["7.62x51 P80 AP"]


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("[[material]]", "[[materials]]", r"unknown key .materials.; allowed are threat, material"),
        ('"2 GPa"', '"2 mm"', r"material\[0\]: resistance: got .2 mm."),
    ],
)
def test_own_entries_that_are_wrong(own: Path, old: str, new: str, sentence: str) -> None:
    own.write_text(OWN.replace(old, new), encoding="utf-8")
    with pytest.raises(ValueError, match=sentence):
        Catalogue.of(own)


@pytest.mark.parametrize(
    ("spelling", "name"),
    [
        ("7.62 mm APM2", ".30 AP M2"),
        ("Armox 500T", "ARMOX500"),
        ("7.62×39 BZ", "7.62x39 API BZ"),
    ],
)
def test_names_match_in_any_case_and_by_aliases(spelling: str, name: str) -> None:
    assert Catalogue().entry(spelling).name == name


@pytest.mark.parametrize(
    ("spelling", "sentence"),
    [
        ("RHA", r'several entries .*: "ARMOX370 Class 1", "BIS RHA300" or "BIS RHA360"; name one'),
        ("Armox", r'did you mean "ARMOX370 Class 1", .* or "ARMOX ADVANCE"\?'),
        ("30 AP M2", r'did you mean "\.30 AP M2"\?'),
        ("30 mm AP M2", "in the catalogue; warpimpact catalogue lists all"),
        ("AA2139-T6", "in the catalogue; warpimpact catalogue lists all"),
    ],
)
def test_of_an_unclear_name_those_it_may_mean_are_listed(spelling: str, sentence: str) -> None:
    with pytest.raises(ValueError, match=sentence):
        Catalogue().entry(spelling)


def test_a_material_without_constants_of_the_continuum_gets_a_reason() -> None:
    with pytest.raises(ValueError, match=r"its published limits \(38\.7 mm and more\) were not computed by elements"):
        flow_entry("aa2139-t8")
