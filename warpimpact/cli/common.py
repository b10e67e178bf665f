"""What several commands share: outputs that are refused early, what computes, exit codes, and progress.

Progress is one line that is rewritten on a terminal, and lines in a log.
"""

import argparse
import os
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from warpimpact.analysis.numbers import interval_text
from warpimpact.campaign.campaign import Campaign
from warpimpact.errors import FileExists, OutputError, ResultError
from warpimpact.measures.hits import failed
from warpimpact.measures.references import Result, as_dataset
from warpimpact.records import attributes as attr
from warpimpact.results.files import atomic_path, check_writable
from warpimpact.runs.options import RunOptions, RunProgress
from warpimpact.runs.store import Store
from warpimpact.scene.input_files import parsed, read_text
from warpimpact.scene.units import count_text

from .messages import say, warn

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PICTURES = (".png", ".pdf", ".svg")
"""Formats of figures."""
_SILENCE = {True: 0.1, False: 60.0}
"""Longest time between two lines [s], by whether they go to a terminal."""
_SHORT = 2.0
"""Seconds after which a pilot is announced, and after the first item a rate."""


def named(paths: Sequence[Path]) -> dict[str, Path]:
    """Return results by different names: the stems of the files if these differ, else the whole paths."""
    if repeated := [path for path in paths if paths.count(path) > 1]:
        raise ResultError(f"{repeated[0]}: got this result {len(repeated)} times, but each result counts once")
    stems = [path.stem for path in paths]
    return dict(zip(stems if len(set(stems)) == len(stems) else map(str, paths), paths, strict=True))


def check_output(arguments: argparse.Namespace, path: Path, *suffixes: str, overwrite: bool | None = None) -> None:
    """Refuse, before anything is computed, a file that cannot be written, has another suffix, is one that the command
    reads, or exists and must not be replaced.

    Args:
        overwrite: whether it may be replaced; by default as --overwrite says.
    """
    if path.is_dir():
        raise OutputError(f"{path}: is a folder, but the output is one file")
    if suffixes and path.suffix.lower() not in suffixes:
        raise OutputError(f"{path}: the name must end in {' or '.join(suffixes)}")
    check_folder(path.parent)
    check_writable(path)
    if not path.exists():
        return
    given = {name: value for name, value in vars(arguments).items() if name not in ("output", "animation")}
    named = [file for value in given.values() for file in (value if isinstance(value, list) else [value])]
    for file in files_read(file for file in named if isinstance(file, Path)):
        if path.samefile(file):
            raise OutputError(f"{path}: is the same file as {file}, which this command reads; name another file")
    if not (arguments.overwrite if overwrite is None else overwrite):
        raise FileExists(f"{path}: exists already; name another file or give --overwrite")


def files_read(paths: Iterable[Path]) -> set[Path]:
    """Those of some files that exist, and the files that they name if they are TOML, and so on."""
    known, waiting = set[Path](), [*paths]
    while waiting:
        path = waiting.pop()
        if path in known or not os.path.isfile(path):  # False of a text that is too long for a name
            continue
        known.add(path)
        if path.suffix == ".toml":
            with suppress(OSError, ValueError):  # the command says what is wrong with it
                waiting += [path.parent / text for text in _texts(parsed(read_text(path), str(path)))]
    return known


def _texts(part: Any) -> Iterator[str]:
    """All texts of some tables that may be names of files."""
    if isinstance(part, str):
        yield part
    for inner in part.values() if isinstance(part, dict) else part if isinstance(part, list) else ():
        yield from _texts(inner)


def check_folder(folder: Path) -> None:
    """Refuse a folder in which no file can be written."""
    try:
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise OutputError(f"{folder}: cannot be written into ({error.strerror})") from None


def outputs(arguments: argparse.Namespace, stem: str, suffix: str = ".nc") -> tuple[Path, Path]:
    """Return the result of a command and its figure, which may be replaced with --overwrite.

    So they may with --resume where the result is begun or complete.
    """
    output = arguments.output or Path(stem + suffix)
    replaces = arguments.overwrite or (getattr(arguments, "resume", False) and Store(output).is_begun)
    for path, ending in ((output, suffix), (output.with_suffix(".png"), ".png")):
        check_output(arguments, path, ending, overwrite=replaces)
    return output, output.with_suffix(".png")


def save_figure(figure: "Figure", picture: Path, output: Path) -> None:
    """Save the figure of a result and say where both are."""
    figure.savefig(picture, dpi=150)
    print(f"written to {output}, figure in {picture}")


def write_text(text: str, path: Path) -> None:
    """Write a text, whole or not at all."""
    with atomic_path(path) as file:
        file.write_text(text, encoding="utf-8")


