"""The warpimpact command."""

import argparse
import math
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
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
    from .device import DeviceError
    from .results import OutputError, ResultError

    return CampaignError, ClusterError, OutputError, ResultError, DeviceError


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
    _add_compare(commands)
    _add_plate(commands)
    _add_replay(commands)
    _add_export(commands)
    _add_report(commands)
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
        help="draw the maps of a result, or of several side by side",
        description="Draw the figures of a result as PNG files: maps, marginal distributions, residual velocity "
        "against tilt, and how sure a map is. Of several results, maps side by side in the same colours.",
        epilog="example: warpimpact plot slotted.nc -o maps",
    )
    parser.add_argument("results", type=Path, nargs="+", metavar="RESULT.nc", help="written by warpimpact run")
    parser.add_argument("-o", "--output", type=Path, metavar="FOLDER", help="existing folder (default: the result's)")
    parser.set_defaults(command=_plot)


def _add_compare(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    parser = commands.add_parser(
        "compare",
        help="tell which of several plates protects better",
        description="Compare plates that were hit by the same shots: rankings, differences with their intervals, and a "
        "figure. A campaign with several plates is run first, each plate into NAME.nc beside the figure; a plate "
        "whose result is there already is not run again.",
        epilog="example: warpimpact compare campaigns/two_plates.toml, or: warpimpact compare slotted.nc round.nc",
    )
    parser.add_argument(
        "files",
        type=Path,
        nargs="+",
        metavar="RESULT.nc",
        help="two or more results of warpimpact run, or one campaign with several [[plate]] tables",
    )
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        metavar="FIGURE.png",
        help="figure, PNG, PDF or SVG (default: comparison.png here, or the campaign's name)",
    )
    parser.add_argument(
        "--angle",
        default="30 deg",
        metavar="ANGLE",
        help='inclination beyond which a core counts as tilted (default: "%(default)s")',
    )
    parser.add_argument(
        "--standoff",
        metavar="LENGTH",
        help='where tilt counts, such as "130 mm" (default: the largest of the results)',
    )
    _add_device(parser)
    parser.add_argument("--count", type=int, metavar="N", help="number of hits, in place of the campaign's")
    parser.add_argument("--resume", action="store_true", help="continue a campaign that was broken off")
    parser.add_argument("--overwrite", action="store_true", help="compute the plates of a campaign anew")
    parser.set_defaults(command=_compare)


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
    parser.add_argument(
        "--animation", type=Path, metavar="HIT.gif", help="film of the hit too; HIT.mp4 where there is FFmpeg"
    )
    parser.add_argument("--overwrite", action="store_true", help="replace an existing history")
    parser.set_defaults(command=_replay)


def _add_export(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    parser = commands.add_parser(
        "export",
        help="write a result as CSV, or a replayed hit for ParaView",
        description="Write a result as CSV with one row per hit, or the history of a hit as a folder of VTK files: "
        "open core.pvd and plate.pvd of it in ParaView. VTK needs: pip install 'warpimpact[vtk]'",
        epilog="example: warpimpact export slotted.nc -o slotted.csv",
    )
    parser.add_argument(
        "file", type=Path, metavar="RESULT.nc|HIT.nc", help="written by warpimpact run or warpimpact replay"
    )
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        metavar="RESULT.csv|FOLDER",
        help="CSV file, or new folder for VTK (default: the file's name, beside it, with .csv or _vtk)",
    )
    parser.add_argument("--overwrite", action="store_true", help="replace an existing CSV file")
    parser.set_defaults(command=_export)


