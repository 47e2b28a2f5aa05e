"""Rigid bodies and the integrator of their motion."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import ellipj, ellipk

from incipient.body.rigidbody import MeanLoad, RigidBody
from incipient.body.rkf45 import Integrator
from incipient.body.state import BodyState, Inertia
from incipient.errors import ConvergenceError, SceneError
from incipient.geometry import Box, Disc, Ellipse, Ellipsoid, Placement, Rectangle, Sphere
from incipient.geometry.placement import rotation_of

# The rigid body of equations (331)-(336) against mechanics: projectiles, tops, drag; without mass, too.


TOP = Inertia(2.0, np.array([1.0, 2.0, 2.5]))
ASKEW = (
    Placement((0.0, 0.0, 0.0)).moved((0.0, 0.0, 0.0), [0.3, -0.8, 0.5]).quaternion
)  # an orientation like any other


def planar(mass: float, moment: float) -> Inertia:
    return Inertia(mass, np.array([moment]))


def at_rest(gdim: int) -> BodyState:
    return BodyState.at(Placement((0.0,) * gdim))


def spinning(spin) -> BodyState:
    """In space, placed askew, with a spin given in the body's axes."""
    turned = rotation_of(ASKEW).as_matrix() @ np.asarray(spin, dtype=float)
    return BodyState.at(
        Placement((0.0, 0.0, 0.0), 0.0, ASKEW), np.concatenate([np.zeros(3), turned])
    )


def converged(body: RigidBody, state: BodyState, dt: float, load, added) -> BodyState:
    """The step with its own result as the guess: where a coupling with a constant load converges to."""
    guess = body.motion(state, dt, load).end.velocities
    return body.motion(state, dt, load, added, guess).end


# Inertia -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("grain", "mass", "moments"),
    [
        (Disc(2.0), np.pi, np.pi / 2),  # m r^2 / 2
        (
            Ellipse((2.0, 1.0)),
            2 * np.pi,
            5 / 2 * np.pi,
        ),  # Fig. 1 of the paper: 251.3 and 314.2 over 40
        (Rectangle(3.0, 1.0), 3.0, 5 / 2),  # m (a^2 + b^2) / 12
        (Sphere(2.0), 4 / 3 * np.pi, 8 / 15 * np.pi * np.ones(3)),
        (Box((1.0, 2.0, 3.0)), 6.0, np.array([13, 10, 5]) / 2),
        (Ellipsoid((3.0, 2.0, 1.0)), 8 * np.pi, 8 / 5 * np.pi * np.array([5, 10, 13])),
    ],
)
def test_inertia_of_grains(grain, mass: float, moments) -> None:
    """Textbook formulas; in 3-D the axes give back the tensor."""
    inertia = Inertia.about(3.0 * grain.volume, 3.0 * np.asarray(grain.inertia), grain.gdim)
    assert inertia.mass == pytest.approx(3 * mass, rel=1e-9)
    np.testing.assert_allclose(np.sort(inertia.moments), np.sort(3 * np.ravel(moments)), rtol=1e-9)
    if grain.gdim == 3:
        tensor = inertia.matrix(np.eye(4)[0])[3:, 3:]
        np.testing.assert_allclose(tensor, 3 * np.asarray(grain.inertia))


# In the plane ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("added", [0.0, 1.0, 30.0])
def test_mean_load_is_an_impulse(added: float) -> None:
    """V(n+1) = V(n) + dt F / m and the place in the middle of the velocities, whatever the added mass."""
    body = RigidBody(planar(2.0, 0.5))
    state = BodyState.at(Placement((0.0, 0.0)), [1.0, 0.0, 2.0])
    coupled = added * np.array([[2.0, 0.5, 0.1], [0.5, 1.0, 0.2], [0.1, 0.2, 1.0]])
    end = converged(body, state, 0.5, [4.0, 1.0, 1.5], coupled)
    np.testing.assert_allclose(end.velocities, [2.0, 0.25, 3.5], rtol=1e-10)
    np.testing.assert_allclose(
        end.place, 0.25 * (state.velocity + end.velocity), rtol=1e-10, atol=1e-12
    )
    assert end.orientation[0] == pytest.approx(0.25 * (2.0 + 3.5), rel=1e-10)


@pytest.mark.parametrize("inertia", [0.0, 1.0])
@pytest.mark.parametrize(
    ("course", "exact"),
    [
        (None, np.zeros(6)),
        (
            lambda t: [np.cos(t), t, -1.0],
            [np.sin(1.5), 1.5**2 / 2, -1.5, np.cos(1.5), 1.5, -1.0],
        ),
    ],
)
def test_prescribed_motion(inertia: float, course, exact) -> None:
    """Place and angle follow the imposed velocities whatever the load, without inertia, too."""
    body = RigidBody(planar(inertia, inertia), [False] * 3, course)
    end = body.motion(at_rest(2), 1.5, [7.0, -3.0, 2.0]).end
    np.testing.assert_allclose(end.packed(), exact, rtol=1e-10)


