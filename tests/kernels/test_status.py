"""The energies at which a shot ends (docs/model.md §8), just below and just above each of them."""

from collections.abc import Mapping

import pytest
import warp as wp

from warpimpact.kernels import march
from warpimpact.kernels.status import RUNNING, Status
from warpimpact.kernels.variant import Variant

VARIANT = Variant(double=True)
built = march.build(VARIANT)
Context, Reach, State, Pose, status_of = built.Context, built.Reach, built.State, built.Pose, built.status_of


def judge(
    context: Context,
    reach: Reach,
    across: wp.float64,
    along: wp.float64,
    touched: wp.bool,
    status: wp.array(dtype=wp.int32),
) -> None:
    """Status of a core of 2 kg inside the target, which goes back across the layers."""
    state, pose = State(), Pose()
    state.attitude = wp.quatd(wp.float64(0.0), wp.float64(0.0), wp.float64(0.0), wp.float64(1.0))
    state.velocity = wp.vec3d(-wp.sqrt(across), wp.sqrt(along), wp.float64(0.0))
    pose.axis = wp.vec3d(wp.float64(1.0), wp.float64(0.0), wp.float64(0.0))
    status[0] = status_of(context, reach, state, pose, touched)


JUDGE = VARIANT.kernel(judge)
BEHIND = {"behind": True}
FREE = {"behind": True, "last_ring": -1, "along": 0.5}


@pytest.mark.parametrize(
    ("least", "case", "below", "above"),
    [
        pytest.param(0.01**2, {}, Status.ARRESTED, RUNNING, id="at rest: 1 % of the impact velocity"),
        pytest.param(0.05**2, BEHIND, Status.ARRESTED, RUNNING, id="turned back behind the plate: 5 %"),
        pytest.param(0.15**2, FREE, Status.ARRESTED, RUNNING, id="between layers: 15 % across them"),
        pytest.param(
            0.1 * 0.05, FREE | {"barrier": 0.05}, Status.ARRESTED, RUNNING, id="a tenth of the work of the layers"
        ),
        pytest.param(1.01, {"touched": False}, RUNNING, Status.GAINED_ENERGY, id="1 % more than at impact"),
    ],
)
def test_a_shot_ends_at_a_share_of_the_impact_energy(
    least: float, case: Mapping[str, float], below: int, above: int, device: str
) -> None:
    context, reach = Context(), Reach()
    context.impact_energy, context.depth = 1.0, 1.0
    context.body.mass, context.body.inertia_axial, context.body.inertia_transverse = 2.0, 1.0, 1.0
    reach.footprint.inside, reach.footprint.last_ring = True, case.get("last_ring", 0)
    reach.behind, reach.barrier = case.get("behind", False), case.get("barrier", 1e3)
    for share, expected in ((0.999, below), (1.001, above)):
        status = wp.empty(1, dtype=wp.int32, device=device)
        inputs = [context, reach, share * least, case.get("along", 0.0), case.get("touched", True)]
        wp.launch(JUDGE, 1, inputs=inputs, outputs=[status], device=device)
        assert status.numpy()[0] == expected
