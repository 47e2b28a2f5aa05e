"""k and epsilon by themselves, in given velocities, against exact solutions; that they stay positive."""

import dolfinx
import numpy as np
import pytest
import ufl
from mpi4py import MPI
from scipy.integrate import solve_ivp
from turbulent import k_epsilon

from incipient.fluid.transient import backward_difference
from incipient.mesh.domain import Domain
from incipient.mesh.sampling import sample

KAPPA = np.sqrt(
    1.3 * (1.92 - 1.44) * np.sqrt(0.09)
)  # of the logarithmic law that these constants have


def rectangle(low, high, cells, names=("bottom", "right", "top", "left")):
    """A rectangle of triangles with named sides."""
    kind = dolfinx.mesh.CellType.triangle
    mesh = dolfinx.mesh.create_rectangle(
        MPI.COMM_SELF, [np.array(low), np.array(high)], cells, kind
    )
    sides = ((1, low[1]), (0, high[0]), (1, high[1]), (0, low[0]))
    found = [
        dolfinx.mesh.locate_entities_boundary(
            mesh, 1, lambda x, a=axis, p=place: np.isclose(x[a], p)
        )
        for axis, place in sides
    ]
    facets = np.concatenate(found).astype(np.int32)
    tags = np.repeat(np.arange(1, 5, dtype=np.int32), [len(one) for one in found])
    order = np.argsort(facets)
    return Domain(
        mesh,
        dolfinx.mesh.meshtags(mesh, 1, facets[order], tags[order]),
        dict(zip(names, range(1, 5), strict=True)),
    )


def uniform(k, epsilon):
    return lambda x: np.log([np.full(x.shape[1], k), np.full(x.shape[1], epsilon)])


def through_time(fields, times):
    """(steps, 2) of k and epsilon at the first node, by backward differences of second order."""
    found, past = [], [fields.state.x.array.copy()]
    for number, length in enumerate(np.diff(times)):
        second = number > 0
        ratio = length / (times[number] - times[number - 1]) if second else 1.0
        rate, _ = backward_difference(1 + second, length, ratio)
        assert fields.step(rate, (past[0], past[-1]), 1e-10) <= 1e-10
        past = [fields.state.x.array.copy(), past[0]]
        found.append(np.exp(fields.state.x.array[:2]))
        assert np.ptp(fields.state.x.array.reshape(-1, 2), axis=0) == pytest.approx(0, abs=1e-8)
    return np.array(found)


def test_homogeneous_turbulence_decays_as_it_must():
    """k = k0 (1 + (C_2 - 1) e0 t/k0)^-1.08696, epsilon with -2.08696 (exact); second order in the step."""
    errors = []
    for steps in (50, 100):
        times = np.expm1(np.linspace(0.0, np.log(1001.0), steps + 1))
        with k_epsilon(rectangle((0, 0), (1, 1), (1, 1)), uniform(2.0, 0.5)) as fields:
            fields.carried_by(dolfinx.fem.Constant(fields.domain.mesh, (0.0, 0.0)), 0.01)
            k, epsilon = through_time(fields, times).T
        age = 1 + 0.92 * 0.25 * times[1:]
        exact = 2.0 * age ** (-1 / 0.92), 0.5 * age ** (-1 / 0.92 - 1)
        errors.append(max(np.abs(k / exact[0] - 1).max(), np.abs(epsilon / exact[1] - 1).max()))
        late = np.log(times[-1] / times[-16])
        assert np.log(k[-16] / k[-1]) / late == pytest.approx(1.08696, rel=0.02)
        assert np.log(epsilon[-16] / epsilon[-1]) / late == pytest.approx(2.08696, rel=0.02)
    assert errors[1] < 1e-2 and errors[0] / errors[1] > 3.0


def test_homogeneous_shear_tends_to_its_limit():
    """With (k/epsilon)' = 0 the equations give P/epsilon = (C_2 - 1)/(C_1 - 1), and S k/epsilon = sqrt(that/C_mu).

    Then k grows at the rate (P/epsilon - 1) epsilon/k.
    """
    shear, produced = 2.0, 0.92 / 0.44
    ratio = np.sqrt(produced / 0.09)
    with k_epsilon(rectangle((0, 0), (1, 1), (1, 1)), uniform(1.0, 2.0)) as fields:
        x = ufl.SpatialCoordinate(fields.domain.mesh)
        # The velocity at the only place that counts is zero: convection of what is uniform vanishes anyway.
        fields.carried_by(ufl.as_vector([shear * x[1], 0]), 0.01)
        times = np.linspace(0.0, 40.0, 161)
        k, epsilon = through_time(fields, times).T
    assert shear * k[-1] / epsilon[-1] == pytest.approx(ratio, rel=1e-4)
    rate = np.log(k[-1] / k[-2]) / (times[-1] - times[-2])
    assert rate == pytest.approx((produced - 1) * shear / ratio, rel=1e-3)


def steady(fields, tolerance=1e-9):
    """Solve the steady equations from the state at hand by a few steps of pseudo-time."""
    for step in (1.0, 10.0, 1e3, 1e9):
        before = fields.state.x.array.copy()
        assert np.isfinite(fields.step((1 / step, -1 / step, 0.0), (before, before), tolerance))


