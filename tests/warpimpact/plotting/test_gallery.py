"""The pictures of the README are those that the code draws now."""

from pathlib import Path

import numpy as np
from PIL import Image

from warpimpact.campaigns import gallery

CAMPAIGNS = Path(__file__).parents[3] / "campaigns"
COARSE = (64, 64)
ALIKE = 0.03
"""Mean difference of coarse pictures, of the range of a colour: fonts and hits on an edge differ between machines."""


def coarse(path: Path) -> np.ndarray:
    with Image.open(path) as picture:
        return np.asarray(picture.convert("RGB").resize(COARSE, Image.Resampling.BOX), dtype=float) / 255.0


def test_stored_pictures_are_not_stale(tmp_path: Path) -> None:
    drawn = []
    for name, figure, width in gallery.pictures():
        gallery.save(figure, tmp_path / name, width)
        drawn.append(name)
        off = float(np.abs(coarse(tmp_path / name) - coarse(CAMPAIGNS / name)).mean())
        assert off < ALIKE, f"{name} differs by {off:.3f} from what the code draws; run make gallery"
    stored = {path.relative_to(CAMPAIGNS).as_posix() for path in (CAMPAIGNS / "gallery").glob("*.png")}
    assert stored == {name for name in drawn if name.startswith("gallery/")}


def test_another_picture_would_be_noticed() -> None:
    one, other = (coarse(CAMPAIGNS / "gallery" / f"{name}.png") for name in ("marginals", "uncertainty"))
    assert np.abs(one - other).mean() > ALIKE
