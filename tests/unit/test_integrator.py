"""The Runge-Kutta-Fehlberg integrator against exact solutions, scipy's and SUNDIALS's."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from incipient.body.fehlberg import NODES, STAGES, WEIGHTS
from incipient.body.integrator import Event, Integrator, Outcome, Tolerances
from incipient.errors import ConvergenceError

LOOSE = Tolerances(1.0, 1e300)  # every step passes: the step stays at its largest length


def fixed(rate, step: float, order: int = 5, **settings) -> Integrator:
    return Integrator(rate, LOOSE, first_step=step, largest_step=step, order=order, **settings)


def tight(rate, tolerance: float = 1e-10, **settings) -> Integrator:
    return Integrator(rate, Tolerances(tolerance, tolerance), **settings)


def solved(integrator: Integrator, t: float, y, end: float) -> np.ndarray:
    integrator.init(t, y)
    assert integrator.advance(end).outcome is Outcome.END
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


@pytest.mark.parametrize("order", [4, 5])
def test_order_conditions(order: int) -> None:
    """The conditions of rooted trees up to order four, and the quadratures of fifth order (Hairer et al. II.1)."""
    b, c, a = WEIGHTS[order], NODES, np.column_stack([STAGES, np.zeros(6)])
    np.testing.assert_allclose(a.sum(axis=1), c, atol=1e-15)
    for power in range(order):
        assert b @ c**power == pytest.approx(1 / (power + 1), abs=1e-15)
    assert b @ a @ c == pytest.approx(1 / 6, abs=1e-15)
    assert b @ (c * (a @ c)) == pytest.approx(1 / 8, abs=1e-15)
    assert b @ a @ c**2 == pytest.approx(1 / 12, abs=1e-15)
    assert b @ a @ a @ c == pytest.approx(1 / 24, abs=1e-15)


@pytest.mark.parametrize("order", [4, 5])
def test_convergence_order(order: int) -> None:
    errors = []
    for count in (8, 16, 32, 64):
        y = solved(fixed(riccati, 1.0 / count, order), 0.0, [1.0], 1.0)
        errors.append(abs(y[0] - 1 / (1 + np.sin(1.0))))
    # At 64 steps the next term of the error makes 0.11 of an order.
    assert rates(errors)[-1] == pytest.approx(order, abs=0.15)


@pytest.mark.parametrize("order", [4, 5])
def test_error_proportional_to_tolerance(order: int) -> None:
    """The error of a step is held below the tolerance, so that of the whole goes with its power order / 5."""
    tolerances = 10.0 ** -np.arange(4, 11)
    errors = [
        np.abs(
            solved(tight(oscillator, tol, order=order), 0.0, [1.0, 0.0], 10.0)
            - [np.cos(10), -np.sin(10)]
        ).max()
        for tol in tolerances
    ]
    slope = np.polyfit(np.log10(tolerances), np.log10(errors), 1)[0]
    assert slope == pytest.approx(order / 5, abs=0.05)
    assert (errors < 30 * tolerances ** (order / 5)).all()


def test_polynomials_are_exact() -> None:
    """A quartic is integrated without error by both orders: one step, and the error estimate says so."""
    for order in (4, 5):
        integrator = tight(lambda t, y: np.array([5 * t**3 - 2 * t]), order=order, first_step=2.0)
        y = solved(integrator, 0.0, [1.0], 2.0)
        assert y[0] == pytest.approx(1 + 5 / 4 * 16 - 4, rel=1e-14)
        assert integrator.statistics.steps == 1


def test_lotka_volterra_keeps_its_invariant() -> None:
    """x - log x + y - log y of x' = x (1 - y), y' = y (x - 1) is constant."""
    y = solved(
        tight(lambda t, y: np.array([y[0] * (1 - y[1]), y[1] * (y[0] - 1)])), 0.0, [0.5, 2.0], 50.0
    )
    assert (y - np.log(y)).sum() == pytest.approx((2.5 - np.log(1.0)), abs=1e-8)


def test_kepler_orbit() -> None:
    """Eccentricity 0.6, semi-axis 1: energy -1/2, and back at the start after 2 pi; steps follow the speed."""
    integrator = tight(kepler, 1e-11)
    y = solved(integrator, 0.0, [0.4, 0.0, 0.0, 2.0], 4 * np.pi)
    assert 0.5 * (y[2:] @ y[2:]) - 1 / np.hypot(*y[:2]) == pytest.approx(-0.5, abs=1e-9)
    np.testing.assert_allclose(y, [0.4, 0.0, 0.0, 2.0], atol=1e-7)
    sizes = np.array(integrator.statistics.step_sizes)
    assert sizes.max() > 4 * sizes[5:-1].min()


def test_stiff_decay_stays_stable() -> None:
    """y' = -1000 (y - cos t): steps are held at the bound of stability (about 3.7 / 1000 for order 5) or below."""
    integrator = Integrator(lambda t, y: -1000 * (y - np.cos(t)), Tolerances(1e-5, 1e-5))
    y = solved(integrator, 0.0, [2.0], 2.0)
    exact = (1e6 * np.cos(2.0) + 1e3 * np.sin(2.0)) / (1e6 + 1)
    assert y[0] == pytest.approx(exact, abs=2e-5)
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