def test_turbulence_decays_along_a_stream():
    """The decay with x/U in place of t, diffusion being 1e-4 of convection."""

    def exact(x):
        age = 1 + 0.92 * x[0]
        return np.log([1e-4 * age ** (-1 / 0.92), 1e-4 * age ** (-1 / 0.92 - 1)])

    errors = []
    for cells in (4, 8):
        with k_epsilon(rectangle((0, 0), (4, 1), (cells, 1)), exact, ("left",)) as fields:
            fields.state.interpolate(lambda x: exact(0 * x))
            fields.carried_by(dolfinx.fem.Constant(fields.domain.mesh, (1.0, 0.0)), 1e-6)
            steady(fields)
            places = np.column_stack([np.linspace(0.1, 3.9, 40), np.full(40, 0.5)])
            errors.append(np.abs(sample(fields.state, places) - exact(places.T).T).max())
    assert errors[1] < 5e-3 and errors[0] / errors[1] > 3.5


def along_the_stagnation_streamline(most):
    """k at y = 0.3 over that at y = 4 in the flow (x, -y), by the equations along its streamlines."""

    def rates(time, logarithms):
        lost = np.exp(logarithms[1] - logarithms[0])
        made = min(0.09 * 4 / lost, most * lost)  # 2 D : D = 4
        return made - lost, 1.44 * made - 1.92 * lost

    path = solve_ivp(rates, (0.0, np.log(4 / 0.3)), np.log([1e-6, 1e-6 / 40]), rtol=1e-8, atol=1e-8)
    return np.exp(path.y[0, -1]) / 1e-6


def test_what_the_limiter_does_where_a_flow_meets_a_wall():
    """Turbulence with k/epsilon = 40 in a flow onto a wall, of strain one, where diffusion is nothing.

    P/epsilon would be 576. At most ten, k/epsilon falls at the rate 9 - (1.44 10 - 1.92) = -3.48 and k grows by
    (T0/(T0 - 3.48 t))^(9/3.48), to 1.94 times (exact); without the limiter to hundreds of times.
    """
    expected, late = along_the_stagnation_streamline(10.0), np.log(4 / 0.3)
    assert expected == pytest.approx((40 / (40 - 3.48 * late)) ** (9 / 3.48), rel=1e-6)
    assert expected < 2.0 and along_the_stagnation_streamline(1e6) > 500.0
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
        (found,) = sample(fields.state, np.array([[0.5, 0.3]]))[:, 0]
    assert np.exp(found) / 1e-6 == pytest.approx(expected, rel=5e-3)


@pytest.mark.parametrize("wall", [False, True])
def test_the_logarithmic_layer_is_a_solution(wall):
    """U = ln(y)/kappa, k = 1/sqrt(C_mu), epsilon = 1/(kappa y), kappa = 0.4327, solves the equations (exact).

    Given on top and at the sides; at the bottom, too, or with the conditions of Neumann's type at a wall one away.
    """

    def exact(x):
        return np.log([0 * x[1] + 1 / 0.3, 1 / (KAPPA * x[1])])

    assert pytest.approx(0.4327, abs=1e-4) == KAPPA
    errors, sides = [], ("top", "left", "right") if wall else ("top", "left", "right", "bottom")
    for cells in (3, 6):
        domain = rectangle((0, 1), (4, 5), (2, cells))
        with k_epsilon(domain, exact, sides, {"bottom": 1.0} if wall else {}) as fields:
            fields.state.x.array[:] += 0.3 * np.sin(np.arange(len(fields.state.x.array)))
            y = ufl.SpatialCoordinate(domain.mesh)[1]
            fields.carried_by(ufl.as_vector([ufl.ln(y) / KAPPA, 0 * y]), 1e-9)
            steady(fields)
            places = np.column_stack([np.full(40, 2.1), np.linspace(1.0, 5.0, 40)])
            errors.append(np.abs(sample(fields.state, places) - exact(places.T).T).max())
    assert errors[1] < 0.02 and errors[0] / errors[1] > 3.5


MOST_CUTS = 20  # after which a run ends, and says that k and epsilon do not converge


def random_steps(number, seed):
    """How often a step had to be cut to a quarter: at random from states, in shear and by steps over many decades.

    Every twelve of them have a mesh of their own, of stretched cells whose corners lie at random.
    """
    random, cuts = np.random.default_rng(seed), []
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
                cut = 0
                while not np.isfinite(
                    fields.step((1 / step, -1 / step, 0.0), (start, start), 1e-6)
                ):
                    fields.state.x.array[:] = start
                    step, cut = 0.25 * step, cut + 1
                    if cut == MOST_CUTS:
                        break
                found = np.exp(fields.state.x.array)
                assert np.isfinite(found).all() and (found > 0.0).all()
                cuts.append(cut)
    return cuts


def test_no_start_and_no_step_makes_k_or_epsilon_negative():
    """They are exponentials: what may fail is a step, which says so, and is taken in parts."""
    assert max(random_steps(12, 3)) < MOST_CUTS


@pytest.mark.slow
def test_a_thousand_starts_meshes_and_steps_leave_k_and_epsilon_positive():
    """Each has a step that is short enough, 19 quarterings at most of steps up to 1000.

    Upwinding that is longer than the step weighs the rate more along the flow than by itself: six starts had no step.
    """
    cuts = random_steps(1000, 4)
    assert len(cuts) >= 1000 and max(cuts) < MOST_CUTS
