"""The pictures of the README are those that the code draws now."""

from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from PIL import Image

from warpimpact.campaigns import gallery

CAMPAIGNS = Path(__file__).parents[3] / "campaigns"
COARSE = (64, 64)
ALIKE = 0.03
"""Mean difference of coarse pictures, of the range of a colour: fonts and hits on an edge differ between machines."""


def coarse(picture: Image.Image) -> np.ndarray:
    return np.asarray(picture.convert("RGB").resize(COARSE, Image.Resampling.BOX), dtype=float) / 255.0


def stored(name: str) -> np.ndarray:
    with Image.open(CAMPAIGNS / name) as picture:
        return coarse(picture)


def test_stored_pictures_are_not_stale() -> None:
    drawn, stale = [], {}
    for name, figure, width in gallery.pictures():
        figure.set_dpi(width / figure.get_figwidth())
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        drawn.append(name)
        off = float(np.abs(coarse(Image.fromarray(np.asarray(canvas.buffer_rgba()))) - stored(name)).mean())
        stale |= {name: round(off, 3)} if off >= ALIKE else {}
        assert (CAMPAIGNS / name).stat().st_size <= gallery.LARGEST
    assert not stale, "these differ from what the code draws; run make gallery"
    kept = {path.relative_to(CAMPAIGNS).as_posix() for path in (CAMPAIGNS / "gallery").glob("*.png")}
    by_browser = {name for name in kept if name.startswith("gallery/design_")}  # tests/benchmarks/design_film.py
    assert kept - by_browser == {name for name in drawn if name.startswith("gallery/")}


def test_another_picture_would_be_noticed() -> None:
    one, other = (stored(f"gallery/{name}.png") for name in ("marginals", "uncertainty"))
    assert np.abs(one - other).mean() > ALIKE