def test_backwards_returns_to_the_start() -> None:
    integrator = tight(kepler, 1e-11)
    y = solved(integrator, 0.0, [0.4, 0.0, 0.0, 2.0], 3.0).copy()
    assert integrator.advance(0.0).outcome is Outcome.END
    np.testing.assert_allclose(integrator.y, [0.4, 0.0, 0.0, 2.0], atol=1e-8)
    assert min(integrator.statistics.step_sizes) < 0.0
    np.testing.assert_allclose(
        solved(tight(kepler, 1e-11), 3.0, y, 0.0), [0.4, 0.0, 0.0, 2.0], atol=1e-8
    )


@pytest.mark.parametrize("order", [4, 5])
def test_dense_output_order(order: int) -> None:
    """The error within one step falls with h^5 (fourth order) and h^6 (fifth), as that of the step."""
    errors = []
    for h in (0.8, 0.4, 0.2, 0.1):
        integrator = fixed(oscillator, h, order)
        integrator.init(0.0, [1.0, 0.0])
        integrator.step()
        inner = np.linspace(0.0, h, 41)
        errors.append(
            max(np.abs(integrator.interpolate(t) - [np.cos(t), -np.sin(t)]).max() for t in inner)
        )
    assert rates(errors)[-1] == pytest.approx(order + 1, abs=0.05)


def test_dense_output_joins_the_steps() -> None:
    integrator = tight(riccati, 1e-9)
    integrator.init(0.0, [1.0])
    for _ in range(5):
        start, y = integrator.t, integrator.y.copy()
        integrator.step()
        np.testing.assert_allclose(integrator.interpolate(start), y, rtol=1e-14)
        np.testing.assert_allclose(integrator.interpolate(integrator.t), integrator.y, rtol=0)
        near = integrator.t - 1e-9 * (integrator.t - start)
        np.testing.assert_allclose(integrator.interpolate(near), integrator.y, rtol=1e-9)
        middle = 0.5 * (start + integrator.t)
        assert integrator.interpolate(middle)[0] == pytest.approx(
            1 / (1 + np.sin(middle)), rel=1e-8
        )
    with pytest.raises(ValueError, match="not within the last step"):
        integrator.interpolate(0.0)


def falling(t, y):
    return np.array([y[1], -9.81])


def test_bouncing_ball() -> None:
    """Dropped from 1: on the ground at sqrt(2/g); restitution 0.5 puts the next impact one sqrt(2/g) later."""
    integrator = tight(falling, events=[Event(lambda t, y: y[0], -1)])
    integrator.init(0.0, [1.0, 0.0])
    for bounce in range(1, 4):
        status = integrator.advance(10.0)
        assert status.outcome is Outcome.EVENT and status.events == (0,)
        exact = np.sqrt(2 / 9.81) * (1 + 2 * sum(0.5**k for k in range(1, bounce)))
        assert status.time == integrator.t == pytest.approx(exact, rel=4e-15)
        assert abs(integrator.y[0]) < 1e-14
        integrator.reinit(integrator.t, [integrator.y[0], -0.5 * integrator.y[1]])


def test_going_on_after_an_event_does_not_find_it_again() -> None:
    integrator = tight(oscillator, events=[Event(lambda t, y: y[0])])
    integrator.init(0.0, [1.0, 0.0])
    times = [integrator.advance(20.0).time for _ in range(7)]
    np.testing.assert_allclose(times, [*((np.arange(6) + 0.5) * np.pi), 20.0], rtol=1e-9)


@pytest.mark.parametrize(("direction", "first"), [(0, 0.5), (-1, 0.5), (1, 1.5)])
@pytest.mark.parametrize("way", [1, -1])
def test_direction_of_events(direction: int, first: float, way: int) -> None:
    """cos t falls through zero at pi/2 and rises at 3 pi/2, in either way of integration."""
    integrator = tight(oscillator, events=[Event(lambda t, y: y[0], direction)])
    integrator.init(0.0, [1.0, 0.0])
    assert integrator.advance(way * 10.0).outcome is Outcome.EVENT
    assert integrator.t == pytest.approx(way * first * np.pi, rel=1e-9)


def test_event_at_the_start_is_none() -> None:
    integrator = tight(oscillator, events=[Event(lambda t, y: y[1])])
    integrator.init(0.0, [1.0, 0.0])
    integrator.advance(10.0)
    assert integrator.t == pytest.approx(np.pi, rel=1e-9)


