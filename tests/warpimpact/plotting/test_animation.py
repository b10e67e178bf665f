"""The film of a hit: number of frames, position of the core, and a clear message for other file names."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
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


def test_other_names_are_refused_before_computing(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command = ["replay", str(folder / "a.nc"), "--hit", "0", "--animation"]
    assert main([*command, "a.avi"]) == 2
    assert "a.avi: the name of a film must end in .gif or .mp4" in capsys.readouterr().err
    assert main([*command, str(folder / "a.gif")]) == 2
    assert "a.gif: exists already" in capsys.readouterr().err
    assert not (folder / "a_hit0.nc").exists()
