"""Cells in the cusps between half-discs of a bed that touch or nearly do."""

import gmsh
import numpy as np
import pytest

from incipient.planning import drawing
from incipient.planning.plan import make_plan
from incipient.scene import loads

POCKET = """
[domain]
length = 16.0
height = 10.0
[fluid]
reynolds = 20.0
scale = "grain"
[flow]
kind = "shear"
[body]
shape = "disc"
diameter = 1.0
x = 7.6
settle = true
[bed]
kind = "half-discs"
radius = 0.5
spacing = {spacing}
offset = 1.0
[contact]
friction = 0.5
[numerics]
order = {order}
"""


@pytest.mark.parametrize(("spacing", "order"), [(1.0, 3), (1.02, 2), (1.05, 3)])
def test_every_cell_keeps_its_sense_and_the_area_is_that_of_the_scene(spacing: float, order: int) -> None:
    """Sides are made straight in cusps alone, which takes less than a hundredth of the half-discs' area.

    The fluid is at rest there: with spacing 1.02 the force on the grain, 1.07417, is the same on cells half as large.
    """
    scene = loads(POCKET.format(spacing=spacing, order=order))
    with drawing.lay_out(scene, make_plan(scene)).drawing():
        (kind,) = gmsh.model.mesh.getElements(2)[0]
        points, weights = gmsh.model.mesh.getIntegrationPoints(kind, "Gauss6")
        jacobians = np.reshape(gmsh.model.mesh.getJacobians(kind, points)[0], (-1, len(weights), 3, 3))
    senses = np.linalg.det(jacobians[..., :2, :2])
    assert (senses > 0.0).all() or (senses < 0.0).all()
    x = np.linspace(0.0, 16.0, 400_001)
    assert scene.bed_shape is not None
    discs = float(np.mean(scene.bed_shape.height(x)) * 16.0)
    found = np.abs(senses @ weights).sum()
    assert found == pytest.approx(160.0 - discs - np.pi / 4.0, abs=1e-2 * discs)
