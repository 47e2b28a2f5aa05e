"""Fields taken from one mesh to the nodes of another."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import dolfinx
import numpy as np
import pytest
from domains import ball_in_box, bent_box, ring, square_in_box, unit_box

from incipient import compat
from incipient.mesh.transfer import Transfer

Values = Callable[[np.ndarray], np.ndarray]


def field(mesh: Any, order: int, values: Values, components: int = 1) -> Any:
    shape = (components,) if components > 1 else ()
    function = dolfinx.fem.Function(compat.space(mesh, ("Lagrange", order), shape))
    function.interpolate(values)
    return function


def polynomials(degree: int, components: int) -> Values:
    """Full polynomials of a degree in all coordinates, one a component."""
    slopes = np.random.default_rng(6).standard_normal((components, 3))
    return lambda x: np.squeeze(
        (0.3 + slopes @ x) ** degree - slopes @ x, axis=0 if components == 1 else ()
    )


def error(source: Any, target: Any, order: int, degree: int, components: int) -> float:
    """Largest error at the nodes of another mesh's space; none of them is outside."""
    values = polynomials(degree, components)
    points = compat.space(target, ("Lagrange", order)).tabulate_dof_coordinates()
    transfer = Transfer(source, points)
    assert transfer.outside == 0
    assert transfer.farthest == 0.0
    found = transfer.values(field(source, order, values, components))
    return float(np.abs(found - values(points.T).reshape(components, -1).T).max())


@pytest.mark.parametrize("components", [1, 2])
@pytest.mark.parametrize("order", [2, 3, 4])
def test_polynomials_in_straight_cells(order: int, components: int) -> None:
    """Of the elements' own degree: exact, between meshes about the same hole that share no inner node."""
    source, target = square_in_box(0.3, 0.3).mesh, square_in_box(0.3, 0.21).mesh
    assert error(source, target, order, order, components) < 1e-11


@pytest.mark.parametrize("components", [1, 3])
@pytest.mark.parametrize("order", [2, 3, 4])
def test_polynomials_in_tetrahedra(order: int, components: int) -> None:
    assert error(unit_box(3, 2).mesh, unit_box(3, 3).mesh, order, order, components) < 1e-11


@pytest.mark.parametrize(
    ("gdim", "bend", "order", "degree"),
    [
        (2, 2, 2, 1),
        (2, 2, 4, 2),
        (2, 3, 3, 1),
        (2, 3, 4, 1),
        (3, 2, 2, 1),
        (3, 2, 4, 2),
    ],
)
def test_polynomials_in_curved_cells(gdim: int, bend: int, order: int, degree: int) -> None:
    """Cells bent by a map of degree g hold polynomials of degree k/g in space."""
    assert error(bent_box(gdim, 2, bend), bent_box(gdim, 3, bend), order, degree, gdim) < 1e-11


