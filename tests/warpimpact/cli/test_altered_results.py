"""Results that somebody altered: every command that reads them reads them, or says in a sentence what is wrong."""

import itertools
import random
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray

from warpimpact.campaign.campaign import Campaign
from warpimpact.cli import main
from warpimpact.runs.run import run

SCENE = (Path(__file__).parents[3] / "campaigns" / "slotted_plate.toml").read_text(encoding="utf-8")
SMALL = SCENE.replace('"standard"', '"draft"').replace("count = 4096", "count = 64")
JUNK: tuple[Any, ...] = (
    *("", "x" * 300, "[]", "{", '{"a": 1}', '{"velocity": "x"}', "\x1b[31m"),
    *(0, -1, 7, 2**62, 0.5, -2.5, float("nan"), float("inf"), 1e300),
    *([1.0], [0.0, 0.0], [1.0, float("nan")], [1, 2, 3], ["a", "b"]),
)
"""What an attribute may be altered to."""
COMMANDS: dict[str, Sequence[str]] = {
    "inspect": ("inspect", "a.nc"),
    "export": ("export", "a.nc", "-o", "a.csv", "--overwrite"),
    "compare": ("compare", "a.nc", "b.nc", "-o", "c.png"),
    "plot": ("plot", "a.nc", "-o", "."),
    "report": ("report", "a.nc", "-o", "a.html", "--trajectories", "1", "--overwrite"),
    "replay": ("replay", "a.nc", "--hit", "3", "-o", "h.nc", "--overwrite"),
}
SEEDS: dict[str, Sequence[int]] = {
    "inspect": [*range(80), 178],
    "export": [*range(41), 151],
    "compare": range(10),
    "plot": range(6),
    "report": [*range(4), 16],
    "replay": range(5),
}
"""Kept, so that a test which fails fails again; those out of order once found a traceback."""

Dataset = xarray.Dataset


@pytest.fixture(scope="module")
def result() -> Dataset:
    return run(Campaign.from_text(SMALL, name="a.toml", folder=Path()), device="cpu")


def altered(dataset: Dataset, draw: random.Random) -> Dataset:
    """The Dataset after one to three alterations."""
    for _ in range(draw.randint(1, 3)):
        dataset = draw.choice(ALTERATIONS)(dataset, draw)
    return dataset


def _without_attribute(dataset: Dataset, draw: random.Random) -> Dataset:
    name = draw.choice(sorted(dataset.attrs) or [""])
    return dataset.drop_attrs().assign_attrs({key: value for key, value in dataset.attrs.items() if key != name})


def _other_attribute(dataset: Dataset, draw: random.Random) -> Dataset:
    return dataset.assign_attrs({draw.choice(sorted(dataset.attrs) or ["title"]): draw.choice(JUNK)})


def _other_attribute_of_a_variable(dataset: Dataset, draw: random.Random) -> Dataset:
    name = draw.choice(sorted(map(str, dataset.variables)))
    attributes = dataset[name].attrs
    change = {draw.choice([*sorted(attributes), "units", "long_name", "flag_values"]): draw.choice(JUNK)}
    return (
        dataset.assign_coords({name: dataset[name].assign_attrs(change)})
        if name in dataset.coords
        else (dataset.assign({name: dataset[name].assign_attrs(change)}))
    )


def _without_variable(dataset: Dataset, draw: random.Random) -> Dataset:
    return dataset.drop_vars(draw.choice(sorted(map(str, dataset.variables))))


def _other_values(dataset: Dataset, draw: random.Random) -> Dataset:
    name = draw.choice(sorted(map(str, dataset.data_vars)))
    values = np.array(dataset[name].values)
    if values.dtype.kind not in "iuf" or not values.size:
        return dataset
    bad = (
        draw.choice([np.nan, np.inf, -1.0, 0.0, 99.0, 1e300]) if values.dtype.kind == "f" else draw.choice([-1, 9, 99])
    )
    values[... if draw.random() < 0.5 else draw.randrange(len(values)) if values.ndim else ...] = bad
    return dataset.assign({name: (dataset[name].dims, values, dataset[name].attrs)})


def _other_type(dataset: Dataset, draw: random.Random) -> Dataset:
    name = draw.choice(sorted(map(str, dataset.data_vars)))
    kind = draw.choice([str, np.float32, np.int16])
    with np.errstate(all="ignore"):
        values = dataset[name].values
        return dataset.assign({name: (dataset[name].dims, values.astype(kind), dataset[name].attrs)})


def _other_dimensions(dataset: Dataset, draw: random.Random) -> Dataset:
    name = draw.choice(sorted(map(str, dataset.data_vars)))
    array = dataset[name]
    change: Callable[[], Any] = draw.choice(
        [
            lambda: array.transpose(),
            lambda: array.isel({array.dims[0]: 0}) if array.dims else array,
            lambda: array.rename(dict.fromkeys(array.dims[:1], "other")).drop_vars(list(array.coords)),
            lambda: array.expand_dims("more"),
        ]
    )
    return dataset.drop_vars(name).assign({name: change()})


def _fewer(dataset: Dataset, draw: random.Random) -> Dataset:
    return dataset.isel({draw.choice(sorted(map(str, dataset.sizes))): slice(draw.randint(0, 2))})


ALTERATIONS = (
    _without_attribute,
    _other_attribute,
    _other_attribute,
    _other_attribute_of_a_variable,
    _without_variable,
    _other_values,
    _other_type,
    _other_dimensions,
    _fewer,
)


@pytest.mark.filterwarnings("ignore")
@pytest.mark.usefixtures("unrendered")
@pytest.mark.parametrize(("command", "seed"), [(name, seed) for name, seeds in SEEDS.items() for seed in seeds])
def test_an_altered_result_is_read_or_refused_in_a_sentence(
    command: str,
    seed: int,
    result: Dataset,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    draw = random.Random(f"{command} {seed}")
    for attempt in itertools.count():  # some alterations do not fit each other, or netCDF
        try:
            altered(result, draw).to_netcdf("a.nc")
        except Exception:
            assert attempt < 100
        else:
            break
    if "b.nc" in COMMANDS[command]:
        result.to_netcdf("b.nc")
    code = main(COMMANDS[command])
    said = capsys.readouterr().err
    assert code in (0, 2, 3), said + "".join(path.read_text() for path in tmp_path.glob("warpimpact_bug_*"))
    if code == 2:
        assert said.count("\n") == 1
        assert len(said) < 1000
