"""Options and fixtures that all tests share."""

import pytest
import warp as wp


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--warp-mode",
        choices=("release", "debug"),
        default="release",
        help="how Warp builds kernels; debug checks array bounds",
    )


def pytest_configure(config: pytest.Config) -> None:
    wp.config.mode = config.getoption("--warp-mode")  # before any kernel is built


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    if "device" in metafunc.fixturenames:
        metafunc.parametrize("device", _devices(), scope="session")


def _devices() -> list[str]:
    wp.config.log_level = max(wp.config.log_level, wp.LOG_WARNING)
    return ["cpu", "cuda:0"] if wp.is_cuda_available() else ["cpu"]
