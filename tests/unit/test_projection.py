"""Coupling of bodies and flow."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from typing import Any

import dolfinx
import numpy as np
import pytest
import ufl
from domains import SIDES, ball_in_box, ring, square_in_box, unit_box
from floating import box_around, floating, lid
from ranks_script import channel, shear

from incipient import compat
from incipient.arrays import Floats
from incipient.body.rigidbody import RigidBody
from incipient.body.state import BodyState, Inertia
from incipient.coupled.coupling import Coupling
from incipient.coupled.remeshing import Projection
from incipient.coupled.rigid import RigidPart
from incipient.errors import ConvergenceError
from incipient.fluid import Carried, Condition, FlowModel, Fluid, Prescribed, no_slip
from incipient.fluid.transient import Transient
from incipient.geometry.placement import Placement
from incipient.geometry.plane.grains import Disc
from incipient.mesh.domain import Domain
from incipient.mesh.motion import MeshMotion, RigidDisplacement
from incipient.mesh.sampling import Transfer

# The nearest discretely divergence-free velocity, on a mesh to which a flow was transferred.


def flow(domain: Domain, conditions: Sequence[Condition], order: int = 2) -> Fluid:
    return Fluid(domain, FlowModel(order=order, inertia=False), conditions, reynolds=1.0)


def closed(*names: str) -> list[Condition]:
    return [no_slip(name) for name in names]


def receive(fluid: Fluid, source: Fluid) -> None:
    """Take the other flow's velocity, and noise for a pressure."""
    transfer = Transfer(source.domain.mesh, fluid.space.velocity_points())
    fluid.state.x.array[fluid.space.velocity_map] = transfer.values(source.velocity).ravel()
    pressure = fluid.space.pressure_map
    fluid.state.x.array[pressure] = np.random.default_rng(1).random(len(pressure))
    fluid.state.x.scatter_forward()


def continuity(fluid: Fluid) -> np.ndarray:
    """Integral of q div v for the q of every pressure node."""
    return fluid.residual()[fluid.space.pressure_map]


def set_velocity(fluid: Fluid, values: Any) -> None:
    points = fluid.space.velocity_points()
    fluid.state.x.array[fluid.space.velocity_map] = values(points.T).T.ravel()


def eddies(x: np.ndarray) -> np.ndarray:
    """Curl of sin^2(pi x) sin^2(pi y): zero on the sides of the unit square."""
    a, b = np.pi * x[0], np.pi * x[1]
    return np.vstack([np.sin(a) ** 2 * np.sin(2 * b), -np.sin(2 * a) * np.sin(b) ** 2])


def projected(fluid: Fluid) -> float:
    """Project the velocity; its relative change."""
    with Projection(fluid) as projection:
        return projection.apply()


def turning(x: np.ndarray, t: float) -> np.ndarray:
    return np.vstack([-x[1], x[0]])


AROUND_A_BALL = [Prescribed("outer", shear), no_slip("body")]
BETWEEN_CIRCLES = [Prescribed("inner", turning), no_slip("outer")]


@pytest.mark.parametrize(
    ("meshed", "sizes", "conditions", "order", "most", "left"),
    [
        # With a hole, a slip and an open boundary.
        (partial(square_in_box, 0.3), (0.2, 0.14), channel(), 2, 1e-2, 1e-14),
        (partial(square_in_box, 0.3), (0.2, 0.14), channel(), 3, 1e-2, 1e-14),
        # Quadratic cells between a turning and a resting circle: nodes lie outside, boundary values are set.
        (lambda n: ring(0.5, 1.0, n, 2), (24, 32), BETWEEN_CIRCLES, 2, 1e-2, 1e-13),
        (ball_in_box, (0.5, 0.6), AROUND_A_BALL, 2, 0.1, 1e-12),
    ],
)
def test_a_flow_meshed_anew(
    meshed: Any,
    sizes: tuple[Any, Any],
    conditions: list[Condition],
    order: int,
    most: float,
    left: float,
) -> None:
    """Continuity holds again; the pressure and given values stay."""
    coarse, fine = map(meshed, sizes)
    with flow(coarse, conditions, order) as source, flow(fine, conditions, order) as fluid:
        source.solve(1e-12)
        receive(fluid, source)
        fluid.constraints.update(0.0)
        compat.impose(fluid.state.x.array, fluid.constraints.dirichlet)
        before = fluid.state.x.array.copy()
        assert np.abs(continuity(fluid)).max() > 1e-5
        assert 1e-5 < projected(fluid) < most
        assert np.abs(continuity(fluid)).max() < left
        held = [condition.dof_indices()[0] for condition in fluid.constraints.dirichlet]
        assert all(map(len, held))
        kept = np.concatenate([fluid.space.pressure_map, *held])
        assert (fluid.state.x.array[kept] == before[kept]).all()


