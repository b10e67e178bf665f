"""The constants of the device code: value, unit, reason, section of docs/model.md, and the test that binds the value.

A constant names the test that computes what the constant decides. The stages read their constants from here, and
docs/reference/device.md shows them. Numbers of a formula, such as ½, stand in the formula, and settings that the host
chooses stand in solver/.
"""

from typing import NamedTuple


class Constant(NamedTuple):
    """A number that somebody chose.

    Attributes:
        value: number in the unit.
        unit: what the number counts or is a share of.
        reason: purpose, and why it is not larger or smaller.
        section: section of docs/model.md; empty where the number belongs to the computation alone.
        test: file and function in tests/ of the test that binds it; empty where any value of its order serves.
    """

    value: float
    unit: str
    reason: str
    section: str = ""
    test: str = ""


# How a shot ends (kernels/march.py)
REST_ENERGY = Constant(
    1.0e-4,
    "impact energy",
    "A core with less, at 1 % of its impact velocity, rests: it cannot do more than this share of the work.",
    "8",
    "kernels/test_march.py::test_a_shot_ends_at_a_share_of_the_impact_energy",
)
RETURN_ENERGY = Constant(
    2.5e-3,
    "impact energy",
    "A core that turned back behind the plate with less, at 5 % of its impact velocity, does not come back through it.",
    "8",
    "kernels/test_march.py::test_a_shot_ends_at_a_share_of_the_impact_energy",
)
STRAY_ENERGY = Constant(
    2.25e-2,
    "impact energy",
    "Nor does a core that touches nothing and has less across the layers, at 15 %, however fast it goes along them.",
    "8",
    "kernels/test_march.py::test_a_shot_ends_at_a_share_of_the_impact_energy",
)
BARRIER_SHARE = Constant(
    0.1,
    "work of the layers that it left, if they were solid",
    "STRAY_ENERGY holds only for a core that has less than this share too, since layers with holes take less work.",
    "8",
    "kernels/test_march.py::test_a_shot_ends_at_a_share_of_the_impact_energy",
)
MOST_ENERGY = Constant(
    1.01,
    "impact energy",
    "No law adds energy, and rounding errors add less than 1 % in many thousand steps. More is a failure.",
    "5",
    "kernels/test_march.py::test_a_shot_ends_at_a_share_of_the_impact_energy",
)

# Contact (kernels/interaction.py, march.py)
DAMPED_ONSETS = Constant(
    8.0,
    "onset speeds",
    "A core that swings between two walls is damped by the chord up to here: a step carries it so far beyond the ramp.",
    "4.2",
    "verification/test_stored_outcomes.py::test_results_are_those_stored",
)
AT_REST = Constant(
    1.0e-5,
    "speed of the core",
    "A wall that slides along itself has v·n = 0 up to rounding, some 1e-7. Below this share it does not touch.",
    "4.2",
    "kernels/test_contact.py::test_wall_that_slides_along_itself_does_not_touch",
)
SMALLEST_ONSET = Constant(
    1.0e-4,
    "impact velocity",
    "The onset speed follows the core, and is never narrower: the slope of the ramp stays finite at rest.",
    "4.2",
    "kernels/test_contact.py::test_onset_follows_the_step_and_a_core_that_slows_down",
)

# Material ahead of a patch (kernels/free_edges.py)
LEAST_RADIAL = Constant(
    0.02,
    "share of the normal that is outwards",
    "A disc has none: its patches have their own azimuths then, and not one that rounding gives to a straight core.",
    "4.9",
    "verification/test_free_surface.py::test_a_disc_looks_outwards",
)

# Patches in the slab (kernels/core_surface.py)
LEAST_EXTENT_RATIO = Constant(
    0.02,
    "larger one of extent and motion",
    "Floor of the smaller one in the convolution: its quotient stays finite, and corners are rounded by 1 %.",
    "4.1",
    "kernels/test_core_surface.py::test_share_of_a_box_alone_has_its_corners_rounded_only",
)
LEAST_PATCH_EXTENT = Constant(
    1.0e-3,
    "half of the ring's extent",
    "Floor of a patch's extent across the face, for a patch that lies along it.",
    "4.1",
    "kernels/test_core_surface.py::test_patch_along_the_face_is_in_or_out_at_once",
)

# Motion (kernels/rigid_body.py)
ITERATIONS = Constant(
    64,
    "iterations",
    "Of the time of flight to a stand-off: enough for a point that swings at half of the speed of flight.",
    "1.3",
    "kernels/test_rigid_body.py::test_a_point_that_swings_at_half_of_the_speed_of_flight_is_located",
)
SMALL_ANGLE = Constant(
    0.02,
    "rad, half of the angle of a turn",
    "Up to here the series of sine and cosine are exact in float64, and ten times as fast.",
    "5",
    "kernels/test_rigid_body.py::test_drift_is_the_closed_form_of_the_symmetric_top",
)
LEAST_SWING = Constant(
    1.0e-8,
    "square of the change of velocity along the axis",
    "Changes across the axis that are smaller than 1e-4 of it are rounding, and no swing of the core.",
    "4.2",
    "kernels/test_rigid_body.py::test_a_core_swings_when_a_step_turns_back_the_last_one",
)

# The computation
VECTOR = Constant(
    16,
    "numbers of float32",
    "Of a vector register of a CPU (AVX-512): the columns of a filtered strip are whole vectors.",
    test="kernels/test_device_code.py::test_a_strip_of_the_filter_is_whole_vectors",
)
LANES = Constant(
    32,
    "threads",
    "Of a block on CUDA: one warp, so that a barrier stops nothing else.",
    test="kernels/test_device_code.py::test_block_keeps_its_front_window_in_shared_memory",
)
THREADS = Constant(256, "threads", "Of a block in the simple layout on CUDA, each of which computes a shot by itself.")
BLOCKS = Constant(
    12,
    "blocks",
    "That a multiprocessor is to hold at least. More hide more of each other's latency, but leave fewer registers.",
)
SHEET = Constant(
    2.0**24,
    "units",
    "Of exposure that one sheet gives to a node, in whole numbers: rounds as float32 does, and 128 sheets fit.",
    test="kernels/test_block.py::test_lanes_that_run_one_after_another_compute_what_one_thread_computes",
)
TINY = Constant(
    1.0e-30,
    "m/s, or a pure number",
    "Keeps quotients finite; far below anything that matters, and no subnormal number of float32.",
    test="kernels/test_contact.py::test_small_variation_leaves_the_ramp_as_it_is",
)
SMALL = Constant(1.0e-9, "m or m/s", "Keeps quotients of ways and speeds finite between layers.")
SLOWEST = Constant(1.0, "m/s", "Keeps times of flight finite where a core hardly moves along x.")
FAR_AWAY = Constant(1.0e9, "m", "Beyond any place of a core: the start of a search for the nearest.")
FAR_NODES = Constant(2**20, "nodes", "Beyond any window: the start of a search for the nearest node.")
