"""Solves small flows on however many ranks there are and prints what was found (run by test_parallel.py)."""

from __future__ import annotations

import json
import sys
from typing import Any

from mpi4py import MPI  # first: PyPI's dolfinx finds its MPI only then

# isort: split
import numpy as np
import ufl
from domains import ball_in_box, integral, square_in_box

from incipient.accuracy.dual import GoalErrors, goal_errors
from incipient.coupled.tractions import TractionProbe, rigid_motion
from incipient.fluid import (
    Condition,
    FlowModel,
    Fluid,
    Open,
    Prescribed,
    Slip,
    no_slip,
    solve_steady,
)
from incipient.fluid.derived import vorticity
from incipient.fluid.transient import Transient
from incipient.geometry.placement import Placement
from incipient.mesh.motion import MeshMotion, RigidDisplacement
from incipient.mesh.sampling import sample

COMM = MPI.COMM_WORLD


def shear(x: np.ndarray, t: float) -> np.ndarray:
    return np.vstack([x[1], 0 * x[0], 0 * x[0]])


def channel() -> list[Condition]:
    """An open channel with a free-slip ceiling."""
    return [
        Open("right"),
        Slip("top", axis=1),
        Prescribed("left", shear),
        no_slip("bottom"),
        no_slip("body"),
    ]


def box() -> list[Condition]:
    """A closed box driven by its lid: the pressure has no level of its own."""
    lid = Prescribed("top", lambda x, t: np.vstack([x[0] * (2 - x[0]), 0 * x[0]]))
    return [lid, *(no_slip(name) for name in ("left", "right", "bottom", "body"))]


def readings(fluid: Fluid, about: tuple[float, ...], points: Any) -> dict[str, Any]:
    """Everything that a result is made of."""
    probe = TractionProbe(fluid, "body", about)
    by_residual, by_integral = probe.resultant(), probe.surface_resultant()
    velocity, pressure = ufl.split(fluid.state)
    traction, curl = probe.field(), vorticity(fluid)
    return {
        "ranks": fluid.domain.comm.size,
        "force": by_residual.force.tolist(),
        "couple": by_residual.torque.tolist(),
        "surface force": by_integral.force.tolist(),
        "surface couple": by_integral.torque.tolist(),
        "velocity norm": integral(fluid.domain, ufl.inner(velocity, velocity) * ufl.dx) ** 0.5,
        "pressure norm": integral(fluid.domain, pressure**2 * ufl.dx) ** 0.5,
        "traction norm": integral(fluid.domain, ufl.inner(traction, traction) * ufl.dx) ** 0.5,
        "vorticity norm": integral(fluid.domain, ufl.inner(curl, curl) * ufl.dx) ** 0.5,
        "velocity at points": sample(fluid.velocity, np.array(points)).tolist(),
        # In a closed box with the node that is pinned.
        "pressure at points": sample(fluid.pressure, np.array(points))[:, 0].tolist(),
    }


def in_cavity(cell: float, order: int, reynolds: float = 20.0, inertia: bool = True) -> Fluid:
    """A square block in a closed box whose lid slides, solved."""
    model = FlowModel(order=order, inertia=inertia)
    fluid = Fluid(square_in_box(0.3, cell), model, box(), reynolds)
    solve_steady(fluid, 1e-12)
    return fluid


def described(goals: GoalErrors) -> dict[str, np.ndarray]:
    """A load, its estimated error, and what the shares of all cells in that add up to."""
    mesh = goals.fluid.domain.mesh
    owned = mesh.topology.index_map(0).size_local
    sums = [mesh.comm.allreduce(goals.shares(goal)[:owned].sum()) for goal in np.eye(3)]
    return {
        "load": goals.computed.load[[0, 1, 5]],
        "estimate": goals.error[[0, 1, 5]],
        "shares": np.array(sums),
    }


def estimates(fluid: Fluid) -> dict[str, Any]:
    """Errors of the load on the block by a dual solution."""
    with fluid, goal_errors(fluid, "body", (0.8, 0.55)) as goals:
        return {name: value.tolist() for name, value in described(goals).items()}


def steady(conditions: list[Condition]) -> dict[str, Any]:
    with Fluid(square_in_box(0.3, 0.25), FlowModel(order=2), conditions, reynolds=20.0) as fluid:
        solve_steady(fluid, 1e-12)
        return readings(fluid, (0.8, 0.55), PLACES)


def in_time() -> dict[str, Any]:
    """Steps solved to a share of their error, so that the ranks must agree on how many corrections each takes."""
    with Fluid(square_in_box(0.3, 0.25), FlowModel(unsteady=True), box(), reynolds=20.0) as fluid:
        steps = list(Transient(fluid, tolerance="auto").march(0.5, 0.02))
        assert min(step.report.iterations for step in steps) == 1
        result = readings(fluid, (0.8, 0.55), PLACES)
        return result | {"corrections": [step.report.iterations for step in steps]}


def by_blocks(inertia: bool) -> dict[str, Any]:
    """By the iterative solver, in a box that is closed: the ranks' blocks must fit together, also those transposed."""
    conditions = [Prescribed("outer", shear), no_slip("body")]
    model = FlowModel(inertia=inertia, upwind=inertia, solver="block")
    with Fluid(ball_in_box(0.5), model, conditions, reynolds=5.0) as fluid:
        solve_steady(fluid, 1e-11)
        spin = rigid_motion(
            fluid, "body", (0.6, 0.5, 0.5), np.array([0.0, 0.0, 0.0, 0.3, 0.5, 0.7])
        )
        places = [[0.1, 0.2, 0.3], [1.2, 0.6, 0.4], [1.0, 0.5, 0.9]]
        result = readings(fluid, (0.6, 0.5, 0.5), places)
        return result | {"dual norm": fluid.speed(fluid.dual(spin))}


def turned() -> dict[str, Any]:
    """Ranks must agree on the places of nodes that they share, also where one alone has a straight cell beside them."""
    domain, centre = ball_in_box(0.3), (0.6, 0.5, 0.5)
    displacement = RigidDisplacement(domain, "body", Placement(centre), turning=True)
    MeshMotion(domain).move(
        displacement.at(Placement(centre).moved((0.0, 0.0, 0.0), [0.4, -0.7, 0.5]))
    )
    x = ufl.SpatialCoordinate(domain.mesh)
    return {"ranks": COMM.size, "moments": [integral(domain, x[k] ** 3 * ufl.dx) for k in range(3)]}


PLACES = [[0.2, 0.3], [1.4, 0.8], [1.9, 0.5]]
CASES = {
    "open": lambda: steady(channel()),
    "closed": lambda: steady(box()),
    "stokes": lambda: by_blocks(inertia=False),
    "inertia": lambda: by_blocks(inertia=True),
    "in_time": in_time,
    "turned": turned,
    "estimated": lambda: {"ranks": COMM.size, **estimates(in_cavity(0.25, 2))},
}

if __name__ == "__main__":
    result = {name: CASES[name]() for name in sys.argv[1:]}
    if COMM.rank == 0:
        print(json.dumps(result))
