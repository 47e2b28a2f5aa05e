"""Models of turbulence, on fixed and moving meshes."""

from contextlib import contextmanager, nullcontext
from dataclasses import replace
from functools import partial
from unittest.mock import MagicMock

import dolfinx
import numpy as np
import pytest
import ufl
from domains import SIDES, named_by_planes, ring, unit_box
from floating import Floating, box_around
from moving import RandomMotion, Swaying
from mpi4py import MPI
from one_dimensional import k_omega_channel
from petsc4py import PETSc
from scipy.integrate import solve_ivp
from test_linear import ROWS, refill, sparse
from turbulent import k_epsilon, k_omega

from incipient import compat
from incipient.body.rigidbody import RigidBody
from incipient.body.state import BodyState, Inertia
from incipient.compat import petsc
from incipient.coupled import turbulent_flow
from incipient.coupled.coupling import Coupling
from incipient.coupled.rigid import RigidPart
from incipient.coupled.turbulent_flow import InTime
from incipient.errors import ConvergenceError
from incipient.fluid import FlowModel, Fluid, Prescribed
from incipient.fluid.along_walls import AlongWall, at_end
from incipient.fluid.conditions import Friction
from incipient.fluid.transient import Transient, backward_difference
from incipient.forms import turbulence as forms
from incipient.forms.k_omega_sst import BETA_STAR as SST_BETA_STAR
from incipient.forms.k_omega_sst import EXPONENT, KOmegaSST
from incipient.geometry.placement import Placement
from incipient.geometry.plane.grains import Disc
from incipient.mesh.motion import MeshMotion, RigidDisplacement
from incipient.mesh.sampling import sample
from incipient.mesh.wall_distance import distances
from incipient.planning.conditions import UFL
from incipient.results.wall_report import WallReport
from incipient.turbulence.continuation import Continued
from incipient.turbulence.coupled_flow import BlockByBlock
from incipient.turbulence.developed import developed, of_discharge
from incipient.turbulence.wall_law import WallLaw

# k and epsilon by themselves, in given velocities, against exact solutions; that they stay positive.


# kappa of the logarithmic layers of k-epsilon and of the inner model of k-omega.
KAPPA = np.sqrt(1.3 * (1.92 - 1.44) * np.sqrt(0.09))
KAPPA_OF_OMEGA = np.sqrt((0.075 / 0.09 - 5.0 / 9.0) * 0.3 / 0.5)
BETA, GAMMA, BETA_STAR = 0.0828, 0.44, 0.09  # of the outer model, which holds far from walls


def rectangle(low, high, cells):
    """A rectangle of triangles with the sides "left", "right", "bottom" and "top"."""
    mesh = dolfinx.mesh.create_rectangle(MPI.COMM_SELF, np.array([low, high], dtype=float), cells)
    (left, bottom), (right, top) = low, high
    planes = {"left": (0, left), "right": (0, right), "bottom": (1, bottom), "top": (1, top)}
    return named_by_planes(mesh, planes)


def uniform(k, epsilon):
    return lambda x: np.log([np.full(x.shape[1], k), np.full(x.shape[1], epsilon)])


def through_time(fields, times):
    """(steps, 2) of k and epsilon at the first node, by backward differences of second order."""
    result, past = [], [fields.state.x.array.copy()]
    for number, length in enumerate(np.diff(times)):
        second = number > 0
        ratio = length / (times[number] - times[number - 1]) if second else 1.0
        rate, _ = backward_difference(1 + second, length, ratio)
        assert fields.step(rate, (past[0], past[-1]), 1e-10) <= 1e-10
        past = [fields.state.x.array.copy(), past[0]]
        result.append(np.exp(fields.state.x.array[:2]))
        assert np.ptp(fields.state.x.array.reshape(-1, 2), axis=0) == pytest.approx(0, abs=1e-8)
    return np.array(result)


@pytest.mark.parametrize(
    ("model", "start", "rate", "powers"),
    [
        # k = k0 (1 + (C_2 - 1) e0 t/k0)^-1.087, epsilon with -2.087.
        (k_epsilon, (2.0, 0.5), 0.92 * 0.25, (-1 / 0.92, -1 / 0.92 - 1)),
        (k_omega, (2.0, 3.0), BETA * 3.0, (-BETA_STAR / BETA, -1.0)),
    ],
)
def test_homogeneous_turbulence_decays_as_it_must(model, start, rate, powers):
    """By the exact powers of time, at second order."""
    errors = []
    for steps in (50, 100):
        times = np.expm1(np.linspace(0.0, np.log(1001.0), steps + 1))
        with model(rectangle((0, 0), (1, 1), (1, 1)), uniform(*start)) as fields:
            fields.carried_by(dolfinx.fem.Constant(fields.domain.mesh, (0.0, 0.0)), 0.01)
            result = through_time(fields, times)
        exact = start * (1 + rate * times[1:, None]) ** powers
        errors.append(np.abs(result / exact - 1).max())
    assert errors[1] < 1e-2 and errors[0] / errors[1] > 3.0


