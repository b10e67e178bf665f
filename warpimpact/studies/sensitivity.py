"""How far the numbers of a campaign move if one thing that nobody measured is otherwise.

Each change is a campaign of its own. All changes have the same hits at one level of resolution (common random numbers),
so what the hits have in common drops out of the differences to the campaign as given.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from typing import Any

import numpy as np
import pandas as pd
from pydantic import ValidationError

from warpimpact.analysis.estimates import measures_named, measures_of_runs
from warpimpact.campaign.campaign import Campaign
from warpimpact.campaign.evidence import is_drawn
from warpimpact.campaign.resistance import StraightPassage
from warpimpact.results import variables as v
from warpimpact.results.dataset import narrow_dataset
from warpimpact.results.measures import Measure, estimate_from
from warpimpact.scene import Interaction, Numerics, Plate, Radians, Shots
from warpimpact.scene.interaction import NEAR_EDGES
from warpimpact.scene.model import Array
from warpimpact.solver.device import Worker
from warpimpact.solver.marching import Progress
from warpimpact.solver.simulate import numerics_for, simulate_many, spread
from warpimpact.statistics.intervals import estimate_of

AS_GIVEN = "as given"
SHOWN = ("P(base_perforated)", "P(base_pierced)", "mean(residual_velocity)", "mean(deflection)", "mean(tilt)")
"""Default measures, as far as the campaign has them; the first one decides."""
HITS = 256
"""Rows differ by far more than 256 hits in common leave open."""
UNKNOWN_SHARE = 0.3
"""How far a resistance or a strength that a user gives may be off: two steels of one hardness differ by more."""


def sensitivity(
    campaign: Campaign,
    *,
    hits: int = HITS,
    measures: Sequence[str] = (),
    device: str = "auto",
    progress: Progress | None = None,
) -> pd.DataFrame:
    """How far measures move with each change of what nobody measured.

    Args:
        campaign: the campaign as given.
        hits: most hits of each row; all rows have the same.
        measures: texts of measures; by default `SHOWN`.
        device: "auto", "cpu", "cuda:0", …
        progress: called with (shots done, all shots).

    Returns:
        A row for the campaign as given and for each change, and a column for each measure in its display unit.

    Raises:
        CampaignError: a text is no measure, or the campaign lacks what it needs.
    """
    computed = _computed({"": campaign}, measures, hits, device, progress)[""]
    rows = {name: {one.title: _value(one, of) for one, of in values.items()} for name, values in computed.items()}
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("change")


def largest_move(table: pd.DataFrame) -> str:
    """A sentence on the changes that move a number most: that of the first measure that moves."""
    moves = (table - table.iloc[0]).abs()
    moved = [name for name in table.columns if moves[name].max() > 0.0]
    if not moved:
        return "No change moves these numbers."
    column, most = table[moved[0]], moves[moved[0]].nlargest(3)
    named = ", ".join(f"{change} ({column[change]:.4g})" for change in most[most > 0.0].index)
    return f"{column.name} is {column.iloc[0]:.4g} as given. It moves most with: {named}."


def plate_sensitivity(
    campaigns: Mapping[str, Campaign], text: str, *, shifts: Mapping[str, float] | None = None, **options: Any
) -> pd.DataFrame:
    """A measure of several plates with each change, and the plate that is best.

    A change counts for all plates; a plate without it stays as given. A plate is best if its paired difference to every
    other one exceeds its 95 % interval and the shifts by the numerics; otherwise the cell is empty.

    Args:
        campaigns: campaigns of the plates, by name.
        text: text of the measure, a mean or a probability.
        shifts: largest shift of each plate's value by the numerics, in the display unit.
        options: hits, device and progress of `sensitivity`.
    """
    computed = _computed(campaigns, (text,), **options)
    rows, replicates = {}, next(iter(campaigns.values())).replicates
    for name in dict.fromkeys(name for numbers in computed.values() for name in numbers):
        of_plates = {plate: numbers.get(name, numbers[AS_GIVEN]) for plate, numbers in computed.items()}
        (measure,) = {one for values in of_plates.values() for one in values}
        values = {plate: by_measure[measure] for plate, by_measure in of_plates.items()}
        best = _best(measure, values, shifts or {}, replicates)
        rows[name] = {plate: _value(measure, of_plate) for plate, of_plate in values.items()} | {"best": best}
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("change")


def reversals(table: pd.DataFrame) -> str:
    """A sentence on the changes in a table of `plate_sensitivity` that turn the order of the plates over."""
    best, *others = table["best"]
    if not best:
        return "No plate is significantly the best as given."
    turned = [name for name, other in zip(table.index[1:], others, strict=True) if other not in ("", best)]
    undecided = others.count("")
    return (
        f"{best} stays the best with {others.count(best)} of {len(others)} changes"
        + (f"; another plate is the best with: {', '.join(turned)}" if turned else "")
        + (f"; {undecided} do not decide" if undecided else "")
        + "."
    )


def _value(measure: Measure, values: Array) -> float:
    return measure.display.factor * estimate_from(measure, values).value


def _best(measure: Measure, values: Mapping[str, Array], shifts: Mapping[str, float], replicates: int) -> str:
    """The plate that is significantly better than every other one; empty if none is."""
    sign = measure.display.factor * (1.0 if measure.higher_is_better else -1.0)
    numbers = {plate: sign * measure.averaged(of_plate) for plate, of_plate in values.items()}

    def is_better(one: str, other: str) -> bool:
        difference = estimate_of("mean", numbers[one] - numbers[other], replicates=replicates)
        return bool(difference.low > np.nan_to_num(shifts.get(one, 0.0) + shifts.get(other, 0.0)))

    best = (one for one in numbers if all(is_better(one, other) for other in numbers if other != one))
    return next(best, "")


def _computed(
    campaigns: Mapping[str, Campaign],
    texts: Sequence[str],
    hits: int = HITS,
    device: str = "auto",
    progress: Progress | None = None,
) -> dict[str, dict[str, dict[Measure, Array]]]:
    """Values of the hits by plate, change and measure, in the units of the Dataset, NaN where a hit does not count; all
    at the finest level that the pilots of the campaigns find."""
    measures = measures_of_runs(texts or SHOWN, campaigns if texts else {}, averaged=True)
    # A change may break a symmetry, so hits are over the whole cell.
    campaigns = {plate: _with(campaign, "hits", irreducible=False) for plate, campaign in campaigns.items()}
    rows = {
        (plate, name): changed
        for plate, campaign in campaigns.items()
        for name, changed in {AS_GIVEN: campaign, **changes(campaign)}.items()
    }
    shots = {row: _shots(changed, hits) for row, changed in rows.items()}
    worker = Worker(device)
    of_plates = [
        numerics_for(campaign.scene, shots[plate, AS_GIVEN], _numerics(campaign), worker)
        for plate, campaign in campaigns.items()
    ]
    numerics = max(of_plates, key=lambda each: each.level or 0)
    outcomes = simulate_many([(rows[row].scene, shots[row]) for row in rows], numerics, worker, progress)
    needed = {v.STATUS, v.STOPPED_IN, *(name for measure in measures for name in measure.quantity.of)}
    computed: dict[str, dict[str, dict[Measure, Array]]] = {plate: {} for plate in campaigns}
    for ((plate, name), changed), outcome in zip(rows.items(), outcomes, strict=True):
        labelled = changed.scene.model_copy(update={"record": campaigns[plate].output})  # stand-offs as given
        dataset = narrow_dataset(labelled, shots[plate, name], outcome, needed)
        known = measures_named(dataset, texts, SHOWN)
        computed[plate][name] = {measure: measure.values(dataset) for measure in known}
    return computed


def _numerics(campaign: Campaign) -> Numerics:
    """The campaign's own accuracy or level; else draft, whose errors all rows share."""
    numerics = campaign.numerics
    if numerics.explicit is not None or {"fidelity", "accuracy"} & numerics.model_fields_set:
        return numerics
    return numerics.model_copy(update={"fidelity": "draft"})


