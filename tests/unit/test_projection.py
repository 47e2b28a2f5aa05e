"""The nearest discretely divergence-free velocity, on a mesh to which a flow was transferred."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

import dolfinx
import numpy as np
import pytest
import ufl
from domains import SIDES, ball_in_box, ring, square_in_box, unit_box

from incipient import compat
from incipient.fluid import Condition, FlowModel, Fluid, Open, Prescribed, Slip, no_slip
from incipient.fluid.projection import Projection
from incipient.mesh.domain import Domain
from incipient.mesh.transfer import Transfer


def flow(domain: Domain, conditions: Sequence[Condition], order: int = 2) -> Fluid:
    return Fluid(domain, FlowModel(order=order, inertia=False), conditions, reynolds=1.0)


def channel() -> list[Condition]:
    """An open channel with a free-slip ceiling about a square."""
    inflow = Prescribed("left", lambda x, t: np.vstack([x[1] * (2 - x[1]), 0 * x[0]]))
    return [Open("right"), Slip("top", axis=1), inflow, no_slip("bottom"), no_slip("body")]


def closed(*names: str) -> list[Condition]:
    return [no_slip(name) for name in names]


def receive(fluid: Fluid, source: Fluid) -> None:
    """Take the other flow's velocity, and noise for a pressure."""
    transfer = Transfer(source.domain.mesh, fluid.space.velocity_points())
    fluid.state.x.array[fluid.space.velocity_map] = transfer.values(source.velocity).ravel()
    pressure = fluid.space.pressure_map
    fluid.state.x.array[pressure] = np.random.default_rng(1).random(len(pressure))
    fluid.state.x.scatter_forward()


def net_flux(fluid: Fluid) -> float:
    """Integral of v . n over the whole boundary."""
    mesh = fluid.domain.mesh
    through = compat.form(ufl.dot(ufl.split(fluid.state)[0], ufl.FacetNormal(mesh)) * ufl.ds(mesh))
    return float(mesh.comm.allreduce(dolfinx.fem.assemble_scalar(through)))


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


@pytest.mark.parametrize("order", [2, 3])
def test_a_channel_meshed_anew(order: int) -> None:
    """With a hole, a slip and an open boundary: continuity holds again, the pressure and given values stay."""
    with (
        flow(square_in_box(0.3, 0.2), channel(), order) as source,
        flow(square_in_box(0.3, 0.14), channel(), order) as fluid,
    ):
        source.solve(1e-12)
        receive(fluid, source)
        before = fluid.state.x.array.copy()
        assert np.abs(continuity(fluid)).max() > 1e-4
        change = projected(fluid)
        assert np.abs(continuity(fluid)).max() < 1e-14
        assert abs(net_flux(fluid)) < 1e-13
        assert 1e-4 < change < 1e-2
        pressure = fluid.space.pressure_map
        assert (fluid.state.x.array[pressure] == before[pressure]).all()
        for condition in fluid.constraints.dirichlet:
            held = condition.dof_indices()[0]
            assert len(held)
            assert (fluid.state.x.array[held] == before[held]).all()


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


@pytest.mark.parametrize("gdim", [2, 3])
def test_noise_is_removed(gdim: int) -> None:
    """In a closed box and from far off; what is left is left alone when asked again."""
    sides = SIDES[: 2 * gdim]
    with flow(unit_box(gdim, 3 if gdim == 3 else 6), closed(*sides)) as fluid:
        disturb(fluid, 1.0)
        assert 0.3 < projected(fluid) < 1.0
        assert np.abs(continuity(fluid)).max() < 1e-13
        before = fluid.state.x.array.copy()
        assert projected(fluid) < 1e-12
        assert fluid.state.x.array == pytest.approx(before, abs=1e-10)


def test_nothing_stays_nothing() -> None:
    with flow(unit_box(2, 3), closed(*SIDES[:4])) as fluid:
        assert projected(fluid) == 0.0
        assert not fluid.state.x.array.any()


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


