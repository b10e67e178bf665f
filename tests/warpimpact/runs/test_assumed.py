"""Hits under assumptions: what each alternative changes, that its hits are those of a campaign that has it, and what
results, comparisons and commands say of them."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray

import warpimpact
from warpimpact import Campaign, Hits, Impact, Plate, Scene, make_shots, simulate
from warpimpact.analysis.assumptions_view import assumptions_lines, assumptions_view
from warpimpact.analysis.comparison import compare
from warpimpact.analysis.comparison_text import comparison_text
from warpimpact.analysis.estimates import estimated
from warpimpact.campaign.alternatives import alternatives
from warpimpact.campaign.straight_passage import StraightPassage
from warpimpact.cli import main
from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.results.files import write
from warpimpact.results.measures import Measure
from warpimpact.runs import assumed
from warpimpact.scene import FreeSurface, Interaction, PolynomialCore
from warpimpact.view.view import text_of

SLOTS = {"shape": "slot", "length": "12 mm", "width": "4 mm", "spacing": ["8 mm", "16 mm"], "staggered": True}
WEAK = {"shear_coefficient": 0.05, "degradation": 0.8}
PLATE: dict[str, Any] = {"thickness": "4 mm", "resistance": "2.6 GPa", "pattern": SLOTS} | WEAK
SOLID = {"thickness": "4 mm", "resistance": "2.6 GPa"}
BASE = {"thickness": "8 mm", "resistance": "1 GPa", "gap": "5 mm"}
ON = {"compute": True, "hits": 16}
NODAL = {"scheme": "nodal"}
EDGES = "less resistance near edges, Y fitted with it"
TABLES: dict[str, Any] = {
    "title": "assumed",
    "core": {"shape": "ogive", "diameter": "6 mm", "crh": 3.0, "length": "27 mm", "mass": "4 g"},
    "plate": PLATE,
    "impact": {"velocity": "825 m/s"},
    "hits": {"count": 64},
    "numerics": {"level": 0},
    "output": {"standoffs": ["50 mm", "130 mm"], "solid_reference": False},
    "assumptions": ON,
}


def campaign(**changes: Any) -> Campaign:
    return Campaign.from_text(json.dumps(TABLES | changes), name="assumed", folder=Path())


def run(**changes: Any) -> xarray.Dataset:
    return warpimpact.run(campaign(**changes), device="cpu")


def names_of(**changes: Any) -> list[str]:
    return [one.name for one in alternatives(campaign(**changes))]


def test_each_alternative_changes_what_it_says_and_nothing_else() -> None:
    given = campaign()
    changed = {}
    for one in alternatives(given):
        tables = one.scene.model_dump(), given.scene.model_dump()
        layers = zip(*(table["target"]["layers"] for table in tables), strict=True)
        in_plate = {f"plate.{name}" for here, there in layers for name in here if here[name] != there[name]}
        others = {
            f"{table}.{name}"
            for table in ("core", "interaction", "record")
            for name in tables[0][table]
            if tables[0][table][name] != tables[1][table][name]
        }
        changed[one.name] = in_plate | others | {f"plate.{name}" for name, _ in one.layers} | {*one.turned}
    reach, rate = {"plate.degradation_length", "plate.degradation_depth"}, {"plate.degradation"}
    assert changed == {
        "Y at its low end": {"plate.resistance"},
        "Y at its high end": {"plate.resistance"},
        "no weakening (β = 1)": rate,
        "weakens half as fast": rate,
        "weakens twice as fast": rate,
        "weakening reaches half as far": reach,
        "weakening reaches twice as far": reach,
        "friction η = 0": {"plate.shear_coefficient"},
        "friction η = 0.1": {"plate.shear_coefficient"},
        "onset κ = 0": {"interaction.onset"},
        "onset κ = 0.02": {"interaction.onset"},
        EDGES: {"plate.resistance", "interaction.quadratic", "interaction.free_surface"} | rate,
        "5° more oblique": {"obliquity"},
        "2° of yaw": {"yaw"},
        "half the stand-off": {"record.standoffs"},
        "a core of 3 GPa": {"core.strength", "record.bending"},
    }


def test_what_a_campaign_does_not_have_is_not_assumed() -> None:
    assert not any("weak" in name for name in names_of(plate=SOLID))
    assert "weakening (β = 0.8 in 1 µs)" in names_of(plate=PLATE | {"degradation": 1.0})
    own_law = {"interaction": {"quadratic": 0.5}}
    for without in ({"plate": SOLID}, {"burst": {"count": 2, "spacing": "6 mm"}}, own_law, {"numerics": NODAL}):
        assert EDGES not in names_of(**without)
    drawn = {"distribution": "normal", "mean": "2.6 GPa", "std": "0.1 GPa"}
    assert not any(name.startswith("Y") for name in names_of(plate=PLATE | {"resistance": drawn}))
    assert "a core of 3 GPa" not in names_of(numerics=NODAL)
    scattered = {"distribution": "uniform", "low": "0 deg", "high": "10 deg"}
    assert "5° more oblique" not in names_of(impact={"velocity": "825 m/s", "obliquity": scattered})
    steep = campaign(impact={"velocity": "825 m/s", "obliquity": "83 deg"})
    (oblique,) = (one for one in alternatives(steep) if one.turned.keys() == {"obliquity"})
    assert not oblique.is_possible(steep.sampler().shots(0, 4))


def test_a_campaign_tells_its_own_alternatives() -> None:
    asked = {name: [] for name in ("degradation", "rate", "reach", "onset", "obliquity", "yaw", "strength")}
    own = asked | {"edges": False, "resistance": [0.5], "shear_coefficient": [0.2], "standoff": [0.25, 0.7, 1.0]}
    # At a quarter of 50 mm the core may still be in the plate.
    assert names_of(assumptions=own) == ["Y × 0.5", "friction η = 0.2", "0.7 × the stand-off"]


def test_the_catalogue_says_how_far_y_may_be_off() -> None:
    named = campaign(plate={"material": "HHA Class 1", "thickness": "6 mm"}, core={"threat": ".30 AP M2"})
    values = {one.name: dict(one.layers) for one in alternatives(named)}
    low, high = (values[f"Y at its {end} end"]["resistance", 0] for end in ("low", "high"))
    assert low * high == pytest.approx(named.plate.resistance**2)
    assert 1.1 < high / low < 1.3  # less than ± 30 %
    smooth, rough = (values[f"friction η = {friction}, Y fitted with it"] for friction in ("0", "0.1"))
    assert smooth["resistance", 0] > named.plate.resistance > rough["resistance", 0]


PASSAGES = [(0.0, 0.0, 728.99), (0.05, 0.0, 673.09), (0.05, 0.01, 674.94)]  # docs/model.md §6.1, §6.2
P80 = PolynomialCore(shape="polynomial", coefficients=[3e-4, 0.24, -5.29], length="27.86 mm", mass="4 g")


@pytest.mark.parametrize(("friction", "onset", "residual"), PASSAGES)
def test_a_straight_passage_meets_its_closed_form(friction: float, onset: float, residual: float) -> None:
    passage = StraightPassage(P80, Interaction(onset=onset), friction, 4e-3, 7850.0)
    assert passage.entry(2.6e9, residual) == pytest.approx(825.0, abs=0.1)
    limit = math.sqrt(825.0**2 - residual**2)  # a constant stress does the same work at any speed
    assert passage.entry(2.6e9) == pytest.approx(limit, abs=0.1)


@pytest.mark.parametrize("velocity", [825.0, 500.0])
def test_a_solid_plate_takes_as_much_under_a_law_that_is_fitted_with_it(velocity: float, device: str) -> None:
    # Straight hits on a solid plate. At 500 m/s the core is little faster than the limit.
    given, other = Interaction(), Interaction(linear=1.7, quadratic=0.5, free_surface=FreeSurface())
    y = StraightPassage(P80, given, 0.05, 4e-3, 7850.0).resistance_under(other, 0.02, 2.6e9, velocity)
    lost = []
    for law, friction, resistance in ((given, 0.05, 2.6e9), (other, 0.02, y)):
        plate = Plate(thickness=4e-3, resistance=resistance, shear_coefficient=friction, density=7850.0)
        shots = make_shots(Impact(velocity=velocity), Hits(count=1), plate)
        outcomes = simulate(Scene(core=P80, target=plate, interaction=law), shots, device=device)
        lost.append(velocity**2 - float(outcomes.residual_velocity[0]) ** 2)
    assert lost[0] == pytest.approx(lost[1], rel=2e-3)


def test_the_assumption_has_the_y_of_a_campaign_that_has_its_law() -> None:
    named = {
        "plate": {"material": "HHA Class 1", "thickness": "6 mm", "pattern": SLOTS},
        "core": {"threat": ".30 AP M2"},
    }
    named |= {"impact": {"velocity": "878 m/s", "obliquity": "30 deg"}}
    (other,) = (one for one in alternatives(campaign(**named)) if one.name == EDGES)
    given = campaign(**named, interaction={"quadratic": 1.0, "free_surface": {}})
    assert other.scene.target.layers[0].resistance == pytest.approx(given.plate.resistance, rel=1e-3)


(EDGED,) = (one.scene.target.layers[0].resistance for one in alternatives(campaign()) if one.name == EDGES)


def test_a_law_that_knows_edges_is_set_against_one_that_does_not() -> None:
    free = {"interaction": {"quadratic": 1.0, "free_surface": {}}}
    plate = PLATE | {"resistance": EDGED, "degradation": 1.0}
    (other,) = (one for one in alternatives(campaign(plate=plate, **free)) if "near edges" in one.name)
    assert other.name == "as much resistance near edges, Y fitted with it"
    assert other.scene.interaction == Interaction()
    assert other.scene.target.layers[0].resistance == pytest.approx(2.6e9, rel=1e-3)


OTHERWISE: dict[str, dict[str, Any]] = {
    "Y at its high end": {"plate": PLATE | {"resistance": "3.38 GPa"}},
    "no weakening (β = 1)": {"plate": PLATE | {"degradation": 1.0}},
    "weakening reaches twice as far": {"plate": PLATE | {"degradation_length": "1 mm", "degradation_depth": "8 mm"}},
    "friction η = 0": {"plate": PLATE | {"shear_coefficient": 0.0}},
    "onset κ = 0.02": {"interaction": {"onset": 0.02}},
    EDGES: {
        "interaction": {"quadratic": 1.0, "free_surface": {}},
        "plate": PLATE | {"resistance": EDGED, "degradation": 1.0},
    },
    "5° more oblique": {"impact": TABLES["impact"] | {"obliquity": "5 deg"}},
    "half the stand-off": {"output": TABLES["output"] | {"standoffs": ["25 mm", "65 mm"]}},
}


@pytest.mark.parametrize("kind", ["cell", "irreducible", "burst", "base"])
def test_hits_under_assumptions_are_those_of_a_campaign_that_has_them(kind: str) -> None:
    more: dict[str, Any] = {
        "cell": {},
        "irreducible": {"hits": {"count": 128, "irreducible": True}},
        "burst": {"burst": {"count": 2, "spacing": "6 mm"}},
        "base": {"layer": [BASE]},
    }[kind] | {"numerics": {"level": 4}}
    found = run(**more, assumptions=ON | {"strength": []})  # builds of bending cores are for another test
    names = json.loads(found.attrs[attr.ASSUMPTIONS])
    numbers = found[v.ASSUMED_HIT].values[found[v.ASSUMPTION].values == 0]
    assert len(numbers) == (64 if kind == "irreducible" else 16)  # at least 8 groups of 8 images
    few = ["no weakening (β = 1)", "5° more oblique"]
    chosen = OTHERWISE if kind == "cell" else {name: OTHERWISE[name] for name in few}
    listed = np.stack([found[name].values[numbers] for name in (v.HIT_Y, v.HIT_Z)], axis=1)
    for name, changes in chosen.items():
        own = more | changes | {"assumptions": {"compute": False}}
        if kind == "irreducible" and name == "5° more oblique":  # its hits are no images of each other
            expected = at_points(own, listed)
        else:
            expected = run(**own).isel(hit=numbers)
        rows = found[v.ASSUMPTION].values == names[name]
        assert found[v.ASSUMED_HIT].values[rows].tolist() == numbers.tolist()
        velocity, tilt = (found[f"assumed_{of_hits}"].values[rows] for of_hits in (v.RESIDUAL_VELOCITY, v.TILT))
        # A plate that does not weaken has another grid by itself.
        few_metres, few_degrees = (1.0, 1.0) if name == "no weakening (β = 1)" else (0.02, 0.05)
        assert velocity == pytest.approx(expected[v.RESIDUAL_VELOCITY].values, abs=few_metres), name
        assert tilt == pytest.approx(expected[v.TILT].values, abs=few_degrees, nan_ok=True), name
        assert np.array_equal(found["assumed_status"].values[rows], expected[v.STATUS].values)


def at_points(changes: dict[str, Any], points: np.ndarray) -> xarray.Dataset:
    """The result of a campaign at some points [m], shape (count, 2)."""
    file = Path("points.csv")
    file.write_text("hit_y,hit_z\n" + "".join(f"{y!r},{z!r}\n" for y, z in points.tolist()), encoding="utf-8")
    own = campaign(**changes | {"hits": {"count": 8}})
    return warpimpact.run(own.model_copy(update={"hits": Hits(sampling="list", file=file)}), device="cpu")


@pytest.fixture(autouse=True)
def _in_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_cores_that_would_break_are_those_of_a_campaign_with_that_strength() -> None:
    asked = ON | {"strength": ["1.5 GPa"]}
    strong = TABLES["core"] | {"strength": "1.5 GPa"}
    broken = run(core=strong, output=TABLES["output"] | {"bending": True}, assumptions={"compute": False})[v.BROKEN]
    (share,) = json.loads(run(assumptions=asked).attrs[attr.WOULD_BREAK]).values()
    assert share == pytest.approx(float(broken[:16].mean()))
    assert 0.0 < share < 1.0


def test_a_pilot_has_assumptions_and_a_given_resolution_has_none_unless_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(warpimpact.runs.run, "has_assumptions", assumed.has_assumptions)
    by_default = TABLES | {"assumptions": {}}
    assert v.ASSUMPTION not in run(**by_default)
    piloted = run(**by_default | {"numerics": {"fidelity": "draft"}})
    assert piloted.sizes["assumed"] == 15 * 64
    assert v.ASSUMPTION not in run(numerics={"fidelity": "draft"}, assumptions={"compute": False})
    note = text_of([assumptions_view(run(assumptions={}))])
    assert "not known: no hits were computed under them; [assumptions] compute = true" in note


def test_fewer_hits_are_taken_of_what_takes_long(monkeypatch: pytest.MonkeyPatch) -> None:
    many = {"compute": True}
    assert run(assumptions=many).sizes["assumed"] == 15 * 64
    monkeypatch.setattr(assumed, "ASSUMED_SECONDS", 1e-9)
    assert run(assumptions=many).sizes["assumed"] == 15 * 8
    assert run(assumptions=ON).sizes["assumed"] == 15 * 16  # as the campaign asks


def test_numbers_move_by_what_the_same_hits_tell() -> None:
    found = run()
    tilt = Measure.parse("mean(tilt@130mm)")
    estimate = estimated(found, [tilt])[tilt]
    names = json.loads(found.attrs[attr.ASSUMPTIONS])
    assert estimate.assumptions.keys() == names.keys()
    rows = found[v.ASSUMPTION].values == names["no weakening (β = 1)"]
    given = found[v.TILT].values[found[v.ASSUMED_HIT].values[rows], 1]
    move = float(np.mean(found["assumed_tilt"].values[rows, 1].astype(float)) - np.mean(given.astype(float)))
    assert estimate.assumptions["no weakening (β = 1)"] == pytest.approx(estimate.value + move)
    assert estimate.assumed == (min(estimate.assumptions.values()), max(estimate.assumptions.values()))
    share = Measure.parse("P(inclination@130mm > 30 deg)")
    assert all(0.0 <= number <= 1.0 for number in estimated(found, [share])[share].assumptions.values())
    (line,) = (line for line in assumptions_lines(found) if "tilt" in line)
    assert "no weakening (β = 1): " in line
    chosen = found.isel(hit=slice(32, 64))  # none of them was computed under assumptions
    assert not estimated(chosen, [tilt])[tilt].assumptions
    assert "none of these hits" in text_of([assumptions_view(chosen)])


def test_a_limit_moves_with_what_the_catalogue_leaves_open() -> None:
    named = {"plate": {"material": "HHA Class 1", "thickness": "6 mm"}, "core": {"threat": ".30 AP M2"}}
    text = json.dumps(TABLES | named | {"hits": {"count": 1}, "output": {"standoffs": ["50 mm"]}})
    file = Path("limit.toml")
    file.write_text(text, encoding="utf-8")
    assert main(["limit", str(file), "-o", "limit.nc", "--device", "cpu", "-q"]) == 0
    with xarray.open_dataset("limit.nc", group="assumed") as otherwise, xarray.open_dataset("limit.nc") as hits:
        names = json.loads(hits.attrs[attr.ASSUMPTIONS])
        shares = otherwise["assumed_limit_velocity"].values / hits["limit_velocity"].values[0]
    limits = dict(zip(names, shares, strict=True))
    known = campaign(**named)
    y = {one.name: one.layers["resistance", 0] for one in alternatives(known) if "Y at its" in one.name}
    for name, resistance in y.items():  # a solid plate: the limit goes with the root of Y
        assert limits[name] == pytest.approx(math.sqrt(resistance / known.plate.resistance), abs=3e-3)
    for friction in ("0", "0.1"):  # which published limits cannot tell apart
        assert limits[f"friction η = {friction}, Y fitted with it"] == pytest.approx(1.0, abs=5e-3)


def test_a_limit_of_a_plate_that_might_weaken_weakens_by_path() -> None:
    named = PLATE | {"degradation": 1.0, "degradation_length": "1 mm", "degradation_depth": "8 mm"}
    Path("limit.toml").write_text(json.dumps(TABLES | {"plate": named, "hits": {"count": 1}}), encoding="utf-8")
    assert main(["limit", "limit.toml", "-o", "limit.nc", "--device", "cpu", "-q"]) == 0
    with xarray.open_dataset("limit.nc", group="assumed") as otherwise, xarray.open_dataset("limit.nc") as hits:
        place = json.loads(hits.attrs[attr.ASSUMPTIONS])["weakening (β = 0.8 in 1 µs)"]
        assert otherwise["assumed_limit_velocity"].values[place] < 0.9 * hits["limit_velocity"].values[0]


def test_verdicts_are_counted_and_what_turns_them_over_is_named() -> None:
    thin = {"thickness": "1.25 mm", "pattern": {"shape": "circle", "diameter": "5.75 mm", "spacing": "7.25 mm"}}
    plates = {
        "slots": run(hits={"count": 512}, assumptions=ON | {"hits": 256}),
        "slots again": run(hits={"count": 512}, assumptions=ON | {"hits": 256}),
        "soft": run(hits={"count": 512}, plate=PLATE | {"resistance": "1.2 GPa"}, assumptions=ON | {"hits": 256}),
        "light": run(hits={"count": 512}, plate=PLATE | thin, assumptions=ON | {"hits": 256}),
    }
    velocity, proxy = "mean(residual_velocity)", "mean(residual_energy_density@130mm)"
    comparison = compare(list(plates.values()), list(plates), [velocity, proxy])
    verdicts = {(one.measure, one.one, one.other): one for one in comparison.verdicts}
    alike = verdicts[velocity, "slots", "slots again"]
    assert (alike.given, {*alike.under.values()}) == (0, {0})
    assert alike.text == "slots and slots again cannot be told apart as given"
    clear = verdicts[velocity, "slots", "soft"]
    assert (clear.given, {*clear.under.values()}) == (1, {1})
    assert f"slots is better than soft in {len(clear.under)} of {len(clear.under)} assumptions" == clear.text
    doubtful = verdicts[proxy, "slots", "light"]
    assert doubtful.under["no weakening (β = 1)"] == 1  # as the slots turn more where nothing weakens
    assert clear.text in comparison_text(comparison)


def test_what_the_hits_leave_open_gives_no_verdict() -> None:
    datasets = [run(hits={"count": 64, "seed": seed}) for seed in (1, 2)]  # one plate, hit elsewhere
    (verdict,) = compare(datasets, ["one", "other"], ["mean(residual_velocity)"]).verdicts
    assert (verdict.given, {*verdict.under.values()}) == (0, {0})


def test_the_command_prints_every_number_under_every_assumption(capsys: pytest.CaptureFixture[str]) -> None:
    plates = [{"name": "thick"} | PLATE, {"name": "thin"} | PLATE | {"thickness": "2 mm"}]
    Path("plates.toml").write_text(json.dumps(TABLES | {"plate": plates}), encoding="utf-8")
    text = ["--measure", "mean(residual_velocity)", "--assumptions"]
    assert main(["compare", "plates.toml", "--device", "cpu", *text]) == 0
    told = capsys.readouterr().out
    assert "assumptions: thick stays ahead in " in told
    assert "5° more oblique" in told[told.index("\nassumption ") :]
    without = run(assumptions={"compute": False})
    for name in ("a.nc", "b.nc"):
        write(without, Path(name))
    assert main(["compare", "a.nc", "b.nc", "-o", "c.png", *text]) == 2
    assert "[assumptions] compute = true" in capsys.readouterr().err
