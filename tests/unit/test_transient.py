"""Steps of the backward differences, and what becomes of them when they fail."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from domains import unit_box

from incipient.errors import ConvergenceError
from incipient.fluid import FlowModel, Fluid, Prescribed
from incipient.fluid.newton import NewtonReport
from incipient.fluid.transient import Transient, backward_difference


def steady_stream(x: np.ndarray, t: float) -> np.ndarray:
    return np.vstack([x[1], x[0]])


def growing_stream(x: np.ndarray, t: float) -> np.ndarray:
    return np.vstack([np.sin(3 * t) * x[1], t**3 * x[0]])


@pytest.fixture
def fluid() -> Any:
    """A flow that changes with time, which each test starts from rest."""
    sides = [Prescribed(name, growing_stream) for name in ("left", "right", "bottom", "top")]
    with Fluid(unit_box(2, 2), FlowModel(unsteady=True), sides, reynolds=10.0) as made:
        yield made


class Failing:
    """A fluid that does not converge in steps longer than a limit; its attempts leave rubbish behind."""

    def __init__(self, fluid: Fluid, longest: float, error: Exception | None = None):
        self.fluid, self.longest, self.error = fluid, longest, error
        self.solve = fluid.solve
        self.start = fluid.time
        fluid.solve = self  # type: ignore[method-assign]

    def __call__(self, tolerance: float) -> NewtonReport:
        if self.fluid.time - self.start > self.longest * (1 + 1e-12):
            self.fluid.state.x.array[:] = np.nan
            if self.error is not None:
                raise self.error
            return NewtonReport(False, (1.0, np.inf), np.inf)
        report = self.solve(tolerance)
        self.start = self.fluid.time
        return report


# -- coefficients -------------------------------------------------------------------------------


@pytest.mark.parametrize("ratio", [0.3, 1.0, 2.0])
@pytest.mark.parametrize("degree", [0, 1, 2])
def test_second_order_is_exact_for_quadratics(ratio: float, degree: int) -> None:
    """t^degree at t = 1 with steps of 0.1 and 0.1 / ratio before it."""
    step = 0.1
    rate, _ = backward_difference(2, step, ratio)
    times = np.array([1.0, 1.0 - step, 1.0 - step - step / ratio])
    assert np.dot(rate, times**degree) == pytest.approx(degree, abs=1e-11)


@pytest.mark.parametrize("ratio", [0.3, 1.0, 2.0])
@pytest.mark.parametrize("degree", [0, 1])
def test_extrapolation_is_exact_for_linear_functions(ratio: float, degree: int) -> None:
    step = 0.1
    _, extrapolation = backward_difference(2, step, ratio)
    times = np.array([1.0 - step, 1.0 - step - step / ratio])
    assert np.dot(extrapolation, times**degree) == pytest.approx(1.0, abs=1e-12)


def test_equal_steps_give_the_known_coefficients() -> None:
    """(3/2, -2, 1/2) / dt, and Childs & Reddy's extrapolation 2 v(n) - v(n-1)."""
    rate, extrapolation = backward_difference(2, 0.5, 1.0)
    assert rate == pytest.approx((3.0, -4.0, 1.0))
    assert extrapolation == pytest.approx((2.0, -1.0))
    assert backward_difference(1, 0.5, 1.0) == ((2.0, -2.0, 0.0), (1.0, 0.0))


# -- marching -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("end", "step", "count"), [(1.0, 0.25, 4), (1.0, 0.3, 4), (0.1, 1.0, 1), (0.3, 0.1, 3)]
)
def test_march_lands_on_the_end(fluid: Fluid, end: float, step: float, count: int) -> None:
    steps = list(Transient(fluid).march(end, step))
    assert fluid.time == pytest.approx(end, rel=1e-12)
    assert [s.number for s in steps] == list(range(1, count + 1))
    assert np.cumsum([s.length for s in steps]) == pytest.approx([s.time for s in steps])


def test_no_step_is_a_sliver(fluid: Fluid) -> None:
    """What is left after equal steps is shared with the last of them."""
    lengths = [s.length for s in Transient(fluid).march(1.01, 0.25)]
    assert max(lengths) <= 0.25 + 1e-12
    assert min(lengths) > 0.1


def test_first_steps_are_each_a_quarter_longer(fluid: Fluid) -> None:
    lengths = [s.length for s in Transient(fluid).march(1.0, 0.1, 0.5)]
    assert lengths[:5] == pytest.approx([0.05, 0.0625, 0.078125, 0.09765625, 0.1])
    assert lengths[4:-2] == pytest.approx([0.1] * len(lengths[4:-2]))
    assert sum(lengths) == pytest.approx(1.0)


def test_resumed_first_steps_go_on_growing(fluid: Fluid) -> None:
    transient = Transient(fluid)
    steps = transient.march(1.0, 0.1, 0.5)
    next(steps), next(steps)
    resumed = Transient(fluid)
    resumed.resume(transient.number, transient.next_length, transient.past, transient.last_error)
    assert next(resumed.march(1.0, 0.1, 0.5)).length == pytest.approx(0.078125)