def output_store(arguments: argparse.Namespace, output: Path) -> Store:
    """Return the file of a computation, and what --resume and --overwrite do to an earlier one."""
    return Store(output, resume=arguments.resume, overwrite=arguments.overwrite)


@contextmanager
def run_options(arguments: argparse.Namespace, unit: str = "hit") -> Iterator[RunOptions]:
    """The options of a computation that shows its progress, or of several one after another.

    Args:
        arguments: --device, and --workers and --scheduler of commands that have them; with --quiet nothing is shown.
        unit: name of the counted items.
    """
    workers, scheduler = (getattr(arguments, name, None) for name in ("workers", "scheduler"))
    with show_progress(arguments, unit) as show:
        yield RunOptions(arguments.device, workers, scheduler, show, warn=warn)


def with_elements(arguments: argparse.Namespace, campaign: Campaign) -> Campaign:
    """The campaign with the hits by finite elements for which --elements or --fast ask."""
    return campaign.with_continuum_hits(continuum_hits(arguments, campaign.continuum.hits))


def continuum_hits(arguments: argparse.Namespace, of_file: int | None) -> int | None:
    """The number of hits by finite elements for which --elements or --fast ask, or else a file."""
    return None if arguments.fast else arguments.continuum_hits or of_file


def failure_code(result: Result, path: Path) -> int:
    """Return 3, with a message, if more shots failed than the campaign allows; else 0."""
    share, allowed = float(failed(as_dataset(result)).mean()), result.attrs[attr.FAILED_SHARE]
    if share <= allowed:
        return 0
    say(
        f"{100.0 * share:.3g} % of the shots failed, more than output.failed_share ({100.0 * allowed:g} %); "
        f"warpimpact inspect {path} lists them"
    )
    return 3


@contextmanager
def show_progress(arguments: argparse.Namespace, unit: str = "hit") -> Iterator[Callable[[RunProgress], None]]:
    """Show the progress of a computation, with its running estimates; arguments as in `run_options`."""
    display = _Display(unit)
    yield (lambda now: None) if arguments.quiet else display.show
    display.end()


class _Display:
    """Writes a line at the start, after every tenth, and after a silence; on a terminal over the one before."""

    def __init__(self, unit: str) -> None:
        self._unit, self._is_terminal = unit, sys.stderr.isatty()
        self._begin = self._last = time.monotonic()
        self._done = self._first = 0
        self._computation, self._phase, self._point = (0, False), "", ""

    def show(self, run: RunProgress) -> None:
        """Take in the progress of the computation.

        Items that an earlier computation had done do not count for the rate, nor does the time of the pilot.
        """
        now, computation, done, total = time.monotonic(), (run.total, run.piloting), run.done, run.total
        if run.point != self._point:
            self.end()
            self._point = run.point
            print(run.point, file=sys.stderr)
        if computation != self._computation or done < self._done == total:  # another one
            self._computation, self._begin, self._first, self._phase = computation, now, run.resumed, ""
        else:
            done = max(done, self._done)  # items under way may be given up
            if self._first == run.resumed < done:  # kernels may have been compiled before the first item
                self._begin, self._first = now, done
        level = "" if run.level is None else f": level {run.level}"
        before = f"choosing the resolution{level}" if run.piloting else ""
        self._done, elapsed, fresh = done, now - self._begin, done - self._first
        phase = before or f"{10 * done // total}"
        is_recent = now - self._last < _SILENCE[self._is_terminal]
        if (is_recent and phase == self._phase) or (before and elapsed < _SHORT):
            return
        self._last, self._phase = now, phase
        line = f"{before} ({elapsed:.0f} s)" if before else f"{done} of {count_text(total, self._unit)}"
        if fresh > 0 and elapsed >= _SHORT:
            line += f", {fresh / elapsed:.4g} {self._unit}s/s, {(total - done) * elapsed / fresh:.0f} s left"
        if (text := run.text or _estimates(run)) and done > run.resumed:
            line += f"; {text}"
        if self._is_terminal:
            line = f"\r{line[: shutil.get_terminal_size().columns - 1]}\x1b[K"
        print(line, end="" if self._is_terminal else "\n", file=sys.stderr, flush=True)

    def end(self) -> None:
        """Go to the next line of a terminal."""
        if self._is_terminal and self._phase:
            print(file=sys.stderr)


def _estimates(run: RunProgress) -> str:
    """Write running estimates and failed shots as one short line."""
    parts = [f"{run.failed} failed"] if run.failed else []
    for measure, estimate in run.estimates.items():
        if estimate.count > 1:
            shown = estimate.times(measure.display.factor)
            interval = interval_text(shown.low, shown.high, digits=".5g")
            parts.append(f"{measure.text} {shown.value:.5g} ({interval}){measure.display.suffix}")
    return ", ".join(parts)
