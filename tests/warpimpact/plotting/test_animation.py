"""The film of a hit: number of frames, position of the core, and a clear message for other file names."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import xarray
from matplotlib.animation import FFMpegWriter
from matplotlib.patches import Polygon
from PIL import Image

from warpimpact import Campaign
from warpimpact.cli import main
from warpimpact.plotting import trajectory
from warpimpact.results import files
from warpimpact.runs.run import run

SLOTTED_PLATE = Path(__file__).parents[3] / "campaigns" / "slotted_plate.toml"


@pytest.fixture(scope="module", autouse=True)
def few_frames() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(trajectory, "FRAMES", 12)
        yield


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Holds a result and the film of its hit 1."""
    folder = tmp_path_factory.mktemp("film")
    text = SLOTTED_PLATE.read_text().replace('"standard"', '"draft"')
    campaign = Campaign.from_text(text, name="a", folder=folder, count=2)
    files.write(run(campaign, device="cpu"), folder / "a.nc")
    command = ["replay", str(folder / "a.nc"), "--hit", "1", "--animation", str(folder / "a.gif")]
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(trajectory, "save_figures", lambda *_: [])
        assert main(command) == 0
    return folder


def test_film_moves_the_core(folder: Path) -> None:
    with Image.open(folder / "a.gif") as image:
        assert image.n_frames == trajectory.FRAMES
        frames = []
        for number in (0, trajectory.FRAMES // 2, trajectory.FRAMES - 1):
            image.seek(number)
            frames.append(np.asarray(image.convert("L"), dtype=float))
    dark = [np.mean(np.nonzero((frame > 120) & (frame < 160))[1]) for frame in frames]  # columns of the grey core
    assert dark[0] < dark[1] < dark[2]


def test_frames_show_the_history(folder: Path) -> None:
    history = xarray.load_dataset(folder / "a_hit1.nc")
    made = trajectory.animation(history)
    made._func(trajectory.FRAMES - 1)
    made._draw_was_started = True  # matplotlib warns of a film that is never shown
    (core,) = (patch for patch in made._fig.axes[0].patches if isinstance(patch, Polygon))
    outline = np.asarray(core.get_xy()) * 1e-3
    last = history.isel(time=-1)
    nose = last["plate_position"] + float(history["station"].max()) * last["core_axis"]
    assert outline[:, 0].max() == pytest.approx(float(nose[0]), abs=0.4e-3)
    speed = float(history["residual_velocity"])
    assert f"{speed:.0f} m/s" in made._fig.get_suptitle()


def test_other_names_are_refused_before_computing(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command = ["replay", str(folder / "a.nc"), "--hit", "0", "--animation"]
    assert main([*command, "a.avi"]) == 2
    assert "a.avi: the name of a film must end in .gif or .mp4" in capsys.readouterr().err
    assert main([*command, str(folder / "a.gif")]) == 2
    assert "a.gif: exists already" in capsys.readouterr().err
    assert not (folder / "a_hit0.nc").exists()


def test_mp4_needs_ffmpeg(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(FFMpegWriter, "isAvailable", lambda: False)
    with pytest.raises(files.OutputError, match=r"a\.mp4: an MP4 needs the program ffmpeg"):
        trajectory.writer_for(Path("a.mp4"))
