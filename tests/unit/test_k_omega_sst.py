"""k and omega by themselves, in given velocities, against exact solutions, and developed flow in one dimension."""

import dolfinx
import numpy as np
import pytest
import ufl
from domains import unit_box
from one_dimensional import k_omega_channel
from scipy.integrate import solve_ivp
from test_turbulence import rectangle, steady, through_time, uniform
from turbulent import k_omega

from incipient.fluid.transient import backward_difference
from incipient.forms.k_omega_sst import EXPONENT, KOmegaSST
from incipient.mesh.sampling import sample
from incipient.mesh.wall_distance import distances
from incipient.turbulence.developed import developed, of_discharge
from incipient.turbulence.wall_law import WallLaw

BETA, GAMMA, BETA_STAR = 0.0828, 0.44, 0.09  # of the outer model, which holds far from walls


def far_from_walls(k, omega):
    return k_omega(rectangle((0, 0), (1, 1), (1, 1)), uniform(k, omega))


def test_homogeneous_turbulence_decays_as_it_must():
    """omega = w0/(1 + beta w0 t), k = k0 (1 + beta w0 t)^(-beta*/beta) (exact); second order in the step."""
    errors = []
    for steps in (50, 100):
        times = np.expm1(np.linspace(0.0, np.log(1001.0), steps + 1))
        with far_from_walls(2.0, 3.0) as fields:
            fields.carried_by(dolfinx.fem.Constant(fields.domain.mesh, (0.0, 0.0)), 0.01)
            k, omega = through_time(fields, times).T
        age = 1 + BETA * 3.0 * times[1:]
        exact = 2.0 * age ** (-BETA_STAR / BETA), 3.0 / age
        errors.append(max(np.abs(k / exact[0] - 1).max(), np.abs(omega / exact[1] - 1).max()))
    assert errors[1] < 1e-2 and errors[0] / errors[1] > 3.0


def test_homogeneous_shear_follows_its_equations():
    """By scipy in k and omega themselves, at second order; in the end omega = S (gamma/beta)^(1/2) (exact)."""
    shear, start = 2.0, (1.0, 0.5)

    def rates(time, state):
        k, omega = state
        made = min(k / omega * shear**2, 10 * BETA_STAR * k * omega)
        return made - BETA_STAR * k * omega, GAMMA * shear**2 - BETA * omega**2

    errors = []
    for steps in (160, 320):
        times = np.expm1(np.linspace(0.0, np.log(21.0), steps + 1))
        exact = solve_ivp(rates, (0.0, 20.0), start, rtol=1e-9, atol=1e-12, t_eval=times).y[:, 1:]
        with far_from_walls(*start) as fields:
            x = ufl.SpatialCoordinate(fields.domain.mesh)
            fields.carried_by(ufl.as_vector([shear * x[1], 0]), 0.01)
            found = through_time(fields, times).T
        errors.append(np.abs(np.log(found / exact)).max())
    assert found[1, -1] == pytest.approx(shear * np.sqrt(GAMMA / BETA), rel=1e-4)
    assert errors[1] < 3e-3 and errors[0] / errors[1] > 3.0


@pytest.mark.parametrize("distance", [0.1, 1.0])
def test_next_to_a_smooth_wall_only_molecules_matter(distance):
    """omega = 6 nu/(0.075 y^2) and k as y^n, n (n - 1) = 6 0.09/0.075, solve the equations at rest (exact).

    They are given on top and at the sides; k is so small that there are no eddies. The wall is below the mesh.
    """

    def exact(x):
        y = x[1]
        return np.array([np.log(1e-14) + EXPONENT * np.log(y), np.log(6 * 0.01 / 0.075 / y**2)])

    assert pytest.approx(7.2) == EXPONENT * (EXPONENT - 1)
    errors = []
    for cells in (8, 16):
        domain = rectangle((0, distance), (1, 1 + distance), (3, cells))
        given = ("top", "left", "right")
        with k_omega(domain, exact, given, {"bottom": distance}) as fields:
            fields.state.x.array[:] += 0.2 * np.sin(np.arange(len(fields.state.x.array)))
            fields.carried_by(dolfinx.fem.Constant(domain.mesh, (0.0, 0.0)), 0.01)
            steady(fields)
            places = np.column_stack([np.full(30, 0.45), np.linspace(0.0, 1.0, 30) + distance])
            errors.append(np.abs(sample(fields.state, places) - exact(places.T).T).max())
    print(errors)
    assert errors[1] < 0.1 * distance**-0.5 and errors[0] / errors[1] > 3.0


def test_the_logarithmic_layer_is_a_solution_next_to_a_far_wall():
    """U = ln(y)/kappa, k = 1/sqrt(beta*), omega = 1/(sqrt(beta*) kappa y) solve the inner model (Menter 1994, exact).

    kappa^2 = (beta/beta* - gamma) sqrt(beta*)/sigma_omega = 0.1667. They are given but at the bottom, whose wall is one
    away.
    """
    kappa = np.sqrt((0.075 / 0.09 - 5.0 / 9.0) * 0.3 / 0.5)

    def exact(x):
        return np.log([0 * x[1] + 1 / 0.3, 1 / (0.3 * kappa * x[1])])

    errors = []
    for cells in (3, 6):
        domain = rectangle((0, 1), (4, 5), (2, cells))
        given = ("top", "left", "right")
        with k_omega(domain, exact, given, {"bottom": 1.0}, viscosity=1e-9) as fields:
            fields.state.x.array[:] += 0.1 * np.sin(np.arange(len(fields.state.x.array)))
            y = ufl.SpatialCoordinate(domain.mesh)[1]
            fields.carried_by(ufl.as_vector([ufl.ln(y) / kappa, 0 * y]), 1e-9)
            steady(fields)
            places = np.column_stack([np.full(40, 2.1), np.linspace(1.0, 5.0, 40)])
            errors.append(np.abs(sample(fields.state, places) - exact(places.T).T).max())
    print(errors)
    assert errors[1] < 0.02 and errors[0] / errors[1] > 3.0


