"""Walls of any shape that resist the flow along them: what crosses, and the force that is read off their part alone."""

from functools import partial

import dolfinx
import numpy as np
import pytest
import ufl
from domains import rectangle, ring
from mpi4py import MPI

from incipient import compat
from incipient.compat import petsc
from incipient.fluid import FlowModel, Fluid, Prescribed
from incipient.fluid.along_walls import along_wall
from incipient.fluid.conditions import Friction
from incipient.mesh.domain import build
from incipient.meshes.model import meshed
from incipient.turbulence.wall_law import WallLaw

INNER, VISCOSITY, DRAG = 0.5, 0.25, 1.5


def exact(rate):
    """A, B of u = A r + B/r with u(1) = 1 and the shear stress nu r d(u/r)/dr = c (u - rate r) at the inner circle."""
    # -2 nu B/a^2 = c (A a + B/a - rate a), A + B = 1
    b = -DRAG * INNER * (1 - rate) / (2 * VISCOSITY / INNER**2 + DRAG * (1 / INNER - INNER))
    return 1 - b, b


def turning(x, t):
    return np.array([-x[1], x[0]])


def solved(around, rate):
    """Errors of the velocity, of the couple, and what crosses the inner circle, which turns; the outer turns at one."""
    moves = rate != 0.0
    wall = Friction(
        "inner", 0.1, lambda speed, turbulent, viscosity, distance: DRAG + 0 * speed, moves=moves
    )
    a, b = exact(rate)
    conditions = [wall, Prescribed("outer", turning)]
    with Fluid(ring(INNER, 1.0, around, 2), FlowModel(), conditions, 1 / VISCOSITY) as fluid:
        if moves:
            fluid.walls.carry("inner", np.zeros(2), np.array([rate]), np.zeros(2))
        assert fluid.solve(1e-10).converged
        x, v = fluid.constraints.points[:, :2], fluid.velocity.x.array.reshape(-1, 2)
        r = np.linalg.norm(x, axis=1, keepdims=True)
        velocity = np.abs(v - (a + b / r**2) * np.column_stack([-x[:, 1], x[:, 0]])).max()
        along = along_wall(fluid, "inner", fluid.state[0])
        assert along.lengths.sum() == pytest.approx(2 * np.pi * INNER, rel=1e-4)
        assert_means_of_normals(along, 2 * np.pi / around)
        through = np.abs((along.velocities * along.normals).sum(axis=1)).max()
        motion = dolfinx.fem.Function(fluid.space.velocity)
        motion.interpolate(lambda x: np.array([-x[1], x[0]]))
        power = fluid.walls.power(fluid.state, motion, "inner")
        couple = dolfinx.fem.assemble_scalar(compat.form(power))
    stress = DRAG * (a * INNER + b / INNER - rate * INNER)
    return velocity, abs(couple / (2 * np.pi * INNER**2 * stress) - 1), through


def assert_means_of_normals(along, angle):
    """Normals point to the middle; as means over two cells of an angle they are shorter than one.

    Weighted with P1 functions, 2 (1 - cos a)/a^2 = 1 - a^2/12, and shorter than 0.95 in corners alone.
    """
    length = np.linalg.norm(along.normals, axis=1, keepdims=True)
    assert along.normals / length == pytest.approx(-along.places / INNER, abs=5e-3)
    assert length == pytest.approx(1 - angle**2 / 12, abs=angle**4 / 20)


@pytest.mark.parametrize("rate", [0.0, -1.0])
def test_slip_with_friction_on_a_circle(rate):
    """Circular Couette flow over a wall whose stress is c times the velocity past it: errors fall as h^1.7 or faster.

    What crosses a circle that turns is that its cells are not quite round, and small on both meshes.
    """
    coarse, fine = (np.array(solved(around, rate)) for around in (12, 24))
    assert (fine < [2e-3, 2e-4, 2e-3]).all()
    assert (coarse / fine > 2**1.7)[: 2 if rate else 3].all()


@pytest.mark.parametrize("thickness", [0.25, 1e-3])
def test_a_wall_dissipates_also_next_to_thin_cells(thickness):
    """The power of any velocity without pressure is not negative: Nitsche's method needs nu over the cells' thickness.

    With nu over the root of their area the least eigenvalue next to cells 250 times as long as thick was -0.5 of the
    largest.
    """
    wall = Friction("bottom", 0.1, lambda speed, turbulent, viscosity, distance: DRAG + 0 * speed)
    grid = rectangle((0.0, 0.0), 1.0, thickness, 4, 1)
    domain = build(MPI.COMM_SELF, partial(meshed, grid))
    with Fluid(domain, FlowModel(), [wall], 1 / VISCOSITY) as fluid:
        fluid.state.x.array[:] = 0.0
        form = fluid.residual_form(*ufl.TestFunctions(fluid.space.mixed))
        matrix = petsc.assemble_matrix(compat.form(ufl.derivative(form, fluid.state)))
        matrix.assemble()
        rows = fluid.space.velocity_map
        whole = matrix.convert("dense").getDenseArray()[np.ix_(rows, rows)]
        powers = np.linalg.eigvalsh(0.5 * (whole + whole.T))
    assert powers.min() > -1e-9 * powers.max()


def test_where_the_flow_rests_the_turbulence_gives_the_friction():
    """In equilibrium u*^2 over the speed; at rest that of k over u+ (Kuzmin, Mierka & Turek 2007); below y+ 11 nu/y.

    Both frictions are blended: the third root of the sum of their cubes.
    """
    law, away = WallLaw(), (1e-4, 0.1)
    shear = 0.05
    speed = shear * law.velocity(shear, *away)
    below = away[0] / away[1]
    for drag, outer in (
        (law.drag(speed, 0.04, *away), shear**2 / speed),
        (law.drag(1e-12, shear, *away), shear / law.velocity(shear, *away)),
    ):
        assert drag == pytest.approx((outer**3 + below**3) ** (1.0 / 3.0), rel=1e-6)
    assert law.drag(1e-12, 1e-3, *away) == pytest.approx(1e-4 / 0.1, rel=1e-3)
    assert law.drag(speed, 2 * shear, *away) == pytest.approx(
        2 * shear / law.velocity(2 * shear, *away), rel=0.01
    )