def test_state_within_the_step_and_contact_time() -> None:
    """Dropped from 1: at sqrt(2 / g) on the ground, found within a step of 1."""
    body = RigidBody(planar(1.0, 1.0))
    motion = body.motion(BodyState.at(Placement((0.0, 1.0)), time=3.0), 1.0, [0.0, -9.81, 0.0])
    touching = motion.first(lambda state: state.place[1])
    assert touching is not None and touching.time == pytest.approx(3 + np.sqrt(2 / 9.81), rel=1e-14)
    assert touching.place[1] == pytest.approx(0.0, abs=1e-13)
    assert motion.first(lambda state: state.place[1] + 5) is None


# In space ----------------------------------------------------------------------------------------------------


def jacobi(inertia: Inertia, spin, times):
    """Spin in principal axes (n, 3) of a free top, from (w1, 0, w3) with M^2 > 2 E J2: Landau & Lifshitz, par. 37."""
    a, b, c = inertia.moments
    energy2, square = inertia.moments @ np.square(spin), np.square(inertia.moments * spin).sum()
    assert square > energy2 * b and spin[1] == 0.0
    rate = np.sqrt((c - b) * (square - energy2 * a) / (a * b * c))
    modulus = (b - a) * (energy2 * c - square) / ((c - b) * (square - energy2 * a))
    sn, cn, dn, _ = ellipj(rate * times, modulus)
    second = np.sqrt((energy2 * c - square) / (b * (c - b)))
    return np.column_stack([spin[0] * cn, second * sn, spin[2] * dn]), 4 * ellipk(modulus) / rate


@pytest.mark.parametrize(
    "spin",
    [
        (0.5, 0.0, 1.0),
        # Within 1e-3 of turning about the intermediate axis: it flips over and over (Dzhanibekov).
        pytest.param((np.sqrt(5 / 4) * 0.999, 0.0, 1.0), marks=pytest.mark.slow),
    ],
)
def test_free_asymmetric_top(spin) -> None:
    """Energy, angular momentum, unit quaternion and Jacobi's elliptic functions over three periods.

    Beside the separatrix errors grow by the ratio of the largest to the smallest distance from it, about 1e3.
    """
    body, states = RigidBody(TOP), [spinning(spin)]
    period = jacobi(TOP, np.array(spin), 0.0)[1]
    times = np.linspace(0.0, 3 * period, 61)
    for length in np.diff(times):
        states.append(body.motion(states[-1], length, np.zeros(6)).end)
    seen = np.array([state.placement.rotation.T @ state.spin for state in states])
    assert seen == pytest.approx(jacobi(TOP, np.array(spin), times)[0], abs=1e-6)
    energies = [body.kinetic_energy(state) for state in states]
    assert energies == pytest.approx([energies[0]] * 61, rel=1e-9)
    momenta = np.array([body.momentum(state)[3:] for state in states])
    assert np.abs(momenta - momenta[0]).max() < 1e-9
    norms = [np.linalg.norm(state.orientation) for state in states]
    assert norms == pytest.approx([1.0] * 61, abs=1e-15)
    # Three periods, without the zeros at both ends; the last one is zero but for round-off.
    assert np.count_nonzero(np.diff(np.sign(seen[1:-1, 1]))) == 5