def test_simultaneous_and_later_events() -> None:
    """Both functions vanish at t = 1; the third later in the same step; the fourth is noted only."""
    events = [
        Event(lambda t, y: y[0] - 1),
        Event(lambda t, y: 3 - 3 * y[0]),
        Event(lambda t, y: y[0] - 1.1),
        Event(lambda t, y: y[0] - 0.5, terminal=False),
    ]
    integrator = tight(lambda t, y: np.ones(1), first_step=5.0, events=events)
    integrator.init(0.0, [0.0])
    status = integrator.advance(5.0)
    assert status.events == (0, 1) and status.time == pytest.approx(1.0, rel=1e-15)
    assert [o.event for o in integrator.occurrences] == [3, 0, 1]
    assert integrator.occurrences[0].time == pytest.approx(0.5, rel=1e-15)
    assert integrator.occurrences[0].y[0] == pytest.approx(0.5, rel=1e-15)
    assert integrator.advance(5.0).events == (2,)
    assert integrator.t == pytest.approx(1.1, rel=1e-15)
    assert integrator.advance(5.0).outcome is Outcome.END


def test_event_is_as_accurate_as_the_step() -> None:
    """Where y = 1/(1 + sin t) is 0.7, against its exact time arcsin(3/7)."""
    integrator = tight(riccati, 1e-11, events=[Event(lambda t, y: y[0] - 0.7)])
    integrator.init(0.0, [1.0])
    integrator.advance(1.0)
    assert integrator.t == pytest.approx(np.arcsin(3 / 7), rel=1e-9)
    assert integrator.y[0] == pytest.approx(0.7, rel=1e-14)


def test_reinit_repeats_to_the_last_bit() -> None:
    integrator = tight(kepler, 1e-9)
    first = solved(integrator, 0.0, [0.4, 0.0, 0.0, 2.0], 2.0).copy()
    statistics = integrator.statistics
    integrator.reinit(0.0, [0.4, 0.0, 0.0, 2.0])
    assert integrator.statistics.steps == 0
    integrator.advance(2.0)
    np.testing.assert_array_equal(integrator.y, first)
    assert integrator.statistics == statistics


def test_statistics() -> None:
    """Six evaluations a step (the last one begins the next), five a failure, one at the start, one to estimate."""
    calls = []

    def counted(t, y):
        calls.append(t)
        return kepler(t, y)

    integrator = tight(counted, 1e-8)
    integrator.init(0.0, [0.4, 0.0, 0.0, 2.0])
    integrator.advance(10.0)
    s = integrator.statistics
    assert s.evaluations == len(calls) == 6 * s.steps + 5 * s.error_test_failures + 2
    assert s.steps == len(s.step_sizes) and s.last_step == s.step_sizes[-1] and s.next_step > 0.0
    assert sum(s.step_sizes) == pytest.approx(10.0, rel=1e-12)
    assert s.error_test_failures < 0.2 * s.steps
    integrator.interpolate(integrator.t - 0.5 * s.last_step)
    assert s.evaluations == len(calls) == 6 * s.steps + 5 * s.error_test_failures + 5


def test_step_stops_where_told_and_keeps_its_length() -> None:
    integrator = tight(oscillator, 1e-6)
    integrator.init(0.0, [1.0, 0.0])
    for _ in range(5):
        integrator.step()
    meant, t = integrator.statistics.next_step, integrator.t
    assert integrator.step(t + 1e-3 * meant).outcome is Outcome.END
    assert integrator.t == t + 1e-3 * meant
    assert integrator.statistics.next_step >= meant
    assert integrator.step(integrator.t).outcome is Outcome.END  # no step to take
    assert integrator.statistics.steps == 6


def test_rates_that_are_not_finite_shorten_the_step() -> None:
    """sqrt(1 - t) does not exist beyond 1; a first step of 10 is refused, and the end at 0.99 is reached."""

    def edge(t, y):
        with np.errstate(invalid="ignore"):
            return np.array([np.sqrt(1 - t)])

    integrator = tight(edge, first_step=0.98 * 10)
    integrator.init(0.0, [0.0])
    integrator.step()
    assert integrator.statistics.error_test_failures > 0
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


def test_wrong_arguments() -> None:
    with pytest.raises(ValueError, match="tolerances"):
        Tolerances(0.0, 0.0)
    with pytest.raises(ValueError, match="order"):
        tight(oscillator, order=3)
    with pytest.raises(ValueError, match="first step"):
        tight(oscillator, first_step=-1.0)
    with pytest.raises(ValueError, match="init"):
        tight(oscillator).step()
    with pytest.raises(ValueError, match="finite"):
        tight(oscillator).init(0.0, [np.inf, 0.0])
    with pytest.raises(ValueError, match="components"):
        tight(oscillator).init(0.0, [1.0, 0.0, 0.0])
    with pytest.raises(ValueError, match="components"):
        Integrator(oscillator, Tolerances(0.0, np.ones(3))).init(0.0, [1.0, 0.0])


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
    integrator = tight(kepler, tolerance, events=[Event(lambda t, y: y[1], -1)])
    integrator.init(0.0, [0.4, 0.0, 0.0, 2.0])
    assert integrator.advance(20.0).outcome is Outcome.EVENT
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
