"""The pages are built without a warning, and what is generated is whole; test_tutorials.py runs the tutorials."""

import doctest
import html
import re
import subprocess
import sys
from pathlib import Path

import pytest

import warpimpact
from warpimpact.campaign.schema import campaign_schema
from warpimpact.cli import parser
from warpimpact.results import variables

DOCS = Path(__file__).parents[2] / "docs"
sys.path.append(str(Path(__file__).parents[1] / "benchmarks"))


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """All pages as HTML, tutorials without their outputs; a warning is an error."""
    folder = tmp_path_factory.mktemp("pages")
    command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-j", "auto", "-b", "html"]
    done = subprocess.run(
        [*command, "-D", "nb_execution_mode=off", "-d", folder / "trees", DOCS, folder],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-5000:] + done.stdout[-2000:]
    return folder


def text(page: Path) -> str:
    """What a person reads on a page."""
    (article,) = re.findall(r"<article.*?</article>", page.read_text(encoding="utf-8"), re.DOTALL)
    return html.unescape(re.sub(r"<[^>]*>", "", article))


def test_every_key_of_a_campaign_is_on_its_page(pages: Path) -> None:
    shown, schema = text(pages / "reference" / "campaign.html"), campaign_schema()
    keys = {key for table in (schema, *schema["$defs"].values()) for key in table.get("properties", {})}
    assert len(keys) > 60
    assert not [key for key in keys if not re.search(rf"\b{key}\b", shown)]
    assert "title" in shown.partition("[core]")[0]
    assert "2^30" in shown  # of hits.count
    assert "7850 kg/m^3" in shown  # default with its unit


def test_every_command_is_on_its_page(pages: Path) -> None:
    shown = text(pages / "reference" / "commands.html")
    (commands,) = [action.choices for action in parser()._actions if hasattr(action.choices, "items")]
    for name, command in commands.items():
        assert f"warpimpact {name}" in shown
        assert all(option in shown for action in command._actions for option in action.option_strings)
    assert all(re.search(rf"^{code}$", shown, re.MULTILINE) for code in (0, 2, 3, 70, 130, 141))


def test_every_public_name_and_every_variable_is_on_its_page(pages: Path) -> None:
    shown = text(pages / "reference" / "python.html")
    assert not [name for name in warpimpact.__all__ if not name.startswith("_") and name not in shown]
    shown = text(pages / "reference" / "results.html")
    assert not [name for name in variables.OUTCOME_VARIABLES if name not in shown]


def test_device_functions_are_on_their_page(pages: Path) -> None:
    shown = text(pages / "reference" / "device.html")
    source = "".join(path.read_text(encoding="utf-8") for path in (DOCS.parent / "kernels").glob("*.py"))
    functions = re.findall(r"@wp\.func\n\s+def (\w+)", source)
    assert len(functions) > 50
    assert not [name for name in functions if name not in shown]


def test_examples_in_pages_are_right() -> None:
    examples_run = 0
    for page in DOCS.rglob("*.md"):
        examples = "\n".join(re.findall(r"```\{doctest\}\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL))
        checked = doctest.DocTestRunner().run(
            doctest.DocTestParser().get_doctest(examples, {}, page.name, str(page), 0)
        )
        assert not checked.failed
        examples_run += checked.attempted
    assert examples_run >= 5


def test_the_benchmark_page_says_what_the_results_say(pages: Path) -> None:
    import page

    shown = re.sub(r"\s+", " ", text(pages / "benchmarks.html"))
    rows = list(page.rows(page.results()))
    assert len(rows) > 20
    for cell in {cell for row in rows for cell in row}:
        assert cell.replace("`", "") in shown
    for sentence in page.machines(page.results()):
        assert sentence.replace("`", "") in shown
