"""Steady and unsteady solvers of the flow."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import dolfinx
import numpy as np
import pytest
import ufl
from domains import SIDES, unit_box

from incipient import Scene, compat, load
from incipient.errors import ConvergenceError, UnsolvedError
from incipient.fluid import FlowModel, Fluid, Prescribed, newton, no_slip, solve_steady
from incipient.fluid.derived import measured_cell_reynolds
from incipient.fluid.newton import NewtonReport
from incipient.fluid.transient import Transient, backward_difference
from incipient.forms import ReferenceMap, terms
from incipient.planning.discretisation import COARSE, cell_reynolds, largest_peclet
from incipient.planning.plan import make_plan
from incipient.setup.setup import Setup

# Newton's method on problems whose corrections are known.


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


# The path in the Reynolds number, on a fluid whose convergence is known.


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
        watch=lambda order, share, iteration, size: heard.append(share),
    )
    assert heard == shares(steps)


# Stabilised convection: consistent, dissipative, absent unless asked for; asked for where cells are coarse.


def scene(reynolds: float, **numerics: object) -> Scene:
    return Scene(
        domain={"kind": "box", "length": 1.0, "height": 1.0},
        fluid={"reynolds": reynolds, "scale": "flow"},
        flow={"kind": "lid"},
        numerics=numerics,
    )


# -- the term -----------------------------------------------------------------------------------


def fluid(stabilisation: bool, **more: object) -> Fluid:
    model = FlowModel(stabilisation=stabilisation, **more)  # type: ignore[arg-type]
    return Fluid(unit_box(2, 4), model, [no_slip(name) for name in SIDES[:4]], 1e4)


def energy_taken(velocity: str) -> float:
    """What the stabilisation takes from a flow: its residual tested with the velocity."""
    fields = {
        "solenoidal": lambda x: np.vstack([x[1] ** 2, x[0] ** 2]),
        "expanding": lambda x: np.vstack([x[0] ** 2, x[1]]),
    }
    taken = []
    for on in (False, True):
        with fluid(on) as found:
            found.state.sub(0).interpolate(fields[velocity])
            form = found.residual_form(*ufl.TestFunctions(found.space.mixed))
            power = ufl.replace(form, {form.arguments()[0]: found.state})
            taken.append(dolfinx.fem.assemble_scalar(compat.form(power)))
    return float(taken[1] - taken[0])


def test_nothing_is_taken_from_a_flow_without_divergence() -> None:
    assert energy_taken("solenoidal") == pytest.approx(0.0, abs=1e-14)


def test_energy_is_taken_from_divergence() -> None:
    assert energy_taken("expanding") > 1e-3


@pytest.mark.parametrize("more", [{"inertia": False}, {}])
def test_an_absent_term_is_not_in_the_form(more: dict[str, bool]) -> None:
    """Without it, and in Stokes flow with it, the code generated is that of a fluid that knows no such term."""
    with fluid(False, **more) as plain, fluid(not more.get("inertia", True), **more) as other:
        forms = [
            found.residual_form(*ufl.TestFunctions(found.space.mixed)) for found in (plain, other)
        ]
    signatures = [
        str(form.integrals()[0].integrand()).count("JacobianDeterminant") for form in forms
    ]
    assert signatures == [0, 0]


def test_a_reference_map_gives_what_the_moved_mesh_gives() -> None:
    """x = 2 X: the integral over the map's domain and that over a domain twice as large."""
    values = []
    for scale in (1.0, 2.0):
        domain = unit_box(2, 3)
        mesh = domain.mesh
        mesh.geometry.x[:] *= scale
        x = ufl.SpatialCoordinate(mesh)
        still = ufl.as_vector([0.0 * x[0], 0.0 * x[0]])
        mapped = ReferenceMap.of(x, still) if scale == 1.0 else ReferenceMap.renewed(2)
        place = (3.0 - scale) * x
        v = ufl.as_vector([place[0] ** 2, place[1]])
        size = abs(ufl.JacobianDeterminant(mesh)) ** 0.5
        dx = ufl.Measure("dx", domain=mesh, metadata={"quadrature_degree": 8})
        values.append(
            dolfinx.fem.assemble_scalar(
                compat.form(terms.grad_div(v, v, v, 0.01, size, mapped) * dx)
            )
        )
    assert values[0] == pytest.approx(values[1], rel=1e-12)


def test_no_carrier_no_stabilisation() -> None:
    with fluid(False, inertia=False) as plain, fluid(True, inertia=False) as asked:
        for one in (plain, asked):
            one.state.x.array[:] = np.random.default_rng(1).random(len(one.state.x.array))
        assert (plain.residual() == asked.residual()).all()


