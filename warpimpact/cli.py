"""The warpimpact command."""

import argparse
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from . import __version__

if TYPE_CHECKING:
    import xarray

    from .campaign.run import Standing


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; returns the exit code: 2 after a mistake that the user can put right, 3 when more shots failed
    than the campaign allows, 130 when interrupted."""
    arguments = _parser().parse_args(argv)
    try:
        code: int | None = arguments.command(arguments)
    except KeyboardInterrupt as interrupt:
        print(f"warpimpact: {str(interrupt) or 'interrupted'}", file=sys.stderr)
        return 130
    except _mistakes() as error:
        print(f"warpimpact: error: {error}", file=sys.stderr)
        return 2
    return code or 0


def _mistakes() -> tuple[type[Exception], ...]:
    """Errors whose message is for the user; imported once there is an error, to keep `--help` quick."""
    from .campaign.campaign import CampaignError
    from .campaign.team import ClusterError
    from .results import OutputError, ResultError
    from .simulate import DeviceError, UnsupportedError

    return CampaignError, ClusterError, OutputError, ResultError, DeviceError, UnsupportedError


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="warpimpact",
        description="Hit maps of hard bullet cores against perforated armour plates.",
        epilog="example: warpimpact run campaigns/slotted_plate.toml && warpimpact plot slotted_plate.nc",
    )
    parser.add_argument("--version", action="version", version=f"warpimpact {__version__}")
    commands = parser.add_subparsers(metavar="COMMAND", required=True)
    _add_run(commands)
    _add_inspect(commands)
    _add_plot(commands)
    _add_plate(commands)
    _add_replay(commands)
    _add_study(commands)
    _add_validate(commands)
    return parser


def _add_run(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    parser = commands.add_parser(
        "run",
        help="compute the hit map of a campaign",
        description="Compute every hit of a campaign and write one netCDF file.",
        epilog="example: warpimpact run campaigns/slotted_plate.toml -o slotted.nc --count 512",
    )
    parser.add_argument("campaign", type=Path, metavar="CAMPAIGN.toml", help="what is shot at what")
    parser.add_argument(
        "-o", "--output", type=Path, metavar="RESULT.nc", help="result (default: the campaign's name, here)"
    )
    _add_device(parser)
    cluster = parser.add_mutually_exclusive_group()
    cluster.add_argument("--scheduler", metavar="ADDRESS", help="compute on the workers of this Dask scheduler")
    cluster.add_argument("--workers", type=_positive, metavar="N", help="compute in N processes of this machine")
    parser.add_argument("--count", type=int, metavar="N", help="number of hits, in place of the campaign's")
    parser.add_argument(
        "--resume", action="store_true", help="continue a run that was broken off; begin where there is none"
    )
    parser.add_argument(
        "--overwrite", action="store_true", help="replace an existing result, and a run that was broken off"
    )
    parser.set_defaults(command=_run)


def _add_inspect(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    parser = commands.add_parser(
        "inspect",
        help="tell what is in a result",
        description="Tell who made a result, from what campaign, its numbers with their intervals, and which shots "
        "failed.",
        epilog="example: warpimpact inspect slotted.nc",
    )
    parser.add_argument("result", type=Path, metavar="RESULT.nc", help="written by warpimpact run")
    parser.add_argument("--campaign", action="store_true", help="print the campaign that it carries, and no more")
    parser.set_defaults(command=_inspect)


def _add_plot(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    parser = commands.add_parser(
        "plot",
        help="draw the maps of a result",
        description="Draw the maps of a result as PNG files.",
        epilog="example: warpimpact plot slotted.nc -o maps",
    )
    parser.add_argument("result", type=Path, metavar="RESULT.nc", help="written by warpimpact run")
    parser.add_argument("-o", "--output", type=Path, metavar="FOLDER", help="existing folder (default: the result's)")
    parser.set_defaults(command=_plot)


def _add_plate(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    parser = commands.add_parser(
        "plate",
        help="draw the plate of a campaign to scale",
        description="Draw the plate of a campaign to scale, with the largest section of the core; tell its open area, "
        "smallest ligament and areal density. Nothing is computed.",
        epilog="example: warpimpact plate campaigns/slotted_plate.toml",
    )
    parser.add_argument("campaign", type=Path, metavar="CAMPAIGN.toml", help="what is shot at what")
    parser.add_argument(
        "-o",
        "--output",
        type=_picture,
        metavar="PLATE.png",
        help="picture (default: the campaign's name with _plate, here)",
    )
    parser.set_defaults(command=_plate)


def _picture(text: str) -> Path:
    if (path := Path(text)).suffix not in (".png", ".svg", ".pdf"):
        raise argparse.ArgumentTypeError(f'got "{text}", but a picture is a .png, .svg or .pdf file')
    return path


def _add_replay(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    parser = commands.add_parser(
        "replay",
        help="compute one hit of a result again, with its history",
        description="Compute one hit of a result again on the CPU; write its history as netCDF and PNG files. It ends "
        "bit-identical to the stored outcome where this CPU and version computed that; a result from a GPU is met "
        "within rounding only.",
        epilog="example: warpimpact replay slotted.nc --hit 34",
    )
    parser.add_argument("result", type=Path, metavar="RESULT.nc", help="written by warpimpact run")
    parser.add_argument("--hit", type=int, required=True, metavar="N", help="which hit of the result, from 0")
    parser.add_argument(
        "-o", "--output", type=Path, metavar="HIT.nc", help="history (default: RESULT_hitN.nc beside the result)"
    )
    parser.add_argument(
        "--campaign-folder",
        type=Path,
        metavar="FOLDER",
        help="where the files are that the campaign names, such as a hit list (default: the result's folder)",
    )
    parser.add_argument("--overwrite", action="store_true", help="replace an existing history")
    parser.set_defaults(command=_replay)


def _add_study(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    parser = commands.add_parser(
        "study",
        help="measure what accuracy costs on a campaign's scene",
        description="Measure error and speed of the numerics, coarse to fine, against a converged answer; write them "
        "as one netCDF file with a figure beside it. Takes minutes.",
        epilog="example: warpimpact study campaigns/slotted_plate.toml --hits 128",
    )
    parser.add_argument("campaign", type=Path, metavar="CAMPAIGN.toml", help="what is shot at what")
    parser.add_argument(
        "-o", "--output", type=Path, metavar="STUDY.nc", help="study (default: the campaign's name with _study, here)"
    )
    parser.add_argument(
        "--hits", type=_positive, default=512, metavar="N", help="hits, spread over the campaign's cell (default: 512)"
    )
    _add_device(parser)
    parser.add_argument("--overwrite", action="store_true", help="replace an existing study")
    parser.set_defaults(command=_study)


def _positive(text: str) -> int:
    if (number := int(text)) < 1:
        raise argparse.ArgumentTypeError(f"got {number}, but it must be at least 1")
    return number


def _add_validate(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    parser = commands.add_parser(
        "validate",
        help="compare with the published shots",
        description="Compute the paper's two shots and print them beside its model, experiment and LS-DYNA.",
        epilog="example: warpimpact validate",
    )
    parser.add_argument(
        "campaign", type=Path, nargs="?", metavar="CAMPAIGN.toml", help="two hits (default: the bundled ones)"
    )
    _add_device(parser)
    parser.set_defaults(command=_validate)


def _add_device(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--device",
        default="auto",
        metavar="auto|cpu|cuda:0",
        help="auto takes CUDA where there is any; several for a run: cuda:0,cuda:1",
    )


def _run(arguments: argparse.Namespace) -> int:
    from . import results
    from .analysis.summary import summary_text, symmetry_text
    from .campaign.campaign import Campaign, CampaignError
    from .campaign.run import run_to_file
    from .campaign.team import cluster_team

    campaign = Campaign.from_toml(arguments.campaign, count=arguments.count)
    output = arguments.output or Path(arguments.campaign.stem + ".nc")
    _check_place(output)
    team = None
    if arguments.scheduler or arguments.workers:
        team = cluster_team(campaign, address=arguments.scheduler, workers=arguments.workers, device=arguments.device)
    try:
        with _terminated_as_interrupted(), _standing() as progress:
            run_to_file(
                campaign,
                output,
                device=arguments.device,
                team=team,
                resume=arguments.resume,
                overwrite=arguments.overwrite,
                progress=progress,
            )
    except MemoryError as error:
        raise CampaignError(f"{arguments.campaign}: {error}") from None
    with results.opened(output) as dataset:
        print(summary_text(dataset))
        if "symmetries" in dataset.attrs:
            print(symmetry_text(dataset))
        print(f"{dataset.attrs['hits_per_second']:.4g} hits per second on {dataset.attrs['device']}")
        print(f"written to {output}")
        return _failure_code(dataset, output)


def _failure_code(dataset: "xarray.Dataset", path: Path) -> int:
    """3, and a line, when more shots failed than the campaign allows."""
    from . import results

    share = float(results.failed(dataset).mean())
    allowed = dataset.attrs["failed_share"]
    if share <= allowed:
        return 0
    print(
        f"warpimpact: {share:.3g} of the shots failed, more than output.failed_share = {allowed:g}; "
        f"warpimpact inspect {path} lists them",
        file=sys.stderr,
    )
    return 3


@contextmanager
def _terminated_as_interrupted() -> Iterator[None]:
    """A batch system ends what has used up its time by SIGTERM: that stops as cleanly as Ctrl-C."""

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGTERM, interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


@contextmanager
def _standing() -> "Iterator[Callable[[Standing], None]]":
    """Shows how far a run is: a bar on a terminal, plain lines in a log."""
    if not sys.stderr.isatty():
        yield _log_standing()
        return
    from tqdm import tqdm

    with tqdm(unit="hit", dynamic_ncols=True) as bar:

        def show(standing: "Standing") -> None:
            if bar.total is None:
                bar.total, bar.initial, bar.n = standing.total, standing.resumed, standing.resumed
            bar.set_postfix_str(_running(standing), refresh=False)
            bar.update(max(0, standing.done - bar.n))

        yield show


def _log_standing() -> "Callable[[Standing], None]":
    """A line at the start, at every tenth, and at least every ten minutes."""
    shown, last, begin = -1, 0.0, time.monotonic()

    def show(standing: "Standing") -> None:
        nonlocal shown, last
        tenths, elapsed = 10 * standing.done // standing.total, time.monotonic() - begin
        if tenths == shown and elapsed - last < _LONGEST_SILENCE:
            return
        shown, last = tenths, elapsed
        line = f"{standing.done} of {standing.total} hits"
        if (fresh := standing.done - standing.resumed) > 0 and elapsed > 0.0:
            left = (standing.total - standing.done) * elapsed / fresh
            line += f", {fresh / elapsed:.4g} hits/s, {left:.0f} s left; {_running(standing)}"
        print(line, file=sys.stderr, flush=True)

    return show


_LONGEST_SILENCE = 600.0


def _running(standing: "Standing") -> str:
    """Running estimates and failed shots as one short line."""
    from .analysis.summary import UNITS

    parts = [
        f"{measure.text} {estimate.value:.5g} ± {estimate.half_width:.2g}{UNITS[measure.units]}"
        for measure, estimate in standing.estimates.items()
        if estimate.count > 1
    ]
    return ", ".join([*parts, f"{standing.failed} failed"])


def _inspect(arguments: argparse.Namespace) -> None:
    from . import results
    from .analysis.inspect import inspect_text

    with results.opened(arguments.result) as dataset:
        print(dataset.attrs["campaign"] if arguments.campaign else inspect_text(dataset))


def _plot(arguments: argparse.Namespace) -> None:
    from . import results
    from .plotting import save_maps

    dataset = results.read(arguments.result)
    folder = arguments.output or arguments.result.parent
    _check_folder(folder)
    for path in save_maps(dataset, folder, arguments.result.stem):
        print(path)


def _plate(arguments: argparse.Namespace) -> None:
    from .analysis.plate import plate_numbers
    from .campaign.campaign import Campaign
    from .plotting import plate_figure

    campaign = Campaign.from_toml(arguments.campaign)
    output = arguments.output or Path(arguments.campaign.stem + "_plate.png")
    _check_place(output)
    plate = campaign.plate
    plate_figure(plate, campaign.core, campaign.title).savefig(output, dpi=150)
    print(campaign.title)
    print(f"{'thickness':<18}  {1e3 * plate.thickness:g} mm")
    numbers = plate_numbers(plate.open_area, plate.ligament, plate.areal_density, plate.pattern.resolution)
    for name, number in numbers.items():
        print(f"{name:<18}  {number}")
    print(output)


def _replay(arguments: argparse.Namespace) -> None:
    from . import results
    from .analysis.hit import hit_text
    from .campaign.campaign import CampaignError
    from .campaign.replay import replay
    from .plotting.trajectory import save_figures

    result, path = results.read(arguments.result), arguments.result
    output = arguments.output or path.with_name(f"{path.stem}_hit{arguments.hit}.nc")
    _check_output(output, overwrite=arguments.overwrite)
    try:
        history = replay(result, arguments.hit, folder=arguments.campaign_folder or path.parent)
    except CampaignError as error:
        raise CampaignError(f"{error}; --campaign-folder tells where the campaign's files are") from None
    results.write(history, output)
    print(hit_text(history))
    for written in (output, *save_figures(history, output.parent, output.stem)):
        print(written)


def _study(arguments: argparse.Namespace) -> None:
    from . import results
    from .analysis.study import study, study_text
    from .campaign.campaign import Campaign, CampaignError
    from .plotting import study_figure

    campaign = Campaign.from_toml(arguments.campaign)
    output = arguments.output or Path(arguments.campaign.stem + "_study.nc")
    _check_output(output, overwrite=arguments.overwrite)
    try:
        with _progress() as progress:
            dataset = study(campaign, hits=arguments.hits, device=arguments.device, progress=progress)
    except MemoryError as error:
        raise CampaignError(f"{arguments.campaign}: {error}") from None
    results.write(dataset, output)
    print(study_text(dataset))
    picture = output.with_suffix(".png")
    study_figure(dataset).savefig(picture, dpi=150)
    for written in (output, picture):
        print(written)


def _validate(arguments: argparse.Namespace) -> None:
    from importlib.resources import files

    from .analysis.paper import validation_table
    from .campaign.campaign import Campaign
    from .campaign.run import run

    bundled = Path(str(files("warpimpact.campaigns") / "paper_shots.toml"))
    campaign = Campaign.from_toml(arguments.campaign or bundled)
    print(validation_table(run(campaign, device=arguments.device)))


def _check_output(path: Path, *, overwrite: bool) -> None:
    """Refuse before hours of computing what could not be written after them."""
    from .results import OutputError

    _check_place(path)
    if path.exists() and not overwrite:
        raise OutputError(f"{path}: exists already; name another file or give --overwrite")


def _check_place(path: Path) -> None:
    from .results import OutputError

    if path.is_dir():
        raise OutputError(f"{path}: is a folder, but the result is one file")
    _check_folder(path.parent)


def _check_folder(folder: Path) -> None:
    from .results import OutputError

    try:
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise OutputError(f"{folder}: cannot be written into ({error.strerror})") from None


@contextmanager
def _progress() -> Iterator[Callable[[int, int], None]]:
    """Shows (done, total): a bar on a terminal, a line per tenth in a log."""
    if not sys.stderr.isatty():
        yield _log_tenths()
        return
    from tqdm import tqdm

    with tqdm(unit="hit") as bar:

        def show(done: int, total: int) -> None:
            bar.total = total
            bar.update(done - bar.n)

        yield show


def _log_tenths() -> Callable[[int, int], None]:
    shown = 0

    def show(done: int, total: int) -> None:
        nonlocal shown
        tenths = 10 * done // total
        if tenths > shown:
            shown = tenths
            print(f"{done} of {total} hits", file=sys.stderr, flush=True)

    return show
