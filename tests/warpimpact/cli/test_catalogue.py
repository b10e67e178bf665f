"""Names of the catalogue, from the command to what a run prints, stores and draws."""

import json
from pathlib import Path

import pytest

from warpimpact.cli import main
from warpimpact.plotting import variable_map
from warpimpact.results import attributes as attr
from warpimpact.results import files

CAMPAIGN = """
title = "named"
catalogue = "own.toml"
core = { threat = "7.62x51 P80 AP" }
plate = { material = "own steel", thickness = "20 mm" }
hits = { sampling = "grid", count = 4 }
numerics = { level = 0 }
output = { solid_reference = false }
"""
OWN = """
[[material]]
name = "own steel"
density = 7850
resistance = "1 GPa"
rows = { "7.62x51 P80 AP" = 3 }
thickness_high = "10 mm"
"""
LINES = (
    "Outside the tested range: thickness.",
    "core: 7.62x51 P80 AP (quoted at second hand: bullet mass, velocity)",
    "plate: own steel, resistance 1 GPa (3 limit velocities; nothing assumed)",
    "thickness (plate): 20 mm, but limit velocities of own steel were measured at 0 to 10 mm",
)


def test_names_are_carried_along(in_tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Path("own.toml").write_text(OWN, encoding="utf-8")
    Path("named.toml").write_text(CAMPAIGN, encoding="utf-8")
    assert main(["run", "named.toml", "--device", "cpu"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert LINES[0] in lines
    assert LINES[1] not in lines
    assert LINES[3] not in lines
    assert main(["inspect", "named.nc"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line for line in LINES if line not in lines] == []
    assert main(["run", "named.toml", "--count", "8", "-o", "other.nc", "--device", "cpu"]) == 0
    capsys.readouterr()
    assert main(["compare", "named.nc", "other.nc"]) == 0
    assert capsys.readouterr().out.splitlines().count(LINES[0]) == 1
    dataset = files.read(Path("named.nc"))
    assert dataset.attrs[attr.CATALOGUE_NAMES].splitlines() == list(LINES[1:3])
    assert json.loads(dataset.attrs[attr.OUTSIDE_TESTED_RANGE]) == [LINES[3]]
    below = " ".join(variable_map(dataset, "residual_velocity").legends[0].get_title().get_text().split())
    assert all(line in below for line in dataset.attrs[attr.CATALOGUE_NAMES].splitlines())
    assert main(["report", "named.nc", "-o", "named.html"]) == 0
    page = Path("named.html").read_text(encoding="utf-8")
    assert all(line in page for line in LINES[:3])


def test_the_command_lists_shows_and_draws(in_tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Path("own.toml").write_text(OWN, encoding="utf-8")
    assert main(["catalogue", "--file", "own.toml"]) == 0
    listed = capsys.readouterr().out
    assert all(name in listed for name in ("14.5 mm BS41", "own steel"))
    assert main(["catalogue", "14.5 mm B32", "-o", "core.png"]) == 0
    assert "STANAG 4569 level 4" in capsys.readouterr().out
    assert Path("core.png").stat().st_size > 10_000
    assert [main(["catalogue", *name]) for name in (["7.62x39 API BZ", "-o", "no.png"], ["P81"])] == [2, 2]


def test_limit_tells_where_a_test_is_expected(in_tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = CAMPAIGN.replace('catalogue = "own.toml"\n', "").replace("7.62x51 P80 AP", ".30 AP M2").replace("= 4", "= 1")
    text = text.replace('"own steel", thickness = "20 mm"', '"HHA Class 1", thickness = "6 mm"')
    Path("hha.toml").write_text(text, encoding="utf-8")
    assert main(["limit", "hha.toml", "-o", "limit.nc", "--device", "cpu"]) == 0
    (line,) = (line for line in capsys.readouterr().out.splitlines() if "a test of this material" in line)
    low, high = (float(word) for word in line.split() if word.replace(".", "").isdigit())
    dataset = files.read(Path("limit.nc"))
    factors, value = dataset.attrs[attr.LIMIT_FACTORS], float(dataset["limit_velocity"].item())
    assert (low, high) == pytest.approx((value * factors[0], value * factors[1]), rel=1e-3)
