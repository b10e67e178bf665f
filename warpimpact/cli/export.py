"""The commands replay, export and report: a hit or a result for other programs and other people."""

import argparse
from contextlib import ExitStack
from pathlib import Path

from .mistakes import suggest_campaign_folder
from .options import (
    Commands,
    add_campaign_folder,
    add_command,
    add_output,
    add_overwrite,
    add_result,
    add_results,
    at_least,
)
from .paths import check_folder, check_output, check_suffix, named
from .progress import Step, show_progress


def add_replay(commands: Commands) -> None:
    parser = add_command(
        commands,
        "replay",
        _replay,
        summary="compute a hit of a result again, with its history",
        description="Compute a hit of a result again on the CPU. Write its history as netCDF and PNG files. The end "
        "has the bits of the stored outcome if the same kind of CPU and the same version computed the result. If a "
        "GPU computed it, both agree within rounding.",
        example="replay slotted.nc --hit 34",
    )
    add_result(parser)
    parser.add_argument("--hit", type=int, required=True, metavar="N", help="number of the hit in the result, from 0")
    add_output(parser, "HIT.nc", "history file (default: RESULT_hitN.nc in the folder of the result)")
    add_campaign_folder(
        parser, "folder of the files that the campaign names, such as a hit list (default: the result's folder)"
    )
    parser.add_argument(
        "--snapshots",
        type=at_least(2),
        default=6,
        metavar="N",
        help="instants at which the history shows what is left of the target, each of which takes memory and time",
    )
    parser.add_argument(
        "--animation", type=Path, metavar="HIT.gif", help="also write a film of the hit; HIT.mp4 needs FFmpeg"
    )
    add_overwrite(parser, "an existing history")


def _replay(arguments: argparse.Namespace) -> None:
    from warpimpact.plotting.trajectory import FIGURES, save_animation, save_figures, writer_for
    from warpimpact.results import files
    from warpimpact.results.replayed_hit import hit_view
    from warpimpact.runs.replay import replay
    from warpimpact.view.view import text_of

    result, path, film = files.read(arguments.result), arguments.result, arguments.animation
    output = arguments.output or path.with_name(f"{path.stem}_hit{arguments.hit}.nc")
    check_output(output, overwrite=arguments.overwrite)
    check_suffix(output, "a history", ".nc")
    for figure in FIGURES:
        check_output(output.with_name(f"{output.stem}_{figure.__name__}.png"), overwrite=arguments.overwrite)
    if film:
        writer_for(film)
        check_output(film, overwrite=arguments.overwrite)
    with suggest_campaign_folder():
        folder = arguments.campaign_folder or path.parent
        history = replay(result, arguments.hit, folder=folder, snapshots=arguments.snapshots)
    files.write(history, output)
    print(text_of(hit_view(history)))
    for written in (output, *save_figures(history, output.parent, output.stem)):
        print(written)
    if film:
        save_animation(history, film)
        print(film)


def add_export(commands: Commands) -> None:
    parser = add_command(
        commands,
        "export",
        _export,
        summary="write a result as CSV, a hit for ParaView, or a plate as a drawing",
        description="Write a result as CSV, one row per hit. Or write the history of a hit as a folder of VTK files; "
        "open its core.pvd and plate.pvd in ParaView. VTK needs: pip install 'warpimpact[vtk]'. Or write the holes of "
        "a campaign's plate as an SVG or DXF drawing in mm. DXF needs: pip install 'warpimpact[cad]'.",
        example="export slotted.nc -o slotted.csv",
    )
    parser.add_argument(
        "file",
        type=Path,
        metavar="RESULT.nc|HIT.nc|CAMPAIGN.toml",
        help="written by warpimpact run or replay, or a campaign file",
    )
    add_output(
        parser,
        "RESULT.csv|FOLDER|PLATE.svg|PLATE.dxf",
        "CSV file, new folder for VTK, or drawing (default: the file's name with .csv, _vtk or .svg, in its folder)",
    )
    add_overwrite(parser, "an existing file")