SHEAR = 2.0


def epsilon_in_shear(time, state):
    k, epsilon = state
    made = 0.09 * k**2 / epsilon * SHEAR**2
    return made - epsilon, (1.44 * made - 1.92 * epsilon) * epsilon / k


def omega_in_shear(time, state):
    k, omega = state
    made = min(k / omega * SHEAR**2, 10 * BETA_STAR * k * omega)
    return made - BETA_STAR * k * omega, GAMMA * SHEAR**2 - BETA * omega**2


@pytest.mark.parametrize(
    ("model", "rates", "start", "limit"),
    [
        # k/epsilon and omega that no longer change (exact).
        (k_epsilon, epsilon_in_shear, (1.0, 2.0), np.sqrt(0.92 / 0.44 / 0.09) / SHEAR),
        (k_omega, omega_in_shear, (1.0, 0.5), SHEAR * np.sqrt(GAMMA / BETA)),
    ],
)
def test_homogeneous_shear_follows_its_equations(model, rates, start, limit):
    """By scipy in both quantities themselves, at second order."""
    errors = []
    for steps in (160, 320):
        times = np.expm1(np.linspace(0.0, np.log(21.0), steps + 1))
        exact = solve_ivp(rates, (0.0, 20.0), start, rtol=1e-9, atol=1e-12, t_eval=times).y[:, 1:]
        with model(rectangle((0, 0), (1, 1), (1, 1)), uniform(*start)) as fields:
            x = ufl.SpatialCoordinate(fields.domain.mesh)
            # The velocity at the only place that counts is zero: convection of what is uniform vanishes anyway.
            fields.carried_by(ufl.as_vector([SHEAR * x[1], 0]), 0.01)
            result = through_time(fields, times).T
        errors.append(np.abs(np.log(result / exact)).max())
    k, second = result[:, -1]
    assert (k / second if model is k_epsilon else second) == pytest.approx(limit, rel=1e-3)
    assert errors[1] < 3e-3 and errors[0] / errors[1] > 3.0


def steady(fields, tolerance=1e-9):
    """Solve the steady equations from the state at hand by a few steps of pseudo-time."""
    for step in (1.0, 10.0, 1e3, 1e9):
        before = fields.state.x.array.copy()
        assert np.isfinite(fields.step((1 / step, -1 / step, 0.0), (before, before), tolerance))


def test_what_the_limiter_does_where_a_flow_meets_a_wall():
    """Turbulence with k/epsilon = 40 in a flow onto a wall, of strain one, where diffusion is nothing.

    P/epsilon would be 576, and k grow to hundreds of times. At most ten, k/epsilon falls at the rate 9 - (1.44 10 -
    1.92) = -3.48 and k grows by (T0/(T0 - 3.48 t))^(9/3.48), to 1.94 times (exact).
    """
    expected = (40 / (40 - 3.48 * np.log(4 / 0.3))) ** (9 / 3.48)
    domain = rectangle((0, 0.3), (1, 4), (1, 60))
    with k_epsilon(domain, uniform(1e-6, 1e-6 / 40), ("top",)) as fields:
        x = ufl.SpatialCoordinate(domain.mesh)
        fields.carried_by(ufl.as_vector([x[0], -x[1]]), 1e-9)
        length = 0.01
        while length < 1e4:
            before = fields.state.x.array.copy()
            if np.isfinite(fields.step((1 / length, -1 / length, 0.0), (before, before), 1e-9)):
                length *= 2.0
            else:
                fields.state.x.array[:] = before
                length *= 0.25
        (result,) = sample(fields.state, np.array([[0.5, 0.3]]))[:, 0]
    assert np.exp(result) / 1e-6 == pytest.approx(expected, rel=5e-3)


def errors_above_a_wall(model, exact, velocity, viscosity, wall, size, meshes):
    """Largest errors of the steady logarithms in squares that begin at a distance from the wall, on two meshes.

    They are given on top and at the sides, and begin beside the solution.
    """
    errors = []
    for cells in meshes:
        domain = rectangle((0, wall), (size, wall + size), cells)
        given = ("top", "left", "right")
        with model(domain, exact, given, {"bottom": wall}, viscosity=viscosity) as fields:
            fields.state.x.array[:] += 0.1 * np.sin(np.arange(len(fields.state.x.array)))
            fields.carried_by(velocity(domain.mesh), viscosity)
            steady(fields)
            heights = np.linspace(wall, wall + size, 40)
            places = np.column_stack([np.full(40, 0.52 * size), heights])
            errors.append(np.abs(sample(fields.state, places) - exact(places.T).T).max())
    return errors


