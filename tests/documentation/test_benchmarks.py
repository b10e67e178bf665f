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
def stored() -> Results:
    return page.results()


def test_every_benchmark_has_rows(stored: Results) -> None:
    assert set(page.RUNS) <= set(stored) <= set(page.KNOWN)
    for name, values in stored.items():
        assert list(page.rows({name: values})), name


def test_rows_follow_from_the_results(stored: Results) -> None:
    """Every figure that users look for first, found again by another way than the one that makes the rows."""
    text = "\n".join(" | ".join(row) for row in page.rows(stored))
    for scene, rates in stored["throughput"]["scenes"].items():
        for name, rate in rates.items():
            shown = re.search(rf"{name}, hits per second \| {scene} \| ([\d,]+) on one core, ([\d,]+) on all", text)
            assert shown is not None
            for one, kind in zip(shown.groups(), ("one_core", "all_cores"), strict=True):
                assert float(one.replace(",", "")) == pytest.approx(rate[kind], rel=6e-3)
    for name, one in stored["roads"]["roads"].items():
        assert f"| {name} | {one['ratio']:.1f}; level {one['level']}," in text
