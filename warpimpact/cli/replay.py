"""The command replay: compute one hit of a result again, with its history."""

import argparse
from pathlib import Path

from .mistakes import suggest_campaign_folder
from .options import Commands, add_campaign_folder, add_command, add_output, add_overwrite, add_result, at_least
from .paths import check_output, check_suffix


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