def _shots(campaign: Campaign, most: int) -> Shots:
    """The first shots of a campaign; of a grid or a list, shots at even distances."""
    sampler = campaign.sampler()
    if campaign.hits.sampling in ("sobol", "random"):
        return sampler.shots(0, most)
    return spread(sampler.shots(0, len(sampler)), min(most, len(sampler)))


def changes(campaign: Campaign) -> dict[str, Campaign]:
    """The campaign with one thing otherwise, by the name of the change. Columns of shots do not change."""
    changed_campaigns, layers = dict[str, Campaign](), range(len(campaign.target.layers))
    for name, quantities, change in CHANGES:
        if any(is_drawn(campaign, quantity, layers) for quantity in quantities):
            continue
        with warnings.catch_warnings(), suppress(ValidationError):  # not every change is a campaign
            warnings.simplefilter("ignore")
            if (changed := change(campaign)) != campaign:
                changed_campaigns[name] = changed
    return changed_campaigns


Change = Callable[[Campaign], Campaign]


def _plates(change: Callable[[Campaign, Plate], Mapping[str, Any]], **law: Any) -> Change:
    """A change of the keys of all plates, and of the law."""

    def changed(campaign: Campaign) -> Campaign:
        plate, *layer = (one.model_copy(update=change(campaign, one)) for one in campaign.target.layers)
        interaction = campaign.interaction.model_copy(update=law)
        return campaign.model_copy(update={"plate": plate, "layer": tuple(layer), "interaction": interaction})

    return changed


