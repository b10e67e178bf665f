"""How far the numbers of a campaign move with each unmeasured input.

Each change is a campaign of its own. All changes have the same hits at one level of resolution (common random numbers),
so what the hits have in common drops out of the differences to the campaign as given.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
import xarray
from pydantic import ValidationError

from warpimpact.analysis.numbers import digits_of, number_text
from warpimpact.campaign.campaign import Campaign, measures_of_runs
from warpimpact.campaign.evidence import is_drawn
from warpimpact.campaign.resistance import equivalent_resistance
from warpimpact.campaign.tables import ContinuumTable
from warpimpact.continuum.finite_elements import FiniteElements
from warpimpact.measures.estimates import measures_named
from warpimpact.measures.measure import Measure, estimate_from
from warpimpact.records.outcomes import Outcomes
from warpimpact.results.dataset import narrow_dataset
from warpimpact.runs.compute import some_shots
from warpimpact.runs.options import RunOptions, RunProgress
from warpimpact.scene import Interaction, Plate, Radians
from warpimpact.scene.interaction import NEAR_EDGES, TERMS
from warpimpact.scene.model import Array
from warpimpact.scene.units import count_text
from warpimpact.solver.accuracy import spread_places
from warpimpact.solver.device import Worker
from warpimpact.solver.simulate import simulate_many
from warpimpact.statistics.correction import FEWEST_ACCURATE, correct, corrected_event, corrected_mean
from warpimpact.statistics.intervals import estimate_of
from warpimpact.studies.correction import continuum_table

AS_GIVEN = "as given"
SHOWN = ("P(base_perforated)", "P(base_pierced)", "mean(residual_velocity)", "mean(deflection)", "mean(tilt)")
"""Default measures, as far as the campaign has them; the first one decides."""
HITS = 256
"""Rows differ by far more than the scatter of 256 common hits."""
UNKNOWN_SHARE = 0.3
"""How far a resistance or a strength that a user gives may be off: two steels of one hardness differ by more."""


def sensitivity(
    campaign: Campaign,
    *,
    hits: int = HITS,
    measures: Sequence[str] = (),
    options: RunOptions = RunOptions(),
) -> pd.DataFrame:
    """How far measures move with each unmeasured input.

    Args:
        campaign: the campaign as given.
        hits: most hits of each row; all rows have the same.
        measures: texts of measures; by default `SHOWN`.
        options: where to compute.

    Returns:
        A row for the campaign as given and for each change, and a column for each measure in its display unit. If its
        table [continuum] has hits, rows follow of changes of the finite elements: the value as given and the mean of
        the paired differences at these hits. `attrs["note"]` says where they exceed the interval of
        a correction, `attrs["hits"]` the number of hits of a row.

    Raises:
        CampaignError: a text is no measure, or the campaign lacks what it needs.
    """
    with options.opened() as options:
        computed = _computed({"": campaign}, measures, hits, options)
        element_moves = _shifts_by_measure(campaign, computed["", AS_GIVEN], hits, options)
    rows = {name: {one.title: _value(one, of) for one, of in row.items()} for (_, name), row in computed.items()}
    for name in next(iter(element_moves.values()))[0] if element_moves else ():
        rows[name] = {title: rows[AS_GIVEN][title] + shifts[name] for title, (shifts, _) in element_moves.items()}
    table = pd.DataFrame.from_dict(rows, orient="index").rename_axis("change")
    table.attrs["note"] = elements_note(element_moves)
    table.attrs["digits"] = {one.title: digits_of(one) for one in computed["", AS_GIVEN]}
    table.attrs["hits"] = len(next(iter(computed["", AS_GIVEN].values())))
    return table


def _shifts_by_measure(
    campaign: Campaign, fast: Mapping[Measure, Array], hits: int, options: RunOptions
) -> dict[str, ElementShifts]:
    """What the finite elements of a campaign leave open, by the titles of measures; empty if it asks for no elements.

    Args:
        fast: values of the hits as given.
        hits: most of these hits.
    """
    if campaign.continuum.hits is None:
        return {}
    given, elements = _prepared(campaign), continuum_table(campaign)
    _, every = some_shots(given, hits)
    places = spread_places(len(every), min(len(every), campaign.continuum.hits))
    shots, computed = every[places], dict[str, xarray.Dataset]()
    methods = {"": elements.method, **element_changes(elements)}

    def compute(method: FiniteElements, *, worker: Worker, report: Callable[[int], None]) -> xarray.Dataset:
        outcomes = method.prepare(given.scene, shots, worker).compute(lambda done, total: report(done))
        return narrow_dataset(given.scene, shots, outcomes)

    def report(done: Sequence[int]) -> None:
        options.progress(RunProgress(len(computed) * len(shots) + sum(done), len(methods) * len(shots)))

    with options.computer() as computer:
        for name, method in methods.items():
            computed[name] = computer.call(compute, method, tick=report)
    return {
        one.title: element_shifts(one, {name: one.values(of) for name, of in computed.items()}, law[places], law)
        for one, law in fast.items()
    }


def as_text(table: pd.DataFrame) -> pd.DataFrame:
    """A table of `sensitivity`, or the plates of one of `plate_sensitivity`, as text, with shares in percent."""
    digits = table.attrs.get("digits", {})
    columns = {
        name: column.map(partial(number_text, digits=digits.get(name, "#.4g"))) for name, column in table.items()
    }
    return pd.DataFrame(columns)


def largest_move(table: pd.DataFrame) -> str:
    """A sentence on the changes that move a number most: that of the first measure that moves."""
    moves = (table - table.iloc[0]).abs()
    moved, hits = [name for name in table.columns if moves[name].max() > 0.0], count_text(table.attrs["hits"], "hit")
    if not moved:
        return f"By {hits} no change moves these numbers."
    column, most = as_text(table)[moved[0]], moves[moved[0]].nlargest(3)
    named = ", ".join(f"{change} ({column[change]})" for change in most[most > 0.0].index)
    return f"{column.name} is {column.iloc[0]} as given, by {hits}. It moves most with: {named}."


def plate_sensitivity(
    campaigns: Mapping[str, Campaign],
    text: str,
    *,
    shifts: Mapping[str, float] | None = None,
    hits: int = HITS,
    options: RunOptions = RunOptions(),
) -> pd.DataFrame:
    """A measure of several plates with each change, and the plate that is best.

    A change counts for all plates; a plate without it stays as given. A plate is best if its paired difference to every
    other one exceeds its 95 % interval and the shifts by the numerics; otherwise the cell is empty.

    Args:
        campaigns: campaigns of the plates, by name.
        text: text of the measure, a mean or a probability.
        shifts: largest shift of each plate's value by the numerics, in the display unit.
        hits, options: as in `sensitivity`.
    """
    computed = _computed(campaigns, (text,), hits, options)
    (measure,), replicates, rows = next(iter(computed.values())), next(iter(campaigns.values())).hits.scramblings, {}
    sign, shifts = measure.display.factor * (1.0 if measure.higher_is_better else -1.0), shifts or {}

    def is_better(values: Mapping[str, Array], one: str, other: str) -> bool:
        numbers = (sign * measure.averaged(values[plate]) for plate in (one, other))
        difference = estimate_of("mean", np.subtract(*numbers), replicates=replicates)
        return bool(difference.low > np.nan_to_num(shifts.get(one, 0.0) + shifts.get(other, 0.0)))

    for name in dict.fromkeys(name for _, name in computed):
        values = {
            plate: of_plate
            for plate in campaigns
            for of_plate in computed.get((plate, name), computed[plate, AS_GIVEN]).values()
        }
        best = (one for one in values if all(is_better(values, one, other) for other in values if other != one))
        numbers = {plate: _value(measure, of_plate) for plate, of_plate in values.items()}
        rows[name] = {**numbers, "best": next(best, "")}
    table = pd.DataFrame.from_dict(rows, orient="index").rename_axis("change")
    table.attrs["digits"] = dict.fromkeys(campaigns, digits_of(measure))
    table.attrs["hits"] = len(next(iter(computed.values()))[measure])
    return table


def reversals(table: pd.DataFrame) -> str:
    """A sentence on the changes in a table of `plate_sensitivity` that turn the order of the plates over."""
    best, *others = table["best"]
    if not best:
        return "No plate is significantly the best as given."
    turned = [name for name, other in zip(table.index[1:], others, strict=True) if other not in ("", best)]
    parts = [f"{best} stays the best with {others.count(best)} of {count_text(len(others), 'change')}"]
    parts += [f"another plate is the best with: {', '.join(turned)}"] if turned else []
    parts += [f"{others.count('')} do not decide"] if "" in others else []
    return f"{'; '.join(parts)}."


def _value(measure: Measure, values: Array) -> float:
    return measure.display.factor * estimate_from(measure, values).value


def _computed(
    campaigns: Mapping[str, Campaign], texts: Sequence[str], hits: int, options: RunOptions
) -> dict[tuple[str, str], dict[Measure, Array]]:
    """Values of the hits by plate and change, and by measure, in the units of the Dataset, NaN where a hit does not
    count; all at the finest level that the pilots of the campaigns find."""
    measures_of_runs(texts or SHOWN, campaigns if texts else {}, averaged=True)  # refuses others
    campaigns = {plate: _prepared(campaign) for plate, campaign in campaigns.items()}
    rows = {
        (plate, name): changed
        for plate, campaign in campaigns.items()
        for name, changed in {AS_GIVEN: campaign, **changes(campaign)}.items()
    }
    shots = {row: some_shots(changed, hits)[1] for row, changed in rows.items()}

    def compute(*, worker: Worker, report: Callable[[int], None]) -> list[Outcomes]:
        of_plates = [
            campaign.numerics.resolve(campaign.scene, shots[plate, AS_GIVEN], worker)
            for plate, campaign in campaigns.items()
        ]
        numerics, scenes = (
            max(of_plates, key=lambda each: each.level or 0),
            [(rows[row].scene, shots[row]) for row in rows],
        )
        return simulate_many(scenes, numerics, worker, lambda done, total: report(done))

    def report(done: Sequence[int]) -> None:
        options.progress(RunProgress(sum(done), sum(map(len, shots.values()))))

    with options.computer() as computer:
        outcomes = computer.call(compute, tick=report)
    computed = {}
    for (row, changed), outcome in zip(rows.items(), outcomes, strict=True):
        scene = changed.scene.model_copy(update={"record": campaigns[row[0]].output})  # the stand-offs as given
        dataset = narrow_dataset(scene, shots[row], outcome)
        computed[row] = {measure: measure.values(dataset) for measure in measures_named(dataset, texts, SHOWN)}
    return computed


def _prepared(campaign: Campaign) -> Campaign:
    """The campaign over the whole cell, as a change may break a symmetry, a single plate at draft if it has no accuracy
    of its own."""
    numerics, layers = campaign.numerics, len(campaign.target.layers)
    if layers == 1 and numerics.explicit is None and not {"fidelity", "accuracy"} & numerics.model_fields_set:
        campaign = _with(campaign, "numerics", fidelity="draft")
    return _with(campaign, "hits", irreducible=False)


def changes(campaign: Campaign) -> dict[str, Campaign]:
    """The campaign with one thing otherwise, by the name of the change. Columns of shots do not change."""
    changed_campaigns, layers = dict[str, Campaign](), range(len(campaign.target.layers))
    for name, quantities, change in _changes(campaign):
        if any(is_drawn(campaign, quantity, layers) for quantity in quantities):
            continue
        with warnings.catch_warnings(), suppress(ValidationError):  # not every change is a campaign
            warnings.simplefilter("ignore")
            if (changed := change()) != campaign:
                changed_campaigns[name] = changed
    return changed_campaigns


def _with(campaign: Campaign, table: str, **keys: Any) -> Campaign:
    """The campaign with other keys of a table."""
    return campaign.model_copy(update={table: getattr(campaign, table).model_copy(update=keys)})


def _changes(given: Campaign) -> Iterator[tuple[str, tuple[str, ...], Callable[[], Campaign]]]:
    """Changes in the order of a table: name, quantities that must not differ from shot to shot, and the change."""
    Keys = Mapping[str, Any]

    def plates(keys: Callable[[Plate], Keys], **law: Any) -> Callable[[], Campaign]:
        def changed() -> Campaign:
            plate, *layer = (one.model_copy(update=keys(one)) for one in given.target.layers)
            interaction = given.interaction.model_copy(update=law)
            return given.model_copy(update={"plate": plate, "layer": tuple(layer), "interaction": interaction})

        return changed

    def interval(plate: Plate) -> tuple[float, float] | None:
        """90 % interval of the catalogue's Y of a plate [Pa]; None where Y is the user's."""
        known = given.catalogue_resistance(plate)
        return known.ends if known is not None and known.deviation else None

    def resistance(plate: Plate, end: int) -> Keys:
        unknown = plate.resistance * (1.0 - UNKNOWN_SHARE), plate.resistance * (1.0 + UNKNOWN_SHARE)
        return {"resistance": (interval(plate) or unknown)[end]}

    def alike(plate: Plate, law: Interaction, friction: float, velocity: float = 0.0) -> float:
        """Y with which a solid plate takes as much from the core under another law and friction (docs/model.md §6.2):
        its limit velocity stays, or what it takes from a core of this velocity [m/s]."""
        stresses = (given.interaction, plate.shear_coefficient), (law, friction)
        return equivalent_resistance(given.core, plate, given.impact.obliquity, *stresses, plate.resistance, velocity)

    def law(friction: float | None = None, **onset: float) -> Callable[[], Campaign]:
        """Another friction or another law. Y of the catalogue follows, because it was fitted with both."""

        def keys(plate: Plate) -> Keys:
            other = given.interaction.model_copy(update=onset)
            coefficient = plate.shear_coefficient if friction is None else friction
            same = other == given.interaction and coefficient == plate.shear_coefficient
            follows = {} if same or interval(plate) is None else {"resistance": alike(plate, other, coefficient)}
            return {"shear_coefficient": coefficient, **follows}

        return plates(keys, **onset)

    def edges() -> Campaign:
        """Free surfaces in place of a constant stress and weakening (docs/model.md §4.9). A plate without holes takes
        as much from the core as before."""
        near = NEAR_EDGES.model_copy(update={"onset": given.interaction.onset})
        if given.interaction != Interaction(onset=near.onset) or not any(one.open_area for one in given.target.layers):
            return given

        def keys(plate: Plate) -> Keys:
            arriving = given.impact.velocity if interval(plate) is None else 0.0
            return {"resistance": alike(plate, near, plate.shear_coefficient, arriving), "degradation": 1.0}

        return plates(keys, **dict(near))()

    def weakens(key: str, changed: Callable[[float], float]) -> Callable[[], Campaign]:
        return plates(lambda plate: {key: changed(getattr(plate, key))} if plate.degradation < 1.0 else {})

    def turned(name: str, degrees: float) -> Campaign:
        """The campaign with a larger angle of the shots, unless they are steep already."""
        angle = Radians(getattr(given.impact, name) + math.radians(degrees))
        return _with(given, "impact", **{name: angle}) if given.impact.obliquity < math.radians(75.0) else given

    def strength(share: float) -> Campaign:
        known = given.core.strength
        return given if known is None else _with(given, "core", strength=(1.0 + share) * known)

    paper = {"degradation": 0.8, "degradation_interval": 1e-6, "degradation_distance": None}
    y, weak, length, friction = ("resistance",), ("degradation",), ("degradation_length",), ("shear_coefficient",)
    yield "resistance at its low end", y, plates(lambda plate: resistance(plate, 0))
    yield "resistance at its high end", y, plates(lambda plate: resistance(plate, 1))
    yield "no weakening", weak, plates(lambda _: {"degradation": 1.0})
    untouched = plates(lambda plate: paper if plate.open_area and plate.degradation == 1.0 else {})
    yield "weakening to 0.8 in 1 µs", weak, untouched
    yield "weakens half as fast", weak, weakens("degradation", lambda share: share**0.5)
    yield "weakens twice as fast", weak, weakens("degradation", lambda share: share**2)
    yield "weakening reaches half as far", length, weakens("degradation_length", lambda reach: 0.5 * reach)
    yield "weakening reaches twice as far", length, weakens("degradation_length", lambda reach: 2.0 * reach)
    yield "friction 0", friction, law(0.0)
    yield "friction 0.1", friction, law(0.1)
    yield "onset of contact 0", ("onset",), law(onset=0.0)
    yield "onset of contact 0.02", ("onset",), law(onset=0.02)
    yield "less resistance near edges", (*y, *weak, *TERMS), edges
    yield "5° more oblique", ("obliquity",), partial(turned, "obliquity", 5.0)
    yield "2° of yaw", ("yaw",), partial(turned, "yaw", 2.0)
    nearer = tuple(0.5 * at for at in given.output.standoffs)
    yield "half the stand-off", (), partial(_with, given, "output", standoffs=nearer)
    yield "a core 30 % weaker", ("strength",), partial(strength, -UNKNOWN_SHARE)
    yield "a core 30 % stronger", ("strength",), partial(strength, UNKNOWN_SHARE)


FRICTIONS = (0.0, 0.06)
"""Least and largest friction between core and target at which limit velocities were met (docs/continuum.md)."""
STRENGTH_ERROR = 0.05
"""Standard error of a strength, as a share, where the catalogue knows none."""


ElementShifts = tuple[dict[str, float], float]
"""What stays open of a measure, in its display unit: means of the paired differences to the elements as given, by the
name of the change; and the half width of its interval, corrected by these elements, NaN with too few sound hits."""


def element_changes(elements: ContinuumTable) -> dict[str, FiniteElements]:
    """The finite elements with one thing otherwise, by the name of the change."""
    given, errors = elements.method, [entry.strength_error or STRENGTH_ERROR for entry in elements.entries]
    changes = {f"elements: friction {mu:g}": given.model_copy(update={"friction": mu}) for mu in FRICTIONS}
    for sign, end in ((-1.0, "low"), (1.0, "high")):
        flows = tuple(flow.scaled(1.0 + sign * error) for flow, error in zip(given.flows, errors, strict=True))
        changes[f"elements: strength at its {end} end"] = given.model_copy(update={"flows": flows})
    if given.fidelity == "draft" and given.spacing is None:
        changes["elements: standard size"] = given.model_copy(update={"fidelity": "standard"})
    return {name: changed for name, changed in changes.items() if changed != given}


def element_shifts(measure: Measure, by_elements: Mapping[str, Array], fast_at: Array, fast: Array) -> ElementShifts:
    """What the changes leave open of a measure that is a mean.

    Args:
        by_elements: values of the hits by elements, NaN where one does not count, by change; "" is as given.
        fast_at: values of the same hits by the fast law.
        fast: values of all hits by the fast law.
    """
    factor, own = measure.display.factor, measure.averaged(by_elements[""])
    differences = {name: measure.averaged(values) - own for name, values in by_elements.items() if name}
    shifts = {
        name: factor * float(np.nanmean(of_hits)) if np.isfinite(of_hits).any() else np.nan
        for name, of_hits in differences.items()
    }
    fast_at, fast = measure.averaged(fast_at), measure.averaged(fast)
    both = np.isfinite(own) & np.isfinite(fast_at)
    if both.sum() < FEWEST_ACCURATE:
        return shifts, np.nan
    correction = correct(own[both], fast_at[both, None], fast[np.isfinite(fast), None])
    corrected = corrected_event(correction) if measure.is_binary else corrected_mean(correction)
    return shifts, factor * corrected.half_width


def elements_note(moves: Mapping[str, ElementShifts]) -> str:
    """A sentence on measures that inputs of the elements move by more than their intervals; empty without any."""
    parts = []
    for title, (shifts, width) in moves.items():
        beyond = {name.removeprefix("elements: "): shift for name, shift in shifts.items() if abs(shift) > width}
        if beyond:
            parts.append(f"{title} (± {width:.2g}): {', '.join(f'{name} {of:+.3g}' for name, of in beyond.items())}")
    words = "Inputs of finite elements move results by more than the interval of a correction"
    return f"{words}: {'; '.join(parts)}." if parts else ""
