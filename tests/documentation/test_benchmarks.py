"""The benchmark page says what the results say, and each of its figures has a reference and a sample."""

import re
import sys
from pathlib import Path
from typing import Any

import pytest

BENCHMARKS = Path(__file__).parents[1] / "benchmarks"
sys.path.append(str(BENCHMARKS))

import page  # noqa: E402

Results = dict[str, Any]


@pytest.fixture
def found() -> Results:
    return page.results()


def test_every_benchmark_has_rows(found: Results) -> None:
    assert set(page.RUNS) <= set(found) <= set(page.KNOWN)
    for name, values in found.items():
        assert list(page.rows({name: values})), name


def test_rows_follow_from_the_results(found: Results) -> None:
    """Every figure that users look for first, found again by another way than the one that makes the rows."""
    text = "\n".join(" | ".join(row) for row in page.rows(found))
    for scene, rates in found["throughput"]["scenes"].items():
        for name, rate in rates.items():
            shown = re.search(rf"{name}, hits per second \| {scene} \| ([\d,]+) on one core, ([\d,]+) on all", text)
            assert shown is not None
            for one, kind in zip(shown.groups(), ("one_core", "all_cores"), strict=True):
                assert float(one.replace(",", "")) == pytest.approx(rate[kind], rel=6e-3)
    for scene, bout in found["peers"]["scenes"].items():
        ratios = re.findall(rf"times as fast as Numba \| {scene} \| ([\d.]+) \|", text)
        assert [float(one) for one in ratios] == [round(one["ratio"], 1) for one in bout["ratios"]]
    for name, one in found["roads"]["roads"].items():
        assert f"| {name} | {one['ratio']:.1f}; level {one['level']}," in text


def test_the_peer_solves_the_same_law(found: Results) -> None:
    for scene, bout in found["peers"]["scenes"].items():
        *_, finest = (one for one in bout["contenders"] if one["program"] == "Numba")
        assert finest["residual_velocity_error"] < 0.5, scene
        assert finest["tilt_error"] < 0.5, scene


def test_the_figure_is_drawn(found: Results) -> None:
    figure = page.draw(found)
    panels = [axes for part in figure.subfigs for axes in part.axes]
    assert len(panels) == len(found["peers"]["scenes"]) + 1
    assert all(axes.lines or axes.patches for axes in panels)
