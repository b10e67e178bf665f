"""Export, report: a result as it is handed on."""

import argparse
from contextlib import ExitStack
from pathlib import Path

from .mistakes import folder_told
from .options import Commands, add_campaign_folder, add_command, add_output, add_overwrite, add_results, at_least
from .paths import check_folder, check_output, named
from .progress import show_count


def add_export(commands: Commands) -> None:
    parser = add_command(
        commands,
        "export",
        _export,
        summary="write a result as CSV, or a replayed hit for ParaView",
        description="Write a result as CSV with one row per hit, or the history of a hit as a folder of VTK files: "
        "open core.pvd and plate.pvd of it in ParaView. VTK needs: pip install 'warpimpact[vtk]'",
        example="export slotted.nc -o slotted.csv",
    )
    parser.add_argument(
        "file", type=Path, metavar="RESULT.nc|HIT.nc", help="written by warpimpact run or warpimpact replay"
    )
    add_output(
        parser,
        "RESULT.csv|FOLDER",
        "CSV file, or new folder for VTK (default: the file's name, beside it, with .csv or _vtk)",
    )
    add_overwrite(parser, "an existing CSV file")


def _export(arguments: argparse.Namespace) -> None:
    from warpimpact.export.paraview import write_vtk
    from warpimpact.export.table import write_csv
    from warpimpact.results import files

    path, output = arguments.file, arguments.output
    with files.opened_either(path) as dataset:
        if files.is_history(dataset):
            output = output or path.with_name(f"{path.stem}_vtk")
            check_folder(output.parent)
            if output.exists():
                raise files.OutputError(f"{output}: exists already; name a new folder")
            written = write_vtk(dataset.load(), output)
        else:
            output = output or path.with_suffix(".csv")
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
        description="Write a report of one or several results as one HTML file that works offline: what was asked, the "
        "plates, maps to point at, trajectories to click, numbers with intervals, limits of the model.",
        example="report slotted.nc -o slotted.html",
    )
    add_results(parser)
    add_output(parser, "REPORT.html", "report (default: the first result's name, beside it)")
    parser.add_argument(
        "--trajectories",
        type=at_least(0),
        default=32,
        metavar="N",
        help="hits of each result to replay: the worst, and others spread evenly (default: 32)",
    )
    parser.add_argument("--study", type=Path, metavar="STUDY.nc", help="accuracy, as warpimpact study measured it")
    add_campaign_folder(parser, "where the files are that campaigns name, as in replay")
    add_overwrite(parser, "an existing report")


def _report(arguments: argparse.Namespace) -> None:
    from warpimpact.report.report import write_report
    from warpimpact.results import files

    paths = arguments.results
    output = arguments.output or paths[0].with_suffix(".html")
    check_output(output, overwrite=arguments.overwrite)
    by_name = named(paths)
    with ExitStack() as stack:
        datasets = {name: stack.enter_context(files.opened(path)) for name, path in by_name.items()}
        study = files.read_study(arguments.study) if arguments.study else None
        progress = stack.enter_context(show_count())
        with folder_told(", --trajectories 0 needs none"):
            write_report(
                datasets,
                output,
                folders={name: arguments.campaign_folder or path.parent for name, path in by_name.items()},
                trajectories=arguments.trajectories,
                study=study,
                progress=progress,
            )
    print(output)