@pytest.mark.parametrize("added", [0.0, 3.0, 1e3])
def test_constant_couple_in_space(added: float) -> None:
    """Euler's equations under a couple of constant direction in space: scipy's DOP853, whatever the added mass."""
    body, start, couple = RigidBody(TOP), spinning([1.0, 0.4, -0.7]), np.array([0.5, -1.0, 0.8])
    momentum = body.momentum(start)[3:]

    def rate(t, q):
        turned = rotation_of(q).as_matrix()
        spin = turned @ ((turned.T @ (momentum + t * couple)) / TOP.moments)
        return 0.5 * np.array([-spin @ q[1:], *(q[0] * spin + np.cross(spin, q[1:]))])

    q = solve_ivp(rate, (0, 0.5), start.orientation, "DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
    load = np.concatenate([[1.0, 0.0, 2.0], couple])
    end = converged(body, start, 0.5, load, added * np.diag([1, 2, 1, 1, 3, 2]))
    np.testing.assert_allclose(body.momentum(end)[3:], momentum + 0.5 * couple, rtol=1e-9)
    np.testing.assert_allclose(end.orientation, q / np.linalg.norm(q), atol=1e-9)
    np.testing.assert_allclose(end.velocity, [0.25, 0.0, 0.5], atol=1e-9)


def test_principal_axes_off_the_frame() -> None:
    """The same body described in a turned frame moves in the same way."""
    turn = rotation_of(ASKEW).as_matrix()
    ends = []
    for inertia, orientation in (
        (TOP, (1.0, 0.0, 0.0, 0.0)),
        (Inertia(2.0, TOP.moments, turn), (ASKEW[0], -ASKEW[1], -ASKEW[2], -ASKEW[3])),
    ):
        state = BodyState.at(Placement((0.0,) * 3, 0.0, orientation), [0, 0, 0, 1.0, 0.4, -0.7])
        ends.append(RigidBody(inertia).motion(state, 0.5, [0, 0, 0, 0.5, -1.0, 0.8]).end)
    np.testing.assert_allclose(ends[0].spin, ends[1].spin, rtol=1e-10)
    np.testing.assert_allclose(
        ends[0].placement.rotation @ np.eye(3), ends[1].placement.rotation @ turn, atol=1e-10
    )


def test_partly_locked_in_space() -> None:
    """No spin about x: the other momenta and the energy are kept, for the constraint does no work."""
    body = RigidBody(TOP, [True, True, True, False, True, True])
    state = body.consistent(spinning([1.0, 0.4, -0.7]))
    energy, momentum = body.kinetic_energy(state), body.momentum(state)[3:]
    for _ in range(10):
        state = body.motion(state, 0.3, np.zeros(6)).end
        assert state.spin[0] == 0.0
        np.testing.assert_allclose(body.momentum(state)[4:], momentum[1:], rtol=1e-8)
        assert body.kinetic_energy(state) == pytest.approx(energy, rel=1e-8)


@pytest.mark.parametrize("moments", [(0.0, 0.0, 0.0), (0.0, 1.0, 1.0), (1e-4, 1.0, 1.0)])
def test_without_inertia_in_space(moments) -> None:
    """No moments, and a needle: with drag the spin is that in which couple and drag balance, after two steps."""
    body = RigidBody(Inertia(0.0, np.array(moments)))
    couple, resistance = (
        np.array([0.0, 0.0, 0.0, 0.3, -0.2, 0.1]),
        np.diag([1.0, 1.0, 1.0, 1e3, 2e3, 1.5e3]),
    )
    state = march(body, at_rest(3), 3, 0.1, lambda t, u: couple - resistance @ u, resistance)[-1]
    np.testing.assert_allclose(
        state.velocities, np.linalg.solve(resistance, couple), rtol=2e-2, atol=1e-15
    )


# With the fluid's backward difference ------------------------------------------------------------------------


def march(body, state, steps, dt, load, resistance, tolerance=1e-12, most=20):
    """The coupling in small: load(t, U), its derivative -resistance, iterated to a tolerance; all states."""
    lengths = np.full(steps, dt) if np.isscalar(dt) else np.asarray(dt)
    states, mean = [state], MeanLoad()
    for length in lengths:
        guess, t = state.velocities, state.time + length
        for _ in range(most):
            force = mean.mean(load(t, guess), length)
            end = body.motion(state, length, force, mean.added(resistance, length), guess).end
            change, guess = np.abs(end.velocities - guess).max(), end.velocities
            if change <= tolerance * max(np.abs(guess).max(), np.abs(state.velocities).max()):
                break
        else:
            pytest.fail(f"the coupling needs more than {most} iterations")
        mean, state = mean.accept(load(t, guess), length), end
        states.append(state)
    return states


@pytest.mark.parametrize("mass", [0.0, 0.01, 1.0, 1e6])
def test_drag_converges_at_once_and_is_bdf2(mass: float) -> None:
    """F = f - K U with its exact derivative: two iterations (the second only finds no change), any mass.

    The pair is BDF2 with variable steps to round-off, started by BDF1, by its own three-term formula.
    """
    resistance = np.array([[3.0, 0.5, 0.1], [0.5, 2.0, 0.2], [0.1, 0.2, 1.0]])
    inertia, lengths = (
        np.diag([mass, mass, 0.3 * mass]),
        np.array([0.1, 0.1, 0.2, 0.15, 0.05, 0.05, 0.1]),
    )

    def drive(t):
        return np.array([np.sin(3 * t), 1.0, np.cos(t)])

    body = RigidBody(planar(mass, 0.3 * mass))
    states = march(
        body,
        at_rest(2),
        7,
        lengths,
        lambda t, u: drive(t) - resistance @ u,
        resistance,
        1e-11,
        most=2,
    )
    old, older, t, before = np.zeros(3), np.zeros(3), 0.0, None
    for length, state in zip(lengths, states[1:], strict=True):
        r = 0.0 if before is None else length / before
        a0, a1, a2 = (1 + 2 * r) / (1 + r), -(1 + r), r**2 / (1 + r)
        t, before = t + length, length
        right = length * drive(t) - inertia @ (a1 * old + a2 * older)
        old, older = np.linalg.solve(a0 * inertia + length * resistance, right), old
        np.testing.assert_allclose(
            state.velocities, old, rtol=1e-11, atol=1e-13 * np.abs(old).max()
        )


# Errors ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("inertia", "spin", "added", "match"),
    [
        (planar(0.0, 1.0), None, np.zeros((3, 3)), "velocity along x"),
        (planar(1.0, 0.0), None, np.diag([1.0, 1.0, 0.0]), "spin"),
        (Inertia(1.0, np.array([0.0, 1.0, 1.0])), [0.0, 0.1, 0.0], np.zeros((6, 6)), "spin"),
    ],
)
def test_nothing_resists(inertia, spin, added, match) -> None:
    state = at_rest(2) if spin is None else spinning(spin)
    with pytest.raises(SceneError, match=match):
        RigidBody(inertia).motion(state, 0.1, np.zeros(len(added)), added)


