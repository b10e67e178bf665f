"""Pages are built without a warning, what is generated is whole, and the benchmark of a GPU runs on the CPU."""

import doctest
import html
import json
import re
import sys
from pathlib import Path

import pytest
from sphinx.cmd.build import build_main

import warpimpact
from warpimpact.campaign.schema import campaign_schema
from warpimpact.cli import parser
from warpimpact.records import variables
from warpimpact.solver import grid

DOCS = Path(__file__).parents[2] / "docs"
sys.path.append(str(Path(__file__).parents[1] / "benchmarks"))
REFERENCE = ("campaign", "commands", "python", "results", "device")

import gpu  # noqa: E402
import page  # noqa: E402


def text(file: Path) -> str:
    """What a person reads on a page."""
    (article,) = re.findall(r"<article.*?</article>", file.read_text(encoding="utf-8"), re.DOTALL)
    return html.unescape(re.sub(r"<[^>]*>", "", article))


@pytest.mark.filterwarnings("ignore")  # of its own extensions
def test_the_pages_are_whole(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """All pages as HTML, tutorials without their outputs; a warning is an error. In one test, they are built once."""
    options = ["-q", "-W", "--keep-going", "-b", "html", "-D", "nb_execution_mode=off", "-d", str(tmp_path / "trees")]
    assert build_main([*options, str(DOCS), str(tmp_path)]) == 0, capsys.readouterr().err[-5000:]
    reference = {name: text(tmp_path / "reference" / f"{name}.html") for name in REFERENCE}
    _has_every_key_of_a_campaign(reference["campaign"])
    _has_every_command(reference["commands"])
    assert not [name for name in warpimpact.__all__ if not name.startswith("_") and name not in reference["python"]]
    assert not [name for name in variables.OUTCOME_VARIABLES if name not in reference["results"]]
    _has_every_device_function(reference["device"])
    _says_what_the_results_say(text(tmp_path / "benchmarks.html"))
    assert "one thickness out" in text(tmp_path / "validation.html")


def _has_every_key_of_a_campaign(page: str) -> None:
    schema = campaign_schema()
    keys = {key for table in (schema, *schema["$defs"].values()) for key in table.get("properties", {})}
    assert len(keys) > 60
    assert not [key for key in keys if not re.search(rf"\b{key}\b", page)]
    assert "title" in page.partition("[core]")[0]
    assert "2^30" in page  # of hits.count
    assert "7850 kg/m^3" in page  # default with its unit


def _has_every_command(page: str) -> None:
    (commands,) = [action.choices for action in parser()._actions if hasattr(action.choices, "items")]
    for name, command in commands.items():
        assert f"warpimpact {name}" in page
        assert all(option in page for action in command._actions for option in action.option_strings)
    assert all(re.search(rf"^{code}$", page, re.MULTILINE) for code in (0, 2, 3, 70, 130, 141))


def _has_every_device_function(page: str) -> None:
    source = "".join(path.read_text(encoding="utf-8") for path in (DOCS.parent / "kernels").glob("*.py"))
    functions = re.findall(r"@wp\.func\n\s+def (\w+)", source)
    assert len(functions) > 50
    assert not [name for name in functions if name not in page]


def _says_what_the_results_say(shown: str) -> None:
    words = re.sub(r"\s+", " ", shown)
    rows = list(page.rows(page.results()))
    assert set(page.RUNS) <= set(page.results())
    assert len(rows) > 20
    for cell in [*(cell for row in rows for cell in row), *page.machines(page.results())]:
        assert cell.replace("`", "") in words


def test_examples_in_pages_are_right() -> None:
    examples_run = 0
    for file in DOCS.rglob("*.md"):
        examples = "\n".join(re.findall(r"```\{doctest\}\n(.*?)```", file.read_text(encoding="utf-8"), re.DOTALL))
        checked = doctest.DocTestRunner().run(
            doctest.DocTestParser().get_doctest(examples, {}, file.name, str(file), 0)
        )
        assert not checked.failed
        examples_run += checked.attempted
    assert examples_run >= 5


sys.path.append(str(Path(__file__).parents[1] / "benchmarks"))


def test_one_call_measures_what_the_page_shows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(grid, "SIZES", (4096,))  # the build of tests/kernels/test_block.py
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
