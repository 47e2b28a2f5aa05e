"""Along walls of a turbulent flow, where it runs upstream and where it leaves; peaks of k; upwinding of its sources."""

import dolfinx
import numpy as np
import pytest
import ufl
from mpi4py import MPI

from incipient import compat
from incipient.compat import petsc
from incipient.fluid.along_walls import AlongWall, at_end
from incipient.forms import turbulence as forms
from incipient.forms.k_omega_sst import BETA_STAR, KOmegaSST


def along(velocities):
    """A level wall with velocities at places one apart."""
    count = len(velocities)
    places = np.column_stack([np.arange(count), np.zeros(count)]).astype(float)
    flow = np.column_stack([velocities, np.zeros(count)]).astype(float)
    return AlongWall(places, np.tile([0.0, -1.0], (count, 1)), np.ones(count), flow, np.ones(count))


@pytest.mark.parametrize(
    ("velocities", "spans"),
    [
        ([1, -1, -1, 1], ((0.5, 2.5),)),
        ([1, 0, -1, -2, 1], ((1.0, 3.0 + 2.0 / 3.0),)),
        ([-1, 0, 1], ((0.0, 1.0),)),
        ([0, -1, 1], ((1.0, 1.5),)),
        ([1, 1, 0], ()),
    ],
)
def test_where_the_flow_runs_upstream_also_with_nodes_at_rest(velocities, spans):
    """By straight lines from node to node, but for those at rest (by hand)."""
    assert np.ravel(along(velocities).backward()) == pytest.approx(np.ravel(spans))


@pytest.mark.parametrize(
    ("velocities", "span"),
    [
        ([1, 1, 1, 0, -1, -1, -1, -1, -1, 1], (2.5, 8.5)),  # no eddy in the corner
        ([1, 1, 1, 0, 1, -1, -1, -1, -1, 1], (2.5, 8.5)),  # one, shorter than what is behind
        ([1, 1, 1, 0, 1, 1, 1, 1, -1, 1], (7.5, 8.5)),  # attached behind the face
    ],
)
def test_the_flow_separates_at_a_face_in_spite_of_an_eddy_in_the_corner(velocities, span):
    """By hand: a wall with nodes one apart and a face that falls at x = 2.5, the node with velocity 0."""
    wall = along(velocities)
    wall.places[3, 0], wall.normals[3] = 2.5, (-1.0, 0.0)
    assert np.ravel(wall.backward()) == pytest.approx(span)


def test_the_outflow_is_at_the_end_wherever_a_domain_lies():
    """Map coordinates: at a million, or at a billionth, only the last of ten nodes is there."""
    for start, step in ((0.0, 1.0), (1e6, 0.1), (0.0, 1e-10)):
        assert at_end(start + step * np.arange(10)).tolist() == [False] * 9 + [True]


@pytest.mark.parametrize("gdim", [2, 3])
def test_a_peak_of_k_at_one_node_does_not_grow(gdim):
    """Eddies of its own make a peak of k spread; in logarithms it would grow for ever on a mesh that is too coarse.

    A node 5 above its neighbours, which all diffuse alike: what is lost by diffusion, and what |grad K|^2 makes, tested
    with the hat of the node.
    """
    box = {2: dolfinx.mesh.create_unit_square, 3: dolfinx.mesh.create_unit_cube}[gdim]
    mesh = box(MPI.COMM_SELF, *[8] * gdim)
    space = compat.space(mesh, ("Lagrange", 1))
    peak = dolfinx.fem.Function(space)
    (node,) = np.nonzero(
        np.linalg.norm(space.tabulate_dof_coordinates()[:, :gdim] - 0.5, axis=1) < 1e-9
    )
    peak.x.array[node] = 5.0
    test, slope, jacobian = ufl.TestFunction(space), ufl.grad(peak), ufl.Jacobian(mesh)

    def made(across):
        square = forms._square(slope, across)
        form = (square * test - ufl.inner(slope, ufl.grad(test))) * ufl.dx(
            metadata={"quadrature_degree": 4}
        )
        return petsc.assemble_vector(compat.form(form)).array[node[0]]

    def across(vector):
        change = ufl.dot(vector, jacobian)
        return ufl.inner(change, change)

    assert made(None) > 0.0
    assert made(across) < 0.0


@pytest.mark.parametrize(("balance", "part"), [(0.5, 1.0), (4.0, 0.25), (4000.0, 0.00025)])
def test_upwinding_lasts_no_longer_than_its_source(balance, part):
    """By hand: |v| = 2 and cells 0.5 long are passed at the rate 8; beta* omega is `balance` times that."""
    mesh = dolfinx.mesh.create_unit_square(MPI.COMM_SELF, 2, 2)
    space = compat.space(mesh, ("Lagrange", 1), (2,))
    state, velocity = dolfinx.fem.Function(space), dolfinx.fem.Constant(mesh, (2.0, 0.0))
    omega = 8.0 * balance / BETA_STAR
    state.x.array[0::2], state.x.array[1::2] = -60.0, np.log(omega)
    closure, logarithms = KOmegaSST(dolfinx.fem.Constant(mesh, 1.0)), ufl.split(state)
    measure = ufl.dx(metadata={"quadrature_degree": 2})

    def of_k(size, balanced):
        stream = forms.Stream(
            velocity, 1e-12, measure, size, logarithms, reach=lambda along: size, balanced=balanced
        )
        form = forms.residual(logarithms, None, ufl.TestFunctions(space), stream, closure)
        return petsc.assemble_vector(compat.form(form)).array[0::2]

    alone = of_k(None, False)
    whole, found = of_k(0.5, False) - alone, of_k(0.5, True) - alone
    assert np.abs(whole).max() > 0.1 * balance
    assert found == pytest.approx(part * whole, rel=1e-6, abs=1e-9 * omega)
