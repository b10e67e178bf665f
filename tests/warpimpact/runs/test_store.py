"""Batches on the disk: what is damaged, missing or complete when a computation begins again."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
import pytest

from warpimpact.results.files import OutputError
from warpimpact.runs.parts import Interrupted, folder_of
from warpimpact.runs.store import Store, stored

CONTENT = {"fit": {"seed": 1}, "threats": [{"speed": 1}]}
ARRAYS = {"points": np.arange(3.0)}
FRESH = {"resume": False, "overwrite": False}


def saving(output: Path, **options: Any) -> None:
    """Save the batches that are not there, and be interrupted."""
    with stored(output, CONTENT, "fit", **FRESH | options) as store:
        assert store is not None
        for batch in range(3):
            if store.load(batch) is None:
                store.save(batch, ARRAYS)
        raise KeyboardInterrupt


def opening(output: Path, content: Mapping[str, Any] = CONTENT, **options: Any) -> None:
    with stored(output, content, "fit", **FRESH | options):
        pass


def begun(output: Path) -> Path:
    """The manifest of a computation that was interrupted after three batches."""
    with pytest.raises(Interrupted, match="3 batches are saved"):
        saving(output)
    return folder_of(output) / "manifest.json"


def a_folder(manifest: Path) -> None:
    manifest.unlink()
    manifest.mkdir()


def flipped(manifest: Path) -> None:
    text = manifest.read_text(encoding="utf-8")
    assert '"seed": 1' in text
    manifest.write_text(text.replace('"seed": 1', '"seed": 3'), encoding="utf-8")


DAMAGES: dict[str, Callable[[Path], object]] = {
    "missing": Path.unlink,
    "truncated": lambda manifest: manifest.write_bytes(manifest.read_bytes()[:40]),
    "list": lambda manifest: manifest.write_text("[]"),
    "empty": lambda manifest: manifest.write_text("{}"),
    "number": lambda manifest: manifest.write_text("7"),
    "deep": lambda manifest: manifest.write_text("[" * 200_000),
    "junk": lambda manifest: manifest.write_bytes(b"\xff\x00junk"),
    "a folder": a_folder,
    "flipped": flipped,
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_batches_outlive_their_manifest(damage: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    output = tmp_path / "fit.nc"
    DAMAGES[damage](begun(output))
    with pytest.raises(OutputError, match=r"contains an unfinished fit \(3 batches\)"):
        opening(output)
    told: list[str] = []
    monkeypatch.setattr(Store, "save", None)  # nothing is computed again
    with pytest.raises(Interrupted):
        saving(output, resume=True, tell=told.append)
    assert len(told) == 1
    assert "manifest.json: is missing or damaged" in told[0]


@pytest.mark.parametrize("damage", DAMAGES)
def test_batches_of_another_computation_do_not_count(damage: str, tmp_path: Path) -> None:
    output = tmp_path / "fit.nc"
    DAMAGES[damage](begun(output))
    told: list[str] = []
    other = {"fit": {"seed": 2}}
    with stored(output, other, "fit", resume=True, overwrite=False, tell=told.append) as store:
        assert store is not None
        assert store.load(0) is None
    assert any("computed again" in sentence for sentence in told)


def test_a_batch_is_replaced_by_that_of_its_number(tmp_path: Path) -> None:
    store = Store(tmp_path / "fit.nc", CONTENT, "fit")
    store.parts.folder.mkdir()
    for arrays in (ARRAYS, {"points": np.ones(4)}):
        store.save(3, arrays)
        np.testing.assert_equal(store.load(3), arrays)
    assert len(store.parts.paths()) == 1


def test_another_content_is_refused_with_the_difference(tmp_path: Path) -> None:
    output = tmp_path / "fit.nc"
    begun(output)
    other = CONTENT | {"threats": [{"speed": 2}]}
    with pytest.raises(OutputError, match=r"cannot be resumed: threats\.0\.speed was 1 and is 2"):
        opening(output, other, resume=True)


@pytest.mark.parametrize("left", [True, False])
def test_a_complete_result_is_resumed_to_itself(left: bool, tmp_path: Path) -> None:
    """With or without batches, as a death may come before they are removed."""
    output = tmp_path / "fit.nc"
    if left:
        begun(output)
    with netCDF4.Dataset(output, "w") as file:
        file.fingerprint = Store(output, CONTENT, "fit").parts.fingerprint
    with pytest.raises(OutputError, match="exists already"):
        opening(output)
    with stored(output, CONTENT, "fit", resume=True, overwrite=False) as store:
        assert store is None
    assert output.exists()
    assert not folder_of(output).exists()
