"""Along walls of a turbulent flow, where it runs upstream and where it leaves; peaks of k; upwinding of its sources."""

from dataclasses import replace

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
from incipient.results.wall_report import WallReport


def along(velocities):
    """A level wall with velocities at places one apart."""
    count = len(velocities)
    places = np.column_stack([np.arange(count), np.zeros(count)]).astype(float)
    flow = np.column_stack([velocities, np.zeros(count)]).astype(float)
    return AlongWall(places, np.tile([0.0, -1.0], (count, 1)), np.ones(count), flow, np.ones(count))


def coarse(wall, stresses):
    """The fraction with stresses signed by the direction of the flow, more than a quarter being too much."""
    return wall.coarse_fraction(wall.directions * np.abs(stresses), 0.25)


def stressed(stresses, normals=(0.0, -1.0), closed=False):
    """A wall of facets from node to node with stresses; closed: the last node is the first one's neighbour."""
    count = len(stresses)
    normals = np.broadcast_to(np.array(normals, dtype=float), (count, 2))
    tangents = np.column_stack([-normals[:, 1], normals[:, 0]])
    facets = np.column_stack([np.arange(count), np.roll(np.arange(count), -1)])
    lengths = np.ones(count)
    flow = tangents * np.array(stresses, dtype=float)[:, None]
    return AlongWall(flow, normals, lengths, flow, lengths, facets if closed else facets[:-1])


@pytest.mark.parametrize(
    ("stresses", "fraction"),
    [
        ([9, 9, 9, 4, 4, 5, 5, 4, 4, 9, 9, 9], 0.0),  # 1 of 5 twice; the ends do not count
        ([9, 9, 9, 4, 4, 8, 7, 4, 4, 9, 9, 9], 7.0 / 8.0),  # 4 of 8, 1 of 8, 3 of 7
        ([9, 9, 9, 1, 1, 2, 2, 1, 1, 9, 9, 9], 0.0),  # 1 of the mean, 5.2
    ],
)
def test_the_change_of_the_stress_from_cell_to_cell(stresses, fraction):
    """By hand: the fraction of all change that lies in facets with more than a quarter, two at both ends left out."""
    assert coarse(stressed(stresses), stresses) == pytest.approx(fraction)


def test_facets_at_corners_do_not_count_and_the_stress_turns_with_the_wall():
    """By hand: a square of 16 facets a side, a stress of one around it, and jumps on both sides of a corner."""
    sides = np.repeat([[0.0, -1.0], [1.0, 0.0], [0.0, 1.0], [-1.0, 0.0]], 16, axis=0)
    corners = np.arange(0, 64, 16)
    normals = sides.copy()
    normals[corners] = 0.5 * (sides[corners] + sides[corners - 1])
    stresses = np.ones(64)
    stresses[[15, 17]] = 50.0
    assert coarse(stressed(stresses, normals, closed=True), stresses) == 0.0
    stresses[24:28] = 5.0  # in the middle of a side, mean 3.8: one step of four up, one down
    assert coarse(stressed(stresses, normals, closed=True), stresses) == 1.0


def test_the_stress_along_the_triangles_of_a_wall_in_space():
    """By hand: twelve rows of a strip across the flow, a stress of 1 and 8 from the sixth on: one step of 7 in all
    edges that lead from row to row. Two triangles share an edge.
    """
    row, side = np.divmod(np.arange(24), 2)
    places = np.column_stack([row, side, np.zeros(24)]).astype(float)
    pull = np.column_stack([np.where(row < 6, 1.0, 8.0), np.zeros((24, 2))])
    ahead = np.array([(k, k + 2) for k in range(22)])
    across = np.array([(k, k + 1) for k in range(0, 24, 2)])
    wall = AlongWall(
        *(places, np.tile([0.0, 0.0, -1.0], (24, 1)), np.ones(24), pull, np.ones(24)),
        np.concatenate([ahead, across]),
    )
    assert coarse(wall, pull[:, 0]) == 1.0
    assert coarse(wall, 20.0 + row) == 0.0


def test_walls_with_corners_or_a_grain_are_called_unresolved_with_evidence_alone():
    known = WallReport("k-omega-sst", 0.01, 0.2, 2.0, 0.05, 0.05, 0.005, 1e-4, plane=False)
    lines = {}
    for judged, fraction in ((True, 0.6), (True, 0.2), (False, 0.6), (False, 0.2), (False, None)):
        walls = replace(known, coarse_along=fraction, judged_along=judged, mesh_size=2.0)
        lines[judged, fraction] = walls.lines()[0]
        assert bool(walls.doubt) == (judged and fraction == 0.6)
    assert "NOT RESOLVED: 60% of the change" in lines[True, 0.6]
    assert "set numerics.mesh_size = 1;" in lines[True, 0.6]
    assert "NOT RESOLVED" not in lines[False, 0.6] and "60% of the change" in lines[False, 0.6]
    assert not any("change" in lines[key] for key in lines if key[1] != 0.6)


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
        stream = forms.FlowFields(
            velocity, 1e-12, measure, size, logarithms, reach=lambda along: size, balanced=balanced
        )
        form = forms.residual(logarithms, None, ufl.TestFunctions(space), stream, closure)
        return petsc.assemble_vector(compat.form(form)).array[0::2]

    alone = of_k(None, False)
    whole, found = of_k(0.5, False) - alone, of_k(0.5, True) - alone
    assert np.abs(whole).max() > 0.1 * balance
    assert found == pytest.approx(part * whole, rel=1e-6, abs=1e-9 * omega)
