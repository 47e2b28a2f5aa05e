"""Orders of convergence in space: velocity k + 1 and pressure k in L2 for elements of order k / k - 1.

Source of the orders: Taylor-Hood elements are stable and approximate best (Brezzi & Falk 1991; Boffi 1997 in
3D), with one order more in L2 by duality; a smooth map changes constants only.
"""

from __future__ import annotations

from typing import Any

import dolfinx
import numpy as np
import pytest
from domains import curved_box, unit_box
from manufactured import Errors, Flow, Motion, errors, fluid_of, orders, start_from
from moving import Steps

from incipient.fluid import FlowModel, solve_steady
from incipient.fluid.transient import Transient

REYNOLDS = 10.0
SLACK = {2: 0.15, 3: 0.25}

# From the stream function psi = sin(3 x + 0.3) cos(2 y) / 3, as v = (d psi/dy, -d psi/dx).
PLANE = Flow(
    2,
    lambda x, t, m: (
        -2 / 3 * m.sin(3 * x[0] + 0.3) * m.sin(2 * x[1]),
        -m.cos(3 * x[0] + 0.3) * m.cos(2 * x[1]),
    ),
    lambda x, t, m: m.sin(2 * x[0] + x[1]),
)

# curl of (0, sin(2 z) cos(x), sin(2 x) cos(2 y)).
SPATIAL = Flow(
    3,
    lambda x, t, m: (
        -2 * m.sin(2 * x[0]) * m.sin(2 * x[1]) - 2 * m.cos(2 * x[2]) * m.cos(x[0]),
        -2 * m.cos(2 * x[0]) * m.cos(2 * x[1]),
        -m.sin(2 * x[2]) * m.sin(x[0]),
    ),
    lambda x, t, m: m.sin(3 * x[0] + x[1] - 2 * x[2]),
)

# v = (F(y), x): with the map x = X + t g(Y) the velocity at fixed X is linear in time, so that no time step errs.
PLANE_MOVING = Flow(
    2, lambda x, t, m: (m.sin(3 * x[1]), x[0]), lambda x, t, m: m.sin(2 * x[0] + x[1])
)
SPATIAL_MOVING = Flow(
    3,
    lambda x, t, m: (m.sin(2 * x[1]) * m.cos(2 * x[2]), x[0], -x[0]),
    lambda x, t, m: m.sin(3 * x[0] + x[1] - 2 * x[2]),
)


# From psi = (1 + (1 - x)^3) sin(2 y), so that p = 0 and dv/dx = 0 at x = 1: fluid may leave there freely.
LEAVING = Flow(
    2,
    lambda x, t, m: (
        2 * (1 + (1 - x[0]) ** 3) * m.cos(2 * x[1]),
        3 * (1 - x[0]) ** 2 * m.sin(2 * x[1]),
    ),
    lambda x, t, m: 3 * m.sin(2 - 2 * x[0]) * m.cos(2 * x[1]),
)

# Maps that move the boundary too, d about a tenth of the box.
CURVED = {
    2: Motion(
        lambda x, t, m: (0.1 * m.sin(2 * x[0] + 3 * x[1]), 0.1 * m.cos(3 * x[0]) * x[1]),
        lambda x, t, m: (0 * x[0], 0 * x[0]),
    ),
    3: Motion(
        lambda x, t, m: (
            0.1 * m.sin(2 * x[0] + 2 * x[1]),
            0.1 * m.cos(2 * x[2]),
            0.1 * m.sin(x[0] * x[1]),
        ),
        lambda x, t, m: (0 * x[0], 0 * x[0], 0 * x[0]),
    ),
}
# The boundary x = 1 stays where it is, but F is not I there.
CURVED_BUT_ONE_SIDE = Motion(
    lambda x, t, m: (0.2 * (1 - x[0]) * m.sin(3 * x[1]), 0.1 * m.sin(2 * x[0]) * x[1]),
    lambda x, t, m: (0 * x[0], 0 * x[0]),
)
SHEARED = {
    2: Motion(
        lambda x, t, m: (0.2 * t * m.sin(3 * x[1]), 0 * x[0]),
        lambda x, t, m: (0.2 * m.sin(3 * x[1]), 0 * x[0]),
    ),
    3: Motion(
        lambda x, t, m: (0.2 * t * m.sin(2 * x[1] + x[2]), 0 * x[0], 0 * x[0]),
        lambda x, t, m: (0.2 * m.sin(2 * x[1] + x[2]), 0 * x[0], 0 * x[0]),
    ),
}


# Cells swell and shrink linearly in time, so that no backward difference of second order errs.
SWELLING = Motion(
    lambda x, t, m: (0.2 * t * m.sin(2 * x[0] + 3 * x[1]), 0 * x[0]),
    lambda x, t, m: (0.2 * m.sin(2 * x[0] + 3 * x[1]), 0 * x[0]),
)


