"""The Runge-Kutta-Fehlberg integrator against exact solutions, scipy's and SUNDIALS's."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from incipient.body.rkf45 import FIFTH, FOURTH, NODES, STAGES, Integrator, Tolerances
from incipient.errors import ConvergenceError

LOOSE = Tolerances(1.0, 1e300)  # every step passes: the step stays at its largest length


def fixed(rate, step: float) -> Integrator:
    return Integrator(rate, LOOSE, largest_step=step)


def tight(rate, tolerance: float = 1e-10, **settings) -> Integrator:
    return Integrator(rate, Tolerances(tolerance, tolerance), **settings)


def solved(integrator: Integrator, t: float, y, end: float) -> np.ndarray:
    integrator.init(t, y)
    assert not integrator.advance(end)
    assert integrator.t == end
    return integrator.y


def riccati(t, y):
    """y' = -y^2 cos t, y(0) = 1: y = 1 / (1 + sin t); nonlinear and not autonomous."""
    return -(y**2) * np.cos(t)


def oscillator(t, y):
    return np.array([y[1], -y[0]])


def kepler(t, y):
    return np.concatenate([y[2:], -y[:2] / np.hypot(*y[:2]) ** 3])


def rates(errors) -> np.ndarray:
    errors = np.asarray(errors)
    return np.log2(errors[:-1] / errors[1:])


@pytest.mark.parametrize(("order", "b"), [(4, FOURTH), (5, FIFTH)])
def test_order_conditions(order: int, b: np.ndarray) -> None:
    """The conditions of rooted trees up to order four, and the quadratures of fifth order (Hairer et al. II.1)."""
    c, a = NODES, np.column_stack([STAGES, np.zeros(6)])
    np.testing.assert_allclose(a.sum(axis=1), c, atol=1e-15)
    for power in range(order):
        assert b @ c**power == pytest.approx(1 / (power + 1), abs=1e-15)
    assert b @ a @ c == pytest.approx(1 / 6, abs=1e-15)
    assert b @ (c * (a @ c)) == pytest.approx(1 / 8, abs=1e-15)
    assert b @ a @ c**2 == pytest.approx(1 / 12, abs=1e-15)
    assert b @ a @ a @ c == pytest.approx(1 / 24, abs=1e-15)


def test_convergence_order() -> None:
    errors = []
    for count in (8, 16, 32, 64):
        y = solved(fixed(riccati, 1.0 / count), 0.0, [1.0], 1.0)
        errors.append(abs(y[0] - 1 / (1 + np.sin(1.0))))
    # At 64 steps the next term of the error makes 0.11 of an order.
    assert rates(errors)[-1] == pytest.approx(5, abs=0.15)


def test_the_error_is_proportional_to_the_tolerance() -> None:
    tolerances = 10.0 ** -np.arange(4, 11)
    exact = [np.cos(10), -np.sin(10)]
    errors = [
        np.abs(solved(tight(oscillator, one), 0.0, [1.0, 0.0], 10.0) - exact).max()
        for one in tolerances
    ]
    slope = np.polyfit(np.log10(tolerances), np.log10(errors), 1)[0]
    assert slope == pytest.approx(1.0, abs=0.05)
    assert (errors < 30 * tolerances).all()


def test_a_quartic_is_exact_in_a_step() -> None:
    """And the error estimate says so: one step is enough."""
    integrator = tight(lambda t, y: np.array([5 * t**3 - 2 * t]))
    assert solved(integrator, 0.0, [1.0], 2.0)[0] == pytest.approx(1 + 5 / 4 * 16 - 4, rel=1e-14)
    assert integrator.statistics.steps == 1


@pytest.mark.parametrize(
    ("rate", "start", "end", "invariant", "near"),
    [
        # x - log x + y - log y of x' = x (1 - y), y' = y (x - 1)
        (
            lambda t, y: np.array([y[0] * (1 - y[1]), y[1] * (y[0] - 1)]),
            [0.5, 2.0],
            50.0,
            lambda y: (y - np.log(y)).sum(),
            1e-8,
        ),
        # The energy of an orbit of semi-axis 1
        (
            kepler,
            [0.4, 0.0, 0.0, 2.0],
            4 * np.pi,
            lambda y: 0.5 * y[2:] @ y[2:] - 1 / np.hypot(*y[:2]),
            1e-9,
        ),
    ],
)
def test_invariants_are_kept(rate, start, end, invariant, near) -> None:
    y = solved(tight(rate, 1e-11), 0.0, start, end)
    assert invariant(y) == pytest.approx(invariant(np.array(start)), abs=near)


