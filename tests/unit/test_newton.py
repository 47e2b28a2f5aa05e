"""Steady and unsteady solvers of the flow."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import dolfinx
import numpy as np
import pytest
import ufl
from domains import SIDES, unit_box
from scenes import SCENES

from incipient import Scene, compat, load
from incipient.errors import ConvergenceError, UnsolvedError
from incipient.fluid import FlowModel, Fluid, Prescribed, newton, no_slip, solve_steady
from incipient.fluid.derived import measured_cell_reynolds
from incipient.fluid.newton import NewtonReport
from incipient.fluid.steady import TOLERANCE_ON_THE_WAY
from incipient.fluid.transient import LEAST, MOST, Transient, backward_difference, of_steps
from incipient.planning.discretisation import COARSE, STEADY, largest_peclet, of_steady
from incipient.planning.plan import make_plan
from incipient.setup.setup import Setup

# Newton's method on problems whose corrections are known.


class SquareRootOfTwo:
    """The equation x^2 = 2, from 1."""

    def __init__(self) -> None:
        self.x = 1.0
        self.asked: list[tuple[bool, float | None]] = []

    def correction(self, fresh: bool, rtol: float | None) -> float:
        self.asked.append((fresh, rtol))
        step = (self.x**2 - 2) / (2 * self.x)
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


@pytest.mark.parametrize(("tolerance", "most"), [(1e-4, 4), (1e-8, 5), (1e-12, 6)])
def test_converges_as_soon_as_the_error_is_below_the_tolerance(tolerance: float, most: int) -> None:
    """Heron's method from 1: errors 6e-2, 2e-3, 2e-6, 2e-12, 0 (by hand); the estimate d r / (1 - r) is above them."""
    heard: list[tuple[int, float]] = []
    system = SquareRootOfTwo()
    report = newton.solve(system, tolerance, 20, lambda i, size: heard.append((i, size)))
    assert report.converged and report.iterations == len(system.asked) <= most
    assert abs(system.x / np.sqrt(2) - 1) <= report.error <= tolerance
    assert heard == list(enumerate(report.corrections))


@pytest.mark.parametrize(
    ("sizes", "most", "converged", "taken", "failure"),
    [
        ((0.0,), 20, True, 1, ""),
        ((0.5, 0.0), 20, True, 2, ""),  # a linear problem: the second correction confirms the first
        ((1e-9,), 1, False, 1, ""),  # one correction does not tell
        (tuple(1e-8 * 0.9**k for k in range(10)), 10, False, 10, ""),  # ten times its size to go
        ((1.0, 2.0, 4.0, 8.0, 16.0), 20, False, 4, ""),  # grows three times in a row
        ((1.0, np.nan), 20, False, 2, ""),
        ((1.0, np.inf), 20, False, 2, ""),
        ((0.2, 0.3), 20, False, 2, "singular"),
    ],
)
def test_what_corrections_tell(
    sizes: tuple[float, ...], most: int, converged: bool, taken: int, failure: str
) -> None:
    report = newton.solve(Scripted(*sizes), 1e-8, most)
    assert (report.converged, report.iterations, report.failure) == (converged, taken, failure)
    assert np.array_equal(report.corrections, sizes[:taken], equal_nan=True)


def test_new_factors_where_those_at_hand_contract_badly() -> None:
    """At the start, and after a correction of more than 0.3 times the one before."""
    system = Scripted(1.0, 0.4, 0.1, 0.01, 1e-12)
    assert newton.solve(system, 1e-9, 20).converged
    assert system.fresh == [True, False, True, False, False]


def test_inexact_corrections_have_new_factors_where_the_flow_has_changed_much() -> None:
    """Each is solved to a thousandth, which is part of the error that is left."""
    system = SquareRootOfTwo()
    report = newton.solve(system, 1e-10, 20, inexact=True)
    fresh, tolerances = zip(*system.asked, strict=True)
    assert report.converged and set(tolerances) == {newton.ROUGH}
    assert list(fresh[1:]) == [size > newton.MUCH for size in report.corrections[:-1]]
    assert report.error >= newton.ROUGH * report.corrections[-1]


