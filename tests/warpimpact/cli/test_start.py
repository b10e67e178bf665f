"""The commands that help to start: new and schema; and what -v and -q show."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from warpimpact import Campaign
from warpimpact.cli import main
from warpimpact.firing.plan import read_test
from warpimpact.identification.fit import read_fit
from warpimpact.optimisation.design import read_design

CAMPAIGNS = Path(__file__).parents[3] / "campaigns"


pytestmark = pytest.mark.usefixtures("in_tmp_path")


def test_examples_are_listed_with_their_questions(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["new", "--list"]) == 0
    lines = capsys.readouterr().out.splitlines()
    paths = [path for kind in (".", "fits", "firing", "designs") for path in CAMPAIGNS.glob(f"{kind}/*.toml")]
    assert [line.split()[0] for line in lines] == sorted(path.stem for path in paths)
    assert all("?" in line and "campaigns/" not in line for line in lines)


@pytest.mark.parametrize("name", ["layered_target", "paper_shots"])
def test_a_new_campaign_can_be_read(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    Path("folder").mkdir()
    assert main(["new", name, "-o", "folder/my.toml"]) == 0
    written = capsys.readouterr().out.split()
    assert all(Path(file).is_file() for file in written)
    first, rest = Path("folder/my.toml").read_text(encoding="utf-8").split("\n", 1)
    assert first == "#:schema warpimpact.schema.json"
    source = (CAMPAIGNS / f"{name}.toml").read_text(encoding="utf-8")
    assert rest == source.replace(f"campaigns/{name}.toml", "my.toml")  # comments name the file itself
    assert "$defs" in json.loads(Path("folder/warpimpact.schema.json").read_text(encoding="utf-8"))
    assert Campaign.from_toml("folder/my.toml") == Campaign.from_toml(CAMPAIGNS / f"{name}.toml").model_copy(
        update={"hits": Campaign.from_toml("folder/my.toml").hits}
    )


@pytest.mark.parametrize(
    ("name", "kind", "is_read"),
    [
        ("paper_fit", "fit", lambda path: len(read_fit(path).shots) == 2),
        ("lightest_plate", "design", lambda path: len(read_design(path).file.objectives) == 2),
        ("v50_test", "test", lambda path: read_test(path).target.campaign == Path("plate_and_base.toml").absolute()),
    ],
)
def test_another_new_file_can_be_read(name: str, kind: str, is_read: Callable[[str], bool]) -> None:
    assert main(["new", name]) == 0
    assert is_read(f"{name}.toml")
    assert [path.name for path in Path().glob("*.json")] == [f"warpimpact.{kind}.schema.json"]


def test_the_schema_is_printed_or_written_once(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["schema"]) == 0
    printed = capsys.readouterr().out
    assert [main(["schema", "-o", "it.json"]) for _ in range(2)] == [0, 2]
    assert Path("it.json").read_text(encoding="utf-8") == printed
    assert json.loads(printed)["title"] == "warpimpact campaign"


@pytest.mark.parametrize(
    ("option", "shown", "hidden"),
    [
        ([], "64 of 64 hits", "warpimpact.solver"),
        (["-q"], "", "of 64 hits"),
        (["-v"], "warpimpact.solver.accuracy: pilot: level 2 errs by", "warpimpact.solver.device"),
    ],
)
def test_more_or_less_is_shown(option: list[str], shown: str, hidden: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", str(CAMPAIGNS / "slotted_plate.toml"), "--count", "64", "--device", "cpu", *option]) == 0
    lines = capsys.readouterr().err
    assert shown in lines
    assert hidden not in lines
