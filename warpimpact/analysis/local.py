"""Local estimates between the hits: a plane through the nearest hits, and its uncertainty."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.stats import norm as normal
from scipy.stats import t as student

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

NEIGHBOURS = 24
"""Number of hits in the fit of a plane. It leaves 21 degrees of freedom for the scatter, and the fit stays local."""
_COEFFICIENTS = 3
_BOTH_SIDES = 0.975
"""Share below the upper end of a 95 % interval."""


class Local(NamedTuple):
    """Estimates at points, each of shape [points] and in the unit of the values: the value, half the width of its
    95 % interval, and the standard deviation of the hits about the plane."""

    value: Array
    half_width: Array
    spread: Array


def plane_fit(offsets: Array, values: Array) -> Local:
    """Value at points by least squares: a plane through the values of the hits near each point (local linear
    regression, Cleveland and Devlin 1988, with equal weights).

    The interval is Student's and uses the scatter about the plane. A bend or a jump of the map among the hits widens it
    as the scatter of shots does. It assumes independent hits. Next to an axis of symmetry, where hits and their images
    meet, it is up to √2 too narrow.

    Args:
        offsets: from each point to its hits [m], shape [points, hits, 2].
        values: values of the hits, shape [points, hits].
    """
    count = values.shape[1]
    reach = np.abs(offsets).max(axis=(1, 2), keepdims=True)
    design = np.concatenate([np.ones((*values.shape, 1)), offsets / np.maximum(reach, np.finfo(float).tiny)], axis=2)
    inverse = np.linalg.pinv(design)
    plane = np.einsum("pch,ph->pc", inverse, values)
    residual = values - np.einsum("phc,pc->ph", design, plane)
    freedom = count - _COEFFICIENTS
    spread = np.sqrt(np.sum(residual**2, axis=1) / freedom)
    error = spread * np.sqrt(np.sum(inverse[:, 0] ** 2, axis=1))
    return Local(plane[:, 0], float(student.ppf(_BOTH_SIDES, freedom)) * error, spread)


def share_of(hits: Array) -> tuple[Array, Array]:
    """Share of ones among zeros and ones, and half the width of its interval (Wilson's; it assumes independent hits).

    Args:
        hits: zeros and ones, shape [points, hits]; the results have the shape [points].
    """
    count, share = hits.shape[1], hits.mean(axis=1)
    z = float(normal.ppf(_BOTH_SIDES))
    half_width = z * np.sqrt(share * (1.0 - share) / count + z**2 / (4.0 * count**2)) / (1.0 + z**2 / count)
    return share, half_width
