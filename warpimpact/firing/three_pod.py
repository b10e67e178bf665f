"""The procedure 3pod."""

from __future__ import annotations

from collections.abc import Generator
from typing import Annotated, Literal

import numpy as np
from pydantic import Field
from scipy import special

from warpimpact.firing.steps import Count, Estimated, InRange, Optimal, Shot, StepEstimate, Steps, ends
from warpimpact.scene.units import Number, PositiveSpeed


class ThreePod(InRange):
    """Three-phase optimal design, 3pod (C. F. J. Wu and Y. Tian, Journal of Statistical Planning and Inference 149
    (2014) 1): a search until the answers overlap, D-optimal shots, then shots that approach a quantile (Robbins, Monro
    and Joseph: V. R. Joseph, Biometrika 91 (2004) 461).

    Attributes:
        lowest, highest: ends of the range that V50 is expected in [m/s].
        spread: guess of the standard deviation [m/s].
        shots: of a test in the first two phases.
        quantile_shots: of the third phase.
        quantile: share of perforations that the third phase approaches.
    """

    name: Literal["3pod"] = "3pod"
    lowest: PositiveSpeed
    highest: PositiveSpeed
    spread: PositiveSpeed
    shots: Count = 20
    quantile_shots: Annotated[int, Field(strict=True, ge=0, le=1000)] = 0
    quantile: Annotated[Number, Field(gt=0, lt=1)] = 0.5

    @property
    def prefixes(self) -> bool:
        """Whether the first shots of a test are the shots of a shorter test; not if a third phase follows."""
        return self.quantile_shots == 0

    @property
    def most(self) -> int:
        """Most shots of a test."""
        return self.shots + self.quantile_shots

    def steps(self) -> Steps:
        """The velocities of one test."""
        search, shot = self._search(), None
        for _ in range(self.shots):
            shot = yield search.send(shot)
        if self.quantile_shots:
            yield from self._approach((yield Estimated()))

    def _search(self) -> Steps:
        """Phase I: until the answers overlap, and one or two shots in the middle of the overlap; then phase II."""
        low, high, spread = self.lowest, self.highest, self.spread
        fired = list[Shot]()
        for aim in (0.75 * low + 0.25 * high, 0.25 * low + 0.75 * high):
            fired.append((yield aim))
        first, second = (shot.perforated for shot in fired)
        outward = 0
        while first == second and fired[-1].perforated == first:
            outward += 1
            spread *= 2.0 if outward % 3 == 0 else 1.0
            fired.append((yield low - 1.5 * outward * spread if first else high + 1.5 * outward * spread))
        if first and not second:
            for aim in (low - 3.0 * spread, high + 3.0 * spread):
                fired.append((yield aim))
        yield from self._overlap(fired, spread)
        while True:
            yield Optimal()

    def _overlap(self, fired: list[Shot], spread: float) -> Generator[float, Shot, None]:
        while True:
            below, above = ends(fired)
            if below is None or above is None or below > above:
                break
            if above - below >= 1.5 * spread:
                fired.append((yield 0.5 * (below + above)))
                continue
            perforations = sum(shot.perforated for shot in fired)
            outside = [above + 0.3 * spread, below - 0.3 * spread]
            for aim in outside if len(fired) > 2 * perforations else outside[::-1]:
                fired.append((yield aim))
                if fired[-1].perforated != (aim > above):
                    break
            else:
                spread *= 2.0 / 3.0
        below, above = ends(fired)
        if below is not None and above is not None:
            middle = 0.5 * (below + above)
            wide = below - above >= spread
            for aim in (middle,) if wide else (middle + 0.5 * spread, middle - 0.5 * spread):
                fired.append((yield aim))

    def _approach(self, estimate: StepEstimate) -> Steps:
        """Phase III, in units of the standard deviation. τ² is the variance of the quantile by the fit, kept between
        those of ± 3 and ± 5 at 95 %, and β = 1/2, as Wu and Tian take them."""
        z = float(special.ndtri(self.quantile))
        s0, s1, s2 = estimate.information
        determinant = max(s0 * s2 - s1 * s1, 1e-12)
        least, most = ((half / 1.959964) ** 2 for half in (3.0, 5.0))
        variance = float(np.clip((s2 - 2.0 * z * s1 + z * z * s0) / determinant, least, most))
        aim = estimate.location + z * estimate.scale
        for _ in range(self.quantile_shots):
            shot = yield aim
            root = np.sqrt(1.0 + 0.25 * variance)
            share = float(special.ndtr(z / root))
            density = float(np.exp(-0.5 * (z / root) ** 2) / np.sqrt(2.0 * np.pi))
            gain = 0.5 * variance / root * density / (share * (1.0 - share))
            aim = aim - gain * estimate.scale * (float(shot.perforated) - share)
            variance -= share * (1.0 - share) * gain**2