def steady_errors(
    flow: Flow, order: int, n: int, motion: Motion | None = None, open_side: str | None = None
) -> Errors:
    domain, model = unit_box(flow.gdim, n), FlowModel(order=order)
    given = None if motion is None else motion.reference_map(domain.mesh, 0.0)
    with fluid_of(flow, domain, model, REYNOLDS, motion, given, open_side) as fluid:
        solve_steady(fluid, 1e-9)
        return errors(fluid, flow)


def moving_errors(flow: Flow, order: int, n: int, motion: Motion) -> Errors:
    """Errors after four steps with a map that moves; the mesh velocity is dd/dt, which BDF meets exactly."""
    domain = unit_box(flow.gdim, n)
    time = dolfinx.fem.Constant(domain.mesh, 0.0)
    model = FlowModel(order=order, unsteady=True)
    given = motion.reference_map(domain.mesh, time)
    with fluid_of(flow, domain, model, 0.3 * REYNOLDS, motion, given) as fluid:
        start_from(fluid, flow, motion)
        transient = Transient(fluid, order=2, tolerance=1e-10)
        for step in (0.25, 0.25, 0.5):
            time.value = fluid.time + step
            transient.advance(step)
        return errors(fluid, flow)


def moved_mesh_errors(n: int, geometry_order: int) -> Errors:
    """Errors on a mesh that is moved itself; the first step, of first order, is short."""
    domain = curved_box(2, n, geometry_order)
    made = domain.mesh.geometry.x.copy()
    model = FlowModel(unsteady=True, moving_mesh=True)
    with fluid_of(PLANE_MOVING, domain, model, 0.3 * REYNOLDS) as fluid:
        start_from(fluid, PLANE_MOVING)
        steps = Steps(fluid, order=2, tolerance=1e-10)
        for length in 0.002 * 2.0 ** np.arange(9):
            steps.advance(length, SWELLING.place(made.T, fluid.time + length).T)
        return errors(fluid, PLANE_MOVING)


def finest(levels: list[int], found: list[Errors]) -> tuple[float, float]:
    """Orders of velocity and pressure at the finest pair of levels."""
    sizes = 1 / np.array(levels)
    velocity = orders(sizes, [e.velocity for e in found])
    pressure = orders(sizes, [e.pressure for e in found])
    print(f"velocity {velocity}, pressure {pressure}")
    return velocity[-1], pressure[-1]


def expected(gdim: int, order: int) -> Any:
    """Orders k + 1 of the velocity and k of the pressure."""
    return pytest.approx((order + 1, order), abs=SLACK[gdim])


LEVELS = {(2, 2): [12, 24], (2, 3): [12, 24], (2, 4): [12, 16], (3, 2): [4, 6], (3, 3): [3, 4]}


def all_but(slow: tuple[int, int]) -> list[Any]:
    """Dimensions and orders: by default each is looked at on one domain or on both."""
    return [pytest.param(*one, marks=pytest.mark.slow if one == slow else ()) for one in LEVELS]


@pytest.mark.parametrize(("gdim", "order"), all_but((3, 2)))
def test_steady_flow_on_a_fixed_domain(gdim: int, order: int) -> None:
    flow, levels = {2: PLANE, 3: SPATIAL}[gdim], LEVELS[gdim, order]
    found = [steady_errors(flow, order, n) for n in levels]
    assert finest(levels, found) == expected(gdim, order)


@pytest.mark.parametrize(("gdim", "order"), all_but((3, 3)))
def test_steady_flow_on_a_mapped_domain(gdim: int, order: int) -> None:
    flow, levels = {2: PLANE, 3: SPATIAL}[gdim], LEVELS[gdim, order]
    found = [steady_errors(flow, order, n, CURVED[gdim]) for n in levels]
    assert finest(levels, found) == expected(gdim, order)


@pytest.mark.parametrize("motion", [None, CURVED_BUT_ONE_SIDE], ids=["fixed", "mapped"])
@pytest.mark.parametrize("order", [2, 3])
def test_flow_that_leaves_freely(order: int, motion: Motion | None) -> None:
    levels = LEVELS[2, order]
    found = [steady_errors(LEAVING, order, n, motion, open_side="right") for n in levels]
    assert finest(levels, found) == expected(2, order)


@pytest.mark.parametrize(("gdim", "order"), [(2, 2), (2, 3), (3, 2)])
def test_flow_on_a_moving_map(gdim: int, order: int) -> None:
    flow, levels = {2: PLANE_MOVING, 3: SPATIAL_MOVING}[gdim], LEVELS[gdim, order]
    found = [moving_errors(flow, order, n, SHEARED[gdim]) for n in levels]
    assert finest(levels, found) == expected(gdim, order)


@pytest.mark.parametrize("geometry_order", [1, 2], ids=["straight", "curved"])
def test_flow_on_a_moved_mesh(geometry_order: int) -> None:
    levels = LEVELS[2, 2]
    found = [moved_mesh_errors(n, geometry_order) for n in levels]
    assert finest(levels, found) == expected(2, 2)
