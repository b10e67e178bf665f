"""The pictures of the README, from the campaigns of this folder: `make gallery`, or `python campaigns/gallery.py`.

Each function of warpimpact.plotting takes a Dataset and returns a matplotlib Figure: use them as this script does.
"""

from io import BytesIO
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from PIL import Image

from warpimpact import Campaign, run
from warpimpact.campaign.replay import replay
from warpimpact.plotting import bursts_figure, dispersion, hit_maps, marginals, overview, trajectory, uncertainty
from warpimpact.plotting.pressure import pressure

HERE = Path(__file__).parent
HIT = 5.8e-3, -5.0e-3  # [m], at the edge of a slot: the core tumbles
LARGEST = 150_000  # bytes of a picture


def save(figure: Figure, path: Path, width: int = 1100) -> None:
    """Write a PNG of this width [px]. A palette of its own halves its size."""
    drawn = BytesIO()
    figure.savefig(drawn, dpi=width / figure.get_figwidth())
    Image.open(drawn).convert("RGB").quantize(192, dither=Image.Dither.NONE).save(path, optimize=True)
    print(f"{path.relative_to(HERE.parent)}: {path.stat().st_size / 1e3:.0f} kB")
    if path.stat().st_size > LARGEST:
        raise SystemExit(f"{path}: is larger than {LARGEST / 1e3:.0f} kB, the limit for a picture")


def main() -> None:
    folder = HERE / "gallery"
    folder.mkdir(exist_ok=True)
    names = {"slotted plate": "slotted_plate", "round holes": "round_holes", "oblique, yawed shot": "oblique_shot"}
    results = {name: run(Campaign.from_toml(HERE / f"{file}.toml")) for name, file in names.items()}
    slotted = results["slotted plate"]
    save(overview(slotted), HERE / "slotted_plate.png", 1000)
    save(hit_maps(results, "tilt"), folder / "tilt_of_three.png", 1400)
    save(marginals(slotted, "residual_velocity"), folder / "marginals.png", 900)
    save(dispersion(results["oblique, yawed shot"]), folder / "dispersion.png", 700)
    oblique = Campaign.from_toml(HERE / "oblique_shot.toml")
    yaw = {"distribution": "normal", "mean": "-2 deg", "std": "1 deg"}
    save(uncertainty(run(oblique.model_copy(update={"scatter": {"yaw": yaw}})), "tilt"), folder / "uncertainty.png")
    save(bursts_figure(run(Campaign.from_toml(HERE / "burst_of_five.toml"))), folder / "bursts.png", 900)
    edge = np.hypot(slotted.hit_y - HIT[0], slotted.hit_z - HIT[1])
    hit = replay(slotted, int(edge.argmin("hit")), folder=HERE)
    for draw in (trajectory.passage, trajectory.flight, trajectory.plate, pressure):
        save(draw(hit), folder / f"{draw.__name__}.png", 900)


if __name__ == "__main__":
    main()
