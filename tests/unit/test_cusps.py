"""Cells in the cusps between half-discs of a bed that touch or nearly do."""

import gmsh
import numpy as np
import pytest
from test_modelling import POCKET

from incipient.effects.plan import make_plan
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
    with meshing.lay_out(Setup(scene), make_plan(scene)).gmsh_model():
        (kind,) = gmsh.model.mesh.getElements(2)[0]
        points, weights = gmsh.model.mesh.getIntegrationPoints(kind, "Gauss6")
        jacobians = np.reshape(
            gmsh.model.mesh.getJacobians(kind, points)[0], (-1, len(weights), 3, 3)
        )
        names = {
            gmsh.model.getPhysicalName(*group): group for group in gmsh.model.getPhysicalGroups(1)
        }
        nodes = np.reshape(gmsh.model.mesh.getNodesForPhysicalGroup(*names["bed"])[1], (-1, 3))
    senses = np.linalg.det(jacobians[..., :2, :2])
    assert (senses > 0.0).all() or (senses < 0.0).all()
    assert scene.bed_shape is not None
    x, y = nodes[nodes[:, 1] > 0.25, :2].T
    assert len(x) > 100 and y == pytest.approx(scene.bed_shape.height(x), abs=1e-9)
