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
from warpimpact.campaign.elements import continuum_table
from warpimpact.campaign.evidence import is_drawn
from warpimpact.campaign.resistance import equivalent_resistance
from warpimpact.campaign.tables import ContinuumTable
from warpimpact.continuum.finite_elements import FiniteElements
from warpimpact.measures.draws import estimate_of_draws
from warpimpact.measures.estimates import estimated, measure_data, measures_named
from warpimpact.measures.hits import hit_numbers
from warpimpact.measures.measure import Measure, estimate_from
from warpimpact.measures.references import ELEMENTS, Result, node_hits
from warpimpact.records.outcomes import Outcomes
from warpimpact.results.dataset import narrow_dataset
from warpimpact.runs.compute import shots_of, some_shots
from warpimpact.runs.options import RunOptions, RunProgress
from warpimpact.runs.run import run
from warpimpact.scene import Interaction, Plate, Radians
from warpimpact.scene.interaction import NEAR_EDGES, TERMS
from warpimpact.scene.model import Array
from warpimpact.scene.units import count_text
from warpimpact.solver.device import Worker
from warpimpact.solver.simulate import simulate_many
from warpimpact.statistics.comparisons import shifted_numbers
from warpimpact.statistics.intervals import Estimate, estimate_of

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
        A row for the campaign as given, which is its answer, and for each change, and a column for each measure in its
        display unit. A change moves the answer as it moves the fast law. If the table [continuum] has hits, rows follow
        of changes of the finite elements, which move the answer by the mean of the paired differences at these hits.
        `attrs["note"]` says where these exceed the interval of the answer, `attrs["hits"]` the number of hits of a row.

    Raises:
        CampaignError: a text is no measure, or the campaign lacks what it needs.
    """
    with options.opened() as options:
        computed = _computed({"": campaign}, measures, hits, options)
        given = computed["", AS_GIVEN]
        answer = _answer(campaign, hits, options)
        estimates = estimated(answer, [*given])
        moves = _element_moves(campaign, answer, [*given], options)
    rows = {
        name: {one.title: float(_moved(one, estimates[one].value, given[one], values)) for one, values in row.items()}
        for (_, name), row in computed.items()
    }
    for name, of_change in moves.items():
        rows[name] = {
            one.title: float(np.clip(estimates[one].value + move, *one.shown_bounds)) for one, move in of_change.items()
        }
    table = pd.DataFrame.from_dict(rows, orient="index").rename_axis("change")
    table.attrs["note"] = elements_note(moves, estimates)
    table.attrs["digits"] = {one.title: digits_of(one) for one in given}
    table.attrs["hits"] = len(next(iter(given.values())))
    return table


def _answer(campaign: Campaign, hits: int, options: RunOptions) -> xarray.DataTree:
    """The answer of a campaign, of no more than so many hits where they are drawn."""
    if campaign.hits.sampling in ("sobol", "random"):
        campaign = _with(campaign, "hits", count=min(hits, len(campaign.sampler())))
    return run(campaign.model_copy(update={"stop": None}), options=options)


def _moved(measure: Measure, numbers: float | Array, given: Array, changed: Array) -> Array:
    """Numbers of an answer that a change moves as it moves the values of the fast law."""
    before, after = (np.array(_value(measure, values)) for values in (given, changed))
    return shifted_numbers(np.asarray(numbers), before, after, measure.shown_bounds)


def _element_moves(
    campaign: Campaign, answer: Result, measures: Sequence[Measure], options: RunOptions
) -> dict[str, dict[Measure, float]]:
    """Means of the paired differences of changed finite elements to those of an answer, in the display units of
    measures, by the names of the changes; empty if it has none."""
    given = node_hits(answer, ELEMENTS)
    if given is None:
        return {}
    shots, elements = shots_of(campaign, hit_numbers(given).astype(np.int64)), continuum_table(campaign)
    methods, done = element_changes(elements), list[xarray.Dataset]()

    def compute(method: FiniteElements, *, worker: Worker, report: Callable[[int], None]) -> xarray.Dataset:
        outcomes = method.prepare(campaign.scene, shots, worker).compute(lambda done, total: report(done))
        return narrow_dataset(campaign.scene, shots, outcomes)

    def report(under_way: Sequence[int]) -> None:
        options.progress(RunProgress(len(done) * len(shots) + sum(under_way), len(methods) * len(shots)))

    with options.computer() as computer:
        for method in methods.values():
            done.append(computer.call(compute, method, tick=report))
    return {
        name: {one: paired_move(one, one.values(given), one.values(of)) for one in measures}
        for name, of in zip(methods, done, strict=True)
    }


def paired_move(measure: Measure, given: Array, changed: Array) -> float:
    """Mean difference of the numbers behind a measure at hits that both have, in its display unit; NaN without any."""
    differences = measure.averaged(changed) - measure.averaged(given)
    known = differences[np.isfinite(differences)]
    return measure.display.factor * float(known.mean()) if len(known) else math.nan


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
    answers: Mapping[str, Result] | None = None,
    shifts: Mapping[str, float] | None = None,
    hits: int = HITS,
    options: RunOptions = RunOptions(),
) -> pd.DataFrame:
    """A measure of several plates with each change, and the plate that is best.

    A change counts for all plates; a plate without it stays as given. A plate is best if its difference to every other
    one exceeds its 95 % interval and the shifts by the numerics; otherwise the cell is empty. Differences are those of
    the draws of answers, which a change moves as it moves the fast law; without draws, those of the hits in pairs.

    Args:
        campaigns: campaigns of the plates, by name.
        text: text of the measure, a mean or a probability.
        answers: results of the plates; by default the numbers are those of the fast law.
        shifts: largest shift of each plate's value by the numerics, in the display unit.
        hits, options: as in `sensitivity`.
    """
    computed = _computed(campaigns, (text,), hits, options)
    (measure,), replicates, rows = next(iter(computed.values())), next(iter(campaigns.values())).hits.scramblings, {}
    sign, shifts = 1.0 if measure.higher_is_better else -1.0, shifts or {}
    known = {plate: next(measure_data(answer, [measure])) for plate, answer in (answers or {}).items()}
    drawn = {plate: one.draws for plate, one in known.items() if one.draws is not None}

    def difference(values: Mapping[str, Array], one: str, other: str) -> Estimate:
        if one not in drawn or other not in drawn:
            numbers = (sign * measure.averaged(values[plate]) for plate in (one, other))
            return estimate_of("mean", np.subtract(*numbers), replicates=replicates).times(measure.display.factor)
        moved = (
            [_moved(measure, of, computed[plate, AS_GIVEN][measure], values[plate]) for of in drawn[plate]]
            for plate in (one, other)
        )
        return estimate_of_draws(*(sign * (first - second) for first, second in zip(*moved, strict=True)))

    def is_better(values: Mapping[str, Array], one: str, other: str) -> bool:
        return bool(difference(values, one, other).low > np.nan_to_num(shifts.get(one, 0.0) + shifts.get(other, 0.0)))

    for name in dict.fromkeys(name for _, name in computed):
        values = {plate: computed.get((plate, name), computed[plate, AS_GIVEN])[measure] for plate in campaigns}
        best = (one for one in values if all(is_better(values, one, other) for other in values if other != one))
        numbers = {
            plate: float(_moved(measure, known[plate].estimate.value, computed[plate, AS_GIVEN][measure], of_plate))
            if plate in known
            else _value(measure, of_plate)
            for plate, of_plate in values.items()
        }
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


def elements_note(moves: Mapping[str, Mapping[Measure, float]], estimates: Mapping[Measure, Estimate]) -> str:
    """A sentence on measures that inputs of the elements move by more than their intervals; empty without any."""
    parts = []
    for measure, estimate in estimates.items():
        of_measure = {name.removeprefix("elements: "): of[measure] for name, of in moves.items()}
        beyond = {name: move for name, move in of_measure.items() if abs(move) > estimate.half_width}
        if beyond:
            text = ", ".join(f"{name} {move:+.3g}" for name, move in beyond.items())
            parts.append(f"{measure.title} (± {estimate.half_width:.2g}): {text}")
    words = "Inputs of finite elements move results by more than the interval of the answer"
    return f"{words}: {'; '.join(parts)}." if parts else ""
