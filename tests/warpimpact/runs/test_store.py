"""Batches on the disk: what is damaged, missing or complete when a computation begins again."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
import pytest

from warpimpact.results.files import OutputError
from warpimpact.runs.parts import Interrupted, folder_of
from warpimpact.runs.questions import Store, stored

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


@pytest.mark.parametrize("damage", [Path.unlink, lambda manifest: manifest.write_bytes(manifest.read_bytes()[:40])])
def test_batches_without_their_manifest_are_kept(damage: Callable[[Path], object], tmp_path: Path) -> None:
    output = tmp_path / "fit.nc"
    damage(begun(output))
    with pytest.raises(OutputError, match=r"contains an unfinished fit \(3 batches\)"):
        opening(output)
    with pytest.raises(OutputError, match="is missing or damaged; begin anew with --overwrite"):
        opening(output, resume=True)
    assert len([*folder_of(output).glob("batch_*")]) == 3
    opening(output, overwrite=True)


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