def _with(campaign: Campaign, table: str, **keys: Any) -> Campaign:
    """The campaign with other keys of a table."""
    return campaign.model_copy(update={table: getattr(campaign, table).model_copy(update=keys)})


def _catalogue_interval(campaign: Campaign, plate: Plate) -> tuple[float, float] | None:
    """90 % interval of the catalogue's Y of a plate [Pa]; None where Y is the user's."""
    known = campaign.catalogue_resistance(plate)
    return known.ends if known is not None and known.deviation else None


def _resistance(end: int) -> Change:
    """Y at the low (0) or high (1) end of the catalogue's interval, or 30 % off where it is the user's."""
    ends = 1.0 - UNKNOWN_SHARE, 1.0 + UNKNOWN_SHARE
    return _plates(
        lambda campaign, plate: {
            "resistance": (_catalogue_interval(campaign, plate) or [plate.resistance * share for share in ends])[end]
        }
    )


def _law(friction: float | None = None, **law: float) -> Change:
    """Another friction or another law. Y of the catalogue follows, because it was fitted with both."""

    def keys(campaign: Campaign, plate: Plate) -> dict[str, float]:
        other = campaign.interaction.model_copy(update=law)
        coefficient = plate.shear_coefficient if friction is None else friction
        same = other == campaign.interaction and coefficient == plate.shear_coefficient
        if same or _catalogue_interval(campaign, plate) is None:
            return {"shear_coefficient": coefficient}
        return {"shear_coefficient": coefficient, "resistance": _alike(campaign, plate, other, coefficient)}

    return _plates(keys, **law)


def _alike(campaign: Campaign, plate: Plate, law: Interaction, friction: float, velocity: float = 0.0) -> float:
    """Y with which a solid plate takes as much from the core under another law and friction (docs/model.md §6.2): its
    limit velocity stays, or what it takes from a core of this velocity [m/s]."""
    given = campaign.interaction, plate.shear_coefficient, plate.thickness, plate.density
    passage = StraightPassage(campaign.core, *given, campaign.impact.obliquity)
    return passage.resistance_under(law, friction, plate.resistance, velocity)


