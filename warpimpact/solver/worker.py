"""Who computes: a device, its threads, and a token by which another thread ends the computation."""

import threading
from dataclasses import dataclass


class Cancelled(Exception):
    """The computation was cancelled."""


class Cancel:
    """Passed down to the march, which looks at it between two launches of a kernel."""

    def __init__(self, outer: "Cancel | None" = None) -> None:
        """A token that is cancelled with an outer one, too."""
        self._asked, self._outer = threading.Event(), outer

    def cancel(self) -> None:
        """End what was given this token."""
        self._asked.set()

    @property
    def cancelled(self) -> bool:
        """Whether it was cancelled."""
        return self._asked.is_set() or (self._outer is not None and self._outer.cancelled)

    def check(self) -> None:
        """Raise Cancelled if it was cancelled."""
        if self.cancelled:
            raise Cancelled


NEVER = Cancel()
"""Of computations that nobody cancels."""


@dataclass(frozen=True)
class Worker:
    """Who computes.

    Attributes:
        device: "auto" (CUDA if there is one, else CPU), "cpu", "cuda:0", …
        threads: number on a CPU; None is one for every core that this process may use.
        cancel: ends what it computes, which then raises Cancelled.
    """

    device: str = "auto"
    threads: int | None = None
    cancel: Cancel = NEVER
