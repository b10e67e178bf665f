"""What hits tell about a point between them: a plane through the nearest ones, and how sure it is."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.stats import norm as normal
from scipy.stats import t as student

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

NEIGHBOURS = 24
"""Hits that a plane is fitted to: 21 are left to tell the scatter by, and few enough to stay local."""
_COEFFICIENTS = 3


class Local(NamedTuple):
    """Of points, shape [points]: the value there, half the width of its confidence interval, and the standard
    deviation of the hits about the plane; all in the unit of the values."""

    value: Array
    half_width: Array
    spread: Array


def plane_fit(offsets: Array, values: Array, confidence: float = 0.95) -> Local:
    """Value at points by least squares: a plane through the values of the hits near each (local linear regression,
    Cleveland and Devlin 1988, with equal weights).

    The interval is Student's with what scatters about the plane, so a bend or a jump of the map within the hits'
    reach widens it like the scatter of shots does. It takes the hits for independent: where images of each other
    meet, on an axis of symmetry, it is up to √2 too narrow.

    Args:
        offsets: of the hits from the point [m], shape [points, hits, 2].
        values: of the hits, shape [points, hits].
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
    return Local(plane[:, 0], float(student.ppf(0.5 + 0.5 * confidence, freedom)) * error, spread)


def share_of(hits: Array, confidence: float = 0.95) -> tuple[Array, Array]:
    """Share of the ones among zeros and ones, and half the width of its interval (Wilson's; it takes the hits for
    independent).

    Args:
        hits: shape [points, hits]; the results have the shape [points].
    """
    count, share = hits.shape[1], hits.mean(axis=1)
    z = float(normal.ppf(0.5 + 0.5 * confidence))
    half_width = z * np.sqrt(share * (1.0 - share) / count + z**2 / (4.0 * count**2)) / (1.0 + z**2 / count)
    return share, half_width
