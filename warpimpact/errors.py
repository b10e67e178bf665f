"""Errors that a user can correct: each is one sentence that names what is wrong and the remedy.

Any room may raise one; a command prints its sentence and ends with exit code 2.
"""


class Unfinished(BaseException):
    """A computation that ended early.

    Attributes:
        saved: what can be resumed, and how; empty if nothing can be; None where nothing was begun.
    """

    def __init__(self, *sentence: object, saved: str | None = None) -> None:
        super().__init__(*sentence)
        self.saved = saved

    def __str__(self) -> str:
        sentence = super().__str__()
        return sentence if self.saved is None else f"{sentence}; {self.saved or 'nothing is saved'}"


class WarpImpactError(ValueError):
    """What a user can correct; the message is for the user."""


class CampaignError(WarpImpactError):
    """A campaign cannot be run: file, field, value and what is allowed; `problem` leaves out the file."""

    def __init__(self, problem: object, file: str = "") -> None:
        super().__init__(f"{file}: {problem}" if file else problem)
        self.problem = str(problem)


class TooLong(WarpImpactError):
    """A computation would take too long."""


class DeviceError(WarpImpactError):
    """The requested device does not exist."""


class ClusterError(WarpImpactError):
    """A cluster cannot be used."""


class ResultError(WarpImpactError):
    """A file cannot be read as a warpimpact result."""


class OutputError(Unfinished, WarpImpactError):
    """A file cannot be written."""


class FileExists(OutputError):
    """A file is there already, and must not be replaced."""


class Interrupted(Unfinished, KeyboardInterrupt):
    """A computation was interrupted."""


class WarpImpactWarning(UserWarning):
    """What a user should know while a computation goes on; the message is for the user."""


class Implausible(WarpImpactWarning):
    """A possible value that is probably a mistake."""


class PilotTooLong(WarpImpactWarning):
    """A pilot would take longer than it may."""
