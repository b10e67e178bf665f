"""When a stop rule looks at its interval."""

import math
from collections.abc import Iterator


def looks(sampling: str, shards: int) -> Iterator[int]:
    """Numbers of shards after which a stop rule looks at its interval. There are few looks, because the spread may be
    small by accident at any of them. Sobol points are balanced at powers of two."""
    at = 1
    while at < shards:
        yield at
        at = 2 * at if sampling == "sobol" else max(at + 1, math.ceil(1.25 * at))
    yield shards