@pytest.mark.parametrize(
    ("known", "sizes", "fresh", "contraction"),
    [
        ((0.01, 9, 9), (1e-3,), False, (0.01, 9, 10)),  # one correction is enough
        ((0.2, 9, 9), (1e-3, 1e-4), False, (0.1, 10, 10)),  # one would leave too much
        (
            (0.01, 9, 9),
            (1e-3, 1e-9),
            True,
            (np.inf, 0, 0),
        ),  # new factors tell nothing of older ones
        ((np.inf, 0, 0), (1e-3, 1e-6), False, (1e-3, 1, 1)),  # nor are they known in the next solve
    ],
)
def test_factors_kept_over_solves_tell_their_contraction(
    known: tuple[float, int, int],
    sizes: tuple[float, ...],
    fresh: bool,
    contraction: tuple[float, int, int],
) -> None:
    report = newton.solve(
        Scripted(*sizes), 1e-4, 9, fresh=fresh, contraction=newton.Contraction(*known)
    )
    assert report.converged and report.corrections == sizes
    ratio, *numbers = contraction
    assert report.contraction == newton.Contraction(pytest.approx(ratio), *numbers)


def test_the_contraction_is_measured_again_now_and_then() -> None:
    """However small the corrections are, every so many solves there is a second one; young factors age faster."""
    assert newton.Contraction(0.01, 1, 1).error_left(1.0) == pytest.approx(0.02 / 0.98)
    known, counts = newton.Contraction(0.01, 100, 100), []
    for _ in range(2 * newton.MEASURED_EVERY + 2):
        report = newton.solve(Scripted(1e-5, 1e-7), 1e-4, 9, fresh=False, contraction=known)
        known = report.contraction
        counts.append(report.iterations)
    period = newton.MEASURED_EVERY + 1
    assert counts == [2 if number % period == period - 1 else 1 for number in range(len(counts))]


# The path in the Reynolds number, on a fluid whose convergence is known.


TARGET = 100.0


class Pretended:
    """Converges if Re is less than `reach` times that of the last solution, and not above `limit`."""

    def __init__(
        self,
        reach: float = np.inf,
        limit: float = np.inf,
        error: Exception | None = None,
        failed: NewtonReport | None = None,
    ):
        self.reach, self.limit, self.error, self.failed = reach, limit, error, failed
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
        return NewtonReport(True, (1.0,) * 3, 0.0)


SINGULAR = NewtonReport(False, (0.1, 0.2), np.inf, failure="it is singular: use another mesh")


@pytest.mark.parametrize(
    ("reach", "failed", "first", "steps", "failures"),
    [
        (2.0, None, 1.0, 1, 0),  # at once
        (np.inf, None, 0.01, 6, 0),
        (1.5, None, 0.1, 30, 1),  # halves its step when Newton's method fails,
        (1.5, SINGULAR, 0.1, 30, 1),  # or a linear system is not solved
    ],
)
def test_the_reynolds_number_grows_from_the_first_share_to_the_whole(
    reach: float, failed: NewtonReport | None, first: float, steps: int, failures: int
) -> None:
    shares: list[float] = []
    fluid = Pretended(reach, failed=failed)
    reports = solve_steady(
        fluid,
        1e-9,
        first_share=first,
        watch=lambda order, share, iteration, size: shares.append(share),
    )
    taken = zip(shares, reports, strict=True)
    converged = [share for share, report in taken if report.converged]
    assert shares[0] == first and shares[-1] == 1.0
    assert np.all(np.diff(converged) > 0) and len(reports) <= steps
    assert (len(reports) - len(converged) >= failures) and reports[-1].converged
    assert fluid.reynolds == TARGET
    # Only the last step must be accurate.
    assert fluid.tolerances == [1e-9 if share == 1.0 else TOLERANCE_ON_THE_WAY for share in shares]


@pytest.mark.parametrize(
    ("limit", "options", "told"),
    [
        (40.0, {}, r"beyond (39\.\d*|40)% of the Reynolds number"),
        (40.0, {"error": ConvergenceError("no factors")}, "no factors"),
        (
            40.0,
            {"failed": SINGULAR},
            r"beyond 40% of the Reynolds number, at 40.1% the linear system of Newton update 3 is not "
            r"solved: it may be unsteady \(add a \[time\] section\) or need a finer mesh",
        ),
        (0.0, {}, "no steady flow beyond 0%"),
        (0.0, {"error": ConvergenceError("no factors")}, "no factors"),
        # From rest no smaller step would help: the mesh does not.
        (0.0, {"failed": replace(SINGULAR, corrections=())}, "it is singular: use another mesh"),
    ],
)
def test_the_last_converged_state_is_left_by_a_flow_that_does_not_converge(
    limit: float, options: dict[str, Any], told: str
) -> None:
    """Or the start, at a Reynolds number by which tractions can still be read; the error says how far it came."""
    fluid = Pretended(limit=limit, **options)
    with pytest.raises(ConvergenceError, match=told):
        solve_steady(fluid, 1e-9, first_share=0.1)
    assert 0.0 < fluid.reynolds <= max(limit, TARGET * (not limit))
    assert np.all(fluid.state.x.array == (np.log(fluid.reynolds) if limit else 0.0))


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


