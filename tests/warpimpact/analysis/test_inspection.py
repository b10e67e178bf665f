"""What a notebook shows of results: drawings that are XML, a verdict; and the bar of a run."""

import re
import sys
from pathlib import Path
from types import SimpleNamespace
from xml.etree import ElementTree

import numpy as np
import pytest

from warpimpact import Campaign, Hits, Impact, Layer, Numerics, Plate, run
from warpimpact.analysis.comparison import compare
from warpimpact.analysis.inspection import inspect
from warpimpact.results import files
from warpimpact.results.files import ResultError
from warpimpact.scene import ConeCore, SquarePattern

HOLES = SquarePattern(side="4 mm", spacing="8 mm")
PLATE = Plate(areal_density="30 kg/m^2", resistance="2.6 GPa", pattern=HOLES)
CAMPAIGN = Campaign(
    title="a & b",
    core=ConeCore(diameter="6 mm", length="20 mm", mass="4 g"),
    plate=PLATE,
    layer=(Layer(thickness="5 mm", resistance="1 GPa", gap="20 mm"),),
    impact=Impact(velocity="800 m/s", obliquity=20),
    hits=Hits(count=16),
    numerics=Numerics(level=0),
)


def drawings(text: str) -> list[str]:
    """Names of the drawings of a page, which is read as XML."""
    root = ElementTree.fromstring(text.replace("<br>", "<br/>"))
    return [one.attrib["aria-label"] for one in root.iter("svg")]


def test_a_notebook_shows_a_result_with_its_verdict(make_result, make_plate_result) -> None:
    shown = inspect(make_result([0] * 30 + [1] * 10).assign_attrs(title="a < b"))
    assert shown.verdict.startswith("30 of 40 cores pass. residual energy fraction, mean ")
    assert str(shown).startswith("a < b\n")
    assert drawings(shown._repr_html_()) == ["map of the hits"]
    assert (shown.drawing.count("Z"), shown.drawing.count("<circle")) == (1, 40)  # a hole, and a mark for every hit
    plates = [make_plate_result(np.full(64, velocity)) for velocity in (700.0, 800.0)]
    text = compare(plates, ["a", "b"])._repr_html_()
    rows = dict(re.findall(r"<th>([^<]*)</th>\s*<td>([^<]*)</td>\s*</tr>", text))
    assert rows["residual energy fraction, mean"] == "a"


def test_a_file_is_inspected_as_its_result(tmp_path: Path) -> None:
    dataset = run(CAMPAIGN, device="cpu")
    files.write(dataset, tmp_path / "a.nc")
    assert inspect(str(tmp_path / "a.nc")) == inspect(tmp_path / "a.nc") == inspect(dataset)
    with pytest.raises(ResultError, match="it is not there"):
        inspect(tmp_path / "b.nc")


@pytest.mark.parametrize(("shell", "shown"), [("ZMQInteractiveShell", True), ("TerminalInteractiveShell", False)])
def test_a_run_has_a_bar_in_a_notebook(
    shell: str, shown: bool, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    notebook = SimpleNamespace(get_ipython=type(shell, (), {}))
    monkeypatch.setitem(sys.modules, "IPython", notebook)
    run(CAMPAIGN, device="cpu")
    assert ("16/16" in capsys.readouterr().err) == shown
