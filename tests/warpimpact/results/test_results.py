"""The Dataset contract, files that are complete or absent, and the CF conventions."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import netCDF4
import numpy as np
import pytest
import xarray

from warpimpact import open_result
from warpimpact.errors import OutputError, ResultError
from warpimpact.firing.simulate import Response, read_test, simulate_test
from warpimpact.kernels.status import Status
from warpimpact.results import files
from warpimpact.results.dataset import outlines
from warpimpact.runs.run import run
from warpimpact.scene import NoPattern, SquarePattern

from ...options import CPU
from ..slotted import CAMPAIGNS, slotted

MM = 1e-3
TWO_HOLES = SquarePattern(side=2 * MM, spacing=(16 * MM, 8 * MM), holes=[(2 * MM, 0.0), (-2 * MM, 0.0)])

CONTRACT = {
    "hit": (("hit",), "1"),
    "hit_y": (("hit",), "m"),
    "hit_z": (("hit",), "m"),
    "standoff": (("standoff",), "m"),
    "axis": (("axis",), "1"),
    "impact_velocity": (("hit",), "m s-1"),
    "obliquity": (("hit",), "degree"),
    "azimuth": (("hit",), "degree"),
    "impact_pitch": (("hit",), "degree"),
    "impact_yaw": (("hit",), "degree"),
    "spin": (("hit",), "rad s-1"),
    "edge_distance": (("hit",), "m"),
    "status": (("hit",), "1"),
    "perforated": (("hit",), "1"),
    "residual_velocity": (("hit",), "m s-1"),
    "deflection": (("hit",), "degree"),
    "angular_velocity": (("hit", "axis"), "rad s-1"),
    "energy_loss": (("hit",), "J"),
    "contact_duration": (("hit",), "s"),
    "tilt": (("hit", "standoff"), "degree"),
    "pitch": (("hit", "standoff"), "degree"),
    "yaw": (("hit", "standoff"), "degree"),
    "total_yaw": (("hit", "standoff"), "degree"),
    "exit_velocity": (("hit", "axis"), "m s-1"),
    "exit_axis": (("hit", "axis"), "1"),
    "exit_position": (("hit", "axis"), "m"),
    "inclination": (("inclination",), "degree"),
    "presented_area": (("inclination",), "m2"),
}


def test_variables_are_those_of_the_contract(make_result):
    dataset = make_result()
    along = {name: (array.dims, array.attrs["units"]) for name, array in dataset.variables.items() if array.ndim}
    assert along == CONTRACT
    of_hits = {"hit", "hit_y", "hit_z", "standoff", "axis"}
    assert {name for name in dataset.coords if dataset[name].ndim} == of_hits | {"inclination", "presented_area"}
    assert dataset["hit"].values.tolist() == [0, 1, 2, 3]
    assert all(array.attrs["long_name"] for array in dataset.variables.values())
    assert dataset["axis"].values.tolist() == ["x", "y", "z"]


def test_numbers_of_the_scene_are_scalars_with_units(make_result):
    dataset = make_result()
    numbers = {name: (float(array), array.units) for name, array in dataset.coords.items() if not array.ndim}
    assert numbers["thickness"] == (4e-3, "m")
    assert numbers["resistance"] == (2.6e9, "Pa")
    assert numbers["pattern_side"] == (4e-3, "m")
    assert numbers["core_length"] == (20e-3, "m")
    assert numbers["core_diameter"] == (pytest.approx(6e-3), "m")
    assert numbers["mass"] == (pytest.approx(4e-3), "kg")
    assert {"degradation", "degradation_length", "shear_coefficient", "density", "onset"} <= numbers.keys()


def test_outcomes_have_the_precision_in_which_they_were_computed(make_result):
    for double, expected in ((False, np.float32), (True, np.float64)):
        dataset = make_result(double=double)
        assert {dataset[name].dtype for name in ("residual_velocity", "tilt", "exit_axis")} == {np.dtype(expected)}
        assert {dataset[name].dtype for name in ("hit_y", "obliquity")} == {np.dtype(np.float64)}


def test_angles_become_degrees_and_the_rest_stays_si(make_result):
    dataset = make_result()
    np.testing.assert_allclose(dataset["obliquity"], 30.0, rtol=1e-15)
    np.testing.assert_allclose(dataset["azimuth"], 90.0, rtol=1e-15)
    np.testing.assert_allclose(dataset["impact_pitch"], -1.0, rtol=1e-15)
    np.testing.assert_allclose(dataset["impact_yaw"], 2.0, rtol=1e-15)
    np.testing.assert_allclose(dataset["deflection"][-1], np.degrees(0.1), rtol=1e-7)
    np.testing.assert_allclose(dataset["tilt"][-1], np.degrees([0.5, 1.5]), rtol=1e-7)
    assert dataset["spin"].values.tolist() == [1.7e4] * 4
    assert dataset["impact_velocity"].values.tolist() == [825.0] * 4
    assert dataset["angular_velocity"].values[-1].tolist() == [0.0, 1e3, -2e3]


def test_outlines_are_separated_by_nan(make_result):
    y, z = outlines(make_result(pattern=TWO_HOLES))
    right, left = np.array([2.0, 0.0, 0.0, 2.0, 2.0]), np.array([1.0, 1.0, -1.0, -1.0, 1.0])
    np.testing.assert_allclose(y * 1e3, [*(right + 1.0), np.nan, *(right - 3.0)], atol=1e-12)
    np.testing.assert_allclose(z * 1e3, [*left, np.nan, *left], atol=1e-12)


@pytest.mark.parametrize("pattern", [NoPattern(), TWO_HOLES])
def test_file_opens_with_plain_xarray_and_is_identical(make_result, tmp_path, pattern):
    dataset = files.with_meanings(make_result([Status.PERFORATED, Status.ARRESTED], pattern=pattern))
    path = tmp_path / "out.nc"
    files.write(dataset, path)
    with xarray.open_dataset(path) as file:
        xarray.testing.assert_identical(file.load(), dataset)
    xarray.testing.assert_identical(files.read(path).to_dataset(), dataset)


def break_off(error: BaseException):
    """A writer that stops half-way, as on a full disk or after Ctrl-C."""

    def to_netcdf(dataset, file, **_):
        file.write_bytes(b"half a file")
        raise error

    return to_netcdf


@pytest.mark.parametrize(
    ("error", "raised"),
    [
        (OSError("disk full"), OutputError),
        (RuntimeError("NetCDF: HDF error"), OutputError),
        (KeyboardInterrupt(), KeyboardInterrupt),
    ],
)
@pytest.mark.parametrize("before", [{}, {"out.nc": "old"}])
def test_breaking_off_leaves_the_folder_as_it_was(make_result, tmp_path, monkeypatch, error, raised, before):
    for name, text in before.items():
        (tmp_path / name).write_text(text)
    monkeypatch.setattr(xarray.Dataset, "to_netcdf", break_off(error))
    with pytest.raises(raised):
        files.write(make_result(), tmp_path / "out.nc")
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == before


def test_an_interrupt_waits_for_the_end_of_a_netcdf_call():
    before, done = signal.signal(signal.SIGINT, signal.default_int_handler), []  # a background job ignores Ctrl-C

    def call():
        with files.delay_interrupts():
            with files.delay_interrupts():
                os.kill(os.getpid(), signal.SIGINT)
                done.append("inner")
            done.append("outer")

    with pytest.raises(KeyboardInterrupt):
        call()
    assert done == ["inner", "outer"]
    assert signal.signal(signal.SIGINT, before) is signal.default_int_handler


def test_a_result_is_opened_by_its_name(make_result, tmp_path):
    written = make_result(5)
    files.write(written, tmp_path / "a.nc")
    for name in (tmp_path / "a.nc", str(tmp_path / "a.nc")):
        with open_result(name) as result:
            assert not result.residual_velocity.variable._in_memory  # read when it is used
            assert np.array_equal(result.residual_velocity, written.residual_velocity)


def test_what_is_no_result_is_reported(make_result, tmp_path):
    (tmp_path / "notes.nc").write_text("not netCDF")
    make_result().drop_vars("tilt").to_netcdf(tmp_path / "other.nc")
    for name, message in (
        ("absent", r"cannot be read \(it is not there\)"),
        ("notes", "cannot be read as a netCDF file"),
        ("other", 'is no whole file of a map of hits, it has no "tilt"'),
    ):
        for read in (files.read, open_result):
            with pytest.raises(ResultError, match=rf"{name}\.nc: {message}"):
                read(tmp_path / f"{name}.nc")


CHANGED_MEANINGS = {
    "residual_velocity.units": ("km s-1", "m s-1"),
    "obliquity.units": ("radian", "degree"),
    "contact_duration.units": ("seconds since 2026-01-01", "s"),  # which xarray takes for dates
    "core_length.units": ("mm", "m"),
    "status.flag_meanings": ("arrested perforated", "perforated arrested"),
    "plate_period_units": ("mm", "m"),
}


@pytest.mark.parametrize("place", CHANGED_MEANINGS)
def test_a_file_whose_numbers_mean_something_else_is_refused(place: str, make_result, tmp_path: Path) -> None:
    path, (changed, written) = tmp_path / "a.nc", CHANGED_MEANINGS[place]
    files.write(make_result(), path)
    name, _, key = place.partition(".")
    with netCDF4.Dataset(path, "a") as file:
        (file[name] if key else file).setncattr(key or name, changed)
    sentence = rf'a.nc: {place} is "{changed}", but its numbers are read as "{written}.*"; put the attribute back'
    for opening in (files.read, open_result):
        with pytest.raises(ResultError, match=sentence):
            opening(path)


def test_units_changed_in_python_or_in_a_reference_are_refused(tmp_path: Path) -> None:
    result = run(slotted(('fidelity = "draft"', "level = 0"), count=2), references=True, options=CPU)
    result["tilt"].attrs["units"] = "radian"
    result.to_netcdf(tmp_path / "a.nc")
    with pytest.raises(ResultError, match=r'tilt.units is "radian", but its numbers are read as "degree"'):
        files.read(tmp_path / "a.nc")
    result["tilt"].attrs["units"] = "degree"
    files.write(result, tmp_path / "b.nc")
    with netCDF4.Dataset(tmp_path / "b.nc", "a") as file:
        file["solid/tilt"].units = "radian"
    with pytest.raises(ResultError, match=r"b.nc: tilt.units"):
        files.read(tmp_path / "b.nc")


def test_a_device_is_not_replaced_by_a_file(make_result, tmp_path):
    os.mkfifo(tmp_path / "a.nc")
    with pytest.raises(OutputError, match=r"a.nc: is a folder or a device, but the output is one file"):
        files.write(make_result(4), tmp_path / "a.nc")
    assert [path.is_fifo() for path in tmp_path.iterdir()] == [True]


def test_a_symbolic_link_is_written_through(make_result, tmp_path):
    (tmp_path / "disk").mkdir()
    (tmp_path / "a.nc").symlink_to("disk/b.nc")
    for count in (3, 5):  # a link to no file yet, and to one
        files.write(make_result(count), tmp_path / "a.nc")
        assert (tmp_path / "a.nc").is_symlink()
        assert files.read(tmp_path / "disk" / "b.nc").sizes["hit"] == count
    assert {path.name for path in tmp_path.iterdir()} == {"a.nc", "disk"}


pytest.importorskip("compliance_checker")


@pytest.fixture(scope="module")
def bent() -> xarray.DataTree:
    return run(slotted(("[output]", "[output]\nbending = true"), count=16), options=CPU)


def report(path: Path) -> str:
    checker = Path(sys.executable).with_name("compliance-checker")
    command = [str(checker), "--test", "cf:1.11", "--criteria", "strict", str(path)]
    return subprocess.run(command, capture_output=True, text=True, check=False).stdout


def test_a_hit_map_complies(bent: xarray.DataTree, tmp_path: Path) -> None:
    files.write(bent, tmp_path / "a.nc")
    message = report(tmp_path / "a.nc")
    assert "All tests passed!" in message, message


def test_a_firing_test_complies(tmp_path: Path) -> None:
    (tmp_path / "limits.nc").touch()
    text = (CAMPAIGNS / "firing" / "v50_test.toml").read_text(encoding="utf-8").replace("tests = 1000", "tests = 20")
    text = text.replace('campaign = "plate_and_base.toml"', 'limits = "limits.nc"')
    (tmp_path / "a.toml").write_text(text, encoding="utf-8")
    test = read_test(tmp_path / "a.toml")
    files.write(simulate_test(test, Response(np.linspace(800.0, 1100.0, 20))), tmp_path / "a.nc")
    message = report(tmp_path / "a.nc")
    assert "All tests passed!" in message, message