def test_the_nearest() -> None:
    """Of two velocities free of divergence with the same boundary values, by Pythagoras."""
    with flow(square_in_box(0.3, 0.2), channel()) as fluid:
        set_velocity(fluid, lambda x: np.vstack([np.sin(2 * x[1]) * x[0] * x[1], x[0] * x[1]]))
        start = fluid.velocity
        projected(fluid)
        nearest = fluid.velocity
        disturb(fluid, 1.0)
        projected(fluid)
        other = fluid.velocity
    assert distance(start, nearest) > 1e-2
    assert distance(nearest, other) > 1e-2
    legs = distance(start, nearest) ** 2 + distance(nearest, other) ** 2
    assert distance(start, other) ** 2 == pytest.approx(legs, rel=1e-12)


def disturb(fluid: Fluid, size: float) -> None:
    """Add noise where the velocity is not prescribed."""
    noise = size * np.random.default_rng(2).standard_normal(len(fluid.state.x.array))
    for condition in fluid.constraints.dirichlet:
        noise[condition.dof_indices()[0]] = 0.0
    fluid.state.x.array[fluid.space.velocity_map] += noise[fluid.space.velocity_map]


def distance(u: Any, v: Any) -> float:
    """In L2."""
    return float(
        np.sqrt(dolfinx.fem.assemble_scalar(compat.form(ufl.inner(u - v, u - v) * ufl.dx)))
    )


