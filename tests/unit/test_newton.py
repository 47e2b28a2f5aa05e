"""Newton's method on problems whose corrections are known."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import pytest

from incipient.errors import UnsolvedError
from incipient.fluid import newton


class Scalar:
    """One equation f(x) = 0 with its derivative."""

    def __init__(self, f: Callable[[float], float], derivative: Callable[[float], float], x: float):
        self.f, self.derivative, self.x = f, derivative, x
        self.asked: list[tuple[bool, float | None]] = []

    def correction(self, fresh: bool, rtol: float | None) -> float:
        self.asked.append((fresh, rtol))
        step = self.f(self.x) / self.derivative(self.x)
        self.x -= step
        return abs(step / self.x)


class Scripted:
    """Corrections as listed; after the last one the matrix is singular. Notes which were made with new factors."""

    def __init__(self, *sizes: float):
        self.sizes: Iterator[float] = iter(sizes)
        self.fresh: list[bool] = []

    def correction(self, fresh: bool, rtol: float | None) -> float:
        self.fresh.append(fresh)
        if (size := next(self.sizes, None)) is None:
            raise UnsolvedError("singular")
        return size


def square_root_of_two(start: float) -> Scalar:
    return Scalar(lambda x: x * x - 2, lambda x: 2 * x, start)


def test_converges_and_bounds_the_error() -> None:
    """The estimate d r / (1 - r) is above the true error, since convergence is quadratic."""
    system = square_root_of_two(1.0)
    report = newton.solve(system, 1e-6, 20)
    assert report.converged
    assert abs(system.x / np.sqrt(2) - 1) <= report.error <= 1e-6
    assert report.iterations == len(report.corrections) == len(system.asked)


@pytest.mark.parametrize("tolerance", [1e-4, 1e-8, 1e-12])
def test_stops_as_soon_as_the_tolerance_is_met(tolerance: float) -> None:
    """Heron's method from 1: errors 6e-2, 2e-3, 2e-6, 2e-12, 0 (by hand)."""
    report = newton.solve(square_root_of_two(1.0), tolerance, 20)
    assert report.converged
    assert report.iterations <= {1e-4: 4, 1e-8: 5, 1e-12: 6}[tolerance]


def test_linear_problem_is_confirmed_by_a_second_correction() -> None:
    report = newton.solve(Scalar(lambda x: 3 * x - 6, lambda x: 3.0, 1.0), 1e-9, 20)
    assert report.converged
    assert report.corrections == (0.5, 0.0)


def test_one_correction_is_not_enough_to_tell() -> None:
    assert not newton.solve(Scripted(1e-9), 1e-6, max_iterations=1).converged


def test_nothing_to_correct() -> None:
    assert newton.solve(Scripted(0.0), 1e-9, 20) == newton.NewtonReport(True, (0.0,), 0.0)


def test_slow_contraction_is_not_taken_for_convergence() -> None:
    """Corrections that shrink by 0.9 have ten times their size still to go."""
    sizes = [1e-8 * 0.9**k for k in range(10)]
    assert not newton.solve(Scripted(*sizes), 1e-8, max_iterations=10).converged


def test_gives_up_when_corrections_keep_growing() -> None:
    report = newton.solve(Scripted(1.0, 2.0, 4.0, 8.0, 16.0), 1e-9, 20)
    assert not report.converged
    assert report.corrections == (1.0, 2.0, 4.0, 8.0)


@pytest.mark.parametrize("size", [np.nan, np.inf])
def test_gives_up_when_corrections_are_not_finite(size: float) -> None:
    report = newton.solve(Scripted(1.0, size), 1e-9, 20)
    assert not report.converged
    assert report.error == np.inf


def test_gives_up_after_the_iterations_allowed() -> None:
    """x^2 + 1 has no real root."""
    report = newton.solve(Scalar(lambda x: x * x + 1, lambda x: 2 * x, 0.3), 1e-9, 7)
    assert not report.converged
    assert report.iterations <= 7