@pytest.mark.parametrize("order", [2, 3])
def test_a_smooth_function_converges(order: int) -> None:
    """One order more than the elements' degree, between unrelated meshes."""

    def smooth(x: np.ndarray) -> np.ndarray:
        return np.vstack([np.sin(3 * x[0] + x[1]), np.cos(4 * x[0] * x[1])])

    errors = []
    for n in (4, 8, 16):
        points = unit_box(2, 3 * n // 2 + 1).mesh.geometry.x
        source = unit_box(2, n).mesh
        found = Transfer(source, points).values(field(source, order, smooth, 2))
        errors.append(np.sqrt(np.mean((found - smooth(points.T).T) ** 2)))
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    assert orders[-1] == pytest.approx(order + 1, abs=0.1), orders


@pytest.mark.parametrize(("mesh", "order", "degree"), [("straight", 3, 3), ("bent", 4, 2)])
def test_points_outside_take_the_polynomial(mesh: str, order: int, degree: int) -> None:
    """They are counted, and how far out they are is told; the bent side leans by at most 0.37 to the vertical."""
    source = unit_box(2, 4).mesh if mesh == "straight" else bent_box(2, 4, 2)
    s = np.linspace(0.05, 0.95, 10)
    above = np.column_stack([0.5 + 0 * s, 0.5 + 0 * s, 0 * s])
    left = np.column_stack([(0.2 * s**2 if mesh == "bent" else 0.0) - 0.1 * s, s, 0 * s])
    points = np.vstack([above, left])
    values = polynomials(degree, 2)
    transfer = Transfer(source, points)
    assert transfer.values(field(source, order, values, 2)) == pytest.approx(
        values(points.T).T, abs=1e-10
    )
    assert transfer.outside == 10
    lean = 0.37 if mesh == "bent" else 0.0
    assert 0.095 * np.cos(lean) - 1e-9 < transfer.farthest < 0.095 + 1e-9


def test_points_outside_may_take_the_value_next_to_them() -> None:
    """What is steep at a boundary is not extrapolated: values stay between those of the cell, points inside do."""
    source = unit_box(2, 4).mesh
    s = np.linspace(0.05, 0.95, 10)
    points = np.column_stack([-0.1 * s, s, 0 * s])
    points[::5, 0] = 0.1

    def steep(x: np.ndarray) -> np.ndarray:
        return np.array([1000.0 * x[0] ** 2 - 500.0 * x[0], x[1]])

    known = field(source, 2, steep, 2)
    found = Transfer(source, points, reach=0.0).values(known)
    assert found[::5] == pytest.approx(steep(points[::5].T).T, abs=1e-10)
    outside = np.delete(found, [0, 5], axis=0)
    assert (outside[:, 0] <= 1e-10).all() and (outside[:, 0] >= -62.5).all()
    assert outside[:, 1] == pytest.approx(np.delete(s, [0, 5]), abs=0.25)
    extrapolated = np.delete(Transfer(source, points).values(known), [0, 5], axis=0)
    assert (extrapolated[:, 0] > 1.0).all()


@pytest.mark.parametrize("order", [1, 2, 3])
def test_a_round_boundary_meshed_anew(order: int) -> None:
    """Nodes off the old mesh lie out by what its cells cut off the circle, less than h^2/8; a line is exact."""
    source, target = ring(0.5, 1.0, 20, order).mesh, ring(0.5, 1.0, 28, order).mesh
    transfer = Transfer(source, target.geometry.x)
    assert transfer.outside > 0
    assert transfer.farthest < 1.5 * (2 * np.pi / 20) ** 2 / 8
    if order > 1:
        assert transfer.farthest < 2e-4
    values = polynomials(1, 2)
    found = transfer.values(field(source, max(order, 2), values, 2))
    assert found == pytest.approx(values(target.geometry.x.T).T, abs=1e-11)


def test_points_within_a_ball() -> None:
    """Of radius 1/4, quadratic cells about it: points at 0.24 lie out by about 0.01."""
    mesh = ball_in_box(0.35).mesh
    directions = np.random.default_rng(9).standard_normal((60, 3))
    points = (0.6, 0.5, 0.5) + 0.24 * directions / np.linalg.norm(directions, axis=1)[:, None]
    transfer = Transfer(mesh, points)
    assert transfer.outside == 60
    assert transfer.farthest == pytest.approx(0.01, rel=0.1)
    values = polynomials(1, 3)
    assert transfer.values(field(mesh, 2, values, 3)) == pytest.approx(
        values(points.T).T, abs=1e-11
    )


def test_one_transfer_serves_many_functions() -> None:
    mesh = unit_box(2, 3).mesh
    points = np.random.default_rng(7).random((50, 2))
    transfer = Transfer(mesh, points)
    for order, components in ((2, 2), (1, 1), (3, 2)):
        values = polynomials(1, components)
        found = transfer.values(field(mesh, order, values, components))
        spatial = np.pad(points, ((0, 0), (0, 1)))
        assert found == pytest.approx(values(spatial.T).reshape(components, -1).T, abs=1e-12)


def test_no_points() -> None:
    mesh = unit_box(2, 2).mesh
    transfer = Transfer(mesh, np.empty((0, 3)))
    assert (transfer.outside, transfer.farthest) == (0, 0.0)
    assert transfer.values(field(mesh, 2, polynomials(1, 2), 2)).shape == (0, 2)


RANKS = """
import json
from mpi4py import MPI
import dolfinx
import numpy as np
from domains import ring
from incipient import compat
from incipient.mesh.transfer import Transfer

comm = MPI.COMM_WORLD
mesh = ring(0.5, 1.0, 20, 2).mesh
function = dolfinx.fem.Function(compat.space(mesh, ("Lagrange", 3), (2,)))
function.interpolate(lambda x: np.vstack([np.sin(3 * x[0]) * x[1], np.exp(x[0])]))
function.x.scatter_forward()
# Drawn the same on all ranks: some within, many out by a little, some by a lot. The last rank has none.
random = np.random.default_rng(8)
angles, radii = random.uniform(0.0, 6.3, 400), np.repeat([0.4, 0.4999, 0.75, 1.02], 100)
points = np.column_stack([radii * np.cos(angles), radii * np.sin(angles)])
askers = max(comm.size - 1, 1)
mine = np.arange(comm.rank, 400, askers) if comm.rank < askers else np.arange(0)
transfer = Transfer(mesh, points[mine])
gathered = comm.gather((mine, transfer.values(function)))
if comm.rank == 0:
    values = np.empty((400, 2))
    for rows, theirs in gathered:
        values[rows] = theirs
    print(json.dumps([comm.size, transfer.outside, transfer.farthest, values.tolist()]))
"""


def test_ranks_agree_with_one(mpirun: Any) -> None:
    """Wherever the points are asked for and the cells are: of three ranks two ask."""
    found = []
    for n in (1, 3):
        done = mpirun(n, RANKS)
        assert done.returncode == 0, done.stderr
        found.append(json.loads(done.stdout))
    (one, outside, farthest, values), (three, *rest) = found
    assert (one, three) == (1, 3)
    assert outside == 300
    assert farthest == pytest.approx(0.1, rel=0.02)
    assert rest[0] == outside
    assert rest[1] == pytest.approx(farthest, rel=1e-9)
    assert np.array(rest[2]) == pytest.approx(np.array(values), abs=1e-9)
