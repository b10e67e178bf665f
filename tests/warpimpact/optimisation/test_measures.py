"""What a search asks of a design has the words of `inspect`."""

from pathlib import Path

import pytest

from warpimpact import Campaign, run
from warpimpact.analysis.effectiveness import ANGLE, effectiveness
from warpimpact.analysis.vocabulary import EFFECTS, SHOWN_UNITS
from warpimpact.optimisation.measures import Key, effect_of, higher_is_better, label_of, names

from .conftest import CORE, HOLES

BASE = """
[[layer]]
thickness = "6 mm"
resistance = "1 GPa"
gap = "50 mm"
"""


@pytest.mark.parametrize("behind", ["", BASE])
def test_labels_and_directions_are_those_of_inspect(behind: str) -> None:
    text = CORE.replace('"130 mm"]', '"130 mm"]\nbending = true').replace(
        'mass = "4 g"', 'mass = "4 g"\nstrength = "2 GPa"'
    )
    hits = '[hits]\nsampling = "sobol"\ncount = 64\n'
    dataset = run(Campaign.from_text(text + HOLES + behind + hits, name="a.toml", folder=Path()), device="cpu")
    told = {measure.name: measure for measure in effectiveness(dataset, standoff="130 mm")}
    asked = [name for name in names() if name in told]
    assert {effect_of(name) for name in asked} == {
        name for name, effect in EFFECTS.items() if not effect.is_limit and (behind or effect.needs != "layer")
    }
    for name in asked:
        label = told[name].label.removesuffix(", mean") + SHOWN_UNITS[told[name].units]
        assert label_of(name, Key(effect_of(name), ANGLE, 0.13, 0)) == label
        assert higher_is_better(name) == told[name].higher_is_better