@pytest.mark.parametrize(
    ("velocity", "least", "most"),
    [
        (lambda x: np.vstack([x[1] ** 2, x[0] ** 2]), -1e-14, 1e-14),  # without divergence
        (lambda x: np.vstack([x[0] ** 2, x[1]]), 1e-3, np.inf),
    ],
)
def test_energy_is_taken_from_divergence_alone(velocity: Any, least: float, most: float) -> None:
    """What the stabilisation takes from a flow: its residual tested with the velocity."""
    taken = []
    for on in (False, True):
        with fluid(on) as result:
            result.state.sub(0).interpolate(velocity)
            form = result.residual_form(*ufl.TestFunctions(result.space.mixed))
            power = ufl.replace(form, {form.arguments()[0]: result.state})
            taken.append(dolfinx.fem.assemble_scalar(compat.form(power)))
    assert least <= taken[1] - taken[0] <= most


@pytest.mark.parametrize(("on", "inertia"), [(False, True), (True, False)])
def test_an_absent_term_is_not_in_the_form(on: bool, inertia: bool) -> None:
    """Without it, and in Stokes flow with it, the code generated is that of a fluid that knows no such term."""
    with fluid(on, inertia=inertia) as result:
        form = result.residual_form(*ufl.TestFunctions(result.space.mixed))
    assert "JacobianDeterminant" not in str(form.integrals()[0].integrand())


@pytest.mark.parametrize(
    ("reynolds", "numerics", "present"),
    [
        (1000, {}, False),
        (1000, {"mesh_size": 6.0}, True),
        (1e4, {}, True),
        (1000, {"stabilisation": "on"}, True),
        (1e4, {"stabilisation": "off"}, False),
    ],
)
def test_auto_goes_by_the_reynolds_number_of_cells_unless_the_scene_decides(
    reynolds: float, numerics: dict[str, Any], present: bool
) -> None:
    """48 columns of P2: h = 1/48; at Re = 1e4 1.78 times as many."""
    plan = make_plan(scene(reynolds, **numerics))
    told, size = plan.stabilisation, numerics.get("mesh_size", 1.0)
    crowd = max(1.0, (reynolds / 1000) ** 0.25)
    assert told.cell_reynolds == pytest.approx(reynolds * size / (48 * crowd * 2))
    option = numerics.get("stabilisation", "auto")
    assert told.present is present and (
        option != "auto" or present is (told.cell_reynolds > COARSE)
    )
    assert f"{told.cell_reynolds:.3g}" in plan.text()
    assert (f'"{option}"' in told.reason) is (option != "auto")


def test_measured_cell_reynolds() -> None:
    """A stream of speed 2 through cells of which two make a square of side 1/4: 2/4/2 times 1e4."""
    with fluid(False) as result:
        result.state.sub(0).interpolate(lambda x: np.vstack([2 + 0 * x[0], 0 * x[0]]))
        squares = unit_box(2, 4).mesh.topology.index_map(2).size_global / 16
        side = (0.0625 * 2 / squares) ** 0.5
        assert measured_cell_reynolds(result) == pytest.approx(2 * side / 2 * 1e4, rel=1e-6)


@pytest.mark.parametrize(("reynolds", "solver"), [(8, "block"), (20, "direct")])
def test_blocks_do_without_upwinding_where_cells_are_fine(reynolds: float, solver: str) -> None:
    """The largest cells are a quarter of the channel's height, and their Peclet number 0.45 h/(4 nu)."""
    path, changes = SCENES / "cylinder_in_space.toml", [f"fluid.reynolds={reynolds}"]
    result = load(path, changes)
    assert largest_peclet(Setup(result)) == pytest.approx(
        0.45 * 0.25 * 0.41 / (4 * 0.02 / reynolds), rel=1e-2
    )
    plan = make_plan(result)
    assert plan.solver.name == solver and not plan.stabilisation.present
    auto = make_plan(load(path, [*changes, "numerics.stabilisation=auto"]))
    assert auto.solver.name == "block" and auto.stabilisation.upwind


# Steps of the backward differences, and what becomes of them when they fail.


def growing_stream(x: np.ndarray, t: float) -> np.ndarray:
    return np.vstack([np.sin(3 * t) * x[1], t**3 * x[0]])