def _add_report(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    parser = commands.add_parser(
        "report",
        help="write a report as one HTML file",
        description="Write a report of one or several results as one HTML file that works offline: what was asked, the "
        "plates, maps to point at, trajectories to click, numbers with intervals, limits of the model.",
        epilog="example: warpimpact report slotted.nc -o slotted.html",
    )
    parser.add_argument("results", type=Path, nargs="+", metavar="RESULT.nc", help="written by warpimpact run")
    parser.add_argument(
        "-o", "--output", type=Path, metavar="REPORT.html", help="report (default: the first result's name, beside it)"
    )
    parser.add_argument(
        "--trajectories",
        type=_not_negative,
        default=32,
        metavar="N",
        help="hits of each result to replay: the worst, and others spread evenly (default: 32)",
    )
    parser.add_argument("--study", type=Path, metavar="STUDY.nc", help="accuracy, as warpimpact study measured it")
    parser.add_argument(
        "--campaign-folder", type=Path, metavar="FOLDER", help="where the files are that campaigns name, as in replay"
    )
    parser.add_argument("--overwrite", action="store_true", help="replace an existing report")
    parser.set_defaults(command=_report)


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


def _not_negative(text: str) -> int:
    if (number := int(text)) < 0:
        raise argparse.ArgumentTypeError(f"got {number}, but it must not be negative")
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
    from .plotting import save_beside, save_maps

    datasets = {name: results.read(path) for name, path in _named(arguments.results).items()}
    folder = arguments.output or arguments.results[0].parent
    _check_folder(folder)
    stem = "_".join(path.stem for path in arguments.results)
    dataset, *others = datasets.values()
    for path in save_beside(datasets, folder, stem) if others else save_maps(dataset, folder, stem):
        print(path)


def _compare(arguments: argparse.Namespace) -> int:
    from . import results
    from .analysis.comparison import compare, comparison_text
    from .plotting import comparison_figure

    is_campaign = arguments.files[0].suffix == ".toml"
    default = arguments.files[0].stem if is_campaign else "comparison"
    figure = arguments.output or Path(f"{default}.png")
    if figure.suffix not in (".png", ".pdf", ".svg"):
        raise results.OutputError(f"{figure}: must end with .png, .pdf or .svg")
    _check_place(figure)
    angle, standoff = _quantities(arguments)
    paths = _plates_run(arguments, figure.parent) if is_campaign else _named(arguments.files)
    if len(paths) < 2:
        raise results.ResultError(
            f"{arguments.files[0]}: is one result, but two or more, or one campaign, are needed to compare"
        )
    with ExitStack() as stack:
        datasets = [stack.enter_context(results.opened(path)) for path in paths.values()]
        comparison = compare(datasets, list(paths), angle=angle, standoff=standoff)
        code = max(_failure_code(dataset, path) for dataset, path in zip(datasets, paths.values(), strict=True))
    print(comparison_text(comparison))
    comparison_figure(comparison).savefig(figure, dpi=150)
    print(figure)
    return code


def _quantities(arguments: argparse.Namespace) -> tuple[float, float | None]:
    """Angle [rad] and stand-off [m] that a person wrote."""
    from .results import ResultError
    from .scene.units import Angle, Length, quantity

    try:
        angle = quantity(Angle)(arguments.angle)
        standoff = None if arguments.standoff is None else quantity(Length)(arguments.standoff)
    except ValueError as error:
        raise ResultError(f"--angle, --standoff: {error}") from None
    if not 0.0 <= angle < math.pi / 2:
        raise ResultError(f'--angle: got "{arguments.angle}", but it must be at least 0 and less than 90 deg')
    return angle, standoff


def _named(paths: Sequence[Path]) -> dict[str, Path]:
    """Results under names that tell them apart."""
    from .results import ResultError

    if len(set(paths)) < len(paths):
        raise ResultError("the same result is given twice")
    stems = [path.stem for path in paths]
    return dict(zip(stems if len(set(stems)) == len(stems) else map(str, paths), paths, strict=True))


def _plates_run(arguments: argparse.Namespace, folder: Path) -> dict[str, Path]:
    """The results of a campaign's plates by their names, computed where they are not there."""
    from .campaign.campaign import CampaignError
    from .campaign.plates import read_plates
    from .campaign.run import run_to_file

    if len(arguments.files) > 1:
        raise CampaignError(f"{arguments.files[0]}: is a campaign, which is compared on its own")
    campaigns = read_plates(arguments.files[0], count=arguments.count)
    paths = {name: folder / f"{name}.nc" for name in campaigns}
    for name, campaign in campaigns.items():
        print(f"plate {name}", file=sys.stderr)
        try:
            with _terminated_as_interrupted(), _standing() as progress:
                run_to_file(
                    campaign,
                    paths[name],
                    device=arguments.device,
                    resume=arguments.resume or (paths[name].exists() and not arguments.overwrite),
                    overwrite=arguments.overwrite,
                    progress=progress,
                )
        except MemoryError as error:
            raise CampaignError(f"{arguments.files[0]}: {error}") from None
    return paths


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
    from .plotting.animation import save_animation, writer_for
    from .plotting.trajectory import save_figures

    result, path, film = results.read(arguments.result), arguments.result, arguments.animation
    output = arguments.output or path.with_name(f"{path.stem}_hit{arguments.hit}.nc")
    _check_output(output, overwrite=arguments.overwrite)
    if film:
        writer_for(film)
        _check_output(film, overwrite=arguments.overwrite)
    try:
        history = replay(result, arguments.hit, folder=arguments.campaign_folder or path.parent)
    except CampaignError as error:
        raise CampaignError(f"{error}; --campaign-folder tells where the campaign's files are") from None
    results.write(history, output)
    print(hit_text(history))
    for written in (output, *save_figures(history, output.parent, output.stem)):
        print(written)
    if film:
        save_animation(history, film)
        print(film)


def _export(arguments: argparse.Namespace) -> None:
    from . import results
    from .export.paraview import write_vtk
    from .export.table import write_csv

    path, output = arguments.file, arguments.output
    with results.opened_either(path) as dataset:
        if results.is_history(dataset):
            output = output or path.with_name(f"{path.stem}_vtk")
            _check_folder(output.parent)
            if output.exists():
                raise results.OutputError(f"{output}: exists already; name a new folder")
            written = write_vtk(dataset.load(), output)
        else:
            output = output or path.with_suffix(".csv")
            _check_output(output, overwrite=arguments.overwrite)
            write_csv(dataset, output)
            written = [output]
    for file in written:
        print(file)


def _report(arguments: argparse.Namespace) -> None:
    from . import results
    from .campaign.campaign import CampaignError
    from .report.report import write_report

    paths = arguments.results
    output = arguments.output or paths[0].with_suffix(".html")
    _check_output(output, overwrite=arguments.overwrite)
    named = _named(paths)
    with ExitStack() as stack:
        datasets = {name: stack.enter_context(results.opened(path)) for name, path in named.items()}
        study = results.read_study(arguments.study) if arguments.study else None
        progress = stack.enter_context(_progress())
        try:
            write_report(
                datasets,
                output,
                folders={name: arguments.campaign_folder or path.parent for name, path in named.items()},
                trajectories=arguments.trajectories,
                study=study,
                progress=progress,
            )
        except CampaignError as error:
            raise CampaignError(
                f"{error}; --campaign-folder tells where the campaign's files are, --trajectories 0 needs none"
            ) from None
    print(output)


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
