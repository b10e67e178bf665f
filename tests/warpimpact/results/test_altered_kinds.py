"""Results with layers and histories that somebody altered are refused in a sentence."""

from collections.abc import Callable
from pathlib import Path

import pytest
import xarray

from warpimpact.campaign.campaign import Campaign
from warpimpact.results import checks, files
from warpimpact.results.checks import RESULT
from warpimpact.results.files import ResultError
from warpimpact.results.replayed_hit import HISTORY
from warpimpact.runs.replay import replay
from warpimpact.runs.run import run

LAYERED = (Path(__file__).parents[3] / "campaigns" / "layered_target.toml").read_text(encoding="utf-8")
Change = Callable[[xarray.Dataset], xarray.Dataset]


@pytest.fixture(scope="module")
def layered() -> xarray.Dataset:
    text = LAYERED.replace("count = 1024", "count = 16") + '\n[numerics]\nfidelity = "draft"\ntime_step = "2 us"\n'
    return run(Campaign.from_text(text, name="a.toml", folder=Path()), device="cpu")


MAPS: dict[str, tuple[Change, str]] = {
    "a face without the other": (lambda d: d.drop_vars("layer_rear"), 'but no variable "layer_rear"'),
    "no depth": (lambda d: d.drop_vars("depth"), 'but no variable "depth"'),
    "the solid plate along another": (lambda d: d.rename(solid_hit="shot"), "is along"),
}


@pytest.mark.parametrize("case", MAPS)
def test_an_altered_map_is_refused(case: str, layered: xarray.Dataset, tmp_path: Path) -> None:
    change, expected = MAPS[case]
    changed = change(layered)
    assert expected in str(checks.RESULT.fault(changed))
    files.write(changed, tmp_path / "a.nc")
    with pytest.raises(ResultError, match="or damaged"):
        files.read(tmp_path / "a.nc")


def test_a_factor_that_is_no_number_is_refused(layered: xarray.Dataset, tmp_path: Path) -> None:
    layered.assign(tilt=layered["tilt"].assign_attrs(scale_factor="many")).to_netcdf(tmp_path / "a.nc")
    with pytest.raises(ResultError, match="scale_factor that is no number"):
        files.read(tmp_path / "a.nc")


def test_an_altered_history_is_refused(layered: xarray.Dataset, tmp_path: Path) -> None:
    history = replay(layered, 3, folder=Path())
    assert HISTORY.fault(history) is None
    for change in (lambda d: d.drop_vars("plate_position"), lambda d: d.assign(force=d["force"].astype(str))):
        files.write(change(history), tmp_path / "a.nc")
        with (
            pytest.raises(ResultError, match="not the history of a hit of warpimpact, or damaged"),
            files.opened(tmp_path / "a.nc", RESULT, HISTORY),
        ):
            pass