@pytest.fixture
def fluid_in_time() -> Any:
    """A flow that changes with time, which each test starts from rest."""
    sides = [Prescribed(name, growing_stream) for name in ("left", "right", "bottom", "top")]
    with Fluid(unit_box(2, 2), FlowModel(unsteady=True), sides, reynolds=10.0) as made:
        yield made


def converging_until(fluid: Fluid, end: float, error: Exception | None = None) -> Any:
    """What solves the steps of a fluid up to a time; attempts at later ones leave rubbish behind."""
    solve = fluid.solve

    def attempt(tolerance: float) -> NewtonReport:
        if fluid.time <= end:
            return solve(tolerance)
        fluid.state.x.array[:] = np.nan
        if error is not None:
            raise error
        return NewtonReport(False, (1.0, np.inf), np.inf)

    return attempt


@pytest.mark.parametrize("ratio", [0.3, 1.0, 2.0])
def test_backward_differences_are_exact_for_polynomials_of_their_order(ratio: float) -> None:
    """t and t^2 at t = 1, with steps of 0.1 and 0.1 / ratio before it; the extrapolation for t."""
    times = 1.0 - 0.1 * np.array([0.0, 1.0, 1.0 + 1.0 / ratio])
    rate, extrapolation = backward_difference(2, 0.1, ratio)
    assert [np.dot(rate, times**degree) for degree in range(3)] == pytest.approx(
        [0, 1, 2], abs=1e-11
    )
    assert np.dot(extrapolation, times[1:]) == pytest.approx(1.0, abs=1e-12)


# -- marching -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("end", "step", "first", "lengths"),
    [
        (1.0, 0.25, 1.0, [0.25] * 4),
        (1.0, 0.3, 1.0, [0.3, 0.3, 0.2, 0.2]),  # what is left is shared: no step is a sliver
        (0.1, 1.0, 1.0, [0.1]),
        (0.3, 0.1, 1.0, [0.1] * 3),
        (0.0, 0.1, 1.0, []),
        # First steps are each a quarter longer.
        (0.5, 0.1, 0.5, [0.05, 0.0625, 0.078125, 0.09765625, 0.1, 0.0559, 0.0559]),
    ],
)
def test_steps_are_alike_and_land_on_the_end(
    fluid_in_time: Fluid, end: float, step: float, first: float, lengths: list[float]
) -> None:
    steps = list(Transient(fluid_in_time).march(end, step, first))
    assert fluid_in_time.time == pytest.approx(end, rel=1e-12)
    assert [one.length for one in steps] == pytest.approx(lengths, rel=1e-3)
    assert [one.number for one in steps] == list(range(1, len(lengths) + 1))
    assert np.cumsum([one.length for one in steps]) == pytest.approx([one.time for one in steps])


def test_resumed_first_steps_go_on_growing(fluid_in_time: Fluid) -> None:
    transient = Transient(fluid_in_time)
    steps = transient.march(1.0, 0.1, 0.5)
    next(steps), next(steps)
    resumed = Transient(fluid_in_time)
    resumed.resume(transient.number, transient.next_length, transient.past, transient.last_error)
    step = next(resumed.march(1.0, 0.1, 0.5))
    assert (step.number, step.length) == (3, pytest.approx(0.078125))


@pytest.mark.parametrize(
    ("order", "told"), [(1, [False, True, True, True]), (2, [False, False, True, True])]
)
def test_error_is_told_once_there_is_history(
    fluid_in_time: Fluid, order: int, told: list[bool]
) -> None:
    """Second differences need two past states, third differences three."""
    steps = Transient(fluid_in_time, order).march(0.4, 0.1)
    assert [step.error is not None for step in steps] == told


# -- failure ------------------------------------------------------------------------------------


