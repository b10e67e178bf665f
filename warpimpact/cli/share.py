"""The commands replay, export and report: a hit or a result for other programs and other people."""

import argparse
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

from warpimpact.analysis.numbers import text_of
from warpimpact.campaign.campaign import Campaign
from warpimpact.campaign.text import CampaignError
from warpimpact.export.drawing import SUFFIXES, write_drawing
from warpimpact.export.paraview import write_vtk
from warpimpact.export.spreadsheet import write_csv
from warpimpact.plotting.trajectory import FIGURES, save_animation, save_figures, writer_for
from warpimpact.report.one_file import file_page
from warpimpact.report.report import report_page
from warpimpact.results import files
from warpimpact.results.kinds import HISTORY, HIT_MAP
from warpimpact.results.replayed_hit import hit_view
from warpimpact.runs.replay import replay

from .paths import check_folder, check_output, named, write_text
from .progress import Step, show_progress


def replay_command(arguments: argparse.Namespace) -> None:
    result, path, film = files.read(arguments.result), arguments.result, arguments.animation
    output = arguments.output or path.with_name(f"{path.stem}_hit{arguments.hit}.nc")
    check_output(output, ".nc", overwrite=arguments.overwrite)
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


def export_command(arguments: argparse.Namespace) -> None:
    path, output = arguments.file, arguments.output
    if path.suffix == ".toml":
        output = output or path.with_suffix(".svg")
        check_output(output, *SUFFIXES, overwrite=arguments.overwrite)
        print(*write_drawing(Campaign.from_toml(path).plate, output), output, sep="\n")
        return
    with files.opened(path, HIT_MAP, HISTORY) as dataset:
        if files.is_history(dataset):
            if output is not None:
                raise files.OutputError(f"{output}: a history is written as a folder; name a new one with --folder")
            folder = arguments.folder or path.with_name(f"{path.stem}_vtk")
            check_folder(folder.parent)
            if folder.exists():
                raise files.OutputError(f"{folder}: exists already; name a new folder with --folder")
            written = write_vtk(dataset.load(), folder)
        else:
            output = output or path.with_suffix(".csv")
            check_output(output, ".csv", overwrite=arguments.overwrite)
            write_csv(dataset, output)
            written = [output]
    for file in written:
        print(file)


def report_command(arguments: argparse.Namespace) -> None:
    paths = arguments.results
    output = arguments.output or paths[0].with_suffix(".html")
    check_output(output, ".html", overwrite=arguments.overwrite)
    for path, kind in zip(paths, map(files.kind_of, paths), strict=True):
        if kind is not HIT_MAP:
            if len(paths) > 1:
                raise files.ResultError(f"got {len(paths)} files, one of which is {kind.name}, which is reported alone")
            write_text(file_page(path, kind, arguments.campaign_folder or path.parent), output)
            print(output)
            return
    by_name = named(paths)
    with ExitStack() as stack:
        datasets = {name: stack.enter_context(files.opened(path)) for name, path in by_name.items()}
        show = stack.enter_context(show_progress(arguments))
        with suggest_campaign_folder(", or --trajectories 0, which needs none of them"):
            page = report_page(
                datasets,
                folders={name: arguments.campaign_folder or path.parent for name, path in by_name.items()},
                trajectories=arguments.trajectories,
                progress=lambda done, total: show(Step(done, total)),
            )
    write_text(page, output)
    print(output)


@contextmanager
def suggest_campaign_folder(more: str = "") -> Iterator[None]:
    """Add the option that may help to an error of the campaign in a result; `more` follows it."""
    try:
        yield
    except CampaignError as error:
        raise CampaignError(f"{error}; give the folder of the campaign's files with --campaign-folder{more}") from None
