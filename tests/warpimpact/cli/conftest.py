"""What a command that must be refused says."""

from collections.abc import Callable

import pytest

from warpimpact.cli import main


@pytest.fixture
def refusal(capsys: pytest.CaptureFixture[str]) -> Callable[[list[str]], str]:
    """A function of a command line that must end with 2 and print one sentence only, which it returns."""

    def sentence(command: list[str]) -> str:
        capsys.readouterr()
        assert main(command) == 2
        shown = capsys.readouterr()
        assert shown.out == ""
        assert shown.err.startswith("warpimpact: error: ")
        assert shown.err.count("\n") == 1
        assert shown.err[:-1].isprintable()
        assert len(shown.err) < 700
        return shown.err.removeprefix("warpimpact: error: ").rstrip("\n")

    return sentence
