"""Cells in the cusps between half-discs of a bed that touch or nearly do."""

import numpy as np
import pytest
from mpi4py import MPI
from test_modelling import POCKET

from incipient.effects.plan import make_plan
from incipient.mesh.domain import build
from incipient.mesh.motion import MeshMotion
from incipient.planning import meshing
from incipient.planning.flow_setup import Setup
from incipient.scene import loads

ENDS_IN_A_CUSP = (
    "bed.offset=0.525",
    "numerics.mesh_size=2.0",
)  # 0.025 from the foot of its last half-disc


@pytest.mark.parametrize(
    ("spacing", "order", "more"),
    [(1.0, 3, ()), (1.02, 2, ()), (1.05, 3, ()), (1.15, 2, ENDS_IN_A_CUSP)],
)
def test_cells_keep_their_sense_and_sides_are_straight_in_cusps_alone(
    spacing: float, order: int, more: tuple[str, ...]
) -> None:
    """The upper half of the bed's height is that of the half-discs to round-off; fluid is at rest in the lower.

    With spacing 1.02 the force on the grain, 1.07417, is the same on cells half as large.
    """
    scene = loads(POCKET, overrides=[f"bed.spacing={spacing}", f"numerics.order={order}", *more])
    mesh = meshing.lay_out(Setup(scene), make_plan(scene)).mesh()
    nodes = mesh.points[np.unique(mesh.sides["bed"])]
    assert MeshMotion(build(MPI.COMM_SELF, lambda: mesh)).quality().worst > 0.0
    assert scene.bed_shape is not None
    x, y = nodes[nodes[:, 1] > 0.25].T
    assert len(x) > 100 and y == pytest.approx(scene.bed_shape.height(x), abs=1e-9)