def test_steps_are_halved_until_they_converge_and_grow_again(
    fluid_in_time: Fluid, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The full length at once would be four times the halved one, beyond 2.4, where second order is unstable."""
    monkeypatch.setattr(fluid_in_time, "solve", converging_until(fluid_in_time, 0.03))
    steps = Transient(fluid_in_time).march(1.0, 0.1)
    first = next(steps)
    assert (first.rejected, fluid_in_time.time) == (2, 0.025)
    assert np.isfinite(fluid_in_time.state.x.array).all()
    monkeypatch.undo()
    lengths = [first.length, *(step.length for step in steps)]
    assert lengths[:7] == pytest.approx([0.025 * 1.25**n for n in range(7)])
    assert max(lengths) == pytest.approx(0.1) and sum(lengths) == pytest.approx(1.0)


@pytest.mark.parametrize(("accuracy", "shortest"), [(None, 0.1 / 2048), (1e-2, 0.01 / 2048)])
def test_a_flow_that_diverges_is_not_followed_in_ever_shorter_steps(
    fluid_in_time: Fluid, accuracy: float | None, shortest: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Steps converge only before t = 0.35; none is shorter than eleven halvings of the first one."""
    monkeypatch.setattr(fluid_in_time, "solve", converging_until(fluid_in_time, 0.35))
    steps = Transient(fluid_in_time, 1, 1e-8, accuracy).march(1.0, 0.1)
    lengths: list[float] = []
    with pytest.raises(ConvergenceError, match=r"^the step from t = 0\.3[45]\d* does not converge"):
        while True:
            lengths.append(next(steps).length)
    assert min(lengths) >= shortest * (1 - 1e-9)


@pytest.mark.parametrize("error", [None, ConvergenceError("the factorisation failed")])
def test_last_good_state_is_left_when_nothing_converges(
    fluid_in_time: Fluid, error: Exception | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    transient = Transient(fluid_in_time)
    list(transient.march(0.3, 0.1))
    expected, time = fluid_in_time.state.x.array.copy(), fluid_in_time.time
    monkeypatch.setattr(fluid_in_time, "solve", converging_until(fluid_in_time, time, error))
    with pytest.raises(ConvergenceError):
        transient.advance(0.1)
    assert fluid_in_time.time == time
    assert np.array_equal(fluid_in_time.state.x.array, expected)
    # The user may go on, say with other parameters, as if nothing had happened.
    monkeypatch.undo()
    after_failure = transient.advance(0.1)
    assert fluid_in_time.time == pytest.approx(0.4)
    assert after_failure.number == 4
    assert after_failure.error is not None


# What iterations may leave: given, or a fraction of a step's own error.


def test_tolerances_of_the_scene() -> None:
    assert (of_steady("auto"), of_steady(1e-4)) == (STEADY, 1e-4)
    assert (of_steps("auto"), of_steps(1e-4), of_steps(1e-14)) == ("auto", 1e-4, LEAST)


@pytest.mark.parametrize(
    ("error", "tolerance"), [(None, 1e-6), (1e-5, 1e-6), (1e-12, LEAST), (1.0, MOST)]
)
def test_steps_are_solved_to_a_tenth_of_the_last_error_within_bounds(
    error: float | None, tolerance: float
) -> None:
    steps: Any = SimpleNamespace(tolerance="auto", last_error=error)
    assert Transient._tolerance(steps) == pytest.approx(tolerance)


def test_each_step_is_solved_to_a_share_of_the_error_of_the_one_before(
    fluid_in_time: Fluid,
) -> None:
    """The tolerance follows the error as it grows and falls, within limits; for many steps one correction is enough.

    What is left then is below the tolerance, as another correction shows.
    """
    errors, alone, expected = [], 0, 1e-6
    for step in Transient(fluid_in_time, tolerance="auto").march(1.0, 0.02):
        assert step.report.error <= step.tolerance == expected
        errors.append(step.error)
        expected = min(max(0.1 * step.error, LEAST), MOST) if step.error else 1e-6
        if step.report.iterations == 1:
            alone += 1
            computed = fluid_in_time.state.x.array.copy()
            fluid_in_time.correct()
            left = fluid_in_time.speed(fluid_in_time.state.x.array - computed)
            assert left <= step.tolerance * fluid_in_time.speed(computed)
            fluid_in_time.state.x.array[:] = computed
            fluid_in_time.renew_factors()
    known = [error for error in errors if error]
    assert alone > 0 and max(known) > 3 * min(known)


@pytest.mark.parametrize("order", [1, 2])
def test_errors_told_by_states_of_two_meshes_are_not_believed(
    fluid_in_time: Fluid, order: int
) -> None:
    """The tolerance after a new mesh goes by the error before it, in a run that is resumed in between as well."""
    transient = Transient(fluid_in_time, order, "auto")
    list(transient.march(0.5, 0.1))
    new_mesh, small = fluid_in_time.time, 1e-9  # as small as no step here errs
    known = transient.number, transient.next_length, transient.past, transient.last_error
    transient.resume(*known, fluid_in_time.time)
    transient.last_error = small
    transient.advance(0.1)
    resumed = Transient(fluid_in_time, order, "auto")
    resumed.resume(
        transient.number, transient.next_length, transient.past, transient.last_error, new_mesh
    )
    errors = []
    for _ in range(order + 1):
        resumed.advance(0.1)
        errors.append(resumed.last_error)
    assert errors[:-1] == [small] * order
    assert errors[-1] is not None and errors[-1] > 10.0 * small