# -- the decision -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("reynolds", "mesh_size", "present"), [(1000, 1.0, False), (1000, 6.0, True), (1e4, 1.0, True)]
)
def test_auto_goes_by_the_reynolds_number_of_cells(
    reynolds: float, mesh_size: float, present: bool
) -> None:
    """48 columns of P2: h = 1/48; at Re = 1e4 1.78 times as many."""
    told = make_plan(scene(reynolds, mesh_size=mesh_size)).stabilisation
    crowd = max(1.0, (reynolds / 1000) ** 0.25)
    assert told.cell_reynolds == pytest.approx(reynolds * mesh_size / (48 * crowd * 2))
    assert told.present is present is (told.cell_reynolds > COARSE)
    assert f"{told.cell_reynolds:.3g}" in make_plan(scene(reynolds, mesh_size=mesh_size)).text()


@pytest.mark.parametrize("asked", ["on", "off"])
def test_the_scene_may_decide(asked: str) -> None:
    told = make_plan(scene(1000, stabilisation=asked)).stabilisation
    assert told.present is (asked == "on")
    assert f'"{asked}"' in told.reason


def test_stokes_flow_needs_none() -> None:
    creeping = scene(1e6).model_copy(
        update={"fluid": scene(1e6).fluid.model_copy(update={"inertia": False})}
    )
    assert not make_plan(creeping).stabilisation.present


def test_measured_cell_reynolds() -> None:
    """A stream of speed 2 through cells of which two make a square of side 1/4: 2/4/2 times 1e4."""
    with fluid(False) as found:
        found.state.sub(0).interpolate(lambda x: np.vstack([2 + 0 * x[0], 0 * x[0]]))
        squares = unit_box(2, 4).mesh.topology.index_map(2).size_global / 16
        side = (0.0625 * 2 / squares) ** 0.5
        assert measured_cell_reynolds(found) == pytest.approx(2 * side / 2 * 1e4, rel=1e-6)
    assert cell_reynolds(Setup(scene(1000))) < COARSE


CYLINDER = Path(__file__).parents[2] / "demos/scenes/cylinder_in_space.toml"


@pytest.mark.parametrize(("reynolds", "solver"), [(20, "block"), (60, "direct")])
def test_blocks_do_without_upwinding_where_cells_are_fine(reynolds: float, solver: str) -> None:
    """The largest cells are a quarter of the channel's height, and their Peclet number 0.45 h/(4 nu)."""
    found = load(CYLINDER, [f"fluid.reynolds={reynolds}"])
    assert largest_peclet(Setup(found)) == pytest.approx(
        0.45 * 0.25 * 0.41 / (4 * 0.02 / reynolds), rel=1e-2
    )
    plan = make_plan(found)
    assert plan.solver.name == solver and not plan.stabilisation.present
    auto = make_plan(load(CYLINDER, [f"fluid.reynolds={reynolds}", "numerics.stabilisation=auto"]))
    assert auto.solver.name == "block" and auto.stabilisation.upwind


# Steps of the backward differences, and what becomes of them when they fail.


def steady_stream(x: np.ndarray, t: float) -> np.ndarray:
    return np.vstack([x[1], x[0]])


def growing_stream(x: np.ndarray, t: float) -> np.ndarray:
    return np.vstack([np.sin(3 * t) * x[1], t**3 * x[0]])


@pytest.fixture
def fluid_in_time() -> Any:
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
def test_march_lands_on_the_end(fluid_in_time: Fluid, end: float, step: float, count: int) -> None:
    steps = list(Transient(fluid_in_time).march(end, step))
    assert fluid_in_time.time == pytest.approx(end, rel=1e-12)
    assert [s.number for s in steps] == list(range(1, count + 1))
    assert np.cumsum([s.length for s in steps]) == pytest.approx([s.time for s in steps])


def test_no_step_is_a_sliver(fluid_in_time: Fluid) -> None:
    """What is left after equal steps is shared with the last of them."""
    lengths = [s.length for s in Transient(fluid_in_time).march(1.01, 0.25)]
    assert max(lengths) <= 0.25 + 1e-12
    assert min(lengths) > 0.1


def test_first_steps_are_each_a_quarter_longer(fluid_in_time: Fluid) -> None:
    lengths = [s.length for s in Transient(fluid_in_time).march(1.0, 0.1, 0.5)]
    assert lengths[:5] == pytest.approx([0.05, 0.0625, 0.078125, 0.09765625, 0.1])
    assert lengths[4:-2] == pytest.approx([0.1] * len(lengths[4:-2]))
    assert sum(lengths) == pytest.approx(1.0)


def test_resumed_first_steps_go_on_growing(fluid_in_time: Fluid) -> None:
    transient = Transient(fluid_in_time)
    steps = transient.march(1.0, 0.1, 0.5)
    next(steps), next(steps)
    resumed = Transient(fluid_in_time)
    resumed.resume(transient.number, transient.next_length, transient.past, transient.last_error)
    assert next(resumed.march(1.0, 0.1, 0.5)).length == pytest.approx(0.078125)