def test_new_factors_where_those_at_hand_contract_badly() -> None:
    """At the start, and after a correction of more than 0.3 times the one before."""
    system = Scripted(1.0, 0.4, 0.1, 0.01, 1e-12)
    assert newton.solve(system, 1e-9, 20).converged
    assert system.fresh == [True, False, True, False, False]


def test_inexact_corrections_are_solved_no_better_than_that_pays() -> None:
    """Each to 0.9 times the square of the last gain (Eisenstat & Walker 1996), 1e-3 at most.

    The last one need not be solved so well, as its size is expected to be below the tolerance.
    """
    system = square_root_of_two(1.0)
    report = newton.solve(system, 1e-10, 20, inexact=True)
    fresh = [asked for asked, _ in system.asked]
    assert report.converged and fresh[1:] == [
        size > newton.MUCH for size in report.corrections[:-1]
    ]
    tolerances = [rtol or 0.0 for _, rtol in system.asked]
    assert tolerances[:3] == [newton.ROUGHEST] * 3 and tolerances[-1] > tolerances[3]
    gain = report.corrections[2] / report.corrections[1]
    assert tolerances[3] == pytest.approx(0.9 * gain**2)
    assert report.error >= tolerances[-1] * report.corrections[-1]


def test_watch_hears_of_every_correction() -> None:
    heard: list[tuple[int, float]] = []
    report = newton.solve(
        square_root_of_two(1.0), 1e-9, 20, lambda i, size: heard.append((i, size))
    )
    assert heard == list(enumerate(report.corrections))


# -- factors kept over several solves ----------------------------------------------------------------


def chords(
    known: newton.Contraction | None, *sizes: float, fresh: bool = False
) -> newton.NewtonReport:
    return newton.solve(Scripted(*sizes), 1e-4, 9, fresh=fresh, contraction=known)


def test_one_correction_is_enough_where_the_contraction_is_known() -> None:
    report = chords(newton.Contraction(0.01, measured=9, solves=9), 1e-3)
    assert report.converged and report.corrections == (1e-3,)
    assert report.error == pytest.approx(1e-3 * 0.01 * 10 / 9, rel=0.02)
    assert report.contraction == newton.Contraction(0.01, 9, 10)


def test_a_contraction_that_leaves_too_much_asks_for_another_correction() -> None:
    report = chords(newton.Contraction(0.2, 9, 9), 1e-3, 1e-4)
    assert report.corrections == (1e-3, 1e-4)
    assert report.contraction == newton.Contraction(pytest.approx(0.1), 10, 10)


def test_the_contraction_is_measured_again_now_and_then() -> None:
    """However small the corrections are, every so many solves there is a second one."""
    known, counts = newton.Contraction(0.01, 100, 100), []
    for _ in range(2 * newton.MEASURED_EVERY + 2):
        report = chords(known, 1e-5, 1e-7)
        known = report.contraction
        counts.append(report.iterations)
    period = newton.MEASURED_EVERY + 1
    assert counts == [2 if number % period == period - 1 else 1 for number in range(len(counts))]


def test_new_factors_say_nothing_of_older_ones() -> None:
    """They contract far better in the solve that they are made for than in the next one."""
    first = chords(newton.Contraction(0.01, 9, 9), 1e-3, 1e-9, fresh=True)
    assert first.iterations == 2 and first.contraction == newton.Contraction()
    second = chords(first.contraction, 1e-3, 1e-6)
    assert second.iterations == 2 and second.contraction == newton.Contraction(
        pytest.approx(1e-3), 1, 1
    )


def test_young_factors_are_taken_to_age() -> None:
    """Measured one solve after they were made, the ratio is taken for twice as large in the next one."""
    assert newton.Contraction(0.01, 1, 1).error_left(1.0) == pytest.approx(0.02 / 0.98)


def test_a_linear_system_that_is_not_solved_ends_the_iteration() -> None:
    report = newton.solve(Scripted(0.2, 0.3), 1e-9, 20)
    assert not report.converged
    assert (report.corrections, report.failure) == ((0.2, 0.3), "singular")