@pytest.mark.parametrize("order", [2, 3])
def test_the_change_is_of_the_order_of_the_transfer(order: int) -> None:
    """A smooth flow that is discretely free of divergence on one mesh: order k + 1 in the change on another."""
    changes = []
    for n in (6, 12, 24):
        with (
            flow(unit_box(2, n), closed(*SIDES[:4]), order) as source,
            flow(unit_box(2, 4 * n // 3), closed(*SIDES[:4]), order) as fluid,
        ):
            set_velocity(source, eddies)
            projected(source)
            receive(fluid, source)
            changes.append(projected(fluid))
    orders = np.log2(np.divide(changes[:-1], changes[1:]))
    assert orders[-1] > order + 0.8, (changes, orders)


# The linear answer of the flow to motions of a body.
#
# The reference is the residual itself, differenced along the answer: the program assembles the derivative, not that.


DISC, PLACE = Disc(0.3), Placement((0.55, 0.6))
NUDGE = 1e-6


def differenced(fluid: Fluid, way: Floats) -> Floats:
    """The change of the residual along a change of the state, by central differences."""
    at = fluid.state.x.array.copy()
    ends = []
    for size in (NUDGE, -NUDGE):
        fluid.state.x.array[:] = at + size * way
        ends.append(fluid.residual())
    fluid.state.x.array[:] = at
    return (ends[0] - ends[1]) / (2 * NUDGE)


def test_the_traction_answers_as_the_whole_residual_does() -> None:
    domain = box_around(DISC, PLACE, cell=0.1, far=0.2)
    conditions = [Prescribed("top", lid), *(no_slip(name) for name in ("left", "right", "bottom"))]
    with floating(domain, DISC, PLACE, conditions, 10.0) as result:
        result.transient.advance(0.05)
        fluid, blocks = result.fluid, result.part._blocks
        fluid.renew_factors()
        fluid.solve(1e-12)
        at_body = fluid.space.velocity_map.reshape(-1, 2)[blocks]
        motion = np.zeros_like(fluid.state.x.array)
        motion[at_body[:, 0]] = 1.0
        change = fluid.response(motion, np.zeros_like(fluid.residual()))
        traction = fluid.change_of_residual(change)
        residual = differenced(fluid, change)
        held = np.concatenate(
            [condition.dof_indices()[0] for condition in fluid.constraints.dirichlet]
        )
    largest = np.abs(residual).max()
    assert change[at_body[:, 0]] == pytest.approx(1.0)
    assert traction[at_body] == pytest.approx(residual[at_body], abs=1e-7 * largest)
    assert (
        np.abs(np.delete(residual, held)).max() < 1e-7 * largest
    )  # the flow itself stays in balance


# A ball in three dimensions: the same coupling as in the plane, with six degrees of freedom.


RADIUS, CENTRE_IN_SPACE = 0.25, (0.6, 0.5, 0.5)


def started_shear(x: np.ndarray, t: float) -> np.ndarray:
    """Sheared along the vertical, started smoothly."""
    return np.vstack([(0.5 + x[2]) * np.sin(np.pi * min(t, 0.5)) ** 2, 0 * x[0], 0 * x[0]])


@contextmanager
def released(cell: float, ratio: float, **terms: Any) -> Iterator[tuple[RigidPart, Coupling]]:
    """A ball of a density ratio, at rest in a flow with further terms."""
    model = FlowModel(unsteady=True, moving_mesh=True, **terms)
    mass = ratio * 4 / 3 * np.pi * RADIUS**3
    body = RigidBody(Inertia(mass, np.full(3, 0.4 * mass * RADIUS**2)))
    placement, conditions = (
        Placement(CENTRE_IN_SPACE),
        [Prescribed("outer", started_shear), Carried("body")],
    )
    with Fluid(ball_in_box(cell), model, conditions, 20.0) as fluid:
        moved = RigidDisplacement(fluid.domain, "body", placement, turning=False)
        part = RigidPart(fluid, body, BodyState.at(placement), moved, lambda state: np.zeros(6))
        yield part, Coupling(fluid, [part], MeshMotion(fluid.domain))


def test_a_mesh_that_folds_stops_the_run_by_name() -> None:
    """Steps so long that the ball leaves its box: every halving still folds cells."""
    with released(0.35, 1.0, inertia=False) as (part, coupling):
        part.state = BodyState.at(Placement(CENTRE_IN_SPACE), [1e6, 0, 0, 0, 0, 0])
        part.past = [part.state]
        with pytest.raises(ConvergenceError, match="fold over: use a larger"):
            Transient(coupling.fluid, 2, 1e-9, interface=coupling).advance(1.0)
        assert np.allclose(coupling.fluid.domain.mesh.geometry.x, coupling.places[0])


def test_a_mesh_does_not_turn_about_an_axis_of_revolution() -> None:
    """The axis leans as the body's; points on it and across it move as with a turn that only leans it."""
    first, domain = Placement(CENTRE_IN_SPACE), ball_in_box(0.6)
    axis = np.array([0.0, 0.6, 0.8])
    around, all_of_it = (
        RigidDisplacement(domain, "body", first, True, axis=known) for known in (axis, None)
    )
    rolled, leant = first.moved(np.zeros(3), 2.5 * axis), [0.3, 0.0, 0.0]
    assert np.abs(around.at(rolled)).max() < 1e-14 < 0.1 < np.abs(all_of_it.at(rolled)).max()
    result, expected = (
        around.at(rolled.moved(np.zeros(3), leant)),
        all_of_it.at(first.moved(np.zeros(3), leant)),
    )
    assert result == pytest.approx(expected, abs=1e-14)