def test_a_stiff_decay_stays_stable() -> None:
    """y' = -1000 (y - cos t): steps are held at the bound of stability (about 3.7 / 1000 for order 5) or below."""
    integrator = Integrator(lambda t, y: -1000 * (y - np.cos(t)), Tolerances(1e-5, 1e-5))
    exact = (1e6 * np.cos(2.0) + 1e3 * np.sin(2.0)) / (1e6 + 1)
    assert solved(integrator, 0.0, [2.0], 2.0)[0] == pytest.approx(exact, abs=2e-5)
    assert integrator.statistics.steps < 1500


def test_vector_of_absolute_tolerances() -> None:
    """A component with a coarse absolute tolerance does not shorten the steps; one with a fine one does."""

    def two(t, y):
        return np.array([np.cos(t), 40 * np.cos(40 * t)])

    steps = []
    for absolute in ([1e-8, 1e2], [1e2, 1e-8]):
        integrator = Integrator(two, Tolerances(0.0, np.array(absolute)), largest_step=1.0)
        y = solved(integrator, 0.0, [0.0, 0.0], 3.0)
        exact = np.array([np.sin(3.0), np.sin(120.0)])
        assert (np.abs(y - exact) < 10 * np.array(absolute)).all()
        steps.append(integrator.statistics.steps)
    assert steps[1] > 5 * steps[0]


def test_dense_output_order() -> None:
    """The error within one step falls with h^6, as that of the step, and both ends are those of the step."""
    errors = []
    for h in (0.8, 0.4, 0.2, 0.1):
        integrator = fixed(oscillator, h)
        integrator.init(0.0, [1.0, 0.0])
        integrator.advance(h)
        inner = np.linspace(0.0, h, 41)
        exact = np.array([np.cos(inner), -np.sin(inner)]).T
        dense = np.array([integrator.interpolate(t) for t in inner])
        np.testing.assert_array_equal(dense[[0, -1]], [[1.0, 0.0], integrator.y])
        errors.append(np.abs(dense - exact).max())
    assert rates(errors)[-1] == pytest.approx(6, abs=0.05)
    with pytest.raises(ValueError, match="not within the last step"):
        integrator.interpolate(-0.1)


def test_a_root_counts_once_and_only_where_the_function_falls() -> None:
    """cos t falls through zero at pi/2 and 5 pi/2, and rises at 3 pi/2; -sin t is zero at the start."""
    integrator = tight(oscillator)
    integrator.init(0.0, [1.0, 0.0])
    for time in (0.5 * np.pi, 2.5 * np.pi, 4.5 * np.pi):
        assert integrator.advance(20.0, lambda t, y: y[0])
        assert integrator.t == pytest.approx(time, rel=1e-9)
    assert not integrator.advance(20.0, lambda t, y: y[0] + 2.0)
    integrator.init(0.0, [1.0, 0.0])
    assert integrator.advance(10.0, lambda t, y: y[1])
    assert integrator.t == pytest.approx(2 * np.pi, rel=1e-9)


def test_roots_are_as_accurate_as_the_steps() -> None:
    """1/(1 + sin t) is 0.7 at arcsin(3/7); impacts of a ball dropped from 1 that keeps half of its velocity."""
    integrator = tight(riccati, 1e-11)
    integrator.init(0.0, [1.0])
    assert integrator.advance(1.0, lambda t, y: y[0] - 0.7)
    assert integrator.t == pytest.approx(np.arcsin(3 / 7), rel=1e-9)
    assert integrator.y[0] == pytest.approx(0.7, rel=1e-14)
    ball = tight(lambda t, y: np.array([y[1], -9.81]))
    ball.init(0.0, [1.0, 0.0])
    for bounce in range(1, 4):
        assert ball.advance(10.0, lambda t, y: y[0])
        exact = np.sqrt(2 / 9.81) * (1 + 2 * sum(0.5**k for k in range(1, bounce)))
        assert ball.t == pytest.approx(exact, rel=1e-14)
        assert abs(ball.y[0]) < 1e-13
        ball.init(ball.t, [ball.y[0], -0.5 * ball.y[1]])


def test_statistics() -> None:
    """Six evaluations a step (the last one begins the next), five a failure, one at the start."""
    calls = []

    def counted(t, y):
        calls.append(t)
        return kepler(t, y)

    integrator = tight(counted, 1e-8)
    integrator.init(0.0, [0.4, 0.0, 0.0, 2.0])
    integrator.advance(10.0)
    s = integrator.statistics
    assert s.evaluations == len(calls) == 6 * s.steps + 5 * s.error_test_failures + 1
    assert s.error_test_failures < 0.2 * s.steps and s.next_step > 0.0


