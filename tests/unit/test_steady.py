"""The path in the Reynolds number, on a fluid whose convergence is known."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from incipient.errors import ConvergenceError
from incipient.fluid import solve_steady
from incipient.fluid.newton import NewtonReport

TARGET = 100.0


class Pretended:
    """Converges if Re is less than `reach` times that of the last solution, and not above `limit`."""

    def __init__(
        self,
        reach: float,
        limit: float = np.inf,
        iterations: int = 4,
        error: Exception | None = None,
        failed: NewtonReport | None = None,
    ):
        self.reach, self.limit, self.iterations, self.error = reach, limit, iterations, error
        self.failed = failed
        self.space, self.model = SimpleNamespace(order=2), SimpleNamespace(linear=False)
        self.reynolds, self.solved = TARGET, 0.0
        self.state = SimpleNamespace(x=SimpleNamespace(array=np.zeros(2)))
        self.tolerances: list[float] = []

    def solve(self, tolerance: float, max_iterations: int, watch: Any) -> NewtonReport:
        self.tolerances.append(tolerance)
        watch(0, 1.0)
        near = self.solved == 0.0 or self.reynolds <= self.reach * self.solved
        if not near or self.reynolds > self.limit:
            self.state.x.array[:] = np.nan
            if self.error is not None:
                raise self.error
            return self.failed or NewtonReport(False, (1.0,) * max_iterations, np.inf)
        self.solved = self.reynolds
        # A solution that is linear in the logarithm of Re, as the extrapolation supposes.
        self.state.x.array[:] = np.log(self.reynolds)
        return NewtonReport(True, (1.0,) * self.iterations, 0.0)


def shares(steps: Any) -> list[float]:
    return [step.share for step in steps]


def test_at_once_where_that_converges() -> None:
    fluid = Pretended(reach=2.0)
    steps = solve_steady(fluid, 1e-9)
    assert shares(steps) == [1.0]
    assert fluid.tolerances == [1e-9]


def test_grows_from_the_first_share_to_the_whole() -> None:
    fluid = Pretended(reach=np.inf, iterations=3)
    steps = solve_steady(fluid, 1e-9, first_share=0.01)
    assert shares(steps)[0] == 0.01
    assert shares(steps)[-1] == 1.0
    assert np.all(np.diff(shares(steps)) > 0)
    assert len(steps) <= 6
    assert fluid.reynolds == TARGET
    # Only the last step must be accurate.
    assert fluid.tolerances[-1] == 1e-9
    assert min(fluid.tolerances[:-1]) >= 1e-3


def test_halves_its_step_when_newton_fails() -> None:
    fluid = Pretended(reach=1.5)
    steps = solve_steady(fluid, 1e-9, first_share=0.1)
    failed = [not step.report.converged for step in steps]
    assert any(failed)
    assert not failed[-1]
    assert shares(steps)[-1] == 1.0


SINGULAR = NewtonReport(False, (0.1, 0.2), np.inf, failure="it is singular: use another mesh")


def test_halves_its_step_when_a_linear_system_is_not_solved() -> None:
    """Newton's method runs away, and its matrix is singular before corrections have grown three times."""
    steps = solve_steady(Pretended(reach=1.5, failed=SINGULAR), 1e-9, first_share=0.1)
    assert not all(step.report.converged for step in steps)
    assert shares(steps)[-1] == 1.0


def test_failed_linear_system_far_from_the_start_is_told_as_divergence() -> None:
    with pytest.raises(
        ConvergenceError,
        match=r"beyond 40% of the Reynolds number, at 40.1% the linear system of Newton update 3 is not "
        r"solved: it may be unsteady \(add a \[time\] section\) or need a finer mesh",
    ):
        solve_steady(Pretended(reach=np.inf, limit=40.0, failed=SINGULAR), 1e-9, first_share=0.1)


def test_first_linear_system_tells_of_the_mesh() -> None:
    """Without inertia, from rest, no smaller step would help."""
    failed = replace(SINGULAR, corrections=())
    with pytest.raises(ConvergenceError, match="it is singular: use another mesh"):
        solve_steady(Pretended(reach=np.inf, limit=0.0, failed=failed), 1e-9)


def test_starts_are_extrapolated_from_two_solutions() -> None:
    """The pretended solution is met exactly by the secant in log Re, where that is not limited."""
    seen: list[float] = []
    fluid = Pretended(reach=np.inf, iterations=8)
    solve = fluid.solve

    def watched(tolerance: float, max_iterations: int, watch: Any) -> NewtonReport:
        seen.append(fluid.state.x.array[0] - np.log(fluid.reynolds))
        return solve(tolerance, max_iterations, watch)

    fluid.solve = watched  # type: ignore[method-assign]
    solve_steady(fluid, 1e-9, first_share=0.2)
    assert len(seen) > 3
    assert seen[2:] == pytest.approx([0.0] * len(seen[2:]), abs=1e-12)


@pytest.mark.parametrize("error", [None, ConvergenceError("the factorisation failed")])
def test_last_converged_state_is_left(error: Exception | None) -> None:
    fluid = Pretended(reach=np.inf, limit=40.0, error=error)
    with pytest.raises(ConvergenceError):
        solve_steady(fluid, 1e-9, first_share=0.1)
    assert 0.0 < fluid.reynolds <= 40.0
    assert np.all(fluid.state.x.array == np.log(fluid.reynolds))


@pytest.mark.parametrize("error", [None, ConvergenceError("the factorisation failed")])
def test_reynolds_number_stays_usable_when_nothing_converges(error: Exception | None) -> None:
    """The start is left, at a Reynolds number by which tractions can still be read."""
    fluid = Pretended(reach=np.inf, limit=0.0, error=error)
    with pytest.raises(ConvergenceError):
        solve_steady(fluid, 1e-9)
    assert fluid.reynolds > 0.0
    assert np.all(fluid.state.x.array == 0.0)


def test_error_says_how_far_it_came() -> None:
    with pytest.raises(ConvergenceError, match=r"beyond (39\.\d*|40)% of the Reynolds number"):
        solve_steady(Pretended(reach=np.inf, limit=40.0), 1e-9, first_share=0.1)


def test_watch_hears_of_every_solve() -> None:
    heard: list[float] = []
    steps = solve_steady(
        Pretended(reach=np.inf),
        1e-9,
        first_share=0.1,
        watch=lambda share, iteration, size: heard.append(share),
    )
    assert heard == shares(steps)
