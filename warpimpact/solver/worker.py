"""Who computes: a device, its threads, and a token by which another thread ends the computation."""

import threading
from dataclasses import dataclass


class Cancelled(Exception):
    """The computation was cancelled."""


class Cancel:
    """A token that the march checks between two launches of a kernel."""

    def __init__(self, outer: "Cancel | None" = None) -> None:
        """Create a token that is also cancelled with an outer one."""
        self._requested, self._outer = threading.Event(), outer

    def cancel(self) -> None:
        """Cancel all computations that were given this token."""
        self._requested.set()

    @property
    def cancelled(self) -> bool:
        """Whether the token, or its outer one, was cancelled."""
        return self._requested.is_set() or (self._outer is not None and self._outer.cancelled)

    def check(self) -> None:
        """Raise Cancelled if the token was cancelled."""
        if self.cancelled:
            raise Cancelled


NEVER = Cancel()
"""Token of computations that nobody cancels."""


@dataclass(frozen=True)
class Worker:
    """Who computes.

    Attributes:
        device: "auto" (CUDA if there is one, else CPU), "cpu", "cuda:0", …
        threads: number of threads on a CPU; None is one for every core that this process may use.
        cancel: token that ends the computation with Cancelled.
    """

    device: str = "auto"
    threads: int | None = None
    cancel: Cancel = NEVER
