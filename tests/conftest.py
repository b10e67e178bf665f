"""Options and fixtures that all tests share."""

import pytest
import warp as wp

from warpimpact.campaign.campaign import Campaign
from warpimpact.runs import run


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--warp-mode",
        choices=("release", "debug"),
        default="release",
        help="how Warp builds kernels; debug checks array bounds",
    )


def pytest_configure(config: pytest.Config) -> None:
    wp.config.mode = config.getoption("--warp-mode")  # before any kernel is built
    run.has_assumptions = _where_asked


def _where_asked(campaign: Campaign) -> bool:
    """Hits under assumptions only where a campaign asks for them: by default every run with a pilot has some 900 of
    them, and builds of bending cores. The default is tested by itself, and by all that is run as a command."""
    return campaign.assumptions.compute is True


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    if "device" in metafunc.fixturenames:
        metafunc.parametrize("device", _devices(), scope="session")


def _devices() -> list[str]:
    wp.config.log_level = max(wp.config.log_level, wp.LOG_WARNING)
    return ["cpu", "cuda:0"] if wp.is_cuda_available() else ["cpu"]
