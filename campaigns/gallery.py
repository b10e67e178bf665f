"""The pictures of the README, from the campaigns of this folder: `make gallery`, or `python campaigns/gallery.py`.

Each function of warpimpact.plotting takes a Dataset and returns a matplotlib Figure: use them as this script does. The
tests draw the pictures again and compare them with the stored ones.

    python campaigns/gallery.py paper_fit.nc      # draws fits/ from a posterior of `warpimpact identify`
"""

import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from PIL import Image

from warpimpact import Campaign, replay, run, sensitivity
from warpimpact.plotting import marginals, overview, trajectory, uncertainty, variable_maps, verdict
from warpimpact.plotting.studies import hits_figure, pairs_figure, sensitivity_figure
from warpimpact.plotting.trajectory import pressure
from warpimpact.records.kinds import POSTERIOR
from warpimpact.results import files

HERE = Path(__file__).parent
HIT = 5.8e-3, -5.0e-3  # [m], at the edge of a slot: the core tumbles
LARGEST = 400_000  # bytes of a picture


def by_law(file: str) -> Campaign:
    """A campaign of this folder without hits by finite elements, which take minutes."""
    campaign = Campaign.from_toml(HERE / f"{file}.toml")
    return campaign.computed_by(campaign.continuum.model_copy(update={"hits": None}))


def pictures() -> Iterator[tuple[str, Figure, int]]:
    """Name from this folder, figure and width [px] of every picture."""
    names = {"slotted plate": "slotted_plate", "round holes": "round_holes", "oblique, yawed shot": "oblique_shot"}
    results = {name: run(by_law(file), references=True) for name, file in names.items()}
    slotted = results["slotted plate"]
    yield "slotted_plate.png", overview(slotted), 1000
    yield "gallery/tilt_of_three.png", variable_maps(results, "tilt"), 1400
    yield "gallery/marginals.png", marginals(slotted, "residual_velocity"), 900
    yield "gallery/verdict.png", verdict(results["oblique, yawed shot"]), 900
    yaw = {"distribution": "normal", "mean": "-2 deg", "std": "1 deg"}
    scattered = run(by_law("oblique_shot").model_copy(update={"scatter": {"yaw": yaw}}))
    yield "gallery/uncertainty.png", uncertainty(scattered, "tilt"), 1100
    plate = by_law("slotted_plate")
    yield "gallery/sensitivity.png", sensitivity_figure(sensitivity(plate, hits=256), plate.title, 256), 1100
    edge = np.hypot(slotted.hit_y - HIT[0], slotted.hit_z - HIT[1])
    hit = replay(slotted, int(edge.argmin("hit")), folder=HERE)
    for draw in (trajectory.passage, trajectory.flight, trajectory.plate, pressure):
        yield f"gallery/{draw.__name__}.png", draw(hit), 900


def pictures_of_fit(posterior: Path) -> Iterator[tuple[str, Figure, int]]:
    """The same of the posterior of fits/paper_fit.toml."""
    dataset = files.read(posterior, POSTERIOR)
    yield "fits/paper_fit_hits.png", hits_figure(dataset), 920
    yield "fits/paper_fit_pairs.png", pairs_figure(dataset), 1064


def save(figure: Figure, path: Path, width: int, *, few_colours: bool = False) -> None:
    """Write a PNG of this width [px], of 256 colours at most if asked for."""
    path.parent.mkdir(exist_ok=True)
    figure.savefig(path, dpi=width / figure.get_figwidth(), pil_kwargs={"optimize": True})
    with Image.open(path) as drawn:
        picture = drawn.convert("RGB")
        (picture.quantize(256, dither=Image.Dither.NONE) if few_colours else picture).save(path, optimize=True)
    if path.stat().st_size > LARGEST:
        raise SystemExit(f"{path}: is larger than {LARGEST / 1e3:.0f} kB, the limit for a picture")


def main() -> None:
    for name, figure, width in pictures_of_fit(Path(sys.argv[1])) if sys.argv[1:] else pictures():
        save(figure, HERE / name, width, few_colours=name.startswith("fits/"))
        print(f"{name}: {(HERE / name).stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main()