def test_march_goes_on_where_it_stopped(fluid_in_time: Fluid) -> None:
    transient = Transient(fluid_in_time)
    list(transient.march(0.5, 0.25))
    steps = list(transient.march(1.0, 0.25))
    assert [s.number for s in steps] == [3, 4]
    assert fluid_in_time.time == pytest.approx(1.0)


def test_nothing_left_to_do(fluid_in_time: Fluid) -> None:
    fluid_in_time.time = 1.0
    assert list(Transient(fluid_in_time).march(1.0, 0.1)) == []


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


def test_error_is_told_once_there_is_history(fluid_in_time: Fluid) -> None:
    """Second differences need two past states, third differences three."""
    first = [s.error is None for s in Transient(fluid_in_time, order=1).march(0.4, 0.1)]
    fluid_in_time.time, fluid_in_time.state.x.array[:] = 0.0, 0.0
    second = [s.error is None for s in Transient(fluid_in_time, order=2).march(0.4, 0.1)]
    assert first == [True, False, False, False]
    assert second == [True, True, False, False]


# -- failure ------------------------------------------------------------------------------------


def test_failing_step_is_halved_until_it_converges(fluid_in_time: Fluid) -> None:
    Failing(fluid_in_time, longest=0.1)
    step = Transient(fluid_in_time).advance(0.5)
    assert (step.rejected, step.length) == (3, 0.0625)
    assert fluid_in_time.time == 0.0625
    assert np.isfinite(fluid_in_time.state.x.array).all()


def test_steps_grow_again_after_one_that_was_halved(fluid_in_time: Fluid) -> None:
    """The full length at once would be four times the halved one, beyond 2.4, where second order is unstable."""
    failing = Failing(fluid_in_time, longest=0.03)
    steps = Transient(fluid_in_time).march(1.0, 0.1)
    lengths = [next(steps).length]
    fluid_in_time.solve = failing.solve  # type: ignore[method-assign]
    lengths += [step.length for step in steps]
    assert lengths[:7] == pytest.approx([0.025 * 1.25**n for n in range(7)])
    assert max(lengths) == pytest.approx(0.1) and sum(lengths) == pytest.approx(1.0)


@pytest.mark.parametrize(("accuracy", "shortest"), [(None, 0.1 / 2048), (1e-2, 0.01 / 2048)])
def test_a_flow_that_diverges_is_not_followed_in_ever_shorter_steps(
    fluid_in_time: Fluid, accuracy: float | None, shortest: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Steps converge only before t = 0.35; none is shorter than eleven halvings of the first one."""
    solve = fluid_in_time.solve

    def solved_until(tolerance: float) -> NewtonReport:
        return replace(solve(tolerance), converged=fluid_in_time.time < 0.35)

    monkeypatch.setattr(fluid_in_time, "solve", solved_until)
    steps = Transient(fluid_in_time, 1, 1e-8, accuracy).march(1.0, 0.1)
    lengths: list[float] = []
    with pytest.raises(ConvergenceError, match=r"^the step from t = 0\.3[45]\d* does not converge"):
        while True:
            lengths.append(next(steps).length)
    assert min(lengths) >= shortest * (1 - 1e-9)


@pytest.mark.parametrize("error", [None, ConvergenceError("the factorisation failed")])
def test_last_good_state_is_left_when_nothing_converges(
    fluid_in_time: Fluid, error: Exception | None
) -> None:
    transient = Transient(fluid_in_time)
    list(transient.march(0.3, 0.1))
    expected, time = fluid_in_time.state.x.array.copy(), fluid_in_time.time
    failing = Failing(fluid_in_time, longest=0.0, error=error)
    with pytest.raises(ConvergenceError):
        transient.advance(0.1)
    assert fluid_in_time.time == time
    assert np.array_equal(fluid_in_time.state.x.array, expected)
    # The user may go on, say with other parameters, as if nothing had happened.
    fluid_in_time.solve = failing.solve  # type: ignore[method-assign]
    after_failure = transient.advance(0.1)
    assert fluid_in_time.time == pytest.approx(0.4)
    assert after_failure.number == 4
    assert after_failure.error is not None


def test_a_failure_changes_nothing_in_what_follows(fluid_in_time: Fluid) -> None:
    """With a failure in between the run ends where it ends without."""

    def final(fail: bool) -> np.ndarray:
        fluid_in_time.time, fluid_in_time.state.x.array[:] = 0.0, 0.0
        transient = Transient(fluid_in_time, tolerance=1e-12)
        for step in range(4):
            if fail and step == 2:
                failing = Failing(fluid_in_time, longest=0.0)
                with pytest.raises(ConvergenceError):
                    transient.advance(0.1)
                fluid_in_time.solve = failing.solve  # type: ignore[method-assign]
            transient.advance(0.1)
        return fluid_in_time.state.x.array.copy()

    assert final(fail=True) == pytest.approx(final(fail=False), abs=1e-10)