def _export(arguments: argparse.Namespace) -> None:
    from warpimpact.campaign.campaign import Campaign
    from warpimpact.export.drawing import SUFFIXES, write_drawing
    from warpimpact.export.paraview import write_vtk
    from warpimpact.export.spreadsheet import write_csv
    from warpimpact.results import files
    from warpimpact.results.kinds import HISTORY, HIT_MAP

    path, output = arguments.file, arguments.output
    if path.suffix == ".toml":
        output = output or path.with_suffix(".svg")
        check_suffix(output, "a drawing", *SUFFIXES)
        check_output(output, overwrite=arguments.overwrite)
        write_drawing(Campaign.from_toml(path).plate, output)
        print(output)
        return
    with files.opened(path, HIT_MAP, HISTORY) as dataset:
        if files.is_history(dataset):
            output = output or path.with_name(f"{path.stem}_vtk")
            check_folder(output.parent)
            if output.suffix:
                raise files.OutputError(
                    f"{output}: the history of a hit is written as a folder, so give a name without a dot"
                )
            if output.exists():
                raise files.OutputError(f"{output}: exists already; give a new folder with -o")
            written = write_vtk(dataset.load(), output)
        else:
            output = output or path.with_suffix(".csv")
            check_suffix(output, "a table", ".csv")
            check_output(output, overwrite=arguments.overwrite)
            write_csv(dataset, output)
            written = [output]
    for file in written:
        print(file)


def add_report(commands: Commands) -> None:
    parser = add_command(
        commands,
        "report",
        _report,
        summary="write a report as one HTML file",
        description="Write a report of one or several results as one HTML file that works offline. It shows the "
        "campaign, the plates, interactive maps and trajectories, numbers with intervals, and the limits of the model. "
        "A posterior is reported alone: its parameters, what they explain, and its figures. So is a search for "
        "designs: a click on a point of its front shows the plate, its map and its campaign.",
        example="report slotted.nc -o slotted.html",
    )
    add_results(parser)
    add_output(parser, "REPORT.html", "report file (default: the name of the first result with .html, in its folder)")
    parser.add_argument(
        "--trajectories",
        type=at_least(0),
        default=32,
        metavar="N",
        help="number of hits to replay per result: the worst hits, and others spread evenly (default: 32)",
    )
    add_campaign_folder(parser, "folder of the files that the campaigns name (default: the folder of each result)")
    add_overwrite(parser, "an existing report")


def _report(arguments: argparse.Namespace) -> None:
    from warpimpact.report.one_file import write_file_report
    from warpimpact.report.report import report_page
    from warpimpact.results import files
    from warpimpact.results.kinds import HIT_MAP

    paths = arguments.results
    output = arguments.output or paths[0].with_suffix(".html")
    check_suffix(output, "a report", ".html")
    check_output(output, overwrite=arguments.overwrite)
    for path, kind in zip(paths, map(files.kind_of, paths), strict=True):
        if kind is not HIT_MAP:
            if len(paths) > 1:
                raise files.ResultError(f"got {len(paths)} files, one of which is {kind.name}, which is reported alone")
            write_file_report(path, kind, output, arguments.campaign_folder or path.parent)
            print(output)
            return
    by_name = named(paths)
    with ExitStack() as stack:
        datasets = {name: stack.enter_context(files.opened(path)) for name, path in by_name.items()}
        show = stack.enter_context(show_progress())
        with suggest_campaign_folder(", or --trajectories 0, which needs none of them"):
            page = report_page(
                datasets,
                folders={name: arguments.campaign_folder or path.parent for name, path in by_name.items()},
                trajectories=arguments.trajectories,
                progress=lambda done, total: show(Step(done, total)),
            )
    with files.aside(output) as file:
        file.write_text(page, encoding="utf-8")
    print(output)
