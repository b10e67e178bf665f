"""The mean of the worst tenth as a mean over all shots, so that it has the intervals of a mean.

R. T. Rockafellar and S. Uryasev (Journal of Risk 2 (2000) 21) write it as the smallest mean of q + (x − q)₊ / 0.1 over
q, where q is the quantile of 0.9. At the minimum an error of q has no effect to first order. The interval is therefore
that of this mean at the sample's q.
"""

import numpy as np

from warpimpact.statistics.intervals import Array

WORST = 0.1
"""Share of the shots that is the worst tenth."""
_FEWEST = 40
"""Fewest independent shots in the worst tenth for an interval that holds with its stated confidence."""


def worst_tenth(values: Array) -> Array:
    """Numbers whose mean is that of the largest tenth of the values; NaN stays NaN; shape as of the values."""
    known = values[~np.isnan(values)]
    if not len(known):
        return values
    start = float(np.quantile(known, 1.0 - WORST, method="inverted_cdf"))
    return start + np.maximum(values - start, 0.0) / WORST


def has_interval(count: int, images: int) -> bool:
    """Whether the worst tenth of `count` shots has an interval; `images` of them in a row count as one."""
    return count * WORST >= _FEWEST * images
