"""The linear answer of the flow to motions of a body: from the cells at the body only, yet the whole traction.

The reference is the residual itself, differenced along the answer: the program assembles the derivative, not that.
"""

from __future__ import annotations

import numpy as np
import pytest
from floating import Floats, box_around, floating

from incipient.fluid import Fluid, Prescribed, no_slip
from incipient.geometry.placement import Placement
from incipient.geometry.plane.grains import Disc

DISC, PLACE = Disc(0.3), Placement((0.55, 0.6))
NUDGE = 1e-6


def lid(x: Floats, t: float) -> Floats:
    """Of the unit cavity, slow in the corners."""
    return np.vstack([16 * x[0] ** 2 * (1 - x[0]) ** 2, 0 * x[0]])


def differenced(fluid: Fluid, way: Floats) -> Floats:
    """The change of the residual along a change of the state, by central differences."""
    at = fluid.state.x.array.copy()
    ends = []
    for size in (NUDGE, -NUDGE):
        fluid.state.x.array[:] = at + size * way
        ends.append(fluid.residual())
    fluid.state.x.array[:] = at
    return (ends[0] - ends[1]) / (2 * NUDGE)


@pytest.mark.parametrize("axis", [0, 1])
def test_the_traction_answers_as_the_whole_residual_does(axis: int) -> None:
    domain = box_around(DISC, PLACE, cell=0.1, far=0.2)
    conditions = [Prescribed("top", lid), *(no_slip(name) for name in ("left", "right", "bottom"))]
    with floating(domain, DISC, PLACE, conditions, 10.0) as found:
        found.transient.advance(0.05)
        fluid, blocks = found.fluid, found.part._blocks
        fluid.renew_factors()
        fluid.solve(1e-12)
        at_body = fluid.space.velocity_map.reshape(-1, 2)[blocks]
        motion = np.zeros_like(fluid.state.x.array)
        motion[at_body[:, axis]] = 1.0
        change, traction = fluid.response(motion, np.zeros_like(fluid.residual()))
        residual = differenced(fluid, change)
        held = np.concatenate(
            [condition.dof_indices()[0] for condition in fluid.constraints.dirichlet]
        )
    largest = np.abs(residual).max()
    assert change[at_body[:, axis]] == pytest.approx(1.0)
    assert traction[at_body] == pytest.approx(residual[at_body], abs=1e-7 * largest)
    assert (
        np.abs(np.delete(residual, held)).max() < 1e-7 * largest
    )  # the flow itself stays in balance
