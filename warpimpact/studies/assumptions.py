"""Whether a ranking of plates survives what nobody measured: the same comparison under every assumption.

Every assumption takes the same hits, at the resolution that the pilot of the campaign as given found, so that what the
hits have in common drops out.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

from warpimpact.analysis.comparison import compare
from warpimpact.analysis.comparison_text import Comparison
from warpimpact.campaign.assumptions import AS_GIVEN, alternatives
from warpimpact.campaign.campaign import Campaign
from warpimpact.runs.compute import HitMap
from warpimpact.runs.run import run
from warpimpact.scene import Numerics
from warpimpact.solver.worker import Worker
from warpimpact.view.view import Column, Section, Table, number

HITS = 1024
"""Hits of a plate under each assumption, at most; the intervals say whether they are enough."""


@dataclass(frozen=True)
class Judged:
    """A comparison of plates under every assumption, by its name; as given first."""

    comparisons: Mapping[str, Comparison]

    def verdicts(self, measure: str, one: str, other: str) -> dict[str, int]:
        """Of every assumption 1 where a plate is better than another, −1 where it is worse, 0 where they cannot be told
        apart."""
        return {name: _verdict(comparison, measure, one, other) for name, comparison in self.comparisons.items()}


def judged(
    campaigns: Mapping[str, Campaign],
    texts: Sequence[str] = (),
    *,
    device: str = "auto",
    tell: Callable[[str], object] = lambda assumption: None,
) -> Judged:
    """Compare plates under every assumption.

    Args:
        campaigns: of the plates, by name.
        texts: of measures, as in `compare`.
        tell: called with the name of every assumption before it is computed.

    Raises:
        DeviceError: the device is absent.
    """
    levels = {name: _level(_short(campaign), device) for name, campaign in campaigns.items()}
    comparisons = {}
    for assumption, changed in alternatives(campaigns).items():
        tell(assumption)
        fixed = (_short(campaign).model_copy(update={"numerics": levels[name]}) for name, campaign in changed.items())
        datasets = [run(campaign, device=device) for campaign in fixed]
        comparisons[assumption] = compare(datasets, list(changed), texts)
    return Judged(comparisons)


def judged_view(judgement: Judged) -> list[Section]:
    """For every measure a table of the plates under every assumption, and which verdicts survive."""
    given = judgement.comparisons[AS_GIVEN]
    names = [plate.name for plate in given.plates]
    ranked = dict.fromkeys(difference.measure for difference in given.differences)
    scores = {score.name: score for score in given.plates[0].measures if score.name in ranked}
    sections = []
    for measure, score in scores.items():
        rows = []
        for assumption, comparison in judgement.comparisons.items():
            shown = (score for plate in comparison.plates for score in plate.measures if score.name == measure)
            rows.append((assumption, *(score.value for score in shown)))
        table = Table((Column("assumption"), *(number(name) for name in names)), rows)
        verdicts = [text for pair in combinations(names, 2) for text in _survives(judgement, measure, *pair)]
        sections.append(Section([table, *verdicts], f"{score.measure.title}; {score.measure.better}"))
    return sections


def _survives(judgement: Judged, measure: str, one: str, other: str) -> Iterator[str]:
    """Such as "a is better than b in 9 of 12 assumptions; turned over by: β = 1"."""
    verdicts = judgement.verdicts(measure, one, other)
    given = verdicts.pop(AS_GIVEN)
    if not given:
        apart = [name for name, verdict in verdicts.items() if verdict]
        yield f"{one} and {other} cannot be told apart as given" + (
            f"; they can with: {', '.join(apart)}" * bool(apart)
        )
        return
    better, worse = (one, other) if given > 0 else (other, one)
    turned = [name for name, verdict in verdicts.items() if verdict == -given]
    open_ = [name for name, verdict in verdicts.items() if not verdict]
    kept = len(verdicts) - len(turned) - len(open_)
    text = f"{better} is better than {worse} in {kept} of {len(verdicts)} assumptions"
    text += f"; turned over by: {', '.join(turned)}" * bool(turned)
    yield text + f"; not told apart with: {', '.join(open_)}" * bool(open_)


def _verdict(comparison: Comparison, measure: str, one: str, other: str) -> int:
    for pair in comparison.differences:
        if pair.measure == measure and (pair.one, pair.other) == (one, other) and pair.told_apart:
            (score,) = (score for score in comparison.plates[0].measures if score.name == measure)
            return 1 if (pair.value > 0.0) == (score.measure.higher_is_better is not False) else -1
    return 0


def _short(campaign: Campaign) -> Campaign:
    """A campaign of few hits, without the solid plate: what is compared are the plates themselves."""
    hits, output = campaign.hits, campaign.output.model_copy(update={"solid_reference": False})
    if hits.count is not None:
        hits = hits.model_copy(update={"count": min(hits.count, HITS)})
    return campaign.model_copy(update={"hits": hits, "output": output, "stop": None})


def _level(campaign: Campaign, device: str) -> Numerics:
    """The resolution that the pilot of a campaign finds, which all assumptions share."""
    found = HitMap().pilot(campaign, Worker(device))
    return campaign.numerics if found is None else found.numerics