def test_locked_velocities_need_no_mass() -> None:
    RigidBody(planar(0.0, 1.0), [False, False, True]).motion(at_rest(2), 0.1, np.zeros(3))


def test_corrections_run_out(monkeypatch) -> None:
    """A body that turns several times in a step still converges; were it not to, it would say so."""
    body, wild = RigidBody(TOP), spinning([30.0, 20.0, 10.0])
    args = (0.2, np.ones(6), 10.0 * np.diag(np.arange(1.0, 7.0)), np.ones(6))
    gained = body.momentum(body.motion(wild, *args).end)[3:] - body.momentum(wild)[3:]
    assert np.linalg.norm(gained) > 1.0
    with pytest.raises(ConvergenceError, match="not finite"):
        body.motion(at_rest(3), 0.1, np.full(6, np.nan))
    monkeypatch.setattr("incipient.body.rigidbody.MAX_ITERATIONS", 2)
    with pytest.raises(ConvergenceError, match="turns too far"):
        body.motion(wild, *args)


# The Runge-Kutta-Fehlberg integrator against exact solutions, scipy's and SUNDIALS's.


def tight(rate, tolerance: float = 1e-10) -> Integrator:
    return Integrator(rate, tolerance, tolerance)


def solved(integrator: Integrator, t: float, y, end: float) -> np.ndarray:
    integrator.init(t, y)
    assert not integrator.advance(end)
    assert integrator.t == end
    return integrator.y


def oscillator(t, y):
    return np.array([y[1], -y[0]])


def kepler(t, y):
    return np.concatenate([y[2:], -y[:2] / np.hypot(*y[:2]) ** 3])


def test_convergence_order() -> None:
    """Of Riccati's equation y' = -y^2 cos t, y(0) = 1: y = 1 / (1 + sin t); nonlinear and not autonomous."""
    errors = []
    for count in (8, 16, 32, 64):
        # Every step passes.
        integrator = Integrator(lambda t, y: -(y**2) * np.cos(t), 1.0, 1e300)
        integrator.init(0.0, [1.0])
        for step in range(count):
            integrator.advance((step + 1) / count)
        errors.append(abs(integrator.y[0] - 1 / (1 + np.sin(1.0))))
    # At 64 steps the next term of the error makes 0.11 of an order.
    assert np.log2(errors[-2] / errors[-1]) == pytest.approx(5, abs=0.15)


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


def test_singular_solutions_stop_by_name(monkeypatch) -> None:
    integrator = tight(lambda t, y: y**2)  # 1 / (1 - t)
    integrator.init(0.0, [1.0])
    with pytest.raises(ConvergenceError), np.errstate(over="ignore", invalid="ignore"):
        integrator.advance(2.0)
    assert integrator.t == pytest.approx(1.0, abs=1e-6)
    monkeypatch.setattr("incipient.body.rkf45.MAX_STEPS", 3)
    with pytest.raises(ConvergenceError, match="3 steps"):
        solved(tight(oscillator, 1e-12), 0.0, [1.0, 0.0], 100.0)
    with pytest.raises(ConvergenceError, match="initial time"):
        tight(lambda t, y: y * np.nan).init(0.0, [1.0])


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
    assert max(ours) < max(100 * tolerance, max(cvodes))
    assert max(cvodes) < 1e4 * tolerance