def test_march_goes_on_where_it_stopped(fluid: Fluid) -> None:
    transient = Transient(fluid)
    list(transient.march(0.5, 0.25))
    steps = list(transient.march(1.0, 0.25))
    assert [s.number for s in steps] == [3, 4]
    assert fluid.time == pytest.approx(1.0)


def test_nothing_left_to_do(fluid: Fluid) -> None:
    fluid.time = 1.0
    assert list(Transient(fluid).march(1.0, 0.1)) == []


def test_steady_state_stays() -> None:
    """A state that solves the steady equations is kept by steps of any length."""
    sides = [Prescribed(name, steady_stream) for name in ("left", "right", "bottom", "top")]
    with Fluid(unit_box(2, 2), FlowModel(unsteady=True), sides, reynolds=10.0) as fluid:
        fluid.discretise_time((0.0, 0.0, 0.0), (1.0, 0.0))
        fluid.solve(1e-12)
        expected = fluid.state.x.array.copy()
        for length in (0.1, 10.0, 0.01):
            Transient(fluid, tolerance=1e-12).advance(length)
        assert fluid.state.x.array == pytest.approx(expected, abs=1e-9)


def test_error_is_told_once_there_is_history(fluid: Fluid) -> None:
    """Second differences need two past states, third differences three."""
    first = [s.error is None for s in Transient(fluid, order=1).march(0.4, 0.1)]
    fluid.time, fluid.state.x.array[:] = 0.0, 0.0
    second = [s.error is None for s in Transient(fluid, order=2).march(0.4, 0.1)]
    assert first == [True, False, False, False]
    assert second == [True, True, False, False]


# -- failure ------------------------------------------------------------------------------------


def test_failing_step_is_halved_until_it_converges(fluid: Fluid) -> None:
    Failing(fluid, longest=0.1)
    step = Transient(fluid).advance(0.5)
    assert (step.rejected, step.length) == (3, 0.0625)
    assert fluid.time == 0.0625
    assert np.isfinite(fluid.state.x.array).all()


def test_steps_grow_again_after_one_that_was_halved(fluid: Fluid) -> None:
    """The full length at once would be four times the halved one, beyond 2.4, where second order is unstable."""
    failing = Failing(fluid, longest=0.03)
    steps = Transient(fluid).march(1.0, 0.1)
    lengths = [next(steps).length]
    fluid.solve = failing.solve  # type: ignore[method-assign]
    lengths += [step.length for step in steps]
    assert lengths[:7] == pytest.approx([0.025 * 1.25**n for n in range(7)])
    assert max(lengths) == pytest.approx(0.1) and sum(lengths) == pytest.approx(1.0)


@pytest.mark.parametrize(("accuracy", "shortest"), [(None, 0.1 / 2048), (1e-2, 0.01 / 2048)])
def test_a_flow_that_diverges_is_not_followed_in_ever_shorter_steps(
    fluid: Fluid, accuracy: float | None, shortest: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Steps converge only before t = 0.35; none is shorter than eleven halvings of the first one."""
    solve = fluid.solve

    def solved_until(tolerance: float) -> NewtonReport:
        return replace(solve(tolerance), converged=fluid.time < 0.35)

    monkeypatch.setattr(fluid, "solve", solved_until)
    steps = Transient(fluid, 1, 1e-8, accuracy).march(1.0, 0.1)
    lengths: list[float] = []
    with pytest.raises(ConvergenceError, match=r"^the step from t = 0\.3[45]\d* does not converge"):
        while True:
            lengths.append(next(steps).length)
    assert min(lengths) >= shortest * (1 - 1e-9)


@pytest.mark.parametrize("error", [None, ConvergenceError("the factorisation failed")])
def test_last_good_state_is_left_when_nothing_converges(
    fluid: Fluid, error: Exception | None
) -> None:
    transient = Transient(fluid)
    list(transient.march(0.3, 0.1))
    expected, time = fluid.state.x.array.copy(), fluid.time
    failing = Failing(fluid, longest=0.0, error=error)
    with pytest.raises(ConvergenceError):
        transient.advance(0.1)
    assert fluid.time == time
    assert np.array_equal(fluid.state.x.array, expected)
    # The user may go on, say with other parameters, as if nothing had happened.
    fluid.solve = failing.solve  # type: ignore[method-assign]
    after_failure = transient.advance(0.1)
    assert fluid.time == pytest.approx(0.4)
    assert after_failure.number == 4
    assert after_failure.error is not None


def test_a_failure_changes_nothing_in_what_follows(fluid: Fluid) -> None:
    """With a failure in between the run ends where it ends without."""

    def final(fail: bool) -> np.ndarray:
        fluid.time, fluid.state.x.array[:] = 0.0, 0.0
        transient = Transient(fluid, tolerance=1e-12)
        for step in range(4):
            if fail and step == 2:
                failing = Failing(fluid, longest=0.0)
                with pytest.raises(ConvergenceError):
                    transient.advance(0.1)
                fluid.solve = failing.solve  # type: ignore[method-assign]
            transient.advance(0.1)
        return fluid.state.x.array.copy()

    assert final(fail=True) == pytest.approx(final(fail=False), abs=1e-10)