def _edges(campaign: Campaign) -> Campaign:
    """Free surfaces in place of a constant stress and weakening (docs/model.md §4.9). A plate without holes takes as
    much from the core as before."""
    law = NEAR_EDGES.model_copy(update={"onset": campaign.interaction.onset})
    holed = any(plate.open_area for plate in campaign.target.layers)
    if not holed or campaign.interaction != Interaction(onset=law.onset):
        return campaign

    def keys(campaign: Campaign, plate: Plate) -> dict[str, float]:
        arriving = campaign.impact.velocity if _catalogue_interval(campaign, plate) is None else 0.0
        return {"resistance": _alike(campaign, plate, law, plate.shear_coefficient, arriving), "degradation": 1.0}

    return _plates(keys, **dict(law))(campaign)


def _turned(campaign: Campaign, name: str, degrees: float) -> Campaign:
    """The campaign with an angle of the shots larger by so much, unless they are steep already."""
    angle = Radians(getattr(campaign.impact, name) + math.radians(degrees))
    return _with(campaign, "impact", **{name: angle}) if campaign.impact.obliquity < math.radians(75.0) else campaign


def _nearer(campaign: Campaign) -> Campaign:
    return _with(campaign, "output", standoffs=tuple(0.5 * at for at in campaign.output.standoffs))


def _weakening(_: Campaign, plate: Plate) -> dict[str, Any]:
    """The paper's weakening of a plate with holes that is given without it."""
    paper = {"degradation": 0.8, "degradation_interval": 1e-6, "degradation_distance": None}
    return paper if plate.open_area and plate.degradation == 1.0 else {}


def _weakens(key: str, changed: Callable[[float], float]) -> Change:
    """Another number of the weakening of plates that weaken."""
    return _plates(lambda _, plate: {key: changed(getattr(plate, key))} if plate.degradation < 1.0 else {})


def _strength(campaign: Campaign, factor: float) -> Campaign:
    """The campaign with another strength of its core, if that may break."""
    strength = campaign.core.strength
    return campaign if strength is None else _with(campaign, "core", strength=factor * strength)


_FIT = ("resistance", "degradation", "static", "linear", "quadratic")
CHANGES: tuple[tuple[str, tuple[str, ...], Change], ...] = (
    ("Y at its low end", ("resistance",), _resistance(0)),
    ("Y at its high end", ("resistance",), _resistance(1)),
    ("no weakening (β = 1)", ("degradation",), _plates(lambda _, one: {"degradation": 1.0})),
    ("weakening (β = 0.8 in 1 µs)", ("degradation",), _plates(_weakening)),
    ("weakens half as fast", ("degradation",), _weakens("degradation", lambda share: share**0.5)),
    ("weakens twice as fast", ("degradation",), _weakens("degradation", lambda share: share**2)),
    (
        "weakening reaches half as far",
        ("degradation_length",),
        _weakens("degradation_length", lambda length: 0.5 * length),
    ),
    (
        "weakening reaches twice as far",
        ("degradation_length",),
        _weakens("degradation_length", lambda length: 2.0 * length),
    ),
    ("friction η = 0", ("shear_coefficient",), _law(0.0)),
    ("friction η = 0.1", ("shear_coefficient",), _law(0.1)),
    ("onset κ = 0", ("onset",), _law(onset=0.0)),
    ("onset κ = 0.02", ("onset",), _law(onset=0.02)),
    ("less resistance near edges", _FIT, _edges),
    ("5° more oblique", ("obliquity",), lambda campaign: _turned(campaign, "obliquity", 5.0)),
    ("2° of yaw", ("yaw",), lambda campaign: _turned(campaign, "yaw", 2.0)),
    ("half the stand-off", (), _nearer),
    ("a core 30 % weaker", ("strength",), lambda campaign: _strength(campaign, 1.0 - UNKNOWN_SHARE)),
    ("a core 30 % stronger", ("strength",), lambda campaign: _strength(campaign, 1.0 + UNKNOWN_SHARE)),
)
"""Changes in the order of a table: name, quantities that must not differ from shot to shot, and the change."""