def test_a_step_cut_short_to_land_keeps_the_length_that_was_meant() -> None:
    integrator = tight(oscillator, 1e-6)
    integrator.init(0.0, [1.0, 0.0])
    integrator.advance(5.0)
    meant, steps, t = integrator.statistics.next_step, integrator.statistics.steps, integrator.t
    integrator.advance(t + 1e-3 * meant)
    assert integrator.t == t + 1e-3 * meant
    assert integrator.statistics.next_step >= meant
    integrator.advance(integrator.t)  # no step to take
    assert integrator.statistics.steps == steps + 1


def test_rates_that_are_not_finite_shorten_the_step() -> None:
    """sqrt(1 - t) does not exist beyond 1: steps that reach there are refused."""

    def edge(t, y):
        with np.errstate(invalid="ignore"):
            return np.array([np.sqrt(1 - t)])

    integrator = tight(edge)
    integrator.init(0.0, [0.0])
    integrator.advance(0.99)
    assert integrator.y[0] == pytest.approx(2 / 3 * (1 - 0.01**1.5), rel=1e-8)
    with pytest.raises(ConvergenceError, match="too small"):
        integrator.advance(1.5)
    assert 0.99 < integrator.t <= 1.0  # the last good state is kept


def test_singular_solutions_stop_by_name() -> None:
    integrator = tight(lambda t, y: y**2)  # 1 / (1 - t)
    integrator.init(0.0, [1.0])
    with pytest.raises(ConvergenceError), np.errstate(over="ignore", invalid="ignore"):
        integrator.advance(2.0)
    assert integrator.t == pytest.approx(1.0, abs=1e-6)
    with pytest.raises(ConvergenceError, match="3 steps"):
        solved(tight(oscillator, 1e-12, max_steps=3), 0.0, [1.0, 0.0], 100.0)
    with pytest.raises(ConvergenceError, match="initial time"):
        tight(lambda t, y: y * np.nan).init(0.0, [1.0])


@pytest.mark.parametrize("tolerance", [1e-5, 1e-9])
def test_against_scipy(tolerance: float) -> None:
    """Near scipy's RK45, whose pair has smaller error constants, for a like number of evaluations.

    The reference is scipy's DOP853 at 1e-13.
    """
    start, end = [0.4, 0.0, 0.0, 2.0], 20.0
    reference = solve_ivp(kepler, (0, end), start, "DOP853", rtol=1e-13, atol=1e-13).y[:, -1]
    other = solve_ivp(kepler, (0, end), start, "RK45", rtol=tolerance, atol=tolerance)
    integrator = tight(kepler, tolerance)
    error = np.abs(solved(integrator, 0.0, start, end) - reference).max()
    assert error < 3 * np.abs(other.y[:, -1] - reference).max()
    assert integrator.statistics.evaluations < 1.5 * other.nfev


@pytest.mark.slow
@pytest.mark.parametrize("tolerance", [1e-6, 1e-8, 1e-10])
def test_against_sundials(tolerance: float) -> None:
    """CVODE (Adams) with the same tolerances and event, through scikit-SUNDAE: the same answer to the tolerance."""
    cvode = pytest.importorskip("sksundae.cvode")

    def into(t, y, yp):
        yp[:] = kepler(t, y)

    def crossing(t, y, events):
        events[0] = y[1]

    crossing.terminal, crossing.direction = [True], [-1]
    theirs = cvode.CVODE(
        into,
        method="Adams",
        rtol=tolerance,
        atol=tolerance,
        eventsfn=crossing,
        num_events=1,
        max_num_steps=50_000,
    ).solve(np.array([0.0, 20.0]), np.array([0.4, 0.0, 0.0, 2.0]))
    integrator = tight(kepler, tolerance)
    integrator.init(0.0, [0.4, 0.0, 0.0, 2.0])
    assert integrator.advance(20.0, lambda t, y: y[1])
    # At half the period pi, where the body is farthest (-1.6) and slowest (-0.5).
    exact = np.array([-1.6, 0.0, 0.0, -0.5])
    ours = [abs(integrator.t - np.pi), np.abs(integrator.y - exact).max()]
    cvodes = [
        abs(float(np.ravel(theirs.t_events)[0]) - np.pi),
        np.abs(np.ravel(theirs.y_events) - exact).max(),
    ]
    print(
        f"tolerance {tolerance}: ours {ours} {integrator.statistics.evaluations}, CVODE {cvodes} {theirs.nfev}"
    )
    assert max(ours) < max(100 * tolerance, max(cvodes))
    assert max(cvodes) < 1e4 * tolerance