def test_next_to_a_wall_that_moves_with_the_fluid_only_molecules_matter():
    """That solution goes along with the wall, up by a fifth of the height to a top at rest: the mesh is squeezed."""
    speed, end, below, distance = 0.2, 1.0, [0.0], 0.5

    def exact(x):
        y = x[1] - below[0] + distance
        return np.array([np.log(1e-14) + EXPONENT * np.log(y), np.log(6 * 0.01 / 0.075 / y**2)])

    errors = []
    for cells in (8, 16):
        below[0] = 0.0
        domain = rectangle((0, 0), (1, 1), (3, cells))
        made = domain.mesh.geometry.x[:, 1].copy()
        given = ("top", "left", "right")
        with k_omega(domain, exact, given, {"bottom": distance}) as fields:
            height, x = fields.constant(0.0), ufl.SpatialCoordinate(domain.mesh)
            fluid = dolfinx.fem.Constant(domain.mesh, (0.0, speed))
            beside = ufl.as_vector([0, speed * (x[1] - height) / (1 - height)])
            fields.carried_by(fluid, 0.01, carrier=beside)
            past = [fields.state.x.array.copy()]
            for number in range(cells):
                below[0] = height.value = speed * end * (number + 1) / cells
                domain.mesh.geometry.x[:, 1] = below[0] + (1 - below[0]) * made
                fields.follow()
                fields.give(exact, 0.01, {}, 0.0)
                rate, _ = backward_difference(1 + (number > 0), end / cells, 1.0)
                assert fields.step(rate, (past[0], past[-1]), 1e-10) <= 1e-10
                past = [fields.state.x.array.copy(), past[0]]
            places = np.column_stack([np.full(30, 0.45), np.linspace(below[0], 1.0, 30)])
            errors.append(np.abs(sample(fields.state, places) - exact(places.T).T).max())
    print(errors)
    assert errors[1] < 0.02 and errors[0] / errors[1] > 3.0


def test_distances_from_walls_are_those_of_geometry():
    domain = rectangle((0, 0), (4, 1), (9, 7))
    places = np.random.default_rng(1).uniform((0, 0), (4, 1), (200, 2))
    x, y = places.T
    assert distances(domain, ("bottom",), places) == pytest.approx(y)
    both = np.minimum(np.minimum(y, 1 - y), x)
    assert distances(domain, ("bottom", "top", "left"), places) == pytest.approx(both)


@pytest.mark.parametrize("re_tau", [180.0, 547.0, 1000.0, 2004.0])
def test_developed_flow_is_that_of_finite_volumes(re_tau):
    """In k and omega themselves, written for the tests: the same mean velocity within 0.1%."""
    assert developed(re_tau).mean == pytest.approx(k_omega_channel(re_tau), rel=1e-3)


@pytest.mark.parametrize(("sand", "within"), [(5.0, 0.4), (11.0, 0.4), (60.0, 0.4), (1000.0, 1.1)])
def test_developed_flow_over_sand_obeys_the_law_of_rough_walls(sand, within):
    """u+ beside Nikuradse's law (as fitted by Cebeci & Bradshaw 1977), from which the smooth flow is 0.34 away."""
    found, law = developed(20000.0, sand / 20000.0), WallLaw(sand / 20000.0)
    away = [
        np.interp(y, found.heights, found.speed) - law.velocity(1.0, 1.0 / 20000.0, y)
        for y in (0.05, 0.1, 0.2)
    ]
    print(sand, away)
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


def test_developed_flow_over_fine_roughness_is_that_over_a_smooth_wall():
    """u* k_s/nu = 2, below 2.25, from which on roughness matters: heights ascend."""
    rough = developed(500.0, 0.004)
    assert rough.mean == developed(500.0).mean and (np.diff(rough.heights) > 0.0).all()


def test_developed_flow_has_the_discharge_asked_for():
    found = of_discharge(11000.0)
    assert found.re_tau * found.mean == pytest.approx(11000.0, rel=1e-5)
    assert found.speed[-1] > found.mean > 0.8 * found.speed[-1]


def test_slow_flow_is_laminar():
    """u*^2 = 3 nu V/h, with V/u* = Re_tau/3 and the surface 1.5 times as fast as the mean (exact)."""
    found = of_discharge(20.0)
    assert found.is_laminar
    assert found.re_tau == pytest.approx(np.sqrt(60.0), rel=1e-4)
    assert found.speed[-1] / found.mean == pytest.approx(1.5, rel=1e-3)


def test_in_crevices_of_a_bed_in_space_corrections_hardly_count():
    """Where eddies make 1e-6 of the viscosity a correction of ln k by ten hardly counts."""
    with k_omega(unit_box(3, 2), uniform(1.0, 1.0)) as fields:
        fields.state.x.array[0] = np.log(1e-8)
        values = np.full(len(fields.state.x.array), 1e-5)
        values[0] = 10.0
        assert fields.usual_change(values) < 1e-4