@pytest.mark.parametrize(
    ("model", "kappa", "second"),
    [
        (k_epsilon, KAPPA, 1.0 / KAPPA),
        (k_omega, KAPPA_OF_OMEGA, 1.0 / (0.3 * KAPPA_OF_OMEGA)),
    ],
)
def test_the_logarithmic_layer_is_a_solution(model, kappa, second):
    """U = ln(y)/kappa, k = 1/0.3, epsilon = 1/(kappa y) or omega = 1/(0.3 kappa y) solve the equations (exact).

    kappa is 0.4327, or that of the inner model (Menter 1994).
    """

    def exact(x):
        return np.log([0 * x[1] + 1 / 0.3, second / x[1]])

    def velocity(mesh):
        return ufl.as_vector([ufl.ln(ufl.SpatialCoordinate(mesh)[1]) / kappa, 0])

    errors = errors_above_a_wall(model, exact, velocity, 1e-9, 1.0, 4.0, ((2, 3), (2, 6)))
    assert errors[1] < 0.02 and errors[0] / errors[1] > 3.0


MOST_CUTS = 20  # after which a run ends, and says that k and epsilon do not converge


@pytest.mark.parametrize(
    ("number", "seed"), [(12, 3), pytest.param(1000, 4, marks=pytest.mark.slow)]
)
def test_starts_meshes_and_steps_leave_k_and_epsilon_positive(number, seed):
    """They are exponentials: what may fail is a step, which says so, and is taken in parts.

    At random from states, in shear and by steps over many decades up to 1000; every twelve of them have a mesh of their
    own, of stretched cells whose corners lie at random. Each has a step that is short enough, 19 quarterings at most:
    upwinding that is longer than the step weighs the rate more along the flow than by itself, and six starts had none.
    """
    random = np.random.default_rng(seed)
    for _ in range(-(-number // 12)):
        cells, height = random.integers(1, 5, 2), 10 ** random.uniform(-1, 1)
        domain = rectangle((0, 0), (1, height), tuple(map(int, cells)))
        places, sizes = domain.mesh.geometry.x, np.array([1.0, height])
        within = ((places[:, :2] > 1e-9) & (places[:, :2] < sizes - 1e-9)).all(axis=1)
        places[within, :2] += random.uniform(-0.3, 0.3, (within.sum(), 2)) * sizes / cells
        shear = dolfinx.fem.Constant(domain.mesh, 0.0)
        with k_epsilon(domain, uniform(1.0, 1.0), ("left",)) as fields:
            x, size = ufl.SpatialCoordinate(domain.mesh), len(fields.state.x.array)
            fields.carried_by(ufl.as_vector([shear * x[1], 0.1 * shear * x[0]]), 1e-3)
            for _ in range(12):
                start = np.tile(random.uniform(np.log(1e-2), np.log(1e2), 2), size // 2)
                start += 0.5 * random.standard_normal(size)
                fields.state.x.array[:] = start
                shear.value, step = 10.0 ** random.uniform(-3, 3, 2)
                cut, past = 0, (start, start)
                while not np.isfinite(fields.step((1 / step, -1 / step, 0.0), past, 1e-6)):
                    fields.state.x.array[:] = start
                    step, cut = 0.25 * step, cut + 1
                    assert cut < MOST_CUTS
                result = np.exp(fields.state.x.array)
                assert np.isfinite(result).all() and (result > 0.0).all()


# k and omega by themselves, in given velocities, against exact solutions, and developed flow in one dimension.


@pytest.mark.parametrize("distance", [0.1, 1.0])
def test_next_to_a_smooth_wall_only_molecules_matter(distance):
    """omega = 6 nu/(0.075 y^2) and k as y^n, n (n - 1) = 6 0.09/0.075, solve the equations at rest (exact).

    k is so small that there are no eddies.
    """

    def exact(x):
        y = x[1]
        return np.array([np.log(1e-14) + EXPONENT * np.log(y), np.log(6 * 0.01 / 0.075 / y**2)])

    assert pytest.approx(7.2) == EXPONENT * (EXPONENT - 1)

    def at_rest(mesh):
        return dolfinx.fem.Constant(mesh, (0.0, 0.0))

    errors = errors_above_a_wall(k_omega, exact, at_rest, 0.01, distance, 1.0, ((3, 8), (3, 16)))
    assert errors[1] < 0.1 * distance**-0.5 and errors[0] / errors[1] > 3.0


def test_distances_from_walls_are_those_of_geometry():
    domain = rectangle((0, 0), (4, 1), (9, 7))
    places = np.random.default_rng(1).uniform((0, 0), (4, 1), (200, 2))
    x, y = places.T
    assert distances(domain, ("bottom",), places) == pytest.approx(y)
    both = np.minimum(np.minimum(y, 1 - y), x)
    assert distances(domain, ("bottom", "top", "left"), places) == pytest.approx(both)


def test_developed_flow_has_the_discharge_asked_for():
    """Roughness of u* k_s/nu = 2 is below 2.25, from which on it matters."""
    result = of_discharge(11000.0)
    assert result.re_tau * result.mean == pytest.approx(11000.0, rel=1e-5)
    assert result.speed[-1] > result.mean > 0.8 * result.speed[-1]
    rough = developed(500.0, 0.004)
    assert rough.mean == developed(500.0).mean and (np.diff(rough.heights) > 0.0).all()


@pytest.mark.parametrize("re_tau", [180.0, 2004.0])
def test_developed_flow_is_that_of_finite_volumes(re_tau):
    """In k and omega themselves, written for the tests: the same mean velocity within 0.1%."""
    assert developed(re_tau).mean == pytest.approx(k_omega_channel(re_tau), rel=1e-3)


@pytest.mark.parametrize(("sand", "within"), [(5.0, 0.4), (11.0, 0.4), (60.0, 0.4), (1000.0, 1.1)])
def test_developed_flow_over_sand_obeys_the_law_of_rough_walls(sand, within):
    """u+ beside Nikuradse's law (as fitted by Cebeci & Bradshaw 1977), from which the smooth flow is 0.34 away."""
    result, law = developed(20000.0, sand / 20000.0), WallLaw(sand / 20000.0)
    away = [
        np.interp(y, result.heights, result.speed) - law.velocity(1.0, 1.0 / 20000.0, y)
        for y in (0.05, 0.1, 0.2)
    ]
    assert np.abs(away).max() < within


def test_powers_at_walls_are_those_of_developed_flow():
    """At y+ of 1 to 100: the power of k within 0.13, of omega within 0.06 (0.4 and 0.3 before)."""
    channel = developed(5000.0)
    y, k, omega = (one[1:-1] for one in (channel.heights, channel.log_k, channel.log_omega))
    layer = (y * 5000.0 > 1.0) & (y * 5000.0 < 100.0)
    powers = KOmegaSST(None).powers_at_wall(5000.0 * np.exp(k - omega))
    for one, power, within in zip((k, omega), powers, (0.13, 0.06), strict=True):
        slope = np.gradient(one, np.log(y))
        assert np.abs(power - slope)[layer].max() < within


def test_slow_flow_is_laminar():
    """u*^2 = 3 nu V/h, with V/u* = Re_tau/3 and the surface 1.5 times as fast as the mean (exact)."""
    result = of_discharge(20.0)
    assert result.is_laminar
    assert result.re_tau == pytest.approx(np.sqrt(60.0), rel=1e-4)
    assert result.speed[-1] / result.mean == pytest.approx(1.5, rel=1e-3)


def test_in_crevices_of_a_bed_in_space_corrections_hardly_count():
    """Where eddies make 1e-6 of the viscosity a correction of ln k by ten hardly counts."""
    with k_omega(unit_box(3, 2), uniform(1.0, 1.0)) as fields:
        fields.state.x.array[0] = np.log(1e-8)
        values = np.full(len(fields.state.x.array), 1e-5)
        values[0] = 10.0
        assert fields.usual_change(values) < 1e-4


# Linear systems of flow and turbulence in space, beside numpy's solution, with factors of the flow that are off.


@pytest.fixture
def blocks():
    """Four blocks (ROWS, ROWS), those on the diagonal well conditioned; k and omega act on each other."""
    made = np.random.default_rng(1).standard_normal((2, 2, ROWS, ROWS))
    for one in (0, 1):
        made[one, one] += 20.0 * np.eye(ROWS)
    for k, omega, sign in ((0, 1, 1.0), (1, 0, -1.0)):
        made[1, 1, k::2, omega::2] += 20.0 * sign * np.eye(ROWS // 2)
    return made


def nest_of(blocks):
    nest = PETSc.Mat().createNest(
        [[sparse(one) for one in row] for row in blocks], comm=PETSc.COMM_SELF
    )
    nest.assemble()
    return nest


ROUGH = 1e-2  # residual of linear systems


def solved(solver):
    right, x = solver.matrix.createVecs()
    right.setArray(np.linspace(1.0, 2.0, 2 * ROWS))
    solver.prepare()
    solver.approximate(right, x, ROUGH)
    return right.array.copy(), x.array.copy()


@pytest.mark.parametrize("coupled", [True, False])
def test_older_factors_of_the_flow_serve_on(blocks, coupled):
    """Wrong in one direction; where the flow depends on no turbulence GMRES needs two applications for that."""
    wrong = blocks[0, 0].copy()
    wrong[:, 0] *= 4.0
    blocks[0, 1] *= coupled
    solver = BlockByBlock(nest_of([[wrong, blocks[0, 1]], blocks[1]]))
    solved(solver)
    refill(solver.matrix.getNestSubMatrix(0, 0), blocks[0, 0])
    b, x = solved(solver)
    whole = np.block([list(row) for row in blocks])
    assert np.linalg.norm(whole @ x - b) <= 1.01 * ROUGH * np.linalg.norm(b)
    assert 1 < solver._solver.getIterationNumber() <= (10 if coupled else 3)
    solver.destroy()


def test_factors_too_old_are_renewed_and_what_none_solve_is_not_finite(blocks):
    """Of a flow unlike the one of its factors; of a matrix to whose range the right-hand side does not belong."""
    solver = BlockByBlock(nest_of(blocks))
    solved(solver)
    unlike = blocks[0, 0].T - 30.0 * np.eye(ROWS)
    refill(solver.matrix.getNestSubMatrix(0, 0), unlike)
    b, x = solved(solver)
    whole = np.block([[unlike, blocks[0, 1]], list(blocks[1])])
    assert np.linalg.norm(whole @ x - b) <= 1.01 * ROUGH * np.linalg.norm(b)
    for column in (0, 1):
        refill(solver.matrix.getNestSubMatrix(1, column), np.zeros((ROWS, ROWS)))
    assert np.isinf(solved(solver)[1]).all()
    solver.destroy()


# Along walls of a turbulent flow, where it runs upstream and where it leaves; peaks of k; upwinding of its sources.


def along(speeds, normals=(0.0, -1.0), closed=False):
    """A wall of facets between nodes one apart, with speeds; closed: the last node is the first one's neighbour."""
    count = len(speeds)
    normals = np.array(np.broadcast_to(normals, (count, 2)), dtype=float)
    tangents = np.column_stack([-normals[:, 1], normals[:, 0]])
    facets = np.column_stack([np.arange(count), np.roll(np.arange(count), -1)])
    places, lengths = (
        np.column_stack([np.arange(count), np.zeros(count)]).astype(float),
        np.ones(count),
    )
    flow = tangents * np.array(speeds, dtype=float)[:, None]
    return AlongWall(places, normals, lengths, flow, lengths, facets if closed else facets[:-1])


def coarse(wall, stresses):
    """The fraction where more than a quarter is too much."""
    return wall.coarse_fraction(np.abs(stresses), 0.25)


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
    assert coarse(along(stresses), stresses) == pytest.approx(fraction)


def test_facets_at_corners_do_not_count_and_the_stress_turns_with_the_wall():
    """By hand: a square of 16 facets a side, a stress of one around it, and jumps on both sides of a corner."""
    sides = np.repeat([[0.0, -1.0], [1.0, 0.0], [0.0, 1.0], [-1.0, 0.0]], 16, axis=0)
    corners = np.arange(0, 64, 16)
    normals = sides.copy()
    normals[corners] = 0.5 * (sides[corners] + sides[corners - 1])
    stresses = np.ones(64)
    stresses[[15, 17]] = 50.0
    assert coarse(along(stresses, normals, closed=True), stresses) == 0.0
    stresses[24:28] = 5.0  # in the middle of a side, mean 3.8: one step of four up, one down
    assert coarse(along(stresses, normals, closed=True), stresses) == 1.0


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


@pytest.mark.parametrize(
    ("judged", "fraction"), [(True, 0.6), (True, 0.2), (False, 0.6), (False, 0.2), (False, None)]
)
def test_walls_with_corners_or_a_grain_are_called_unresolved_with_evidence_alone(judged, fraction):
    known = WallReport("k-omega-sst", 0.01, 0.2, 2.0, 0.05, 0.05, 0.005, 1e-4, plane=False)
    walls = replace(known, coarse_along=fraction, judged_along=judged, mesh_size=2.0)
    lines, large = "".join(walls.lines()), fraction == 0.6
    assert bool(walls.doubt) == (judged and large)
    assert ("NOT RESOLVED: " in lines) == (judged and large)
    assert ("set numerics.mesh_size = 1" in lines) == (judged and large)
    assert ("60% of the change" in lines) == large
    assert ("change" in lines) == large


@pytest.mark.parametrize(
    ("velocities", "face", "spans"),
    [
        ([1, -1, -1, 1], None, ((0.5, 2.5),)),
        ([1, 0, -1, -2, 1], None, ((1.0, 3.0 + 2.0 / 3.0),)),
        ([-1, 0, 1], None, ((0.0, 1.0),)),
        ([0, -1, 1], None, ((1.0, 1.5),)),
        ([1, 1, 0], None, ()),
        ([1, -1, 1, 1, -1, -1, 1], None, ((3.5, 5.5), (0.5, 1.5))),  # the longest first
        # A face that falls at x = 2.5, the node with velocity 0: no eddy in its corner, one that is shorter than what
        # is behind, and flow attached behind the face.
        ([1, 1, 1, 0, -1, -1, -1, -1, -1, 1], 3, ((2.5, 8.5),)),
        ([1, 1, 1, 0, 1, -1, -1, -1, -1, 1], 3, ((2.5, 8.5),)),
        ([1, 1, 1, 0, 1, 1, 1, 1, -1, 1], 3, ((7.5, 8.5),)),
    ],
)
def test_where_the_flow_runs_upstream_also_with_nodes_at_rest(velocities, face, spans):
    """By straight lines from node to node, one apart, but for those at rest (by hand)."""
    wall = along(velocities)
    if face is not None:
        wall.places[face, 0], wall.normals[face] = 2.5, (-1.0, 0.0)
    assert np.ravel(wall.backward()) == pytest.approx(np.ravel(spans))


@pytest.mark.parametrize(("start", "step"), [(0.0, 1.0), (1e6, 0.1), (0.0, 1e-10)])
def test_the_outflow_is_at_the_end_wherever_a_domain_lies(start, step):
    """Map coordinates: at a million, or at a billionth, only the last of ten nodes is there."""
    assert at_end(start + step * np.arange(10)).tolist() == [False] * 9 + [True]


def residual_of_k(state, fields, closure):
    """The residual (nodes,) of the equation of k, without a rate."""
    tests = ufl.TestFunctions(state.function_space)
    form = forms.residual(ufl.split(state), None, tests, fields, closure)
    return petsc.assemble_vector(compat.form(form)).array[0::2]


@pytest.mark.parametrize("gdim", [2, 3])
def test_a_peak_of_k_at_one_node_does_not_grow(gdim):
    """Diffusion lowers a peak of k, by the equation of k itself; by that of ln k it would grow on a coarse mesh.

    ln k of a node 5 above its neighbours, which all diffuse alike: what is lost, tested with the hat of the node.
    """
    box = {2: dolfinx.mesh.create_unit_square, 3: dolfinx.mesh.create_unit_cube}[gdim]
    mesh = box(MPI.COMM_SELF, *[8] * gdim)
    space = compat.space(mesh, ("Lagrange", 1), (2,))
    state = dolfinx.fem.Function(space)
    away = np.linalg.norm(space.tabulate_dof_coordinates()[:, :gdim] - 0.5, axis=1)
    node = int(away.argmin())
    state.x.array[2 * node] = 5.0
    rest = dolfinx.fem.Constant(mesh, [0.0] * gdim)
    measure, balance = ufl.dx(metadata={"quadrature_degree": 8}), forms.KEpsilon(c_mu=1e-30)
    lasting = ufl.exp(state[1] - state[0])  # what is destroyed is added again

    def lost(weighted):
        fields = forms.FlowFields(rest, 1.0, measure, added=(lasting, 0), weighted=weighted)
        return residual_of_k(state, fields, balance)[node]

    assert lost(False) < 0.0
    assert lost(True) > 0.0


@pytest.mark.parametrize(("balance", "part"), [(0.5, 1.0), (4.0, 0.25), (4000.0, 0.00025)])
def test_upwinding_lasts_no_longer_than_its_source(balance, part):
    """By hand: |v| = 2 and cells 0.5 long are passed at the rate 8; beta* omega is `balance` times that."""
    mesh = dolfinx.mesh.create_unit_square(MPI.COMM_SELF, 2, 2)
    space = compat.space(mesh, ("Lagrange", 1), (2,))
    state, velocity = dolfinx.fem.Function(space), dolfinx.fem.Constant(mesh, (2.0, 0.0))
    omega = 8.0 * balance / SST_BETA_STAR
    state.x.array[0::2], state.x.array[1::2] = -60.0, np.log(omega)
    closure = KOmegaSST(dolfinx.fem.Constant(mesh, 1.0))
    measure = ufl.dx(metadata={"quadrature_degree": 2})

    def of_k(size, balanced):
        stream = forms.FlowFields(
            *(velocity, 1e-12, measure, size, ufl.split(state)),
            reach=lambda along: size,
            balanced=balanced,
        )
        return residual_of_k(state, stream, closure)

    alone = of_k(None, False)
    whole, result = of_k(0.5, False) - alone, of_k(0.5, True) - alone
    assert np.abs(whole).max() > 0.1 * balance
    assert result == pytest.approx(part * whole, rel=1e-6, abs=1e-9 * omega)


# Turbulence on meshes that move, and walls that do: what may not depend on the mesh's motion, nor on the frame.


STREAM, STEP = np.array([0.6, -0.3]), 0.01
SAND = 0.15  # radius of a disc that moves


def steady_on_moving_meshes(velocity):
    return lambda x, t: np.tile(np.array(velocity, dtype=float)[:, None], x.shape[1])


@pytest.mark.parametrize(("model", "second"), [(k_epsilon, 0.1), (k_omega, 50.0)])
def test_a_free_stream_stays_one_on_a_mesh_moved_at_random(model, second):
    """What is uniform decays as on a mesh at rest, to round-off; the lengths of steps differ."""
    ends, stream = [], steady_on_moving_meshes(STREAM)
    for radius in (0.0, 0.06):
        domain = unit_box(2, 4)
        with model(domain, uniform(0.02, second)) as fields:
            flow = FlowModel(unsteady=True, moving_mesh=True, viscosity=fields.viscosity)
            conditions = [Prescribed(name, stream) for name in domain.names]
            with Fluid(domain, flow, conditions, 100.0) as fluid:
                points = fluid.constraints.points.T
                fluid.state.x.array[fluid.space.velocity_map] = stream(points, 0.0).T.ravel()
                velocity, _ = ufl.split(fluid.state)
                fields.carried_by(velocity, 0.01, carrier=fluid.carrier(velocity))
                motion = RandomMotion(domain.mesh, radius)
                swaying = Swaying(fluid, lambda time, motion=motion: motion.places())
                transient = Transient(fluid, 2, 1e-12, interface=swaying)
                past = [fields.state.x.array.copy()]
                for number in range(4):
                    transient.advance(STEP * (1 + 0.3 * (number % 2)))
                    rate = [float(one.value) for one in fluid.rate]
                    assert fields.step(rate, (past[0], past[-1]), 1e-12) <= 1e-12
                    past = [fields.state.x.array.copy(), past[0]]
                velocities = fluid.velocity.x.array.reshape(-1, 2)
                assert velocities == pytest.approx(np.tile(STREAM, (len(velocities), 1)), abs=1e-12)
                ends.append(fields.state.x.array.reshape(-1, 2))
    assert ends[1] == pytest.approx(np.tile(ends[0][0], (len(ends[1]), 1)), abs=1e-11)
    assert ends[0][0, 0] < np.log(0.02) - 0.05


LAW = partial(WallLaw().drag, functions=UFL)


@contextmanager
def in_eddies(
    fields, body, state, entering, at_first, distance=0.01, names=("body", *SIDES[:4]), frame=None
):
    """A body along which the law of the wall holds, in a turbulent fluid that enters, or leaves, at other boundaries.

    `at_first` (gdim,) is the fluid's velocity. `frame`: the fraction of the body's way that the whole mesh goes along.
    """
    (name, *outer), domain, nu = names, fields.domain, fields._molecules
    eddies = {"viscosity": fields.viscosity, "shear_velocity": fields.shear_velocity()}
    model = FlowModel(unsteady=True, moving_mesh=True, **eddies)
    walls = [Prescribed(side, entering) for side in outer]
    friction = Friction(name, distance, LAW, moves=True)
    with fields, Fluid(domain, model, [friction, *walls], 1 / nu) as fluid:
        velocity, _ = ufl.split(fluid.state)
        fields.carried_by(velocity, nu, carrier=fluid.carrier(velocity))
        fields.watch(fluid)
        count = len(fluid.constraints.points)
        fluid.state.x.array[fluid.space.velocity_map] = np.tile(at_first, count)
        displacement = RigidDisplacement(domain, name, state.placement, turning=False)
        if frame is not None:
            displacement.weights[:, :2] = frame + (1 - frame) * displacement.weights[:, :2]
        part = RigidPart(fluid, body, state, displacement, lambda state: np.zeros(body.size))
        coupling = Coupling(fluid, [part], MeshMotion(domain), tolerance=1e-9)
        transient = Transient(fluid, 2, 1e-9, interface=InTime(fluid, fields, moving=coupling))
        yield Floating(fluid, coupling, part, transient), fields


def sand_in_box(frame):
    """A disc that goes through a box in a stream, by k-omega SST, seen from a frame that goes along.

    Boxes and meshes are the same but for their place: of the body's way that goes along with all nodes which is the
    frame's, and of the other the mesh near the body takes as much as always.
    """
    place, way, frame = Placement((0.5, 0.5)), np.array([0.8, 0.2]), np.array(frame)
    course = np.array([*(way - frame), 4.0])
    body = RigidBody(Inertia(1.0, np.ones(1)), [False] * 3, lambda t: course)
    domain, stream = box_around(Disc(2.0 * SAND), place, cell=0.08, far=0.2), STREAM - frame
    fields = k_omega(domain, uniform(0.01, 20.0), SIDES[:4], {"body": 0.01}, viscosity=1e-3)
    state, entering = BodyState.at(place, course), steady_on_moving_meshes(stream)
    return in_eddies(fields, body, state, entering, stream, 1e-3, frame=1 - way / (way - frame))


def test_sand_that_goes_through_a_box_bears_the_same_in_any_frame():
    """Galilean invariance of k-omega SST, whose distances are from a wall that goes, on a mesh that it deforms.

    Cells miss the outline by 1e-4 at most.
    """
    result = []
    for frame in ([0.0, 0.0], [2.5, -0.6]):
        with sand_in_box(frame) as (floating, fields):
            floating.march(4 * STEP, STEP)
            places = fields._distance.function_space.tabulate_dof_coordinates()[:, :2]
            away = np.linalg.norm(places - floating.part.state.place, axis=1) - SAND + 0.01
            assert fields._distance.x.array == pytest.approx(away, abs=1e-4)
            result.append((floating.part.end.flow_load, fields.state.x.array.copy()))
    (load, eddies), (moved, as_seen) = result
    assert np.abs(load).min() > 1e-4
    assert moved == pytest.approx(load, rel=1e-6)
    assert as_seen == pytest.approx(eddies, abs=1e-6)


@pytest.mark.parametrize("density", [2.65, 0.0])
def test_a_free_disc_set_off_at_once_takes_the_velocity_of_an_ideal_fluid(density):
    """Whatever its density: an impulse makes a potential flow. No couple comes of it.

    Between circles of radius a and b, of which the outer one is set off at V, it gets U = (c + 1) V/(density + c),
    c = (b^2 + a^2)/(b^2 - a^2) being its added mass over that of the fluid it displaces (Lamb 1932, article 69).
    """
    a, b = 0.15, 0.5
    c = (b**2 + a**2) / (b**2 - a**2)
    expected = (c + 1) / (density + c) * STREAM
    dipole = (expected - STREAM) / (1 / b**2 - 1 / a**2)

    def entering(x, t):
        """grad of A . x + B . x/r^2."""
        square = (x[:2] ** 2).sum(axis=0)
        whole = (STREAM + dipole / b**2)[:, None] + dipole[:, None] / square
        return whole - 2 * (dipole @ x[:2]) / square**2 * x[:2]

    mass = density * np.pi * a**2
    body = RigidBody(Inertia(mass, np.array([mass * a**2 / 2])))
    state, values = BodyState.at(Placement((0.0, 0.0))), uniform(0.01, 0.02)
    fields = k_epsilon(ring(a, b, 24, 2), values, ("outer",), {"inner": 0.01}, viscosity=1e-5)
    disc = in_eddies(fields, body, state, entering, np.zeros(2), names=("inner", "outer"))
    with disc as (floating, _):
        steps, _ = floating.march(1e-6, 1e-6)
        velocities = floating.part.state.velocities
    assert velocities[:2] == pytest.approx(expected, rel=5e-3)
    assert abs(velocities[2]) < 1e-3 and steps[-1].report.corrected <= 5


@pytest.mark.slow
def test_a_thousand_steps_of_random_lengths_on_a_random_course_leave_k_and_epsilon_positive():
    """Over three decades of lengths, the disc going to and fro at up to the stream's speed: one in a hundred is halved.

    It is 0.3 of a box, which the stream enters at once. The least and the largest of k stay within what stream and
    production make of it.
    """
    random = np.random.default_rng(3)
    rates, phases = random.uniform(2.0, 20.0, (3, 4)), random.uniform(0.0, 2 * np.pi, (3, 4))

    def course(t):
        """Four waves a component, none of which goes farther than 0.03."""
        return 0.03 * (rates * np.cos(rates * t + phases)).sum(axis=1)

    place = Placement((0.5, 0.5))
    body = RigidBody(Inertia(1.0, np.array([1.0])), [False] * 3, course)
    domain = box_around(Disc(0.3), place, cell=0.08, far=0.2)
    eddies = k_epsilon(domain, uniform(0.01, 0.02), SIDES[:4], {"body": 0.01}, viscosity=1e-5)
    state, entering = BodyState.at(place, course(0.0)), steady_on_moving_meshes(STREAM)
    with in_eddies(eddies, body, state, entering, np.zeros(2)) as (floating, fields):
        halved, spans = 0, []
        for length in 10 ** random.uniform(-4.5, -1.5, 1000):
            halved += floating.transient.advance(length).rejected
            logarithms = fields.state.x.array
            assert np.isfinite(logarithms).all() and np.isfinite(floating.part.end.load).all()
            spans.append(np.exp(logarithms[::2]))
    assert floating.transient.number == 1000 and halved <= 10 and floating.fluid.time > 3.0
    assert np.min(spans) > 1e-3 and np.max(spans) < 1.0


@pytest.mark.parametrize(("onwards", "failures"), [(True, 1), (True, 2), (False, 1)])
def test_a_flow_that_diverges_from_another_begins_again_at_the_inflow(
    monkeypatch, onwards, failures
):
    """Once: a coarse run for error bars begins with the run's own flow, in another domain."""
    ends = [ConvergenceError("diverges")] * failures + [Continued(True, ())]
    monkeypatch.setattr(turbulent_flow, "continued", MagicMock(side_effect=ends))
    flow = MagicMock()
    flow._setup.scene.numerics.tolerance, flow._setup.scene.gdim = 1e-4, 2
    again = failures <= onwards
    with nullcontext() if again else pytest.raises(ConvergenceError, match="diverges"):
        turbulent_flow.TurbulentFlow.solve(flow, MagicMock(), onwards=onwards)
    assert (flow.continued is ends[-1]) is again
    flow.enter.assert_called_once()