def test_quadratic_cells_and_a_turning_boundary() -> None:
    """The ring between a turning and a resting circle, meshed anew: nodes lie outside, boundary values are set."""

    def turning(x: np.ndarray, t: float) -> np.ndarray:
        return np.vstack([-x[1], x[0]])

    conditions = [Prescribed("inner", turning), no_slip("outer")]
    with (
        flow(ring(0.5, 1.0, 24, 2), conditions) as source,
        flow(ring(0.5, 1.0, 32, 2), conditions) as fluid,
    ):
        source.solve(1e-12)
        receive(fluid, source)
        fluid.constraints.update(0.0)
        compat.impose(fluid.state.x.array, fluid.constraints.dirichlet)
        assert abs(net_flux(fluid)) < 1e-13
        assert projected(fluid) < 1e-2
        assert np.abs(continuity(fluid)).max() < 1e-13


def test_a_closed_box_that_takes_in_more_than_it_lets_out() -> None:
    """Continuity fails at the pinned node alone, and by the net flux: v = (x, 0) leaves the square at rate 1."""
    with flow(unit_box(2, 4), [Prescribed(name, lambda x, t: x) for name in SIDES[:4]]) as fluid:
        set_velocity(fluid, lambda x: np.vstack([x[0], 0 * x[0]]))
        assert net_flux(fluid) == pytest.approx(1.0, rel=1e-12)
        projected(fluid)
        left = np.sort(np.abs(continuity(fluid)))
        assert left[-1] == pytest.approx(1.0, rel=1e-10)
        assert left[-2] < 1e-12


def test_a_ball_in_three_dimensions() -> None:
    stream = Prescribed("outer", lambda x, t: np.vstack([x[1], 0 * x[0], 0 * x[0]]))
    conditions = [stream, no_slip("body")]
    with flow(ball_in_box(0.5), conditions) as source, flow(ball_in_box(0.6), conditions) as fluid:
        source.solve(1e-12)
        receive(fluid, source)
        fluid.constraints.update(0.0)
        compat.impose(fluid.state.x.array, fluid.constraints.dirichlet)
        assert projected(fluid) < 0.1
        assert np.abs(continuity(fluid)).max() < 1e-12


RANKS = """
import json
import numpy as np
from mpi4py import MPI
from domains import square_in_box
from incipient import compat
from incipient.fluid import FlowModel, Fluid, Open, Prescribed, Slip, no_slip
from incipient.fluid.projection import Projection
from incipient.mesh.sampling import sample
from incipient.mesh.transfer import Transfer

inflow = Prescribed("left", lambda x, t: np.vstack([x[1] * (2 - x[1]), 0 * x[0]]))
channel = [Open("right"), Slip("top", axis=1), inflow, no_slip("bottom"), no_slip("body")]
lid = Prescribed("top", lambda x, t: np.vstack([x[0] * (2 - x[0]), 0 * x[0]]))
box = [lid, *(no_slip(name) for name in ("left", "right", "bottom", "body"))]
found = []
for conditions in (channel, box):
    for order in (2, 3):
        model = FlowModel(order=order, inertia=False)
        with (
            Fluid(square_in_box(0.3, 0.3), model, conditions, 1.0) as source,
            Fluid(square_in_box(0.3, 0.25), model, conditions, 1.0) as fluid,
        ):
            source.solve(1e-12)
            transfer = Transfer(source.domain.mesh, fluid.space.velocity_points())
            fluid.state.x.array[fluid.space.velocity_map] = transfer.values(source.velocity).ravel()
            with Projection(fluid) as projection:
                change = projection.apply()
            points = np.array([[0.3, 0.3], [1.0, 0.8], [1.3, 0.5], [1.9, 0.1]])
            velocities = sample(fluid.velocity, points)
            found += [transfer.outside, change, *velocities.ravel().tolist()]
comm = MPI.COMM_WORLD
if comm.rank == 0:
    print(json.dumps([comm.size, found]))
"""


def test_two_ranks_agree_with_one(mpirun: Any) -> None:
    """Transfer between differently divided meshes and projection, in open and closed domains, orders two and three."""
    found = []
    for n in (1, 2):
        done = mpirun(n, RANKS)
        assert done.returncode == 0, done.stderr
        found.append(json.loads(done.stdout))
    assert [ranks for ranks, _ in found] == [1, 2]
    assert found[1][1] == pytest.approx(found[0][1], rel=1e-8, abs=1e-10)
