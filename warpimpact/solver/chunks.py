"""Shots of a march in chunks, which threads take one after another."""

from __future__ import annotations

import math
import threading

CHUNK = 64
"""Most shots of a chunk, where other threads look for the progress."""
SHARES = 3
"""Chunks per thread into which the shots that are left would be divided at least."""
SHORTEST, LONGEST = 0.002, 0.25
"""Seconds that a chunk is to take. A computation can be broken off between two of them."""


class Chunks:
    """Some shots in chunks; safe to use by several threads.

    The first chunks are of one shot each, as some scenes take seconds per shot. The last ones are small, as no thread
    is to wait long for another.

    Attributes:
        total, done: shots, and how many of them are computed.
    """

    def __init__(self, total: int, together: int, shares: int, most: int) -> None:
        """So many shots.

        Args:
            together: shots in a row that no two chunks share.
            shares: into how many the shots that are left would be divided at least, if that takes no time.
            most: shots of a chunk.
        """
        self.total, self.done = total, 0
        self._together, self._shares, self._most = together, shares, most
        self._begun, self._pace, self._lock = 0, math.inf, threading.Lock()

    def take(self) -> tuple[int, int]:
        """The first shot of a chunk that nobody has taken, and their number; 0 where none is left."""
        with self._lock:
            left, fewest, most = self.total - self._begun, SHORTEST / self._pace, LONGEST / self._pace
            count = min(max(left // self._shares, int(fewest)), int(most), self._most)
            first, count = self._begun, min(chunk_of(max(1, count), self._together), left)
            self._begun += count
            return first, count

    def computed(self, count: int, seconds: float) -> None:
        """So many shots of a chunk are computed, in so many seconds."""
        with self._lock:
            self.done += count
            self._pace = max(seconds, 1e-9) / count

    def end(self) -> None:
        """Nobody takes what is left."""
        with self._lock:
            self._begun = self.total


def chunk_of(most: int, count: int) -> int:
    """Shots of a chunk, at most so many but at least one plate: those at one plate stay together."""
    return max(1, most // count) * count
