"""Files of every kind that somebody altered in one place: each command that takes them reads them, or says in a
sentence what is wrong."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1]))
from altered_kinds import COMMANDS, failures, write_files

TRIES = 4
"""Of a kind. `python tests/warpimpact/altered_kinds.py` tries more."""
READERS = {"result": ("inspect", "export", "report", "replay"), "limits": ("inspect", "export", "report", "test")}
"""Commands of kinds that have many; `plot` and `compare` read a file as these do, and draw for seconds."""
ONCE_FOUND = {
    "result": ("@level_shifts: ('0',) [1, [2]]", "@material: ('degradation',) 'x'"),
    "sweep": ("/hit_z: texts",),
    "history": ("/cell_y: first 99.0",),
    "posterior": ("observed_data/std: first -1.0",),
    "front": (
        *(
            "@title: gone",
            "@history: gone",
            "@warpimpact_version: gone",
            "/hits: first inf",
            "/front_design: first 99.0",
        ),
        *("/variable_labels: first '['", "/asked_limit: all 0.0"),
        *("#front: renamed", "/front_group: all -1.0"),
    ),
}
"""What a command once ended in a traceback of."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("kinds")
    write_files(folder)
    return folder


@pytest.fixture
def there(folder: Path, monkeypatch: pytest.MonkeyPatch, unrendered: None) -> None:
    monkeypatch.chdir(folder)
    monkeypatch.setattr("tempfile.tempdir", str(folder))


@pytest.mark.usefixtures("there")
@pytest.mark.parametrize("kind", COMMANDS)
def test_an_altered_file_is_read_or_refused_in_a_sentence(kind: str) -> None:
    assert not [
        failure for failure in failures(kind, TRIES, commands=1, names=READERS.get(kind, ())) if failure is not None
    ]


@pytest.mark.usefixtures("there")
@pytest.mark.parametrize("kind", ONCE_FOUND)
def test_what_once_ended_in_a_traceback(kind: str) -> None:
    found = failures(kind, 0, only=ONCE_FOUND[kind], names=READERS.get(kind, ()))
    assert not [failure for failure in found if failure is not None]
