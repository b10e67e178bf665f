"""The benchmark of a GPU, tried on the CPU: it runs, the page has its rows, its scenes need all builds."""

import json
import sys
from pathlib import Path

sys.path.append(str(Path(__file__).parents[1] / "benchmarks"))

import gpu
import page


def test_one_call_measures_what_the_page_shows(tmp_path: Path) -> None:
    path = tmp_path / "gpu.json"
    assert gpu.main(["--device", "cpu", "--trial", "--output", str(path)]) == 0
    values = json.loads(path.read_text(encoding="utf-8"))
    agreement = values["agreement"]
    assert {name: one["hits"] for name, one in agreement.items()} == {
        "slotted plate, simple": 12,
        "slotted plate, block": 12,
    }
    assert set(values["rates"]["slotted plate"]) == set(gpu.LAYOUTS)
    assert values["file"]["bytes"] > 64 * 40
    assert values["continuum"]["hits"] == values["continuum"]["agreement"]["hits"] == 2
    assert values["continuum"]["nanoseconds"] > 1.0
    rows = list(page.rows({"gpu": values}))
    assert len(rows) == 2 + 2 + 1 + 1
    assert all(all(row) for row in rows)
