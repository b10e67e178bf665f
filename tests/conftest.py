"""Options and fixtures that all tests share."""

import os
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import matplotlib
import pytest
import warp as wp
from hypothesis.configuration import set_hypothesis_home_dir

from warpimpact.kernels import variant
from warpimpact.solver.device import find_device

ROUNDINGS = {
    "native": variant.CPU_FLAGS,
    # The processor that all of a kind have in common: narrow vectors, and no product and sum in one step.
    "other": variant.CPU_FLAGS.replace("-march=native", "").replace("-ffp-contract=fast", "-ffp-contract=off"),
}
"""Compiler flags by the value of --warp-rounding."""


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--warp-mode",
        choices=("release", "debug"),
        default="release",
        help="how Warp builds kernels; debug checks array bounds",
    )
    parser.addoption(
        "--warp-rounding",
        choices=ROUNDINGS,
        default="native",
        help="how kernels round on the CPU; other is as on another processor",
    )


def pytest_configure(config: pytest.Config) -> None:
    wp.config.mode = config.getoption("--warp-mode")  # before any kernel is built
    wp.config.log_level = max(wp.config.log_level, wp.LOG_WARNING)
    variant.CPU_FLAGS = os.environ["WARPIMPACT_CPU_FLAGS"] = ROUNDINGS[config.getoption("--warp-rounding")]


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    if "device" in metafunc.fixturenames:
        metafunc.parametrize("device", _devices(), scope="session")


def _devices() -> list[str]:
    return ["cpu"] if find_device("auto").is_cpu else ["cpu", "cuda:0"]


class Guard:
    """Raises where Python writes, renames or deletes a file outside some folders, and remembers it."""

    EVENTS = dict.fromkeys(("os.remove", "os.mkdir", "os.rmdir", "shutil.rmtree"), slice(1)) | {
        "os.rename": slice(2),
        "os.link": slice(1, 2),
        "os.symlink": slice(1, 2),
    }
    """Which arguments of an event are paths that change; a path in an open folder (dir_fd) is one of shutil.rmtree."""

    def __init__(self, *folders: Path) -> None:
        self._folders, self.outside, self.holds = [str(folder.resolve()) + os.sep for folder in folders], [], False

    def __call__(self, event: str, arguments: tuple[Any, ...]) -> None:
        if not self.holds:
            return
        if event == "open":
            path, _, flags = arguments
            is_written = flags & (os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC)
            paths = [path] if is_written and path != os.devnull else []
        else:
            is_plain = event in self.EVENTS and arguments[-1] in (-1, None)
            paths = arguments[self.EVENTS[event]] if is_plain else []
        for path in paths:
            if isinstance(path, str | bytes | os.PathLike) and self._is_outside(os.fsdecode(path)):
                self.outside.append(f"{event} {os.fsdecode(path)}")
                raise PermissionError(f"a test must not write to {path}; tmp_path is its folder")

    def _is_outside(self, path: str) -> bool:
        place = os.path.join(os.path.realpath(os.path.dirname(path)), os.path.basename(path))
        return "__pycache__" not in place and not f"{place}{os.sep}".startswith(tuple(self._folders))


@pytest.fixture(scope="session")
def guard(tmp_path_factory: pytest.TempPathFactory) -> Guard:
    """Only temporary folders and caches of libraries may change; another temporary folder serves tempfile."""
    folder = tmp_path_factory.mktemp("temporary")
    tempfile.tempdir = os.environ["TMPDIR"] = str(folder)
    find_device("cpu")  # Warp chooses the folder of its cache
    set_hypothesis_home_dir(folder)
    caches = Path(wp.config.kernel_cache_dir), Path(matplotlib.get_cachedir())
    guard = Guard(tmp_path_factory.getbasetemp(), *caches)
    sys.addaudithook(guard)
    return guard


@pytest.fixture(autouse=True)
def writes_to_its_folder_alone(guard: Guard) -> Iterator[None]:
    guard.holds, was_device = True, Path(os.devnull).is_char_device()
    yield
    guard.holds = False
    outside, guard.outside = guard.outside, []
    assert not outside, f"written outside tmp_path: {outside}"
    assert not was_device or Path(os.devnull).is_char_device()
